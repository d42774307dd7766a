"""Checkers for 11_csg_stump, and the shapes they are about. Answers are judged by what is inside them."""

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..interpreters.openscad import ScadError, read
from ..interpreters.stump import Box, Cylinder, ProgramError, Square, Stump, execute, parse
from ..interpreters.stump.layers import binary
from . import OK, UNANSWERED, hint

LETTERS = "ABCD"
SOFT_ERROR = 0.01  # exercise 11.4: mean of |soft - hard|
NEAR = 1.1  # exercise 11.4: times the smallest sharpness
SLIPS = 0.005  # share of the points that may differ: numbers read off a picture
POINTS = 20_000
BLIND = """F1 = box(half=(0.5, 0.3, 0.1))
F2 = cylinder(radius=0.15, height=0.1, translation=(-0.2, 0.0, 0.05))
S1 = F1 & F2
T = S1
"""
_PLATE = """F1 = square(half=(0.5, 0.3))
F2 = not circle(radius=0.15, translation=(-0.25, 0.0))
F3 = not square(half=(0.2, 0.05), translation=(0.2, 0.0))
S1 = F1 & F2 & F3
T = S1
"""
_DRILL = ((-0.2, 0.0), 0.15)  # exercise 11.3: where the hole is, and its radius


def plate_picture(resolution: int = 240) -> Bool[Tensor, "r r"]:
    """Exercise 11.1: the picture to match, [row, column] of x and y from -0.6 to 0.6, row 0 above.

    A plate 1 wide and 0.6 high around the origin; a hole of radius 0.15 at (-0.25, 0); a slot 0.4 x 0.1 at (0.2, 0).
    """
    return execute(parse(_PLATE), [[-0.6, -0.6], [0.6, 0.6]]).image(resolution)


def four() -> tuple[Square, Square, Square, Square]:
    """Exercise 11.2: A, B, C, D, strips that cross: each of the 16 combinations has its own place in the plane."""
    return (
        Square((0.125, 0.5), (-0.125, 0.0)),
        Square((0.125, 0.5), (0.0, 0.0)),
        Square((0.5, 0.125), (0.0, -0.125)),
        Square((0.5, 0.125), (0.0, 0.0)),
    )


def washer() -> Stump:
    """Exercise 11.5: a disc with a hole, whose OpenSCAD file is to be edited."""
    disc, drill = Cylinder(0.4, 0.1), Cylinder(0.12)
    return Stump((disc, drill), [0, 1], [[1], [1]], [1])


def check_plate(answer: object) -> str:
    """Exercise 11.1: a stump, as a text, whose shape is that of `plate_picture`."""
    stump = _stump(answer, 2)
    if isinstance(stump, str):
        return stump
    window = [[-0.6, -0.6], [0.6, 0.6]]
    points = _random(window)
    got, wanted = execute(stump).occupancy(points), execute(parse(_PLATE)).occupancy(points)
    verdict = _compared(got, wanted, points, SLIPS)
    return _within(stump, window) if verdict == OK else verdict


def check_matrices(answer: object, most: int = 2) -> str:
    """Exercise 11.2: W_C, W_I, W_U for A, B, C, D, which say (A + B) * (C - D) with at most so many nodes."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, list | tuple) or len(answer) != 3:
        return hint("the answer is three matrices: (complement, intersection, union)")
    try:
        stump = Stump(four(), *answer)
    except Exception as error:  # whatever is wrong with a reader's matrices, it becomes a hint
        return hint(str(error)[:200])
    rows = torch.tensor([[bit >> k & 1 for bit in range(16)] for k in range(4)], dtype=torch.bool)
    a, b, c, d = rows
    wanted, got = (a | b) & c & ~d, binary(rows, *stump.matrices)[1]
    wrong = (got != wanted).nonzero().flatten().tolist()
    if wrong:
        return hint(_disagreement(rows[:, wrong[0]].tolist(), bool(got[wrong[0]]), len(wrong)))
    used = int(stump.union.sum())
    return OK if used <= most else hint(f"it is the right shape, but unites {used} nodes; {most} will do")


def _disagreement(inside: list[bool], got: bool, count: int) -> str:
    """In words: one of the 16 cases that is wrong."""
    names = [letter for letter, one in zip(LETTERS, inside) if one]
    where = f"inside {', '.join(names)} only" if names else "outside of all four"
    says = ("in the shape", "not in the shape")
    return f"{count} of 16 cases are wrong; a point {where} is {says[not got]} now, it should be {says[got]}"


def check_hole(answer: object) -> str:
    """Exercise 11.3: the plate of BLIND, as a text, with a hole all the way through, of the same place and radius."""
    stump = _stump(answer, 3)
    if isinstance(stump, str):
        return stump
    window = [[-0.6, -0.4, -0.2], [0.6, 0.4, 0.2]]
    points = _random(window)
    inside = execute(stump).occupancy(points)
    block = execute(Stump([Box((0.5, 0.3, 0.1))], [0], [[1]], [1])).occupancy(points)
    (center, radius) = _DRILL
    drilled = block & ((points[:, :2] - points.new_tensor(center)).norm(dim=1) <= radius)
    solid = block & ~drilled
    if _many(solid & ~inside, solid):
        return hint(
            f"{_share(solid & ~inside, solid)} of the plate itself is gone, {_around(points, solid & ~inside)}"
        )
    if _many(inside & ~block, ~block):
        return hint(f"something stands beyond the plate, {_around(points, inside & ~block)}")
    left = inside & drilled
    if not _many(left, drilled):
        verdict = _within(stump, window)
        return _open(stump) if verdict == OK else verdict
    if _share(left, drilled) == "100%":
        return hint("the plate has no hole: what does W_C do to the cylinder?")
    low, high = _number(points[left, 2].min()), _number(points[left, 2].max())
    return hint(f"{_share(left, drilled)} of the hole is still filled, z from {low} to {high}")


def _open(stump: Stump) -> str:
    """ "ok" if no skin, however thin, is left in the hole: told along lines through it."""
    (x, y), radius = _DRILL
    depths = 0.1 - torch.cat([torch.logspace(-9, -4, 50).double(), torch.arange(1e-4, 0.1, 5e-5).double()])
    turns = torch.linspace(0, 2 * torch.pi, 9, dtype=torch.float64)
    across = [
        torch.stack([x + r * turns.cos(), y + r * turns.sin()], 1) for r in (0, radius / 2, 0.9 * radius)
    ]
    across = torch.cat(across)
    lines = torch.cat([depths, -depths])
    points = torch.cat([across.repeat_interleave(len(lines), 0), lines.repeat(len(across))[:, None]], 1)
    closed = execute(stump).occupancy(points)
    return hint(f"a thin skin closes the hole, {_around(points, closed)}") if closed.any() else OK


def check_sharpness(answer: object, stump: Stump, points: Float[Tensor, "m d"]) -> str:
    """Exercise 11.4: a sharpness near the smallest for which the mean of |soft - hard| at the points is SOFT_ERROR."""
    if answer is None:
        return UNANSWERED
    try:
        sharpness = float(answer)
    except Exception:
        return hint(f"the answer is a number, this is of type {type(answer).__name__}")
    if not 0 < sharpness < float("inf"):
        return hint("the answer is a number above 0")
    if not len(points):
        return hint("there are no points, so there is no error either")
    error = soft_error(stump, points, sharpness)
    if not error <= SOFT_ERROR:
        return hint(f"the mean error is {error:.4f}, more than {SOFT_ERROR:g}: is it sharp enough?")
    if soft_error(stump, points, sharpness / NEAR) <= SOFT_ERROR:
        return hint(f"the mean error is {error:.4f}, but a smaller sharpness will do, too")
    return OK


def soft_error(stump: Stump, points: Float[Tensor, "m d"], sharpness: float) -> float:
    """The mean of |soft - hard| over points. It falls as the sharpness grows."""
    shape = execute(stump)
    return float(
        (shape.soft_occupancy(points, sharpness).detach() - shape.occupancy(points).double()).abs().mean()
    )


def check_openscad(answer: object) -> str:
    """Exercise 11.5: the OpenSCAD file of `washer`, its hole twice as wide and nothing else changed."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, str):
        return hint(f"the answer is the text of an OpenSCAD file, this is of type {type(answer).__name__}")
    try:
        stump = read(answer)
    except ScadError as error:
        return hint(str(error)[:300])
    if not isinstance(stump, Stump) or stump.dimensions != 3:
        return hint("this file holds no stump of space; edit that of the washer")
    if stump == washer():
        return hint("this file still says the washer as it was: change a number in its parameters")
    points = _random([[-0.6, -0.6, -0.1], [0.6, 0.6, 0.1]])
    disc, drill = washer().primitives
    wide = Stump((disc, Cylinder(2 * drill.radius)), *washer().matrices)
    verdict = _compared(execute(stump).occupancy(points), execute(wide).occupancy(points), points, 0.0)
    if verdict == OK and not _same(stump, wide):
        return hint("the shape is nearly right, but something else is changed: edit nothing but one number")
    return verdict


def _same(one: Stump, other: Stump) -> bool:
    """Whether two stumps are written alike, but for the rounding of their numbers."""
    if list(map(type, one.primitives)) != list(map(type, other.primitives)):
        return False
    a, b = one.parameters().detach(), other.parameters().detach()
    if a.shape != b.shape or not torch.allclose(a, b, rtol=0, atol=1e-9):
        return False
    return all(torch.equal(*pair) for pair in zip(one.matrices, other.matrices))


def _stump(answer: object, dimensions: int) -> Stump | str:
    """The stump of an answer, or what to tell the reader."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, str | Stump):
        return hint(f"the answer is a stump as a text, this is of type {type(answer).__name__}")
    try:
        stump = answer if isinstance(answer, Stump) else parse(answer)
    except ProgramError as error:
        return hint(str(error)[:300])
    if stump.dimensions != dimensions:
        found, wanted = ("the plane", "space") if dimensions == 3 else ("space", "the plane")
        return hint(f"this is a stump of {found}; write one of {wanted}")
    return stump


def _random(window: list) -> Float[Tensor, "m d"]:
    """Points in a window: none lies on anybody's surface, so both answers of a surface are right."""
    low, high = torch.tensor(window, dtype=torch.float64)
    generator = torch.Generator().manual_seed(11)
    return low + (high - low) * torch.rand(POINTS, len(low), dtype=torch.float64, generator=generator)


def _compared(got: Bool[Tensor, " m"], wanted: Bool[Tensor, " m"], points: Tensor, slips: float) -> str:
    """ "ok" if so few points differ, else how many do, and where."""
    missing, extra = wanted & ~got, got & ~wanted
    differ = int((missing | extra).sum())
    if differ <= slips * len(points):
        return OK
    parts = [
        f"{int(some.sum()):,} {what}, {_around(points, some)}"
        for some, what in ((missing, "are missing"), (extra, "are too many"))
        if some.any()
    ]
    return hint(f"{differ:,} of {len(points):,} points differ: {'; '.join(parts)}")


def _within(stump: Stump, window: list) -> str:
    """ "ok" if the shape, as far as its primitives reach, stays in a window; told exactly, from its edge."""
    shape = execute(stump)
    edge = np.concatenate(shape.outline()) if stump.dimensions == 2 else shape.mesh().vertices
    edge = torch.tensor(edge, dtype=torch.float64)
    low, high = torch.tensor(window, dtype=torch.float64)
    out = ((edge < low) | (edge > high)).any(1)
    return hint(f"something stands far from the plate, {_around(edge, out)}") if out.any() else OK


def _around(points: Tensor, some: Bool[Tensor, " m"]) -> str:
    """Where these points are: the one of them that is nearest to their middle."""
    middle = points[some].median(0).values
    place = points[some][(points[some] - middle).norm(dim=1).argmin()]
    return f"around ({', '.join(map(_number, place))})"


def _number(value: Tensor) -> str:
    """Two decimals, and no minus before a zero."""
    return f"{round(float(value), 2) + 0.0:.2f}"


def _many(some: Bool[Tensor, " m"], of: Bool[Tensor, " m"]) -> bool:
    return bool(some.sum() > SLIPS * of.sum())


def _share(some: Bool[Tensor, " m"], of: Bool[Tensor, " m"]) -> str:
    return f"{float(some.sum() / of.sum()):.0%}"
