"""Figures about gradients: bars by parameter, curves over a number, a fit against its target."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from torch import Tensor

from lib.interpreters.shapeassembly import Program
from lib.viewing.camera import Camera
from lib.viewing.figure import bounds_of, draw, draw_points
from lib.viewing.naming import knobs

LABELLED = 30  # parameters at most that get a name each
DIFFERENT = 1e-4  # relative above 1, absolute below
_COMMAND_COLORS = {"Cuboid": "#5e8bba", "attach": "#e28f4f", "squeeze": "#70ad77", "translate": "#9379b8"}


def gradient_bars(program: Program, gradient: Tensor, dots: Tensor | None = None, title: str = "") -> Figure:
    """One bar per parameter in text order, coloured by its statement; optional dots of another estimate, (p,) both.

    A red ring marks where the two differ by more than DIFFERENT. Few parameters are named, many are counted.
    """
    commands = [name.split(":")[2] for name in program.parameter_names()]
    few = len(commands) <= LABELLED
    figure, ax = _axes(7.5, 3.6 if few else 2.6)
    place = np.arange(len(commands))
    if few:
        ax.set_xticks(place, [knob.label for knob in knobs(program)], rotation=90, fontsize=7)
    ax.bar(place, gradient.detach().numpy(), color=[_COMMAND_COLORS[c] for c in commands], width=0.9)
    for command in dict.fromkeys(commands):
        ax.bar([0], [0], color=_COMMAND_COLORS[command], label=command)
    if dots is not None:
        other = dots.detach() - gradient.detach()
        apart = (other.abs() > DIFFERENT * (1 + dots.detach().abs())).numpy()
        ax.scatter(place, dots.detach().numpy(), s=9, color="#1b1f27", zorder=3)
        ax.scatter(
            place[apart],
            dots.detach().numpy()[apart],
            s=60,
            facecolors="none",
            edgecolors="#d62839",
            zorder=4,
        )
    ax.axhline(0, color="#5b6475", linewidth=0.8)
    ax.set(
        xlabel="" if few else "number in the program's text, counted from 0", ylabel="derivative", title=title
    )
    ax.legend(fontsize=8, frameon=False, ncols=4)
    return _finished(figure)


def plot_against(
    values: Tensor, results: Mapping[str, Tensor], xlabel: str, ylabel: str, title: str
) -> Figure:
    """Curves over one number, (n,) each."""
    figure, ax = _axes(5.2, 2.8)
    for name, result in results.items():
        ax.plot(values.detach().numpy(), result.detach().numpy(), label=name, linewidth=1.6)
    ax.set(xlabel=xlabel, ylabel=ylabel, title=title)
    ax.legend(fontsize=8, frameon=False)
    return _finished(figure)


def draw_fit(shapes: Sequence, titles: Sequence[str], target: Tensor) -> Figure:
    """Shapes under one camera with the target's points (m, 3) over them, then the target alone."""
    points = target.detach().numpy()
    camera = Camera(bounds=bounds_of(*shapes, points))
    figure, axes = plt.subplots(1, len(shapes) + 1, figsize=(2.6 * (len(shapes) + 1), 2.9), dpi=100)
    plt.close(figure)
    for ax, shape, title in zip(axes, shapes, titles, strict=False):
        draw(ax, shape, camera=camera)
        draw_points(ax, points, camera=camera, color="#d62839", size=1.5)
        ax.set_xlabel(title, fontsize=9)
    draw_points(axes[-1], points, camera=camera, size=3)
    axes[-1].set_xlabel("the target", fontsize=9)
    figure.subplots_adjust(0, 0.1, 1, 1, 0.02, 0)
    return figure


def _axes(width: float, height: float):
    figure, ax = plt.subplots(figsize=(width, height), dpi=100)
    plt.close(figure)
    ax.spines[["top", "right"]].set_visible(False)
    return figure, ax


def _finished(figure: Figure) -> Figure:
    figure.tight_layout()
    return figure
