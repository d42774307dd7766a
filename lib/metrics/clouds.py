"""Surface points of many shapes at once: what the metrics that compare point clouds begin with."""

from collections.abc import Sequence

import torch
from jaxtyping import Float, Int
from torch import Tensor

from ..interpreters.cuboids import Cuboids, concatenate
from ..interpreters.shapeassembly import Shape, Shapes

SEEDS_APART = 1_000_000  # sets drawn with different seeds share no random numbers, up to so many shapes
AT_ONCE = 256  # shapes: bounds the memory (some 40 MB for 1,024 points)


def surface_points_many(
    shapes: Shapes | Sequence[Shape], n: int, seed: int = 0
) -> Float[Tensor, "shapes n 3"]:
    """n points on the faces of the leaves of every shape, uniform by area, world units; faces inside leaves count.

    Shape i gets the points of `shapes[i].surface_points(n, seed * SEEDS_APART + i)`, whatever stands beside it. Two
    sets that are to be compared want different seeds: with the same one, equal shapes at the same place get equal
    points, and a distance of 0. Without gradient. Raises ValueError for a shape without finite boxes of some area.
    """
    cuboids, count = _leaves(shapes if len(shapes) else [])
    _check(cuboids, count, n)
    stops = torch.tensor([0, *count]).cumsum(0)
    parts = [
        _points(cuboids, stops[first : first + AT_ONCE + 1], n, seed * SEEDS_APART + first)
        for first in range(0, len(count), AT_ONCE)
    ]
    return torch.cat(parts) if parts else cuboids.size.new_zeros(0, n, 3)


def _leaves(shapes: Shapes | Sequence[Shape]) -> tuple[Cuboids, list[int]]:
    """The leaves of all shapes one after the other, and how many each has."""
    if isinstance(shapes, Shapes):
        return shapes.cuboids.detach(), shapes.count
    cuboids = [shape.cuboids.detach() for shape in shapes]
    nothing = Cuboids(torch.zeros(0, 3), torch.zeros(0, 3), torch.zeros(0, 3, 3))
    return (concatenate(cuboids) if cuboids else nothing), [len(boxes) for boxes in cuboids]


def _points(
    cuboids: Cuboids, stops: Int[Tensor, " shapes_and_one"], n: int, seed: int
) -> Float[Tensor, "shapes n 3"]:
    """Points of the shapes whose boxes lie between consecutive stops."""
    start, count = stops[:-1], stops.diff()
    boxes = cuboids[int(start[0]) : int(stops[-1])]
    cumulative = _cumulative_areas(boxes, count)
    which, where = _uniform(len(count), n, seed)
    face = torch.searchsorted(cumulative, which * cumulative[:, -1:], right=True)
    face = torch.minimum(face, 6 * count.unsqueeze(1) - 1)
    axis, side = (face % 6) // 2, face % 2
    where.scatter_(-1, axis.unsqueeze(-1), side.unsqueeze(-1).double())
    box = (start - start[0]).unsqueeze(1) + face // 6
    return boxes[box].world(where.to(boxes.size))


def _cumulative_areas(boxes: Cuboids, count: Int[Tensor, " shapes"]) -> Float[Tensor, "shapes faces"]:
    """Running sums of the areas of left, right, bottom, top, back, front of each box; then the whole sum again."""
    length, height, width = boxes.size.abs().cpu().unbind(-1)
    area = torch.stack([height * width, length * width, length * height], -1).repeat_interleave(2, -1)
    filled = torch.arange(int(count.max())) < count.unsqueeze(1)  # (shapes, most boxes)
    padded = torch.zeros(*filled.shape, 6, dtype=torch.float64)
    padded[filled] = area.double()
    return padded.flatten(1).cumsum(1)


def _uniform(shapes: int, n: int, seed: int) -> tuple[Float[Tensor, "shapes n"], Float[Tensor, "shapes n 3"]]:
    """Numbers in [0, 1), from a generator of its own for each shape."""
    which = torch.empty(shapes, n, dtype=torch.float64)
    where = torch.empty(shapes, n, 3, dtype=torch.float64)
    generator = torch.Generator()
    for shape in range(shapes):
        generator.manual_seed(seed + shape)
        torch.rand(n, dtype=torch.float64, generator=generator, out=which[shape])
        torch.rand(n, 3, dtype=torch.float64, generator=generator, out=where[shape])
    return which, where


def _check(cuboids: Cuboids, count: list[int], n: int) -> None:
    if n < 1:
        raise ValueError(f"found {n} points a shape; expected at least 1")
    finite = torch.stack(
        [x.flatten(1).isfinite().all(1) for x in (cuboids.size, cuboids.center, cuboids.axes)]
    )
    flat = (cuboids.size != 0).sum(-1) < 2  # no face of it has an area
    for shape, usable in enumerate((~flat).split(count)):
        if not usable.any():
            raise ValueError(f"shape {shape} has no surface: {len(usable)} boxes, none with an area")
    for shape, fine in enumerate(finite.all(0).split(count)):
        if not fine.all():
            raise ValueError(f"shape {shape} has boxes whose numbers are not finite; see `valid` of Shapes")
