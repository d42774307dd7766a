"""How a training went: the terms of the loss, what a network wrote while it learned, where its codes lie.

terms_figure({"untrained": terms}, weights)    what each term costs
curves_figure(log, weights)                    the terms over the epochs
progress_figure({"epoch 1": programs, …})      a row of shapes for each moment
surprise_figure(texts, {"trained": surprise})  how unexpected each line of a program was
codes_figure({"with KL": codes, …})            where codes lie, beside the standard normal distribution
"""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from torch import Tensor

from lib.interpreters.shapeassembly import Program
from lib.viewing.figure import show
from lib.viewing.latent_figures import line_count, shapes_of, with_row_names

COLORS = ("#9aa5b8", "#e28f4f", "#5e8bba", "#70ad77")
SMALLEST = 0.01  # what a logarithmic axis of costs begins with


def terms_figure(terms: Mapping[str, Mapping[str, float]], weights: Mapping[str, float]) -> Figure:
    """A group of bars a term: term times weight, on a logarithmic scale, a colour for each of `terms`."""
    figure, ax = _axes(9.5, 2.9)
    place = np.arange(len(weights))
    width = 0.8 / len(terms)
    for number, (name, found) in enumerate(terms.items()):
        costs = [max(weights[term] * float(found[term]), SMALLEST) for term in weights]
        ax.bar(
            place + (number - (len(terms) - 1) / 2) * width,
            costs,
            width * 0.94,
            label=name,
            color=COLORS[number],
        )
    ax.set_xticks(place, [f"{term}\n× {weight:g}" for term, weight in weights.items()], fontsize=8)
    ax.set(yscale="log", ylim=(SMALLEST, None), ylabel="cost of a program")
    ax.legend(fontsize=8, frameon=False, ncols=len(terms))
    figure.tight_layout()
    return figure


def curves_figure(log: Sequence[Mapping[str, float]], weights: Mapping[str, float]) -> Figure:
    """Left the whole loss, training and validation; right each weighted term of the training, named at its end."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.6), dpi=100, width_ratios=(2, 3))
    plt.close(figure)
    epochs = [row["epoch"] for row in log]
    for name, label, color in (("loss", "training", COLORS[2]), ("val_loss", "validation", COLORS[1])):
        if name in log[-1]:
            left.plot(epochs, [row[name] for row in log], color=color, label=label)
    left.legend(fontsize=8, frameon=False)
    colors = plt.get_cmap("tab20").colors
    for number, (term, weight) in enumerate(weights.items()):
        costs = [max(weight * row[term], SMALLEST) for row in log]
        right.plot(epochs, costs, color=colors[number], linewidth=1.5, label=term)
    right.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    for ax, title in ((left, "the whole loss"), (right, "its terms, weighted")):
        ax.set(yscale="log", xlabel="epoch", title=title)
        ax.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    return figure


def progress_figure(rows: Mapping[str, Sequence[Program | None]], size: float = 1.15) -> Figure:
    """A row of programs for each name, which stands left of it; an empty picture for None. Rows are equally long."""
    programs = [program for row in rows.values() for program in row]
    titles = [f"{line_count(program)} lines" if program else "none" for program in programs]
    columns = len(programs) // len(rows)
    return with_row_names(show(shapes_of(programs), titles, columns=columns, size=size), list(rows))


def surprise_figure(
    texts: Sequence[str], surprise: Mapping[str, Float[Tensor, " lines"]], unit: str
) -> Figure:
    """A bar a line of a program, beside its text; a colour for each reader."""
    figure, ax = plt.subplots(figsize=(9, 0.9 + 0.24 * len(texts)), dpi=100)
    plt.close(figure)
    place, height = np.arange(len(texts)), 0.8 / len(surprise)
    for number, (name, values) in enumerate(surprise.items()):
        at = place + (number - (len(surprise) - 1) / 2) * height
        ax.barh(at, values.detach().numpy(), height * 0.9, color=COLORS[number + 1], label=name)
    ax.set_yticks(place, texts, fontsize=7, family="monospace")
    ax.invert_yaxis()
    ax.set_xlabel(unit, fontsize=9)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(fontsize=8, frameon=False)
    figure.tight_layout()
    return figure


def codes_figure(codes: Mapping[str, Float[Tensor, "codes latent"]]) -> Figure:
    """A panel each: codes along their two main directions from 0, rings where 1, 2 and 3 standard deviations are."""
    figure, axes = plt.subplots(1, len(codes), figsize=(4.2 * len(codes), 4.0), dpi=100, squeeze=False)
    plt.close(figure)
    for number, (ax, (name, found)) in enumerate(zip(axes[0], codes.items())):
        _draw_codes(ax, found, COLORS[number + 1])
        ax.set_title(name, fontsize=10)
    figure.tight_layout()
    return figure


def _draw_codes(ax: Axes, codes: Tensor, color: str) -> None:
    flat = codes.detach().double()
    _, _, axes = torch.linalg.svd(flat, full_matrices=False)
    u, v = (flat @ axes[:2].T).T.numpy()
    for radius in (1, 2, 3):
        ax.add_patch(
            plt.Circle((0, 0), radius, fill=False, color="#5b6475", linewidth=0.8, linestyle=(0, (4, 3)))
        )
    ax.scatter(u, v, s=22, color=color, edgecolors="white", linewidths=0.6, zorder=3)
    reach = 1.1 * max(3.0, abs(u).max(), abs(v).max())
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    ax.set(xlabel="along the first main direction", ylabel="along the second")
    ax.spines[["top", "right"]].set_visible(False)


def _axes(width: float, height: float) -> tuple[Figure, Axes]:
    figure, ax = plt.subplots(figsize=(width, height), dpi=100)
    plt.close(figure)
    ax.spines[["top", "right"]].set_visible(False)
    return figure, ax
