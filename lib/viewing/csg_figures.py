"""Figures of numbers: how far each pixel of a picture is from an outline, and a curve through a few points."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from torch import Tensor

NUMBERED = 12  # pixels along a side at most, for each to get its number
RINGS = 8  # pixels from one contour line to the next, where there are no numbers
MARK = "#d62839"


def show_distances(
    maps: Sequence[Tensor], titles: Sequence[str], marks: Sequence[Tensor] | None = None, *, size: float = 3.0
) -> Figure:
    """Maps of distances side by side in one scale, (h, w) px [row y, column x]; light is near, dark is far.

    Small maps show their numbers, rounded to one decimal; large ones a line every 8 px, marked with its distance.
    marks   pixels to mark in red, one bool (h, w) a map.    size   of one map, inches.
    """
    if len(titles) != len(maps) or (marks is not None and len(marks) != len(maps)):
        raise ValueError(f"{len(maps)} maps need as many titles, and as many marks or none")
    if not len(maps):
        raise ValueError("found no maps; expected one or more")
    grids = [np.asarray(each, dtype=float) for each in maps]
    figure, axes = plt.subplots(
        1, len(grids), figsize=(size * len(grids), size + 0.3), dpi=100, squeeze=False
    )
    plt.close(figure)
    # Where there is no outline, all distances are infinite.
    farthest = max(grid[np.isfinite(grid)].max(initial=0) for grid in grids)
    for ax, grid, title in zip(axes[0], grids, titles):
        # 1.6: numbers stay readable on the darkest
        ax.imshow(np.where(np.isfinite(grid), grid, np.nan), cmap="Blues", vmin=0, vmax=1.6 * farthest)
        if max(grid.shape) <= NUMBERED:
            for (y, x), distance in np.ndenumerate(grid):
                ax.text(x, y, f"{distance:.1f}", ha="center", va="center", fontsize=7.5)
        elif farthest > RINGS and min(grid.shape) > 1:
            lines = ax.contour(grid, np.arange(RINGS, farthest, RINGS), colors="#24344d", linewidths=0.8)
            ax.clabel(lines, fmt="%g", fontsize=6.5)
        ax.set(xticks=[], yticks=[])
        ax.set_xlabel(title, fontsize=9)
    for ax, mark in zip(axes[0], [] if marks is None else marks):
        large = max(mark.shape) > NUMBERED  # no frame, but all of the pixel
        side = 1.0 if large else 0.88
        for y, x in np.argwhere(np.asarray(mark)):
            place = (x - side / 2, y - side / 2)
            ax.add_patch(Rectangle(place, side, side, fill=large, color=MARK, linewidth=0 if large else 1.4))
    figure.tight_layout()
    return figure


def show_points(
    places: Sequence[int], heights: Sequence[float], xlabel: str, ylabel: str, title: str
) -> Figure:
    """A curve that is known at a few places only: a marker, a tick and the number (two digits) at each."""
    if len(places) != len(heights):
        raise ValueError(f"{len(heights)} heights for {len(places)} places: one each, please")
    figure, ax = plt.subplots(figsize=(5.2, 2.8), dpi=100)
    plt.close(figure)
    ax.plot(places, heights, marker="o", color="#5e8bba", linewidth=1.6)
    for place, height in zip(places, heights):
        above = {"xytext": (4, 5), "textcoords": "offset points", "fontsize": 8}
        ax.annotate(f"{height:.2g}", (place, height), **above)
    ax.set(xticks=places, xlabel=xlabel, ylabel=ylabel, title=title)
    ax.set_ylim(0, 1.15 * max(heights))
    ax.margins(x=0.08)
    ax.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    return figure
