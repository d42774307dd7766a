"""Programs of the sister languages -> trees of this language's primitives, and so stumps: the same solids.

CSG, in pixels as in its pictures (x right, y down; space: x, y, z): each primitive is its exact form, which
`csg.geometry` describes. A triangle has a blunt apex: a sharp one, cut by a half-plane. Where a form has an edge that
pixel centers can lie on, the edge is moved by EDGE, so that no rounding decides about them: a circle without its rim
is that much smaller, a sphere or cylinder larger, and a triangle, whose left edge belongs to it and whose right edge
does not, stands that much farther left. Every other pixel center is at least 0.005 away from each edge.

ShapeAssembly, in the program's own units: the union of its leaf cuboids. A mirrored box is the same box.

The other way there are no conversions: a stump's primitives have any size, place and turn.
"""

from functools import partial

import torch
from torch import Tensor

from .. import csg, shapeassembly
from ..csg import Operation, Tree
from ..csg.geometry import flat_half, fold, round_radius, trapezoid
from .errors import ProgramError
from .poses import quaternion
from .primitives import Box, Circle, Cylinder, HalfPlane, Primitive, Sphere, Square, Triangle
from .trees import joined

EDGE = 1e-4  # pixels; single precision still tells it apart at the far side of the canvas


def csg_tree(program: csg.Program) -> Tree | Primitive:
    """The program's tree, with this language's primitives. Raises ProgramError for what is no CSG program."""
    if not isinstance(program, csg.Program):
        raise ProgramError(f"found a {type(program).__name__}", expected="a csg.Program, see csg.parse(text)")
    return fold(program, _exact, {symbol: partial(Tree, Operation(symbol)) for symbol in csg.OPERATIONS})


def shapeassembly_tree(program: shapeassembly.Program) -> Tree | Primitive:
    """The union of the program's leaf cuboids. Raises ProgramError for what is no ShapeAssembly program, and for one
    without cuboids."""
    if not isinstance(program, shapeassembly.Program):
        expected = "a shapeassembly.Program, see shapeassembly.parse(text)"
        raise ProgramError(f"found a {type(program).__name__}", expected=expected)
    cuboids = shapeassembly.execute(program).cuboids.detach()
    boxes = [_box(*numbers) for numbers in zip(cuboids.size, cuboids.center, cuboids.axes)]
    if not boxes:
        raise ProgramError("the shape has no cuboids", expected="at least one Cuboid besides the bbox")
    return joined("+", boxes)


def _exact(primitive: csg.Primitive) -> Tree | Primitive:
    """The exact form of one CSG primitive."""
    kind, center, sizes = primitive.kind, *_split(primitive)
    if kind == "c":
        return Circle(sizes[0] - EDGE, center)
    if kind == "sp":
        return Sphere(round_radius(*sizes) + EDGE, center)
    if kind == "cu":
        return Box([flat_half(*sizes)] * 3, center)
    if kind == "cy":
        radius, height = sizes
        return Cylinder(round_radius(radius) + EDGE, 2 * flat_half(height), center)
    return _trapezoid(*trapezoid(primitive), moved=EDGE if kind == "t" else 0.0)


def _split(primitive: csg.Primitive) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Center and sizes."""
    return primitive.numbers[: primitive.dimensions], primitive.numbers[primitive.dimensions :]


def _trapezoid(rows: tuple, lefts: tuple, rights: tuple, moved: float) -> Tree | Primitive:
    """A square or a triangle with a blunt apex, from its rows and its edges at the top and at the bottom, y down."""
    (top, bottom), (left, right) = rows, (lefts[1] - moved, rights[1] - moved)
    narrow, wide = rights[0] - lefts[0], right - left
    if narrow == wide:
        return Square(((right - left) / 2, (bottom - top) / 2), ((left + right) / 2, (top + bottom) / 2))
    height = (bottom - top) * wide / (wide - narrow)  # of the sharp triangle
    apex = left + (lefts[0] - lefts[1]) * height / (bottom - top)
    half_turn = torch.pi  # y is down here, and an unturned triangle points to +y
    sharp = Triangle(right - apex, apex - left, height, (apex, bottom), half_turn)
    return Tree(Operation("*"), sharp, HalfPlane((apex, top), half_turn))


def _box(size: Tensor, center: Tensor, axes: Tensor) -> Box:
    """One cuboid. Its axes, the rows, are at right angles but may have another length than 1, and any handedness."""
    lengths = torch.linalg.vector_norm(axes, dim=1)
    turn = torch.where(lengths > 0, axes.T / lengths, torch.eye(3).to(axes)).T
    if torch.linalg.det(turn) < 0:
        turn = -turn
    return Box((size * lengths).abs() / 2, center, quaternion(turn))
