"""Figures of a CSG program as it runs: the stack as a strip of film, and the tree of its operations.

Blue is A and orange is B, what an operation takes: `A B -` is A without B.
"""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from matplotlib.patheffects import withStroke

from lib.interpreters.csg import Operation, Program, Shape, Step, parse, trace
from lib.interpreters.csg.packing import SIDE
from lib.interpreters.csg.program import Statement
from lib.viewing.canvas import (
    COLOR_A,
    COLOR_B,
    GAP,
    INK,
    RIM,
    SOFT,
    fitting_scale,
    page,
    refuse_space,
    stamp,
    write,
)

MEANING = {"+": "A or B", "*": "A and B", "-": "A without B"}
_AISLE = 20  # pixels between two columns of the strip, where the arrows run


def show_stack(program: Program | str | Sequence[Statement], *, columns: int = 9) -> Figure:
    """The stack after each token, its top above; what the next operation takes is coloured, blue A and orange B.

    A program, its text, or the statements of a half-written one. `columns` tokens stand in a row of the figure.
    Raises TypeError for a program of space.
    """
    steps = _steps(program)
    columns = max(1, min(columns, len(steps)))
    rows = [range(first, min(first + columns, len(steps))) for first in range(0, len(steps), columns)]
    cell = SIDE + _AISLE
    scale = fitting_scale(columns * cell, largest=2)
    below = round(48 / scale)
    depths = [max(len(steps[place].stack) for place in row) for row in rows]
    height = sum(depth * (SIDE + GAP) + below for depth in depths)
    figure, ax = page(columns * cell, max(1, height), scale)
    floor = 0
    for row, depth in zip(rows, depths):
        floor += depth * (SIDE + GAP)
        for place in row:
            _column(ax, steps, place, (place - row.start) * cell + _AISLE / 2, floor, place > row.start)
        floor += below
    return figure


def _steps(program: Program | str | Sequence[Statement]) -> list[Step]:
    """The trace of a program of the plane. Raises TypeError for one of space."""
    program = parse(program) if isinstance(program, str) else program
    refuse_space(program)
    steps = trace(program)
    if steps:
        refuse_space(steps[0].token)
    return steps


def _column(ax: Axes, steps: list[Step], place: int, x: float, floor: float, follows: bool) -> None:
    """The stack after one token, and arrows from what that token took."""
    step, dots = steps[place], (ax.figure.dpi * ax.figure.get_figwidth() / ax.get_xlim()[1])
    taken = len(steps[place + 1].taken) if place + 1 < len(steps) else 0
    levels = [floor - (level + 1) * (SIDE + GAP) + GAP / 2 for level in range(len(step.stack) + 2)]
    for level, shape in enumerate(step.stack):
        role = level - (len(step.stack) - taken)  # 0 is A, 1 is B, below 0 waits
        color = (COLOR_A, COLOR_B)[role] if role >= 0 else INK
        _entry(ax, shape, x, levels[level], color, role)
    if step.taken and follows:
        goal = (x - 1, levels[len(step.stack) - 1] + SIDE / 2)
        for role, color in enumerate((COLOR_A, COLOR_B)):
            start = (x - _AISLE + 1, levels[len(step.stack) - 1 + role] + SIDE / 2)
            _arrow(ax, start, goal, color)
    write(ax, str(step.token), x + SIDE / 2, floor + 1, 9.5 if step.taken else 8, True, fontweight="bold")
    if step.taken:
        write(ax, MEANING[str(step.token)], x + SIDE / 2, floor + 1 + 19 / dots, 8, color=SOFT)


def _entry(ax: Axes, shape: Shape, x: float, y: float, color: str, role: int) -> None:
    """One picture of the stack, with its letter where the next operation takes it."""
    stamp(ax, shape.image.cpu().numpy(), x, y, color, *((color, 1.4) if role >= 0 else ()))
    if role >= 0:
        rim = [withStroke(linewidth=2, foreground="white")]
        write(ax, "AB"[role], x + 3, y + 2, 8, ha="left", color=color, fontweight="bold", path_effects=rim)


def _arrow(ax: Axes, start: tuple, end: tuple, color: str) -> None:
    style = {"arrowstyle": "-|>", "mutation_scale": 7, "color": color, "linewidth": 1.1, "zorder": 2}
    ax.add_patch(FancyArrowPatch(start, end, shrinkA=0, shrinkB=0, **style))


def show_tree(program: Program | str, *, scale: float | None = None) -> Figure:
    """The tree of operations with the picture of every node; blue lines lead to A, orange ones to B.

    Raises TypeError for a program of space.
    """
    steps = _steps(program)
    places, parents = _places(steps)
    leaves, levels = (1 + max(place[k] for place in places) for k in (0, 1))
    wide, high = SIDE + GAP + 8, SIDE + 36
    scale = scale or fitting_scale(round(leaves * wide), largest=1.5)
    figure, ax = page(round(leaves * wide), levels * high, scale)
    spots = [(GAP + column * wide, GAP / 2 + level * high) for column, level in places]
    for step, (x, y), parent in zip(steps, spots, parents):
        stamp(ax, step.stack[-1].image.cpu().numpy(), x, y, INK, rim=RIM)
        operation = isinstance(step.token, Operation)
        text = f"{step.token}  {step.token.name}" if operation else str(step.token)
        size = {"fontweight": "bold"} if operation else {}
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1.2}
        write(ax, text, x + SIDE / 2, y + SIDE + 3, 8.5, not operation, bbox=box, zorder=3, **size)
        if parent is not None:
            above, role = parent
            px, py = spots[above]
            ax.plot(
                [px + SIDE / 2, x + SIDE / 2], [py + SIDE + 8, y], color=(COLOR_A, COLOR_B)[role], zorder=0.5
            )
    return figure


def _places(steps: list[Step]) -> tuple[list[tuple[float, int]], list[tuple[int, int] | None]]:
    """For each token its (column, level) in the tree, a leaf a column, and (its parent, 0 for A or 1 for B)."""
    columns: list[float] = []
    parents: list[tuple[int, int] | None] = [None] * len(steps)
    stack, leaves = [], 0
    for place, step in enumerate(steps):
        if step.taken:
            right, left = stack.pop(), stack.pop()
            parents[left], parents[right] = (place, 0), (place, 1)
            columns.append((columns[left] + columns[right]) / 2)
        else:
            columns.append(leaves)
            leaves += 1
        stack.append(place)
    levels = [0] * len(steps)
    for place in reversed(range(len(steps))):
        if parents[place]:
            levels[place] = levels[parents[place][0]] + 1
    return list(zip(columns, levels)), parents
