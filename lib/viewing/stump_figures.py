"""Figures of a CSG-Stump: its three layers wired together, its matrices, and what is soft about a soft one.

The layers are drawn as wires that cross: a row is a primitive, first itself (O), then behind its switch of W_C (F); a
column is an intersection (S). A dot where they cross is a one of W_I. Dots in the last row are ones of W_U, and lead to
the shape (T). `stump_widget` shows the same, with dots to click.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from lib.interpreters.stump import Stump, execute
from lib.viewing.canvas import COLOR_B, GAP, GRID, INK, PAPER, RIM, SOFT, WIDTH, frame, page, write
from lib.viewing.stump_pictures import color_of, picture_points, pictures_of

MOST = 12  # primitives, and nodes, that fit a figure of the layers
FINE = 4  # samples of a dot of a picture, across and down: edges come out smooth
_SWITCH, _CAPTION, _EDGE = 46, 18, 6  # dots: between O and F, below a picture, around the page
_NAMED = 128  # dots: left of W_I, where rows of matrices have the names of primitives
_WIRE = {"color": "#9aa3b0", "linewidth": 1.2, "solid_capstyle": "butt", "zorder": 0.5}


@dataclass(frozen=True)
class _Plan:
    """Where everything stands, dots from the upper left corner of the page."""

    rows: int
    columns: int
    side: int  # of a small picture

    @property
    def wordy(self) -> bool:
        """Is there room for more than a name?"""
        return self.side >= 68

    @property
    def complements(self) -> float:
        return _EDGE + self.side + _SWITCH

    def column(self, c: int) -> float:
        return self.complements + self.side + 20 + c * (self.side + GAP)

    def row(self, k: int) -> float:
        return 26 + k * (self.side + _CAPTION + 4)

    @property
    def union(self) -> float:
        """The height of the wire that unites."""
        return self.row(self.rows) + self.side + 24

    @property
    def large(self) -> float:
        """Side of the picture of the shape."""
        return max(2 * self.side, 110)

    @property
    def shape(self) -> float:
        """The left side of the picture of the shape."""
        return self.column(self.columns) + 24

    @property
    def size(self) -> tuple[int, int]:
        return round(self.shape + self.large + _EDGE), round(self.union + 34)


def layers_figure(stump: Stump, resolution: int | None = None, **view) -> Figure:
    """The three layers of a stump with a picture of every node, from the primitives (left) to the shape (right).

    resolution  of the pictures: fine enough when left out.    view  window, plane and at of `pictures_of`.
    Raises ValueError for more than MOST primitives or nodes.
    """
    rows, columns = stump.intersection.shape
    if max(rows, columns) > MOST:
        raise ValueError(
            f"found {rows} primitives and {columns} nodes; expected at most {MOST} to draw them all"
        )
    side = next(
        side for side in range(72, 0, -4) if _Plan(rows, columns, side).size[0] <= WIDTH or side <= 36
    )
    plan = _Plan(rows, columns, side)
    pictures = pictures_of(stump, resolution or FINE * side, **view)
    _, ax = page(*plan.size, 1)
    _wires(ax, stump, plan)
    for k, primitive in enumerate(stump.primitives):
        _primitive(
            ax, plan, k, primitive, pictures.primitives[k], pictures.complements[k], stump.complement[k]
        )
    for c, (picture, united) in enumerate(zip(pictures.nodes, stump.union.tolist())):
        _paste(ax, picture, plan.column(c), plan.row(rows), side, INK if united else RIM)
        write(ax, f"S{c + 1}", plan.column(c) + side / 2 + 5, plan.row(rows) + side + 3, 8.5, ha="left")
    _paste(ax, pictures.shape, plan.shape, plan.union + 10 - plan.large, plan.large, INK, 1.4)
    _explain(ax, plan)
    return ax.figure


def _primitive(ax: Axes, plan: _Plan, k: int, primitive, inside, after, complemented) -> None:
    """A row: the primitive, its switch, and what it is behind the switch."""
    top, middle = plan.row(k), plan.row(k) + plan.side / 2
    for picture, x in ((inside, _EDGE), (after, plan.complements)):
        _paste(ax, picture, x, top, plan.side, color_of(primitive))
    ax.plot([_EDGE + plan.side, plan.complements], [middle] * 2, **_WIRE)
    name = f"O{k + 1} {primitive.name}" if plan.wordy else f"O{k + 1}"
    write(ax, name, _EDGE + plan.side / 2, top + plan.side + 3, 8.5)
    write(ax, f"F{k + 1}", plan.complements + plan.side / 2, top + plan.side + 3, 8.5)
    if complemented:
        box = {"boxstyle": "round,pad=0.3", "facecolor": INK, "edgecolor": INK}
        x = _EDGE + plan.side + _SWITCH / 2
        write(ax, "not", x, middle, 8.5, va="center", color=PAPER, bbox=box, zorder=2)


def _wires(ax: Axes, stump: Stump, plan: _Plan) -> None:
    """All lines, and the dots on them."""
    centers = [plan.column(c) + plan.side / 2 for c in range(plan.columns)]
    for k, row in enumerate(stump.intersection.tolist()):
        y = plan.row(k) + plan.side / 2
        ax.plot([plan.complements + plan.side, *centers[-1:]], [y] * (1 + bool(centers)), **_WIRE)
        _dots(ax, centers, y, row)
    for x in centers:
        ax.plot([x, x], [plan.row(0) + plan.side / 2, plan.union], **_WIRE)
    ax.plot([*centers[:1], plan.shape], [plan.union] * (1 + bool(centers)), **_WIRE)
    _dots(ax, centers, plan.union, stump.union.tolist())


def _dots(ax: Axes, places: list[float], y: float, ones: list[bool]) -> None:
    """Where wires cross: joined by a dot, or not."""
    for x, one in zip(places, ones):
        style = {"markersize": 9, "color": INK} if one else {"markersize": 5, "color": PAPER}
        ax.plot([x], [y], marker="o", markeredgecolor=INK if one else RIM, zorder=2, **style)


def _explain(ax: Axes, plan: _Plan) -> None:
    """Headings, and in words what the lower rows do."""
    first, second = ("primitives", "complement") if plan.wordy else ("O", "F")
    heads = {first: _EDGE + plan.side / 2, "W_C": _EDGE + plan.side + _SWITCH / 2}
    heads[second] = plan.complements + plan.side / 2
    for text, x in heads.items():
        write(ax, text, x, 6, 8.5, color=SOFT)
    if plan.columns:
        write(ax, "W_I", (plan.column(0) + plan.column(plan.columns) - GAP) / 2, 6, 8.5, color=SOFT)
    beside = {"x": plan.complements + plan.side, "size": 8.5, "ha": "right", "va": "center", "color": SOFT}
    which = "S, intersections: where\nall F with a dark dot are" if plan.wordy else "S, intersections"
    write(ax, which, y=plan.row(plan.rows) + plan.side / 2, **beside)
    write(ax, "W_U, which S are united" if plan.wordy else "W_U, the union", y=plan.union, **beside)
    write(ax, "T, the shape", plan.shape + plan.large / 2, plan.union + 14, 8.5)


def _paste(
    ax: Axes, picture: np.ndarray, x: float, y: float, side: float, color: str, wide: float = 0.8
) -> None:
    """A picture of booleans or of shares 0..1 in one colour on paper, with a frame."""
    share = np.asarray(picture, dtype=float)[..., None]
    colors = share * to_rgba(color) + (1 - share) * to_rgba(PAPER)
    ax.imshow(colors, extent=(x, x + side, y + side, y), interpolation="antialiased", aspect="auto", zorder=1)
    frame(ax, x, y, side, side, RIM, wide)


def matrices_figure(stump: Stump) -> Figure:
    """W_C, W_I and W_U as they lie around the layers: a row a primitive, a column a node; dark is 1, light is 0."""
    rows, columns = stump.intersection.shape
    cell = min(22.0, (WIDTH - 130) / max(1, columns), WIDTH / rows)  # dots
    named = (
        _step(cell) == 1 and _NAMED + columns * cell + 14 <= WIDTH
    )  # is there room for more than a number?
    left, top, gap = _NAMED if named else 82, 44, 10
    union = top + rows * cell + gap
    _, ax = page(max(round(left + columns * cell + 14), 220), round(union + max(cell, 14) + 6), 1)
    _matrix(ax, stump.complement[:, None], left - gap - cell, top, cell)
    _matrix(ax, stump.intersection, left, top, cell)
    _matrix(ax, stump.union[None], left, union, cell)
    style = {"size": 8.5, "color": SOFT, "va": "center"}
    write(ax, "W_C", left - gap, 12, **(style | {"ha": "right"}))
    write(ax, f"W_I, {rows} x {columns}", left, 12, **(style | {"ha": "left"}))
    write(ax, "W_U", left - gap, union + cell / 2, **(style | {"ha": "right"}))
    for k in range(0, rows, _step(cell)):
        name = f"F{k + 1} {stump.primitives[k].name}" if named else f"F{k + 1}"
        write(ax, name, left - gap - cell - 5, top + (k + 0.5) * cell, 8, ha="right", va="center")
    for c in range(0, columns, _step(cell, 7 * len(f"S{columns}") + 6)):
        write(ax, f"S{c + 1}", left + (c + 0.5) * cell, 32, 8, va="center")
    return ax.figure


def _step(cell: float, wide: float = 13) -> int:
    """Every how many rows have room for a label of so many dots."""
    return next(step for step in (1, 2, 4, 8, 16, 32, 64, 128, 256, 1 << 30) if step * cell >= wide)


def _matrix(ax: Axes, matrix: torch.Tensor, x: float, y: float, cell: float) -> None:
    """Cells with their upper left corner at (x, y); lines between them where they are large enough."""
    height, width = matrix.shape
    colors = np.where(matrix.cpu().numpy()[..., None], to_rgba(INK), to_rgba(GRID))
    edges = (x, x + width * cell, y + height * cell, y)
    if not width:
        return
    ax.imshow(colors, extent=edges, interpolation="nearest", aspect="auto", zorder=1)
    if cell >= 6:
        line = {"color": PAPER, "linewidth": 1, "zorder": 1.1}
        ax.vlines(x + np.arange(1, width) * cell, y, y + height * cell, **line)
        ax.hlines(y + np.arange(1, height) * cell, x, x + width * cell, **line)


def soft_figure(stump: Stump, sharpnesses: Sequence[float] = (5, 20, 150), **view) -> Figure:
    """The hard shape, and beside it the soft occupancy for each sharpness: white is 0, dark is 1.

    The titles have the mean of |soft - hard| over the picture's points. An orange line follows occupancy 0.5: it is the
    hard outline, however soft, for a minimum or a maximum is above 0.5 exactly where it would be 1 if all were hard.
    view: window, plane and at of `pictures_of`.
    """
    side = min(190, WIDTH // (len(sharpnesses) + 1) - GAP)
    shape, resolution = execute(stump), 2 * side
    points = picture_points(stump, resolution, **view)
    hard = shape.occupancy(points).view(resolution, resolution).cpu().numpy()
    _, ax = page((side + GAP) * (len(sharpnesses) + 1), side + GAP + 34, 1)
    _paste(ax, hard, GAP / 2, GAP / 2, side, INK)
    write(ax, "hard", (side + GAP) / 2, side + GAP + 1)
    for place, sharpness in enumerate(sharpnesses, start=1):
        soft = shape.soft_occupancy(points, sharpness).detach().view(resolution, resolution).cpu().numpy()
        x, error = GAP / 2 + place * (side + GAP), abs(soft - hard).mean()
        _paste(ax, soft, x, GAP / 2, side, INK)
        _half(ax, soft, x, GAP / 2, side)
        write(ax, f"sharpness {sharpness:g}\nmean error {error:.3f}", x + side / 2, side + GAP + 1)
    return ax.figure


def _half(ax: Axes, soft: np.ndarray, x: float, y: float, side: float) -> None:
    """A line where a picture passes through 0.5, where it does."""
    if soft.min() < 0.5 <= soft.max():
        places = (np.arange(len(soft)) + 0.5) / len(soft) * side
        ax.contour(x + places, y + places, soft, [0.5], colors=COLOR_B, linewidths=1.2, zorder=1.2)
