"""Distances between point clouds."""

import torch
from jaxtyping import Float
from torch import Tensor


def chamfer_distance(
    a: Float[Tensor, "*batch n 3"], b: Float[Tensor, "*batch m 3"]
) -> Float[Tensor, "*batch"]:
    """Sum of the two mean distances from each point to its nearest neighbour in the other cloud, world units.

    Euclidean, not squared; differentiable in both clouds; leading dimensions are a batch. With about 1,000 points
    this is the distance of the ShapeAssembly paper's Table 4. Raises ValueError for a cloud without points.
    """
    if not a.shape[-2] or not b.shape[-2]:
        raise ValueError(f"both clouds need points, got {a.shape[-2]} and {b.shape[-2]}")
    return _to_nearest(a, b) + _to_nearest(b, a)


def _to_nearest(a: Tensor, b: Tensor) -> Tensor:
    with torch.no_grad():  # who is nearest is a constant; only the distance to it has a gradient
        nearest = torch.cdist(a, b).argmin(-1)
    partner = b.gather(-2, nearest.unsqueeze(-1).expand(*nearest.shape, 3))
    return torch.linalg.vector_norm(a - partner, dim=-1).mean(-1)
