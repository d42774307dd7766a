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
    _check_points(a, b)
    return _to_nearest(a, b) + _to_nearest(b, a)


def squared_chamfer_distance(
    a: Float[Tensor, "*batch n 3"], b: Float[Tensor, "*batch m 3"]
) -> Float[Tensor, "*batch"]:
    """L2 Chamfer distance, squared world units: the mean of the two mean squared distances to the nearest neighbour.

    CSG-Stump Net's program prints this one, times 1000, for 2,048 points on shapes of diagonal 1; UCSG-Net's the sum
    of the two, twice as much. Raises ValueError for a cloud without points.
    """
    _check_points(a, b)
    return (_to_nearest(a, b, 2) + _to_nearest(b, a, 2)) / 2


def _check_points(a: Tensor, b: Tensor) -> None:
    if not a.shape[-2] or not b.shape[-2]:
        raise ValueError(f"both clouds need points, got {a.shape[-2]} and {b.shape[-2]}")


def _to_nearest(a: Tensor, b: Tensor, power: int = 1) -> Tensor:
    with torch.no_grad():  # who is nearest is a constant; only the distance to it has a gradient
        nearest = torch.cdist(a, b).argmin(-1)
    partner = b.gather(-2, nearest.unsqueeze(-1).expand(*nearest.shape, 3))
    return (torch.linalg.vector_norm(a - partner, dim=-1) ** power).mean(-1)
