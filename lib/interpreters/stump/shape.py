"""What an executed stump is, and the questions one asks of a shape. Coordinates are the stump's own, y UP in the plane.

Points, voxels and marching cubes ask the three layers themselves; meshes, outlines and areas are those of polyhedra and
polygons, which are exact but for round primitives (see solids and outlines).
"""

import math
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..checks import check_inside, check_points, check_resolution, draw
from ..threads import one_thread
from . import layers
from .errors import ProgramError
from .primitives import Batches
from .program import Stump

_IN_CACHE, _ON_CARD = 1 << 18, 1 << 24  # primitives x points at once, on a processor and on a graphics card


def step(rows: int, device: torch.device) -> int:
    """How many points to test at once against so many primitives."""
    return max(1, (_IN_CACHE if device.type == "cpu" else _ON_CARD) // rows)


class Shape:
    """One executed stump: a Picture or a Solid.

    window  (2, d) lowest and highest coordinates that voxels, images, surfaces and outlines show. The shape's bounds
            unless told otherwise; where it goes on for ever, see bounds.
    """

    def __init__(self, program: Stump, window: Float[Tensor, "2 d"]):
        self.program, self.window = program, window

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.program!r})"

    @property
    def dimensions(self) -> int:
        return self.program.dimensions

    @property
    def device(self) -> torch.device:
        """Where the primitives are, and the answers will be."""
        return self.program.primitives[0].translation.device

    def nodes(self, points) -> Bool[Tensor, "c m"]:
        """Is each point (m, d) inside each intersection node? Raises ValueError for what are no points."""
        return self._layers(points)[0]

    def occupancy(self, points) -> Bool[Tensor, " m"]:
        """Is each point (m, d) inside the shape, its surface included? The window has no say.

        Points that are not finite are not. Raises ValueError for what are no points.
        """
        return self._layers(points)[1]

    @one_thread()
    @torch.no_grad()
    def _layers(self, points) -> tuple[Tensor, Tensor]:
        parts = self._points(points).split(step(len(self.program.primitives), self.device))
        nodes, inside = zip(*[self._layers_of(part) for part in parts])
        return torch.cat(nodes, -1), torch.cat(inside)

    def _layers_of(self, points: Tensor) -> tuple[Tensor, Tensor]:
        nodes, inside = layers.binary(self._batches.distances(points) <= 0, *self._matrices)
        finite = points.isfinite().all(1)
        return nodes & finite, inside & finite

    def _points(self, points) -> Tensor:
        return check_points(points, "xyz"[: self.dimensions]).to(self.device)

    @cached_property
    def _batches(self) -> Batches:
        return Batches(self.program.primitives)

    @cached_property
    def _matrices(self) -> list[Tensor]:
        return [matrix.to(self.device) for matrix in self.program.matrices]

    def soft_occupancy(self, points, sharpness: float = 150.0) -> Float[Tensor, " m"]:
        """T of O = sigmoid(-sharpness * distance), from 0 outside to 1 inside; differentiable.

        Raises ValueError for what are no points, and for a sharpness that is no finite number above 0.
        """
        _check_sharpness(sharpness)
        distances = self.program.distances(self._points(points))
        matrices = (matrix.to(distances) for matrix in self._matrices)
        return layers.soft(torch.sigmoid(-sharpness * distances), *matrices)[1]

    def voxel_centers(self, resolution: int) -> Float[Tensor, "*r d"]:
        """Centers of the cells of a cube about the middle of the window, as wide as its longest side. float64."""
        return torch.stack(torch.meshgrid(*self._axes(resolution), indexing="ij"), -1)

    def _axes(self, resolution: int) -> Float[Tensor, "d r"]:
        """The coordinates of those centers along each axis."""
        (low, high), resolution = self.window.to(self.device), check_resolution(resolution)
        steps = (torch.arange(resolution, device=self.device).to(low) + 0.5) / resolution - 0.5
        return ((low + high) / 2).unsqueeze(1) + steps * (high - low).max()

    def voxels(self, resolution: int) -> Bool[Tensor, "*r"]:
        """Which cells of `voxel_centers` have their center in the shape: [x, y, z], and [x, y] in the plane.

        Raises ValueError for a resolution that is no whole number.
        """
        first, *rest = self._axes(resolution)
        others = [len(axis) for axis in rest]
        slabs = first.split(max(1, _ON_CARD // 64 // math.prod(others)))  # not all centers at once
        parts = [self.occupancy(torch.cartesian_prod(slab, *rest)).view(-1, *others) for slab in slabs]
        return torch.cat(parts)

    def to_stl(self) -> bytes:
        """A binary STL file of the mesh, z up. Raises ProgramError for a shape without an inside."""
        from ..meshes import stl

        return stl(check_inside(self.mesh(), ProgramError))


def _check_sharpness(sharpness) -> None:
    try:
        fits = math.isfinite(sharpness) and sharpness > 0
    except (TypeError, ValueError, RuntimeError, OverflowError):
        fits = False
    if not fits:
        raise ValueError(f"found a sharpness of {sharpness!r:.40}; expected a finite number above 0")


class Picture(Shape):
    """A shape in the plane, y up. Circles are polygons of the same area."""

    def image(self, resolution: int = 256) -> Bool[Tensor, "r r"]:
        """The voxels as a picture, [row, column]: row 0 is the topmost, where y is largest, as imshow draws it."""
        return self.voxels(resolution).T.flip(0)

    @cached_property
    def area(self) -> float:
        """The area within the window; exact where all is straight, and for round primitives that no other cuts."""
        from .outlines import area

        return area(self.program, self.window)

    def outline(self, segments: int = 64) -> list[Float[np.ndarray, "_ 2"]]:
        """The closed rings of the outline, (corners, 2) x, y each; empty for a shape without an inside.

        Outer rings run counter-clockwise, holes the other way; segments: corners of a whole circle.
        """
        from .outlines import outline

        return outline(self.program, self.window, segments)

    def surface_points(self, n: int, seed: int = 0) -> Float[Tensor, "n 2"]:
        """n points on the outline, uniform by length. Raises ProgramError for a shape without an inside."""
        from ..rings import points_on

        return draw(points_on, check_inside(self.outline(), ProgramError), n, seed)

    def mesh(self, height: float | None = None, segments: int = 64):
        """A trimesh.Trimesh: the shape cut out of a plate, watertight; without faces if there is nothing inside.

        z goes from 0 to `height`, an eighth of the window's longest side if left out. Raises ValueError for a height
        below about 1e-8 or above 1e4 of that side.
        """
        from .outlines import plate

        return plate(self.program, self.window, height, segments)

    def to_svg(self, color: str = "#5e8bba") -> str:
        """The outline as an SVG file that shows the window. Raises ProgramError for a shape without an inside."""
        from .outlines import to_svg

        return to_svg(check_inside(self.outline(), ProgramError), self.window, color)

    def to_glb(self) -> bytes:
        """The plate as a GLB file, standing upright. Raises ProgramError for a shape without an inside."""
        from ..meshes import glb

        return glb(check_inside(self.mesh(), ProgramError), turn=False)


class Solid(Shape):
    """A shape in space, z up."""

    def mesh(self, segments: int = 64):
        """A trimesh.Trimesh, watertight; without faces for a shape without an inside.

        segments: corners of a whole circle, a multiple of 4.
        """
        from .solids import mesh

        return mesh(self.program, self.window, segments)

    def marching_cubes(self, resolution: int = 128):
        """A trimesh.Trimesh, watertight, of the signed field at `voxel_centers`; without faces if none is inside.

        What is thinner than a cell is lost, corners are cut off; `mesh` is exact. Raises ValueError for a resolution
        that is no whole number.
        """
        from .surface import marching_cubes

        return marching_cubes(self.program, self.window, check_resolution(resolution))

    def surface_points(self, n: int, seed: int = 0) -> Float[Tensor, "n 3"]:
        """n points on the mesh, uniform by area. Raises ProgramError for a shape without an inside."""
        from ..meshes import points_on

        return draw(points_on, check_inside(self.mesh(), ProgramError), n, seed)

    def to_glb(self) -> bytes:
        """The mesh as a GLB file, where y is up: x, z, -y. Raises ProgramError for a shape without an inside."""
        from ..meshes import glb

        return glb(check_inside(self.mesh(), ProgramError), turn=True)
