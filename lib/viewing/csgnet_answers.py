"""What CSGNet answered, beside what it was asked.

gallery_figure(targets, answers, titles)       pairs of pictures, and where they differ
boxes_figure(images, true, found)              primitives as objects: boxes around them
lengths_figure(lengths, {"k = 10": row, …})    how likeness falls with the length of programs
"""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
from jaxtyping import Bool
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from torch import Tensor

from lib.interpreters.csg.packing import SIDE
from lib.interpreters.csg.primitives import KINDS
from lib.viewing.canvas import COLOR_A, COLOR_B, COLORS, GAP, overlay, page, stamp, write
from lib.viewing.csgnet_figures import CURVES

WIDTH = 860  # dots of a figure
TITLES = {"chamfer_px": "mean Chamfer distance (px)", "exact": "share of exactly right pictures"}
NAMED = 0.25  # a score from which on it is written
Box = tuple[str, Sequence[float], float]  # kind, (left, top, right, bottom), score


def gallery_figure(
    targets: Bool[Tensor, "n 64 64"],
    answers: Bool[Tensor, "n 64 64"],
    titles: Sequence[str],
    *,
    columns: int = 3,
) -> Figure:
    """For each target three pictures: itself, the answer, and both: blue only in the target, orange only in the
    answer, grey in both. A title of up to six lines below; programs are broken to fit."""
    if not len(targets) == len(answers) == len(titles):
        found = f"{len(targets)} targets, {len(answers)} answers and {len(titles)} titles"
        raise ValueError(f"found {found}; expected one of each")
    wide = 3 * SIDE + 2 * 3 + 2 * GAP
    scale = WIDTH / (columns * wide)
    titles = [_broken(title, int((wide - GAP) * scale / 6.3)) for title in titles]
    below = round((6 + 13.5 * max(title.count("\n") + 1 for title in titles)) / scale)
    rows = -(-len(titles) // columns)
    figure, ax = page(columns * wide, rows * (SIDE + 2 * GAP + below), scale)
    for place, (target, answer, title) in enumerate(zip(targets.numpy(), answers.numpy(), titles)):
        x = place % columns * wide + GAP
        y = place // columns * (SIDE + 2 * GAP + below) + GAP
        stamp(ax, target, x, y, COLOR_A)
        stamp(ax, answer, x + SIDE + 3, y, COLOR_B)
        overlay(ax, target, answer, x + 2 * (SIDE + 3), y)
        write(ax, title, x, y + SIDE + 5 / scale, 7.4, True, ha="left")
    return figure


def _broken(title: str, width: int) -> str:
    """Lines of at most so many letters, broken after a bracket or an operation."""
    lines = []
    for line in title.splitlines():
        lines.append("")
        for piece in line.replace(")", ")\0").split("\0"):
            if lines[-1] and len(lines[-1]) + len(piece) > width:
                lines.append("  ")
            lines[-1] += piece
    return "\n".join(lines)


def boxes_figure(
    images: Bool[Tensor, "n 64 64"], true: Sequence[Sequence[Box]], found: Sequence[Sequence[Box]]
) -> Figure:
    """Above the true boxes over each picture, below those that were found, the more opaque the higher their score."""
    cell = SIDE + GAP
    width, high = len(images) * cell + 34, cell + 4
    scale = min(2.6, WIDTH / width)
    figure, ax = page(width, 2 * high + 14, scale)
    for row, (name, boxes) in enumerate({"true": true, "found": found}.items()):
        write(ax, name, 30, row * high + SIDE / 2, 9, ha="right")
        for place, (image, each) in enumerate(zip(images.numpy(), boxes)):
            x, y = 34 + place * cell, row * high + GAP // 2
            stamp(ax, image, x, y, "#d3d9e2")
            for kind, (left, top, right, bottom), score in each:
                style = {"fill": False, "edgecolor": COLORS[kind], "linewidth": 1.6, "zorder": 1.2}
                corner = (x + left, y + top)
                ax.add_patch(Rectangle(corner, right - left, bottom - top, alpha=float(score), **style))
                if NAMED <= score < 1:
                    paper = {"facecolor": "white", "edgecolor": "none", "pad": 0.3, "alpha": 0.8}
                    write(
                        ax,
                        f"{score:.0%}",
                        x + left + 1,
                        y + top + 1,
                        6.5,
                        ha="left",
                        color=COLORS[kind],
                        bbox=paper,
                    )
    keys = [Line2D([], [], color=color, label=KINDS[kind].name) for kind, color in COLORS.items()]
    style = {"ncols": 3, "fontsize": 8, "frameon": False, "loc": "lower center", "borderaxespad": 0}
    ax.legend(handles=keys, bbox_to_anchor=(0.5, 0.0), **style)
    return figure


def lengths_figure(lengths: Sequence[int], rows: Mapping[str, Mapping[str, Sequence[float]]]) -> Figure:
    """Likeness by the length of programs, a curve a method: left the mean Chamfer distance, right the share of pictures
    that are exactly right.

    rows    {method: {"chamfer_px": one number a length, "exact": shares}}
    """
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.0), dpi=100)
    plt.close(figure)
    for ax, (quantity, title) in zip(axes, TITLES.items()):
        for color, (name, row) in zip(CURVES, rows.items()):
            ax.plot(lengths, row[quantity], "o-", markersize=4, color=color, label=name)
        ax.set(xticks=list(lengths), xlabel="tokens of the program", ylim=(0, None))
        ax.set_title(title, fontsize=10)
        ax.spines[["top", "right"]].set_visible(False)
    axes[1].set_ylim(0, 1.02)
    axes[0].legend(fontsize=8, frameon=False)
    figure.tight_layout()
    return figure
