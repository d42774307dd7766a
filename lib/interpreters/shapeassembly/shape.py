"""What an executed program is: boxes in a hierarchy, and the questions one asks of a shape.

World axes: x right, y up, z to the front. Sizes and coordinates are in the program's own units.
"""

from collections.abc import Iterator, Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..cuboids import Cuboids
from ..quoting import quoted
from .errors import ProgramError
from .hierarchy import Layout
from .program import Program

# Twelve colours that differ in hue and lightness, so that neighbours stay apart in print and for most eyes.
PALETTE = (
    (94, 139, 186), (226, 143, 79), (112, 173, 119), (200, 92, 92), (147, 121, 184), (222, 189, 92),
    (96, 178, 178), (190, 134, 102), (217, 139, 178), (135, 148, 120), (78, 104, 140), (165, 165, 165),
)  # fmt: skip


class Shape:
    """One executed program.

    cuboids  the leaf boxes, breadth-first over blocks, in each block as declared, then the copies
    boxes    every box, inner ones and the root included, breadth-first
    parents  for each of `boxes` the index of the box it lies in (-1 for the root)
    """

    def __init__(self, program: Program, layout: Layout, first: int, boxes: Cuboids):
        self.program = program
        self.boxes = boxes
        self._layout, self._first = layout, first
        self._leaves = [i for i in range(len(boxes)) if layout.leaf[first + i]]
        self.cuboids = boxes[self._leaves]

    def __repr__(self) -> str:
        return f"Shape({len(self.cuboids)} leaf cuboids, {len(self.boxes)} boxes)"

    @property
    def parents(self) -> list[int]:
        start = self._first
        return [p - start if p >= 0 else -1 for p in self._layout.parent[start : start + len(self.boxes)]]

    @property
    def box_names(self) -> list[str]:
        """Path names of all boxes."""
        return [self._layout.path(self._first + i) for i in range(len(self.boxes))]

    @property
    def names(self) -> list[str]:
        """Path names of the leaves, such as `Program_0/Program_1/cube0`."""
        return [self._layout.path(self._first + i) for i in self._leaves]

    @property
    def is_leaf(self) -> list[bool]:
        """For each of `boxes`: is it drawn?"""
        return self._layout.leaf[self._first : self._first + len(self.boxes)]

    @property
    def colors(self):
        """(n, 3) uint8 numpy array: a colour per leaf; copies look like their source."""
        import numpy as np

        parts = [self._layout.part[self._first + i] for i in self._leaves]
        number = {part: k for k, part in enumerate(dict.fromkeys(parts))}
        return np.array([PALETTE[number[part] % len(PALETTE)] for part in parts], dtype=np.uint8).reshape(
            -1, 3
        )

    def bounds(self) -> Float[Tensor, "2 3"]:
        """Smallest and largest coordinates of the leaves."""
        return self._drawn().bounds()

    def occupancy(self, points: Float[Tensor, "m 3"]) -> Bool[Tensor, "m"]:
        """Is each point inside or on a leaf?"""
        return self.cuboids.detach().contains(torch.as_tensor(points).to(self.cuboids.size))

    def surface_points(self, n: int, seed: int = 0) -> Float[Tensor, "n 3"]:
        """n points on the leaves' faces, uniform by area (faces inside other leaves count); gradients flow."""
        return self._drawn().surface_points(n, seed)

    def voxel_centers(self, resolution: int) -> Float[Tensor, "r r r 3"]:
        """Centers of the voxels, [x, y, z]: a cube about the middle of the bounds, as wide as the longest side."""
        if not isinstance(resolution, int) or resolution < 1:
            raise ValueError(f"found a resolution of {resolution}; expected a whole number, at least 1")
        low, high = self.bounds().detach()
        steps = (torch.arange(resolution).to(low) + 0.5) / resolution - 0.5
        grid = torch.stack(torch.meshgrid(steps, steps, steps, indexing="ij"), -1)
        return grid * (high - low).max() + (low + high) / 2

    def voxels(self, resolution: int) -> Bool[Tensor, "r r r"]:
        """Which voxels have their center in the shape, [x, y, z]; the grid is that of `voxel_centers`."""
        centers = self.voxel_centers(resolution)
        return self.occupancy(centers.reshape(-1, 3)).reshape(centers.shape[:3])

    def mesh(self):
        """A trimesh.Trimesh: eight corners and twelve triangles per leaf, each leaf a closed body of its own colour."""
        from .meshing import boxes_mesh

        return boxes_mesh(self.cuboids, self.colors)

    def to_glb(self) -> bytes:
        """The shape as a GLB file, one named part per leaf."""
        from .meshing import parts_scene

        return parts_scene(self._drawn(), self.colors, self.names).export(file_type="glb")

    def to_obj(self) -> str:
        """The shape as an OBJ file, one named object per leaf."""
        from .meshing import parts_obj

        return parts_obj(self.cuboids, self.names)

    def _drawn(self) -> Cuboids:
        """The leaves, of which there must be some. Raises ProgramError for a shape without any."""
        if not len(self.cuboids):
            raise ProgramError("the shape has no cuboids", expected="at least one Cuboid besides the bbox")
        return self.cuboids


class Shapes(Sequence):
    """Executed programs, one after the other: `shapes[i]` is a Shape, `cuboids` the leaves of all of them."""

    def __init__(self, programs: Sequence[Program], layout: Layout, boxes: Cuboids):
        """boxes: (variants, boxes of all programs); variants other than 1 only for a single program."""
        self.programs, self._layout, self._boxes = list(programs), layout, boxes
        self._variants = len(boxes)

    def __len__(self) -> int:
        return self._variants * (len(self._layout.start) - 1)

    def __getitem__(self, i):
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        if not -len(self) <= i < len(self):
            raise IndexError(f"shape {i} of {len(self)}")
        variant, program = divmod(i % len(self), len(self.programs))
        first, stop = self._layout.start[program], self._layout.start[program + 1]
        boxes = self._boxes[variant, first:stop]
        _require_finite(boxes, self._layout, first)
        return Shape(self.programs[program], self._layout, first, boxes)

    def __iter__(self) -> Iterator[Shape]:
        return (self[i] for i in range(len(self)))

    @property
    def count(self) -> list[int]:
        """Number of leaves of each shape."""
        total = torch.tensor([0, *self._layout.leaf]).cumsum(0)
        start = torch.tensor(self._layout.start)
        return (total[start[1:]] - total[start[:-1]]).tolist() * self._variants

    @property
    def cuboids(self) -> Cuboids:
        """The leaves of all shapes in order; shape i has the next count[i] of them."""
        leaves = self._boxes[:, torch.tensor(self._layout.leaf)]
        return Cuboids(leaves.size.flatten(0, 1), leaves.center.flatten(0, 1), leaves.axes.flatten(0, 1))

    @property
    def valid(self) -> Bool[Tensor, " shapes"]:
        """Which shapes have finite geometry throughout; the others raise ProgramError when asked for."""
        finite = _finite(self._boxes).to(torch.float64)  # (variants, boxes)
        bad = torch.nn.functional.pad((1 - finite).cumsum(1), (1, 0))
        start = torch.tensor(self._layout.start, device=bad.device)
        return (bad[:, start[1:]] == bad[:, start[:-1]]).flatten()


def _finite(boxes: Cuboids) -> Bool[Tensor, "*n"]:
    """Are all corners finite? Told from the farthest any corner can be, without building the corners."""
    reach = (boxes.size.unsqueeze(-1) * boxes.axes).abs().sum(-2)
    return (boxes.center.abs() + reach).isfinite().all(-1)


def _require_finite(boxes: Cuboids, layout: Layout, first: int) -> None:
    broken = (~_finite(boxes)).nonzero()
    if len(broken):
        name = layout.path(first + int(broken[0]))
        found = f"the attachments of {quoted(name)} have no finite result"
        raise ProgramError(found, token=name, expected="numbers whose geometry can be computed")
