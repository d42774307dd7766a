"""Figures of learning without a teacher: a two-armed toy, what distances earn, curves of trainings, answers, films.

runs_figure({"no baseline": (runs, steps)})        how many small trainings went
spread_figure({"no baseline": estimates}, exact)   estimates of a slope around the exact one
estimate_figure(estimates, exact)                  how their mean settles
power_figure(powers)                               rewards by distance, and what one pixel nearer is worth
tuning_figure(rewards, reports)                    a short fine-tuning
long_runs_figure(runs)                             long ones
answers_figure(targets, {"supervised": images})    what programs draw, over what they should draw
film(targets, moments)                             the same, moving
"""

import io
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import torch
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from PIL import Image
from torch import Tensor

from lib.metrics.images import reward
from lib.viewing.canvas import BOTH, COLOR_A, COLOR_B, DPI, GAP, SOFT, overlay, page, write

COLORS = ("#9aa5b8", "#e28f4f", "#5e8bba", "#70ad77", "#9379b8")
EXACT = "#d62839"
NAMES = 42  # pixels of the page that the names of rows take
FARTHEST = 30.0  # px: how far the curves of rewards go
SMOOTH = 10  # steps that are averaged for the thick curve of a training


def runs_figure(runs: Mapping[str, Float[Tensor, "runs moments"]], ylabel: str) -> Figure:
    """A panel each: thin the single runs, thick their mean."""
    figure, axes = _panels(len(runs), 4.4, 2.9, sharey=True)
    for ax, color, (name, found) in zip(axes, COLORS[1:], runs.items()):
        ax.plot(found.T.numpy(), color=color, linewidth=0.6, alpha=0.55)
        ax.plot(found.mean(0).numpy(), color="#24344d", linewidth=2.2, label=f"mean of {len(found)} runs")
        ax.set(title=name, xlabel="draws", ylim=(-0.02, 1.02))
        ax.legend(fontsize=8, frameon=False, loc="lower right")
    axes[0].set_ylabel(ylabel)
    figure.tight_layout()
    return figure


def spread_figure(estimates: Mapping[str, Float[Tensor, " n"]], exact: float, xlabel: str) -> Figure:
    """How estimates of one number are spread: a histogram each, one above the other, the exact number in red."""
    everything = torch.cat(list(estimates.values())).numpy()
    bins = np.linspace(everything.min() - 1e-6, everything.max() + 1e-6, 41)
    figure, axes = plt.subplots(
        len(estimates), 1, figsize=(6.4, 0.5 + 1.1 * len(estimates)), dpi=DPI, sharex=True, squeeze=False
    )
    plt.close(figure)
    for ax, color, (name, found) in zip(axes[:, 0], COLORS[1:], estimates.items()):
        ax.hist(found.numpy(), bins, color=color)
        ax.axvline(exact, color=EXACT, linewidth=1.6)
        ax.set_title(
            f"{name}: mean {found.mean():.3f}, standard deviation {found.std():.3f}", fontsize=9, loc="left"
        )
        ax.set_yticks([])
        _bare(ax, "left")
    axes[-1, 0].set_xlabel(xlabel + " (red: exact)")
    figure.tight_layout()
    return figure


def estimate_figure(estimates: Float[Tensor, "runs n"], exact: float) -> Figure:
    """The mean of the first 1, 2, … n estimates, a line a run, and the exact number in red."""
    count = torch.arange(1, estimates.shape[1] + 1)
    means = estimates.cumsum(1) / count
    figure, (ax,) = _panels(1, 6.4, 2.9)
    ax.plot(count.numpy(), means.T.numpy(), color=COLORS[2], linewidth=0.9, alpha=0.7)
    ax.axhline(exact, color=EXACT, linewidth=1.6, label="exact")
    ax.set(xscale="log", xlabel="draws averaged", ylabel="estimate of the slope")
    ax.legend(fontsize=8, frameon=False)
    figure.tight_layout()
    return figure


def power_figure(powers: Sequence[float]) -> Figure:
    """Left the reward of a Chamfer distance for each power; right what one pixel less adds to it, by distance."""
    distance = torch.linspace(0, FARTHEST, 121)
    figure, (left, right) = _panels(2, 4.4, 3.0)
    for color, power in zip(COLORS, powers):
        earned = reward(distance, power)
        left.plot(distance, earned, color=color, linewidth=1.8, label=f"power {power:g}")
        nearer = reward((distance - 1).clamp(min=0), power) - earned
        right.plot(distance[4:], nearer[4:], color=color, linewidth=1.8)  # from 1 px on
    left.set(xlabel="Chamfer distance (px)", ylabel="reward", title="what a distance earns", ylim=(0, 1.03))
    right.set(
        xlabel="Chamfer distance (px)", ylabel="more reward", title="what one pixel less adds", ylim=(0, 0.3)
    )
    right.legend(*left.get_legend_handles_labels(), fontsize=8, frameon=False)
    figure.tight_layout()
    return figure


def tuning_figure(rewards: Sequence[float], reports: Mapping[int, Mapping[str, float]]) -> Figure:
    """A short fine-tuning. Left the mean reward of each step's draws, and of SMOOTH steps; right, of other pictures
    with the likeliest tokens, the mean Chamfer distance after so many steps."""
    figure, (left, right) = _panels(2, 4.4, 2.9)
    steps = np.arange(1, len(rewards) + 1)
    left.plot(steps, rewards, color=COLORS[2], linewidth=0.8, alpha=0.6, label="one step")
    width = min(SMOOTH, len(rewards))
    smooth = np.convolve(rewards, np.ones(width) / width, mode="valid")
    left.plot(steps[width - 1 :], smooth, color="#24344d", linewidth=2.0, label=f"mean of {width} steps")
    left.set(xlabel="step", ylabel="reward", title="what drawn programs earn")
    left.set_ylim(0, None)
    left.legend(fontsize=8, frameon=False, loc="lower right")
    right.plot(
        list(reports),
        [each["val_cd"] for each in reports.values()],
        color=COLORS[1],
        marker="o",
        linewidth=1.6,
    )
    right.set(xlabel="step", ylabel="Chamfer distance (px)", title="pictures it does not learn from")
    right.set_ylim(0, None)
    figure.tight_layout()
    return figure


def long_runs_figure(runs: Sequence[Mapping]) -> Figure:
    """Long trainings, [{"name": …, "log": rows with "epoch", "val_reward" and "val_cd"}]: both over the epochs."""
    figure, axes = _panels(2, 4.4, 3.0)
    labels = {"val_reward": "reward", "val_cd": "Chamfer distance (px)"}
    for ax, (quantity, label) in zip(axes, labels.items()):
        for color, run in zip(COLORS[1:], runs):
            epochs, values = zip(*((row["epoch"], row[quantity]) for row in run["log"]))
            ax.plot(epochs, values, color=color, linewidth=1.8, marker=".", label=run["name"])
        ax.set(xlabel="epoch", ylabel=label)
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes[0].set_ylim(0, 1)
    axes[1].set_ylim(0, None)
    axes[1].legend(fontsize=8, frameon=False)
    figure.suptitle("pictures they do not learn from, likeliest token each time", fontsize=10)
    figure.tight_layout()
    return figure


def answers_figure(
    targets: Bool[Tensor, "n 64 64"],
    answers: Mapping[str, Bool[Tensor, "n 64 64"]],
    numbers: Mapping[str, Sequence[float]] | None = None,
    *,
    scale: float = 1.5,
) -> Figure:
    """A row of pictures for each name, over the targets: grey in both, blue in the target only, orange in the answer
    only. Below each stands its number, such as the Chamfer distance in px."""
    cell, low = 64 + GAP, 11 * bool(numbers)
    key = 140 / scale  # of the legend: pixels from one to the next
    width = max(NAMES + len(targets) * cell, round(NAMES + 3 * key))
    figure, ax = page(width, len(answers) * (cell + low) + 10, scale)
    for row, (name, images) in enumerate(answers.items()):
        y = row * (cell + low) + GAP // 2
        write(ax, name.replace(" ", "\n"), 1, y + 32, 8.5, ha="left", va="center")
        for column, (target, image) in enumerate(zip(targets, images)):
            x = NAMES + column * cell + GAP // 2
            overlay(ax, target.numpy(), image.numpy(), x, y)
            if numbers:
                write(ax, f"{numbers[name][column]:.1f}", x + 32, y + 65, 8.5, color=SOFT)
    below = len(answers) * (cell + low)
    for k, (color, text) in enumerate(
        ((BOTH, "both"), (COLOR_A, "only in the target"), (COLOR_B, "only in the answer"))
    ):
        x = NAMES + 4 + key * k
        ax.add_patch(plt.Rectangle((x, below + 1), 6, 6, color=color))
        write(ax, text, x + 9, below + 0.5, 8.5, ha="left")
    return figure


def film(
    targets: Bool[Tensor, "n 64 64"],
    moments: Sequence[Bool[Tensor, "n 64 64"]],
    captions: Sequence[str],
    *,
    seconds: float = 0.7,
    scale: float = 2,
) -> bytes:
    """What programs draw at several moments, over the targets, as an animated PNG that repeats for ever.

    IPython.display.Image(data) shows it; where pictures do not move, its first moment. The last one is held longer.
    Raises ValueError for no moments, and unless there is a caption for each.
    """
    if not moments or len(captions) != len(moments):
        raise ValueError(
            f"found {len(moments)} moments and {len(captions)} captions; expected one each, one or more"
        )
    pictures = [_still(targets, images, caption, scale) for images, caption in zip(moments, captions)]
    milliseconds = [round(1000 * seconds)] * (len(pictures) - 1) + [round(3000 * seconds)]
    out = io.BytesIO()
    pictures[0].save(
        out, "PNG", save_all=True, append_images=pictures[1:], duration=milliseconds, loop=0, optimize=True
    )
    return out.getvalue()


def _still(targets: Tensor, images: Tensor, caption: str, scale: float) -> Image.Image:
    """One frame, in few colours, so that it is small."""
    figure, ax = page(len(targets) * (64 + GAP), 64 + GAP + 14, scale)
    for column, (target, image) in enumerate(zip(targets, images)):
        overlay(ax, target.numpy(), image.numpy(), column * (64 + GAP) + GAP // 2, GAP // 2)
    write(ax, caption, 4, 64 + GAP, 9, ha="left")
    out = io.BytesIO()
    figure.savefig(out, dpi=DPI)
    return Image.open(out).convert("RGB").quantize(32, dither=Image.Dither.NONE)


def _panels(count: int, width: float, height: float, **options) -> tuple[Figure, Sequence[Axes]]:
    """Axes side by side; the figure is closed in pyplot."""
    figure, axes = plt.subplots(1, count, figsize=(width * count, height), dpi=DPI, squeeze=False, **options)
    plt.close(figure)
    for ax in axes[0]:
        _bare(ax)
    return figure, list(axes[0])


def _bare(ax: Axes, *more: str) -> None:
    ax.spines[["top", "right", *more]].set_visible(False)
