"""From a decided field to a surface and points on it: for all networks that read clouds, and their rivals, alike.

The field is sampled at cell centres of the cloud's own box and of two cells around it, and marched at 0. Beyond the box
there is nothing, as in the authors' program: primitives without an end are closed there. Cells are a 64th of the
diagonal, the authors' a 128th of a cube's side: what is thinner than a cell, 0.016, may be lost.
"""

import math
from collections.abc import Callable

import numpy as np
import torch
import trimesh
from jaxtyping import Float
from skimage import measure
from torch import Tensor, nn

from ..interpreters.checks import check_points

CELL = 1 / 64  # of the diagonal
AT_ONCE = 8192  # samples
AROUND = 2  # cells around the box; the outermost are outside
MOST = 1 << 25  # samples

DIAGONAL = (0.5, 1.5)  # of a cloud's box: networks know 1, and some points of a shape may span less
OFF = 0.25  # of its middle from the origin, at most

Field = Callable[[Float[Tensor, "m 3"]], Float[Tensor, " m"]]


@torch.no_grad()
def reconstructed(network: nn.Module, cloud: Float[Tensor, "n 3"], cell: float = CELL) -> trimesh.Trimesh:
    """The solid that a network says of a cloud (diagonal 1, around the origin), decided; perhaps empty.

    All points say where the cloud's box ends; how many are looked at, the first ones, is the network's matter. Raises
    ValueError for other clouds, which `lib.datasets.read_cloud` moves and scales, for a network that is being trained,
    and for one that answers with what is no number.
    """
    cloud = check_points(cloud, "xyz").to(next(network.parameters()))
    _check_place(cloud)
    if network.training:  # its answers, and its running means, would depend on what it is asked
        raise ValueError("found a network in training mode; expected one after network.eval()")
    return surface(decided(network(cloud.unsqueeze(0))), cloud, cell)


def decided(said) -> Field:
    """The field of what a network says of one cloud: a SoftStump, or a SoftTree."""
    return lambda points: said.signed(said.distances(points.unsqueeze(0)))[0]


def _check_place(cloud: Float[Tensor, "n 3"]) -> None:
    if not len(cloud) or not cloud.isfinite().all():
        raise ValueError("found a cloud without points, or with some that are not finite; expected a shape's")
    low, high = cloud.amin(0), cloud.amax(0)
    diagonal, off = (high - low).norm().item(), ((low + high) / 2).norm().item()
    if not DIAGONAL[0] <= diagonal <= DIAGONAL[1] or off > OFF:
        raise ValueError(
            f"found a cloud whose box has diagonal {diagonal:.3g} and a middle {off:.3g} from the origin; expected "
            "diagonal 1 around the origin, as lib.datasets.read_cloud makes it"
        )


@torch.no_grad()
def surface(field: Field, cloud: Float[Tensor, "n 3"], cell: float = CELL) -> trimesh.Trimesh:
    """A closed surface where the field, negative inside, is 0, within the cloud's box; perhaps empty.

    Raises ValueError for a cloud without points, or whose box has no sensible number of cells, and where the field is
    no number, or not one for each point.
    """
    cloud = check_points(cloud, "xyz")
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
    if values.shape != points.shape[:1]:
        raise ValueError(
            f"found a field of shape {tuple(values.shape)} at {len(points)} points; expected a number each"
        )
    if values.isnan().any():
        raise ValueError("found a field that is no number somewhere; expected numbers, negative inside")
    beyond = torch.maximum(low - points, points - high).amax(1)  # of the box: negative inside
    values = torch.maximum(values, beyond).view(*counts.tolist())
    values = (
        torch.where(values == 0, -1e-9, values.double()).cpu().numpy()
    )  # at 0 triangles would have no area
    if not (values < 0).any():
        return trimesh.Trimesh()
    corners, faces, _, _ = measure.marching_cubes(values, 0.0)
    return trimesh.Trimesh(
        corners.astype(np.float64) * cell + first.double().cpu().numpy(), faces, process=False
    )
