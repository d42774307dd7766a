"""Figures of what written programs come to: how often codes give none, how near neighbours are, where a way jumps.

outcome_bars({"rules": {"program": 200, …}})     counts side by side, one bar a name
distance_figure({"copies": distances, …})        many distances as dots, a row a name, the median marked
steps_figure(edits, distances)                   along a way between two shapes: what changes at each step
compared_figure({"no rules": shapes, …})         a row a name, with the boxes that shapes should lie in
"""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float, Int
from matplotlib.figure import Figure
from torch import Tensor

from lib.interpreters.shapeassembly import Shape
from lib.viewing.camera import Camera
from lib.viewing.figure import bounds_of, show

COLORS = ("#70ad77", "#e28f4f", "#9379b8", "#c2679a", "#5e8bba")


def outcome_bars(counts: Mapping[str, Mapping[str, int]], width: float = 7.0) -> Figure:
    """A bar a name, in parts; each part is written down with its count where it has room."""
    parts = list(dict.fromkeys(part for each in counts.values() for part in each))
    figure, ax = plt.subplots(figsize=(width, 0.9 + 0.36 * len(counts)), dpi=100)
    plt.close(figure)
    left = np.zeros(len(counts))
    for number, part in enumerate(parts):
        values = np.array([each.get(part, 0) for each in counts.values()])
        bars = ax.barh(range(len(counts)), values, left=left, color=COLORS[number % len(COLORS)], label=part)
        enough = 0.05 * max(sum(each.values()) for each in counts.values())
        ax.bar_label(bars, [str(v) if v >= enough else "" for v in values], label_type="center", fontsize=8)
        left += values
    ax.set_yticks(range(len(counts)), counts, fontsize=9)
    ax.invert_yaxis()
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(fontsize=8, frameon=False, ncols=4, loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2)
    figure.tight_layout()
    return figure


def distance_figure(
    distances: Mapping[str, Float[Tensor, " n"] | Int[Tensor, " n"]], xlabel: str, width: float = 7.0
) -> Figure:
    """One row of dots a name; a line at the median."""
    figure, ax = plt.subplots(figsize=(width, 0.8 + 0.45 * len(distances)), dpi=100)
    plt.close(figure)
    for row, values in enumerate(distances.values()):
        values = np.asarray(values, dtype=float)
        rise = np.linspace(-0.22, 0.22, 7)[np.arange(len(values)) % 7]  # so that equal values stay visible
        ax.scatter(values, row + rise, s=14, color=COLORS[row % len(COLORS)], linewidths=0, alpha=0.8)
        ax.plot([np.median(values)] * 2, [row - 0.36, row + 0.36], color="#1b1f27", linewidth=1.6)
    ax.set_yticks(range(len(distances)), distances, fontsize=9)
    ax.set(xlabel=xlabel)
    ax.set_xlim(-0.02 * ax.get_xlim()[1], None)  # a dot at 0 is seen whole
    ax.invert_yaxis()
    ax.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    return figure


def steps_figure(edits: Sequence[int], distances: Float[Tensor, " steps"], width: float = 7.0) -> Figure:
    """Above, edits of the program at each step; below, how far its surface moved, shape scales."""
    figure, axes = plt.subplots(2, 1, figsize=(width, 2.8), dpi=100, sharex=True)
    plt.close(figure)
    at = np.arange(1, len(edits) + 1)
    for ax, values, label, color in zip(
        axes, (edits, distances), ("edits", "Chamfer distance"), ("#e28f4f", "#5e8bba")
    ):
        ax.bar(at, np.asarray(values, dtype=float), color=color, width=0.8)
        ax.set_ylabel(label, fontsize=8)
        ax.spines[["top", "right"]].set_visible(False)
    axes[1].set_xlabel("step", fontsize=9)
    figure.tight_layout()
    return figure


def compared_figure(
    rows: Mapping[str, Sequence[Shape | None]], size: float = 1.7, boxes: bool = True
) -> Figure:
    """Shapes of one column seen by one camera; dashed, with `boxes`, the bounding box that each program states."""
    columns = list(zip(*rows.values(), strict=True))
    cameras = [Camera(bounds=bounds_of(*column, *_ghosts(column))) for column in columns]
    details = [
        {"camera": camera, "ghost": shape.boxes[:1] if boxes and shape is not None else None}
        for shapes in rows.values()
        for camera, shape in zip(cameras, shapes)
    ]
    titles = [name for name, shapes in rows.items() for _ in shapes]
    every = [shape for shapes in rows.values() for shape in shapes]
    return show(every, titles, columns=len(columns), size=size, details=details)


def _ghosts(shapes: Sequence[Shape | None]) -> list:
    return [shape.boxes[:1] for shape in shapes if shape is not None]
