"""Aligned cuboids: grow as little as needed until the two boxes meet (paper, Appendix A, "Aligned Cuboids").

The points named in the attach are ignored. Both boxes are sampled on a 10 x 10 x 10 grid; the closest pair of
samples tells which way to grow.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..cuboids import Cuboids

GRID = 10  # samples along each side, both ends included
MEETING = 0.05  # boxes nearer than this share of the longest side of the two count as touching
_CHUNK = 128  # rows searched at a time: bounds the memory


def grow(cuboid: Cuboids, still: Cuboids) -> Cuboids:
    """Grow `cuboid` towards `still` where no corner of one lies in the other and the gap is not small.

    The sample of `cuboid` nearest to `still` moves onto its partner; the antipodal point stays where it was.
    Orientation never changes. Quirk: for a sample inside a face, the step across that face is amplified (up to 9
    times), so growth is not minimal.
    """
    apart = ~(_corner_inside(cuboid, still) | _corner_inside(still, cuboid))
    rows = apart.nonzero().squeeze(-1)
    rows = rows[~_meeting(cuboid[rows].detach(), still[rows].detach())]
    if not len(rows):
        return cuboid
    grown = _grow_apart(cuboid[rows], still[rows])
    return Cuboids(
        cuboid.size.index_put((rows,), grown.size),
        cuboid.center.index_put((rows,), grown.center),
        cuboid.axes,
    )


def _corner_inside(a: Cuboids, b: Cuboids) -> Bool[Tensor, " rows"]:
    q = b.detach().local_many(a.detach().corners())
    return ((q >= 0) & (q <= 1)).all(-1).any(-1)


def _meeting(a: Cuboids, b: Cuboids) -> Bool[Tensor, " rows"]:
    """True where a few steps to and fro find samples near enough to count as touching.

    Spares most pairs the search over all samples; where it says False, that search decides.
    """
    goal = b.center
    for _ in range(4):
        near = _nearest_sample(a, goal)
        goal = _nearest_sample(b, near)
    return (near - goal).norm(dim=-1) < MEETING * _longest_side(a, b)


def _nearest_sample(box: Cuboids, point: Float[Tensor, "rows 3"]) -> Float[Tensor, "rows 3"]:
    return box.world((box.local(point).clamp(0, 1) * (GRID - 1)).round() / (GRID - 1))


def _longest_side(a: Cuboids, b: Cuboids) -> Float[Tensor, " rows"]:
    return torch.maximum(a.size, b.size).amax(-1)


def _grow_apart(cuboid: Cuboids, still: Cuboids) -> Cuboids:
    near, goal = closest_samples(cuboid.detach(), still.detach())
    far = ((near - goal).norm(dim=-1) >= MEETING * _longest_side(cuboid, still)).unsqueeze(-1)
    q = cuboid.local(near).clamp(0, 1)
    opposite = cuboid.world(1 - q)
    lever = (q - 0.5) * torch.diagonal(cuboid.axes, dim1=-2, dim2=-1)
    step = (goal - near) / (2 * torch.where(lever == 0, torch.inf, lever))
    size = cuboid.size + torch.where(far & (step > 0), step, 0.0)
    grown = Cuboids(size, cuboid.center, cuboid.axes)
    return Cuboids(
        size, torch.where(far, grown.center + opposite - grown.world(1 - q), cuboid.center), cuboid.axes
    )


def closest_samples(a: Cuboids, b: Cuboids) -> tuple[Float[Tensor, "rows 3"], Float[Tensor, "rows 3"]]:
    """The closest pair of grid samples of each two boxes; the first in order x, y, z (x fastest) of equals.

    Every sample of `a` needs to look only at the eight samples of `b` around it. (The data set's own search compares
    float32 distances, so rounding decides between equals there; a handful of its programs hang on that.)
    """
    grid = _grid(a.size)
    found = [_closest_chunk(a[i : i + _CHUNK], b[i : i + _CHUNK], grid) for i in range(0, len(a), _CHUNK)]
    near, goal = zip(*found)
    return torch.cat(near), torch.cat(goal)


def _closest_chunk(a: Cuboids, b: Cuboids, grid: Float[Tensor, "samples 3"]):
    samples = a.world_many(grid.expand(len(a), -1, -1))  # (rows, 1000, 3)
    lowest = (b.local_many(samples) * (GRID - 1)).floor().clamp(0, GRID - 2)
    around = (lowest.unsqueeze(-2) + _NEXT.to(lowest)) / (GRID - 1)  # (rows, 1000, 8, 3) local to b
    partners = b.world_many(around.flatten(1, 2)).unflatten(1, (-1, 8))
    distance = (samples.unsqueeze(-2) - partners).square().sum(-1)  # (rows, 1000, 8)
    shortest, which = distance.min(-1)
    first = shortest.argmin(-1)  # the first of equals
    row = torch.arange(len(a), device=first.device)
    return samples[row, first], partners[row, first, which[row, first]]


_NEXT = torch.tensor([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])


def _grid(like: Tensor) -> Float[Tensor, "samples 3"]:
    steps = torch.arange(GRID, dtype=like.dtype, device=like.device) / (GRID - 1)
    z, y, x = torch.meshgrid(steps, steps, steps, indexing="ij")
    return torch.stack([x, y, z], -1).reshape(-1, 3)
