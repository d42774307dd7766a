"""Does every part of a shape hang together with the ground? (ShapeAssembly paper, section 7.1 and Appendix E)

Two parts count as connected when they are no farther apart than 2 % of the diagonal of the shape's bounding box. The
ground is the plane at the shape's lowest point. Distances between boxes are exact, not sampled.
"""

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy.sparse.csgraph import connected_components
from torch import Tensor

from ..interpreters.cuboids import Cuboids, cross

CONNECTED = 0.02  # share of the bounding box diagonal

# Corner numbers (order of `Cuboids.corners`) of the two ends of each of the twelve edges.
_EDGES = torch.tensor([[i, j] for i in range(8) for j in range(i + 1, 8) if (i ^ j) in (1, 2, 4)])


def is_rooted(cuboids: Cuboids) -> bool:
    """True if every box is connected, directly or through others, to the ground. No boxes: True."""
    return bool(not len(cuboids) or connected_to_ground(cuboids).all())


def connected_to_ground(cuboids: Cuboids) -> Bool[Tensor, " n"]:
    """For each box: does a chain of connected boxes lead from it to the ground?"""
    cuboids = cuboids.detach()
    low, high = cuboids.bounds()
    reach = CONNECTED * (high - low).norm()
    count = len(cuboids)
    links = torch.zeros(count + 1, count + 1, dtype=torch.bool)  # the last node is the ground
    one, other = torch.triu_indices(count, count, 1)
    near = _gap(cuboids, one, other) <= reach  # spares most pairs the exact distance
    one, other = one[near], other[near]
    links[one, other] = (box_distance(cuboids[one], cuboids[other]) <= reach).cpu()
    links[:count, count] = (cuboids.corners()[..., 1].amin(-1) - low[1] <= reach).cpu()
    _, group = connected_components(links.numpy(), directed=False)
    return torch.from_numpy(np.asarray(group[:count] == group[count]))


def _gap(cuboids: Cuboids, one: Tensor, other: Tensor) -> Float[Tensor, " n"]:
    """How far apart the bounds of two boxes are along x, y or z: never more than their distance."""
    corners = cuboids.corners()
    low, high = corners.amin(1), corners.amax(1)
    return torch.maximum(low[one] - high[other], low[other] - high[one]).amax(-1)


def box_distance(a: Cuboids, b: Cuboids) -> Float[Tensor, " n"]:
    """Exact distance between each two oriented boxes, world units; 0 where they touch or overlap.

    Disjoint boxes are nearest at a corner of one and the other box, or at two edges; a plane that separates them
    (normal to a face of one, or to an edge of each) tells that they are disjoint.
    """
    corner = torch.minimum(_corner_distance(a, b), _corner_distance(b, a))
    return torch.where(_separated(a, b), torch.minimum(corner, _edge_distance(a, b)), 0.0)


def _corner_distance(a: Cuboids, b: Cuboids) -> Float[Tensor, " n"]:
    """From the corners of a to the box b."""
    corners = a.corners()
    nearest = b.world_many(b.local_many(corners).clamp(0, 1))
    return (corners - nearest).norm(dim=-1).amin(-1)


def _edge_distance(a: Cuboids, b: Cuboids) -> Float[Tensor, " n"]:
    """Smallest distance between an edge of a and an edge of b (all 12 x 12 pairs)."""
    ends_a, ends_b = a.corners()[:, _EDGES].unsqueeze(2), b.corners()[:, _EDGES].unsqueeze(1)
    p, u = ends_a[..., 0, :], ends_a[..., 1, :] - ends_a[..., 0, :]
    q, v = ends_b[..., 0, :], ends_b[..., 1, :] - ends_b[..., 0, :]
    w = p - q
    uu, uv, vv, uw, vw = (u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1), (u * w).sum(-1), (v * w).sum(-1)
    determinant = uu * vv - uv * uv
    parallel = determinant < 1e-12 * uu * vv  # then the nearest points include a corner, measured elsewhere
    s = ((uv * vw - vv * uw) / torch.where(parallel, 1.0, determinant)).clamp(0, 1)
    t = ((uv * s + vw) / vv).clamp(0, 1)
    s = ((uv * t - uw) / uu).clamp(0, 1)
    gap = (w + s.unsqueeze(-1) * u - t.unsqueeze(-1) * v).norm(dim=-1)
    return gap.flatten(1).amin(-1)


def _separated(a: Cuboids, b: Cuboids) -> Bool[Tensor, " n"]:
    """Is there a separating plane? The fifteen directions that suffice for two boxes."""
    edges = cross(a.axes.unsqueeze(2), b.axes.unsqueeze(1)).flatten(1, 2)
    directions = torch.cat([a.axes, b.axes, edges], 1).mT  # (n, 3, 15)
    on_a, on_b = a.corners() @ directions, b.corners() @ directions
    apart = torch.maximum(on_a.amin(1) - on_b.amax(1), on_b.amin(1) - on_a.amax(1))
    length = directions.norm(dim=1)  # parallel edges give no direction
    return (apart > 1e-9 * length).logical_and(length > 1e-6).any(-1)
