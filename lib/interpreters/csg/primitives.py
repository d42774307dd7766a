"""The six primitives: what their numbers mean, and which pixels or voxels they switch on.

    in the plane   c(x,y,r) circle       s(x,y,r) square      t(x,y,r) triangle, its apex up
    in space       sp(x,y,z,r) sphere    cu(x,y,z,s) cube     cy(x,y,z,r,h) cylinder along z

x, y, z is the center, r the radius (of the circumscribed circle for square and triangle), s and h a cube's side and a
cylinder's height, all whole numbers of pixels. A picture is image[y, x] with y growing DOWN, a grid is grid[x, y, z];
pixel k has its center at the coordinate k. What lies outside the 64 pixels of the canvas is cut off.

Every primitive meets every line of the canvas in one run of pixels, first..last, and that is how it is drawn. The rules
are those of the CSGNet authors' renderer to the pixel (Sharma et al. 2018, section 4.1 and its program), its constants
1.412 and 1.732 and its rounding towards zero included, because networks are compared on these pixels. One difference:
at r = 41 their floating-point test adds eight pixels on the circle's rim, which lie exactly r from the center.
"""

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Real

import torch
from jaxtyping import Int
from torch import Tensor

from ..quoting import quoted
from ..threads import one_thread
from .errors import ProgramError
from .packing import SIDE, pack_runs

LARGEST = 64  # pixels: radii, sides and heights go from 1 to this
CENTER = "xyz"  # fields that are a place on the canvas; the others are sizes
_AT_ONCE = 64  # primitives drawn in one step: enough for speed, little enough for memory

Runs = tuple[Int[Tensor, "n lines"], Int[Tensor, "n lines"]]  # first and last pixel; first > last: none


def _half_chord(square: Tensor) -> Tensor:
    """The largest whole k with k * k <= square, or -1 where there is none."""
    return torch.where(square < 0, -1, square.clamp(min=0).double().sqrt().floor().long())


def _circle(numbers: Int[Tensor, "n 3"]) -> Runs:
    x, y, r = numbers.unsqueeze(-1).unbind(1)
    rows = torch.arange(SIDE, device=numbers.device)
    half = _half_chord(r * r - 1 - (rows - y) ** 2)  # strictly inside: dx^2 + dy^2 < r^2
    return x - half, x + half


def square_corners(numbers: Int[Tensor, "*n 3"]) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """First and last column, first and last row of each square, as whole numbers."""
    x, y, r = numbers.unbind(-1)
    half = 1.412 * r.double() / 2
    return tuple(corner.trunc().long() for corner in (x - half, x + half, y - half, y + half))


def _square(numbers: Int[Tensor, "n 3"]) -> Runs:
    left, right, top, bottom = (corner.unsqueeze(-1) for corner in square_corners(numbers))
    rows = torch.arange(SIDE, device=numbers.device)
    return _where((top <= rows) & (rows <= bottom), left, right)


def triangle_corners(numbers: Int[Tensor, "*n 3"]) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Apex row, base row, leftmost and rightmost column of each triangle, as whole numbers."""
    x, y, r = numbers.unbind(-1)
    side = 1.732 * r.double()
    corners = (y - side / 1.732, y + side / (2 * 1.732), x - side / 2, x + side / 2)
    return tuple(corner.trunc().long() for corner in corners)


def _triangle(numbers: Int[Tensor, "n 3"]) -> Runs:
    x = numbers[:, :1]
    apex, base, left, right = (corner.unsqueeze(-1) for corner in triangle_corners(numbers))
    rows = torch.arange(SIDE, device=numbers.device)
    height = base - apex
    # Both slanted edges are lines of pixels, the left one drawn down from the apex, the right one up from the base.
    first = x - (2 * (x - left) * (rows - apex) + height) // (2 * height)
    last = right - (2 * (right - x) * (base - rows) + height) // (2 * height)
    return _where((apex <= rows) & (rows <= base), first, last)


def _sphere(numbers: Int[Tensor, "n 4"]) -> Runs:
    z, r = numbers[:, 2:].unsqueeze(-1).unbind(1)
    half = _half_chord((r - 1) ** 2 - _from_axis(numbers))
    return z - half, z + half


def _cube(numbers: Int[Tensor, "n 4"]) -> Runs:
    x, y, z, s = numbers.unsqueeze(-1).unbind(1)
    half = (s - 1) // 2
    lines = torch.arange(SIDE, device=numbers.device)
    inside = ((lines - x).abs() <= half).unsqueeze(2) & ((lines - y).abs() <= half).unsqueeze(1)
    return _where(inside.flatten(1), z - half, z + half)


def _cylinder(numbers: Int[Tensor, "n 5"]) -> Runs:
    z, r, h = numbers[:, 2:].unsqueeze(-1).unbind(1)
    half = (h - 1) // 2
    return _where(_from_axis(numbers) <= (r - 1) ** 2, z - half, z + half)


def _from_axis(numbers: Tensor) -> Int[Tensor, "n lines"]:
    """Squared distance of each column (x, y) from the vertical through the center."""
    lines = torch.arange(SIDE, device=numbers.device)
    x, y = ((lines - numbers[:, k : k + 1]) ** 2 for k in (0, 1))
    return (x.unsqueeze(2) + y.unsqueeze(1)).flatten(1)


def _where(inside: Tensor, first: Tensor, last: Tensor) -> Runs:
    return torch.where(inside, first, SIDE), torch.where(inside, last, -1)


@dataclass(frozen=True)
class Kind:
    """A kind of primitive: its letters in a program, its name, what its numbers are called, and how it is drawn."""

    letters: str
    name: str
    fields: tuple[str, ...]
    runs: Callable[[Tensor], Runs]

    @property
    def dimensions(self) -> int:
        return 3 if "z" in self.fields else 2

    def __str__(self) -> str:
        return f"{self.letters}({','.join(self.fields)})"


KINDS = {
    kind.letters: kind
    for kind in (
        Kind("c", "circle", ("x", "y", "r"), _circle),
        Kind("s", "square", ("x", "y", "r"), _square),
        Kind("t", "triangle", ("x", "y", "r"), _triangle),
        Kind("sp", "sphere", ("x", "y", "z", "r"), _sphere),
        Kind("cu", "cube", ("x", "y", "z", "s"), _cube),
        Kind("cy", "cylinder", ("x", "y", "z", "r", "h"), _cylinder),
    )
}


def _whole(field: str, number, text: str) -> int:
    """The number as an int. Raises ProgramError for what is not whole, or off the canvas."""
    low, high = (0, SIDE - 1) if field in CENTER else (1, LARGEST)
    try:
        value = operator.index(number)
    except TypeError:
        found = f"{field} is {quoted(str(number))} in {quoted(text)}"
        raise ProgramError(found, None, text, "a whole number") from None
    if low <= value <= high:
        return value
    where = "off the canvas, " if field in CENTER else ""
    found = f"{field} is {quoted(str(value))}, {where}in {quoted(text)}"
    raise ProgramError(found, None, text, f"{field} from {low} to {high}")


@dataclass(frozen=True)
class Primitive:
    """One primitive, such as Primitive("c", (32, 32, 16)). Raises ProgramError for numbers that are off the canvas."""

    kind: str
    numbers: tuple[Real, ...]  # whole ones; any others raise ProgramError

    def __post_init__(self):
        text = str(self)
        if self.kind not in KINDS:
            raise ProgramError(f"{quoted(text)} is no primitive", None, text, " ".join(KINDS))
        kind = KINDS[self.kind]
        if len(self.numbers) != len(kind.fields):
            found = f"{quoted(text)} has {len(self.numbers)} number{'s' * (len(self.numbers) != 1)}"
            raise ProgramError(found, None, text, f"{len(kind.fields)}: {kind}")
        whole = tuple(_whole(field, number, text) for field, number in zip(kind.fields, self.numbers))
        object.__setattr__(self, "numbers", whole)  # numpy's whole numbers become Python's

    @property
    def dimensions(self) -> int:
        return KINDS[self.kind].dimensions

    def __str__(self) -> str:
        return f"{self.kind}({','.join(map(str, self.numbers))})"


@one_thread()
def draw(
    primitives: Sequence[Primitive], dimensions: int, device: torch.device | str = "cpu"
) -> Int[Tensor, "n lines"]:
    """The canvases of primitives of one dimension: 64 words each in the plane, 4,096 in space."""
    words = torch.empty((len(primitives), SIDE ** (dimensions - 1)), dtype=torch.int64, device=device)
    for letters in KINDS:
        rows = [i for i, primitive in enumerate(primitives) if primitive.kind == letters]
        if rows:
            numbers = torch.tensor([primitives[i].numbers for i in rows], device=device)
            words[torch.tensor(rows, device=device)] = draw_numbers(letters, numbers)
    return words


def draw_numbers(letters: str, numbers: Int[Tensor, "n fields"]) -> Int[Tensor, "n lines"]:
    """The canvases of primitives of one kind, whose numbers are trusted to be in range."""
    runs = KINDS[letters].runs
    return torch.cat([pack_runs(*runs(some)) for some in numbers.split(_AT_ONCE)])
