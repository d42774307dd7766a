"""The exact shapes behind the pixels: which points a primitive and a program contain.

A pixel or voxel is the sample at its whole-numbered center k, and stands for the cell from k - 1/2 to k + 1/2. A
primitive's exact form is a simple continuous one that has all centers of its ON pixels inside, and no other centers:

    circle    nearer than r to its center
    square    what its ON pixels cover: its drawn edges, half a pixel farther out
    triangle  what its ON rows cover, between its two slanted edges, half a pixel farther out; so its apex is blunt
    sphere    not farther than r - 1 from its center       cylinder  not farther than r - 1 from its axis, flat ends
    cube      what its ON voxels cover                               half a voxel beyond the last ON voxels

(A sphere or cylinder with r = 1 has one ON voxel across; its radius is 1/2 rather than 0, so that it has an inside.)
The canvas does not cut the exact shape, it is a window onto it. Operations act on every point by itself. So a point at
the center of a pixel is inside exactly when the pixel is ON, and this holds to the last pixel.
"""

import operator
from collections.abc import Callable
from typing import TypeVar

import torch
from jaxtyping import Bool
from torch import Tensor

from ..checks import check_points, check_resolution
from .packing import SIDE
from .primitives import Primitive, square_corners, triangle_corners
from .program import Program

_AT_ONCE = 1 << 17  # points tested in one step: their coordinates stay in the cache

Result = TypeVar("Result")


def fold(
    program: Program,
    leaf: Callable[[Primitive], Result],
    operations: dict[str, Callable[[Result, Result], Result]],
) -> Result:
    """What the program makes where `leaf` makes the primitives, and `operations` has a function for each of + * -."""
    stack = []
    for statement in program.statements:
        if isinstance(statement, Primitive):
            stack.append(leaf(statement))
        else:
            right = stack.pop()
            stack.append(operations[statement.symbol](stack.pop(), right))
    return stack[0]


def inside(program: Program, *coordinates: Tensor) -> Bool[Tensor, "..."]:
    """Is each point in the program's shape? x, y and in space z are tensors that broadcast; doubles keep it exact."""
    operations = {"+": operator.or_, "*": operator.and_, "-": lambda a, b: a & ~b}
    return fold(
        program, lambda primitive: _INSIDE[primitive.kind](*primitive.numbers, *coordinates), operations
    )


def occupancy(program: Program, points) -> Bool[Tensor, " n"]:
    """Is each of the points (n, 2) or (n, 3) in the shape? Points that are not finite are not."""
    parts = check_points(points, "xyz"[: program.dimensions]).split(_AT_ONCE)
    return torch.cat([inside(program, *part.double().unbind(1)) for part in parts])


def voxels(program: Program, resolution: int, device: torch.device | str = "cpu") -> Bool[Tensor, "r *rs"]:
    """The shape at the centers of `resolution` cells along each side of the canvas, -1/2 to 63 1/2.

    [row y, column x] in the plane, [x, y, z] in space.
    """
    resolution = check_resolution(resolution)
    centers = (torch.arange(resolution, dtype=torch.float64, device=device) + 0.5) * SIDE / resolution - 0.5
    others = program.dimensions - 1
    filled = torch.empty((resolution,) * program.dimensions, dtype=torch.bool, device=device)
    step = max(1, _AT_ONCE // resolution**others)
    for start in range(0, resolution, step):
        first = centers[start : start + step].view(-1, *[1] * others)
        rest = (centers.view(-1, *[1] * k) for k in reversed(range(others)))
        axes = (first, *rest) if others == 2 else (*rest, first)
        filled[start : start + step] = inside(program, *axes)
    return filled


def square_edges(x: int, y: int, r: int) -> tuple[float, float, float, float]:
    """Left, right, top and bottom edge of a square, between pixels: its area is the number of its pixels."""
    left, right, top, bottom = (int(corner) for corner in square_corners(torch.tensor((x, y, r))))
    return left - 0.5, right + 0.5, top - 0.5, bottom + 0.5


def trapezoid(primitive: Primitive) -> tuple[tuple[float, float], ...]:
    """A square or triangle as (top, bottom), (left edge at the top, at the bottom), (right edge at the top, …).

    In the picture's axes, y down: top < bottom.
    """
    x, _, _ = primitive.numbers
    if primitive.kind == "s":
        left, right, top, bottom = square_edges(*primitive.numbers)
        return (top, bottom), (left, left), (right, right)
    apex, base, left, right = (int(k) for k in triangle_corners(torch.tensor(primitive.numbers)))
    over = 0.5 / (base - apex)  # half a row farther than the drawn edge, as a share of its length
    lefts = x - 0.5 + (x - left) * over, left - 0.5 - (x - left) * over
    rights = x + 0.5 - (right - x) * over, right + 0.5 + (right - x) * over
    return (apex - 0.5, base + 0.5), lefts, rights


def round_radius(r: int) -> float:
    """The radius of a sphere or cylinder."""
    return max(r - 1, 0.5)


def flat_half(s: int) -> float:
    """Half of a cube's side or a cylinder's height."""
    return (s - 1) // 2 + 0.5


def _in_circle(cx, cy, r, x, y):
    return (x - cx) ** 2 + (y - cy) ** 2 < r * r


def _in_square(cx, cy, r, x, y):
    left, right, top, bottom = square_edges(cx, cy, r)
    return (left <= x) & (x <= right) & (top <= y) & (y <= bottom)


def _in_triangle(cx, cy, r, x, y):
    apex, base, left, right = (int(k) for k in triangle_corners(torch.tensor((cx, cy, r))))
    height = base - apex
    # Multiplied by 2 * height, so that whole numbers stay whole: many centers lie on the edges. The drawing's rounding
    # puts those of the left edge inside, and those of the right edge outside.
    in_left = 2 * height * (cx - x) <= 2 * (cx - left) * (y - apex) + height
    in_right = 2 * height * (right - x) > 2 * (right - cx) * (base - y) - height
    return in_left & in_right & (apex - 0.5 <= y) & (y <= base + 0.5)


def _in_sphere(cx, cy, cz, r, x, y, z):
    return (x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2 <= round_radius(r) ** 2


def _in_cube(cx, cy, cz, s, x, y, z):
    half = flat_half(s)
    return ((x - cx).abs() <= half) & ((y - cy).abs() <= half) & ((z - cz).abs() <= half)


def _in_cylinder(cx, cy, cz, r, h, x, y, z):
    return ((x - cx) ** 2 + (y - cy) ** 2 <= round_radius(r) ** 2) & ((z - cz).abs() <= flat_half(h))


_INSIDE = {
    "c": _in_circle,
    "s": _in_square,
    "t": _in_triangle,
    "sp": _in_sphere,
    "cu": _in_cube,
    "cy": _in_cylinder,
}
