"""What an executed stump is, and the questions one asks of a shape. Coordinates are the stump's own."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from . import layers
from .program import Stump

_AT_ONCE = 1 << 22  # primitives x points tested in one step


class Shape:
    """One executed stump.

    window  (2, d) lowest and highest coordinates that voxels and surfaces show. The shape's bounds unless told
            otherwise; where it goes on for ever, see bounds.
    """

    def __init__(self, program: Stump, window: Float[Tensor, "2 d"]):
        self.program, self.window = program, window

    def __repr__(self) -> str:
        return f"Shape({self.program!r})"

    @property
    def dimensions(self) -> int:
        return self.program.dimensions

    def nodes(self, points: Float[Tensor, "m d"]) -> Bool[Tensor, "c m"]:
        """Is each point inside each intersection node?"""
        return self._layers(points)[0]

    def occupancy(self, points: Float[Tensor, "m d"]) -> Bool[Tensor, " m"]:
        """Is each point inside the shape, its surface included? The window has no say."""
        return self._layers(points)[1]

    def _layers(self, points) -> tuple[Tensor, Tensor]:
        points = torch.as_tensor(points)
        step = max(1, _AT_ONCE // len(self.program.primitives))
        parts = [
            layers.binary(self.program.distances(part) <= 0, *self.program.matrices)
            for part in points.split(step)
        ]
        nodes, inside = zip(*parts)
        return torch.cat(nodes, -1), torch.cat(inside)

    def soft_occupancy(self, points: Float[Tensor, "m d"], sharpness: float = 150.0) -> Float[Tensor, " m"]:
        """T of O = sigmoid(-sharpness * distance), from 0 outside to 1 inside; differentiable."""
        raise NotImplementedError

    def voxel_centers(self, resolution: int) -> Float[Tensor, "*r d"]:
        """Centers of the cells of a cube about the middle of the window, as wide as its longest side."""
        low, high = self.window
        steps = ((torch.arange(resolution).to(low) + 0.5) / resolution - 0.5) * (high - low).max()
        grid = torch.stack(torch.meshgrid(*[steps] * self.dimensions, indexing="ij"), -1)
        return grid + (low + high) / 2

    def voxels(self, resolution: int) -> Bool[Tensor, "*r"]:
        """Which cells of `voxel_centers` have their center in the shape: [x, y, z], and [x, y] in the plane."""
        centers = self.voxel_centers(resolution)
        return self.occupancy(centers.flatten(0, -2)).view(centers.shape[:-1])
