"""What an executed program is: pixels or voxels, and the questions one asks of a shape.

In the plane x grows right and y DOWN, image[y, x]; in space grid[x, y, z], z up. Pixel k has its center at k.
Beside its pixels a shape has an exact form (see geometry), whose points and surfaces are not cut off by the canvas.
"""

import operator
from collections.abc import Sequence
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from ..checks import check_inside, draw
from . import geometry
from .errors import ProgramError
from .packing import SIDE, count, unpack
from .program import Program


class Shape:
    """One executed program; `words` are its packed pixels (see packing)."""

    def __init__(self, program: Program, words: Int[Tensor, " lines"]):
        self.program, self.words = program, words

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.program.to_text()!r}, {self.on} of {SIDE**self.dimensions} ON)"

    @property
    def dimensions(self) -> int:
        return self.program.dimensions

    @property
    def on(self) -> int:
        """How many pixels or voxels are ON."""
        return int(count(self.words))

    def occupancy(self, points) -> Bool[Tensor, " n"]:
        """Is each point inside the exact shape? (n, 2) x, y or (n, 3) x, y, z. Raises ValueError for another shape.

        At the centers of pixels, whole numbers from 0 to 63, this is the picture or the grid itself.
        """
        return geometry.occupancy(self.program, points)

    def voxels(self, resolution: int) -> Bool[Tensor, "r *rs"]:
        """The exact shape at the centers of `resolution` cells along each side of the canvas.

        (r, r), [row y, column x], or (r, r, r), [x, y, z]; 64 makes the picture or the grid. Raises ValueError.
        """
        return geometry.voxels(self.program, resolution, self.words.device)

    def to_stl(self) -> bytes:
        """A binary STL file of the mesh, z up. Slicers take the unit for a millimetre: the canvas is 64 mm wide.

        Raises ProgramError for a shape without an inside.
        """
        from ..meshes import stl

        return stl(check_inside(self.mesh(), ProgramError))


class Picture(Shape):
    """A shape in the plane."""

    @cached_property
    def image(self) -> Bool[Tensor, "64 64"]:
        """The pixels, [row y, column x]. Shared: do not change it."""
        return unpack(self.words)

    @cached_property
    def area(self) -> float:
        """The exact area in square pixels, with true circles, of the whole shape, what is off the canvas included."""
        from .outlines import area

        return area(self.program)

    def outline(self, segments: int = 64) -> list[Float[np.ndarray, "_ 2"]]:
        """The closed rings of the outline, (corners, 2) x, y each; empty for a shape without an inside.

        Outer rings run clockwise as one sees them, holes the other way; segments: corners of a whole circle.
        """
        from .outlines import rings

        return rings(self.program, segments)

    def surface_points(self, n: int, seed: int = 0) -> Float[Tensor, "n 2"]:
        """n points on the outline, uniform by length. Raises ProgramError for a shape without an inside."""
        from ..rings import points_on

        return draw(points_on, check_inside(self.outline(), ProgramError), n, seed)

    def mesh(self, height: float = 8.0, segments: int = 64):
        """A trimesh.Trimesh: the picture cut out of a plate, watertight; without faces if there is nothing inside.

        x, 63 - y and z from 0 to `height` pixels: from above, where z points, it looks like the picture.
        height: from 1e-6 to 1e6. Raises ValueError.
        """
        from ..meshes import triangles
        from .outlines import plate
        from .solids import DUST

        return triangles(plate(self.program, height, segments), DUST * min(1, height))

    def to_svg(self, color: str = "#5e8bba") -> str:
        """The outline as an SVG file that shows the canvas. Raises ProgramError for a shape without an inside."""
        from .outlines import to_svg

        return to_svg(check_inside(self.outline(), ProgramError), color)

    def to_glb(self) -> bytes:
        """The plate as a GLB file, standing upright. Raises ProgramError for a shape without an inside."""
        from ..meshes import glb

        return glb(check_inside(self.mesh(), ProgramError), turn=False)


class Solid(Shape):
    """A shape in space."""

    @cached_property
    def grid(self) -> Bool[Tensor, "64 64 64"]:
        """The voxels, [x, y, z]. Shared: do not change it."""
        return unpack(self.words).view(SIDE, SIDE, SIDE)

    def mesh(self, segments: int = 64):
        """A trimesh.Trimesh, watertight, in the grid's coordinates; without faces for a shape without an inside.

        segments: corners of a whole circle, a multiple of 4.
        """
        from ..meshes import triangles
        from .solids import DUST, solid

        return triangles(solid(self.program, segments), DUST)

    def surface_points(self, n: int, seed: int = 0) -> Float[Tensor, "n 3"]:
        """n points on the mesh, uniform by area. Raises ProgramError for a shape without an inside."""
        from ..meshes import points_on

        return draw(points_on, check_inside(self.mesh(), ProgramError), n, seed)

    def to_glb(self) -> bytes:
        """The mesh as a GLB file, where y is up: x, z, -y. Raises ProgramError for a shape without an inside."""
        from ..meshes import glb

        return glb(check_inside(self.mesh(), ProgramError), turn=True)


class Shapes(Sequence):
    """Executed programs: `shapes[i]` is a Shape, `shapes[2:5]` are Shapes; the pixels of all stay packed in `words`."""

    def __init__(
        self,
        words: Int[Tensor, "programs lines"],
        valid: Bool[Tensor, " programs"],
        tokens: Tensor,
        vocabulary,
    ):
        self.words, self.valid, self.tokens, self.vocabulary = words, valid, tokens, vocabulary

    def __len__(self) -> int:
        return len(self.words)

    def __getitem__(self, index):
        """A number gives a Shape, or raises ProgramError saying why not; a slice or a mask (tensor) gives Shapes."""
        if isinstance(index, slice):
            index = torch.tensor(range(len(self))[index], dtype=torch.int64, device=self.words.device)
        if isinstance(index, Tensor) and index.ndim == 1:
            return Shapes(self.words[index], self.valid[index], self.tokens[index], self.vocabulary)
        index = operator.index(index)
        if not -len(self) <= index < len(self):
            raise IndexError(f"shape {index} of {len(self)}")
        program = self.vocabulary.program(self.tokens[index])
        return (Solid if self.dimensions == 3 else Picture)(program, self.words[index])

    def __repr__(self) -> str:
        return f"Shapes({len(self)} of {self.dimensions}D programs, {int(self.valid.sum())} valid)"

    @property
    def dimensions(self) -> int:
        return self.vocabulary.dimensions

    @property
    def on(self) -> Int[Tensor, " programs"]:
        """How many pixels or voxels of each shape are ON."""
        return count(self.words)

    @property
    def images(self) -> Bool[Tensor, "programs 64 64"]:
        """The pictures of programs of the plane, [program, row y, column x]; blank where a program is not valid."""
        self._require(2, "grids")
        return unpack(self.words)

    @property
    def grids(self) -> Bool[Tensor, "programs 64 64 64"]:
        """The voxels of programs of space, [program, x, y, z]; blank where a program is not valid."""
        self._require(3, "images")
        return unpack(self.words).view(-1, SIDE, SIDE, SIDE)

    def _require(self, dimensions: int, instead: str) -> None:
        if self.dimensions != dimensions:
            raise ProgramError(
                f"these are programs with {self.dimensions} dimensions", expected=f"shapes.{instead}"
            )
