"""From a decided field to a surface and points on it: for all networks that read clouds, and their rivals, alike.

The field is sampled at cell centres of the cloud's own box and of two cells around it, and marched at 0. Beyond the box
there is nothing, as in the authors' program: primitives without an end are closed there.
"""

import math
from collections.abc import Callable

import numpy as np
import torch
import trimesh
from jaxtyping import Float
from skimage import measure
from torch import Tensor, nn

CELL = 1 / 64  # of the diagonal
AT_ONCE = 8192  # samples
AROUND = 2  # cells around the box; the outermost are outside
MOST = 1 << 25  # samples

Field = Callable[[Float[Tensor, "m 3"]], Float[Tensor, " m"]]


@torch.no_grad()
def reconstructed(network: nn.Module, cloud: Float[Tensor, "n 3"], cell: float = CELL) -> trimesh.Trimesh:
    """The solid that a network says of a cloud (diagonal 1, around the origin), decided; perhaps empty."""
    said = network(cloud.unsqueeze(0))
    return surface(lambda points: said.signed(said.distances(points.unsqueeze(0)))[0], cloud, cell)


@torch.no_grad()
def surface(field: Field, cloud: Float[Tensor, "n 3"], cell: float = CELL) -> trimesh.Trimesh:
    """A closed surface where the field, negative inside, is 0, within the cloud's box; perhaps empty.

    Raises ValueError for a cloud without points, or whose box has no sensible number of cells, and where the field is
    no number.
    """
    if not len(cloud):
        raise ValueError("found a cloud without points; expected 1 or more")
    low, high = cloud.amin(0), cloud.amax(0)
    sides = (high - low).tolist()
    if not (0 < cell < math.inf and math.prod(side / cell + 2 * AROUND for side in sides) <= MOST):
        raise ValueError(f"found a box of {sides} and cells of {cell}; expected at most {MOST} cells")
    counts = ((high - low) / cell).ceil().long() + 2 * AROUND
    first = (low + high) / 2 - (counts - 1) * cell / 2
    axes = [start + cell * torch.arange(count).to(start) for start, count in zip(first, counts.tolist())]
    points = torch.cartesian_prod(*axes)
    values = torch.cat([field(part) for part in points.split(AT_ONCE)])
    if values.isnan().any():
        raise ValueError("found a field that is no number somewhere; expected numbers, negative inside")
    beyond = torch.maximum(low - points, points - high).amax(1)  # of the box: negative inside
    values = torch.maximum(values, beyond).view(*counts.tolist())
    values = torch.where(values == 0, -1e-9, values.double()).numpy()  # at 0 triangles would have no area
    if not (values < 0).any():
        return trimesh.Trimesh()
    corners, faces, _, _ = measure.marching_cubes(values, 0.0)
    return trimesh.Trimesh(corners.astype(np.float64) * cell + first.double().numpy(), faces, process=False)
