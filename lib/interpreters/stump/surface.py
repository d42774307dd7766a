"""Marching cubes on a stump's signed field: fast, of any stump, with the grid's precision.

The field is `layers.signed`: negative inside, and nowhere farther from 0 than the surface is away. The surface also
closes where the window cuts the shape.

Where the field is known to keep its sign it is not computed: a small block of samples whose middle is farther from the
surface than all of them, and than their neighbours, has the middle's value throughout.
"""

import math
from dataclasses import replace

import numpy as np
import torch
import trimesh
from jaxtyping import Float
from skimage import measure
from torch import Tensor

from ..threads import one_thread
from . import distances as formulas
from . import layers
from .cutting import side
from .primitives import Batches, Cone, Primitive
from .program import Stump
from .shape import step

_SIDE = 4  # samples along an edge of a block
_NEAR = 1e-3  # cells: no sample is nearer to the surface
_UNLIKE = 1.001  # so much more counts what is outside, to break ties


def marching_cubes(stump: Stump, window: Float[Tensor, "2 3"], resolution: int) -> trimesh.Trimesh:
    """A closed surface through the cells of a cube about the window's middle, as wide as its longest side."""
    size = side(window)
    if not size or not ((samples := field(stump, window, resolution)) < 0).any():
        return trimesh.Trimesh()
    corners, faces, _, _ = measure.marching_cubes(samples.cpu().numpy(), 0.0)
    # Sample 1 is the center of cell 0, half a cell from the cube's edge.
    in_cube = (corners.astype(np.float64) - 1 + 0.5) / resolution - 0.5
    return trimesh.Trimesh(in_cube * size + window.mean(0).numpy(), faces.astype(np.int64), process=False)


@one_thread()
@torch.no_grad()
def field(stump: Stump, window: Float[Tensor, "2 3"], resolution: int) -> Float[Tensor, "n n n"]:
    """The signed field in cells, never 0, at the centers of all cells and of one more around them: n = resolution + 2.

    Near the surface; elsewhere it only has the right sign.
    """
    cell = 1 / resolution
    field = _Field(stump.pruned(), window)
    count = math.ceil((resolution + 2) / _SIDE)  # blocks along an edge
    axis = (torch.arange(count * _SIDE, device=field.device) - resolution / 2 - 0.5) * cell
    middle = axis.view(count, _SIDE).mean(1)
    middles = torch.cartesian_prod(middle, middle, middle)
    around = torch.cartesian_prod(*[axis[:_SIDE] - middle[0]] * 3)  # a block's samples
    values = torch.cat([field(part) for part in middles.split(field.step)])
    far = ((_SIDE - 1) / 2 * math.sqrt(3) + 1) * cell * 1.001  # beyond rounding
    near = (values.abs() <= far).nonzero()[:, 0]
    values = values.unsqueeze(1).repeat(1, len(around))
    for block in near.split(max(1, field.step // len(around))):
        values[block] = field((middles[block].unsqueeze(1) + around).flatten(0, 1)).view(-1, len(around))
    values = values.view(*[count] * 3, *[_SIDE] * 3).permute(0, 3, 1, 4, 2, 5).reshape(*[len(axis)] * 3)
    return _without_ties(values[(slice(resolution + 2),) * 3] / cell)


def _without_ties(values: Float[Tensor, "n n n"]) -> Float[Tensor, "n n n"]:
    """At 0, triangles would have no area; and between -a, a, -a, a around a face, each side of it could join its own
    pair of corners, which leaves a gap. The surface moves by less than a thousandth of a cell."""
    return torch.where(values <= 0, values.clamp(max=-_NEAR), values.clamp(min=_NEAR) * _UNLIKE)


class _Field:
    """The signed field of a stump in single precision, seen from the window's middle, its longest side as the unit."""

    def __init__(self, stump: Stump, window: Float[Tensor, "2 3"]):
        self.device = stump.primitives[0].translation.device
        middle, unit = window.mean(0).to(self.device), side(window) or 1.0
        self.batches = Batches([_seen_from(middle, unit, primitive) for primitive in stump.primitives])
        self.matrices = [matrix.to(self.device) for matrix in stump.matrices]
        self.half = ((window[1] - window[0]) / (2 * unit)).to(self.device, torch.float32)
        self.step = step(len(stump.primitives), self.device)

    def __call__(self, points: Float[Tensor, "m 3"]) -> Float[Tensor, " m"]:
        nearest = layers.signed(self.batches.distances(points), *self.matrices)
        nearest = nearest.clamp(max=2 * float(self.half.max()))  # finite, where nothing is united
        return torch.maximum(nearest, formulas.box(points, self.half))


class _Mantle(Cone):
    """A boundless cone whose distance has no jump, which would move the surface and mislead the search for it."""

    def _formula(self):
        return formulas.mantle


def _seen_from(middle: Float[Tensor, "3"], unit: float, primitive: Primitive) -> Primitive:
    """Moved, and all its lengths divided by the unit."""
    lengths = {
        key: getattr(primitive, key).double() for key in primitive.written if key not in ("slope", "rotation")
    }
    lengths["translation"] = lengths["translation"] - middle
    moved = replace(primitive, **{key: length / unit for key, length in lengths.items()}).to(torch.float32)
    if isinstance(primitive, Cone) and primitive.height is None:
        return _Mantle(moved.slope, None, moved.translation, moved.rotation)
    return moved
