"""Oriented boxes, many at a time: the geometry that every part of this house passes around.

A cuboid has a size (length, height, width), a center and three unit axes. World axes: x right, y up, z to
the front. "length" lies along the right axis, "height" along top, "width" along front. A point *in* a cuboid
has local coordinates q in [0, 1]^3, so that

    world(q) = center + (q - 1/2) * size @ axes        (axes: rows right, top, front)

and the right face is q_x = 1, the left one q_x = 0, top q_y = 1, bottom 0, front q_z = 1, back 0.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

# Signs of the eight corners over (x, y, z), in the order of meshes and of recorded corner arrays.
CORNER_SIGNS = torch.tensor(
    [[1, 1, 1], [1, 1, -1], [1, -1, 1], [1, -1, -1], [-1, 1, 1], [-1, 1, -1], [-1, -1, 1], [-1, -1, -1]],
    dtype=torch.float64,
)


@dataclass(frozen=True)
class Cuboids:
    """A batch of oriented boxes; any number of leading dimensions, all differentiable."""

    size: Float[Tensor, "*n 3"]
    center: Float[Tensor, "*n 3"]
    axes: Float[Tensor, "*n 3 3"]

    def __len__(self) -> int:
        return len(self.size)

    def __getitem__(self, rows) -> "Cuboids":
        return Cuboids(self.size[rows], self.center[rows], self.axes[rows])

    def detach(self) -> "Cuboids":
        """The same boxes, cut off from the gradient."""
        return Cuboids(self.size.detach(), self.center.detach(), self.axes.detach())

    def to(self, *args) -> "Cuboids":
        """The same boxes with another dtype or on another device, as `Tensor.to`."""
        return Cuboids(self.size.to(*args), self.center.to(*args), self.axes.to(*args))

    def world(self, q: Float[Tensor, "*n 3"]) -> Float[Tensor, "*n 3"]:
        """World position of one local point per box."""
        return self.center + self.lever(q).sum(-2)

    def lever(self, q: Float[Tensor, "*n 3"]) -> Float[Tensor, "*n 3 3"]:
        """How far q lies from the center, axis by axis: row k is (q_k - 1/2) * size_k * axis_k."""
        return ((q - 0.5) * self.size).unsqueeze(-1) * self.axes

    def local(self, points: Float[Tensor, "*n 3"]) -> Float[Tensor, "*n 3"]:
        """Local coordinates of one world point per box."""
        return self.local_many(points.unsqueeze(-2)).squeeze(-2)

    def world_many(self, q: Float[Tensor, "*#n m 3"]) -> Float[Tensor, "*n m 3"]:
        """World positions of m local points per box; (m, 3) are the same points in every box."""
        return self.center.unsqueeze(-2) + ((q - 0.5) * self.size.unsqueeze(-2)) @ self.axes

    def local_many(self, points: Float[Tensor, "*#n m 3"]) -> Float[Tensor, "*n m 3"]:
        """Local coordinates of m world points per box. A box without volume gives inf or NaN."""
        offset = (points - self.center.unsqueeze(-2)) @ inverse_axes(self.axes)
        return offset / self.size.unsqueeze(-2) + 0.5

    def corners(self) -> Float[Tensor, "*n 8 3"]:
        """World positions of the corners, signs (+++)(++-)(+-+)(+--)(-++)(-+-)(--+)(---) over (x, y, z)."""
        return self.world_many(CORNER_SIGNS.to(self.size) / 2 + 0.5)

    def bounds(self) -> Float[Tensor, "2 3"]:
        """Smallest and largest coordinates over all boxes."""
        corners = self.corners().reshape(-1, 3)
        return torch.stack([corners.amin(0), corners.amax(0)])

    def volume(self) -> Float[Tensor, "*n"]:
        """Volume of each box, cubic world units."""
        return self.size.prod(-1).abs()

    def contains(self, points: Float[Tensor, "m 3"]) -> Bool[Tensor, "m"]:
        """Is each point inside (or on) at least one of the boxes?"""
        inside = torch.zeros(len(points), dtype=torch.bool, device=points.device)
        for box in range(len(self)):  # one box at a time: memory stays at m, whatever the number of boxes
            q = self[box].local_many(points)
            inside |= ((q >= 0) & (q <= 1)).all(-1)
        return inside

    def surface_points(self, n: int, seed: int = 0) -> Float[Tensor, "*batch n 3"]:
        """n points on the faces of the boxes, uniform by area; inner faces count like outer ones.

        Which face and where on it are drawn from `seed` and held constant; the points move with the boxes, so
        gradients flow to size, center and axes. Leading dimensions before the last box dimension are a batch.
        """
        generator = torch.Generator().manual_seed(seed)
        box, q = _draw_on_faces(self.size.detach().abs().cpu(), n, generator)
        box, q = box.to(self.size.device), q.to(self.size)
        vectors = box.unsqueeze(-1).expand(*box.shape, 3)
        matrices = box[..., None, None].expand(*box.shape, 3, 3)
        chosen = Cuboids(
            self.size.gather(-2, vectors), self.center.gather(-2, vectors), self.axes.gather(-3, matrices)
        )
        return chosen.world(q)


def _draw_on_faces(
    size: Float[Tensor, "*batch boxes 3"], n: int, generator: torch.Generator
) -> tuple[Int[Tensor, "*batch n"], Float[Tensor, "*batch n 3"]]:
    """For n points: which box, and the local coordinates on one of its six faces, weighted by area."""
    length, height, width = size.unbind(-1)
    area = torch.stack([height * width, length * width, length * height], -1)
    # (*batch, boxes * 6): left, right, bottom, top, back, front of each box
    weight = area.repeat_interleave(2, -1).flatten(-2)
    batch = weight.shape[:-1]
    cumulative = weight.double().cumsum(-1)
    at = torch.rand(*batch, n, dtype=torch.float64, generator=generator) * cumulative[..., -1:]
    face = torch.searchsorted(cumulative, at, right=True).clamp(max=weight.shape[-1] - 1)
    q = torch.rand(*batch, n, 3, dtype=torch.float64, generator=generator)
    axis, side = (face % 6) // 2, face % 2
    q.scatter_(-1, axis.unsqueeze(-1), side.unsqueeze(-1).double())
    return face // 6, q


def inverse_axes(axes: Float[Tensor, "*n 3 3"]) -> Float[Tensor, "*n 3 3"]:
    """Inverse of each 3x3 matrix by cross products (quicker than a general solver on many small matrices)."""
    right, top, front = axes.unbind(-2)
    columns = torch.stack([cross(top, front), cross(front, right), cross(right, top)], -1)
    return columns / (right * columns[..., 0]).sum(-1)[..., None, None]


def cross(a: Float[Tensor, "*#n 3"], b: Float[Tensor, "*#n 3"]) -> Float[Tensor, "*m 3"]:
    """Cross product over the last dimension."""
    return torch.linalg.cross(a, b, dim=-1)


def skew(v: Float[Tensor, "*n 3"]) -> Float[Tensor, "*n 3 3"]:
    """The matrix S of each vector with S w = v x w."""
    x, y, z = v.unbind(-1)
    zero = torch.zeros_like(x)
    return torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).unflatten(-1, (3, 3))


def concatenate(parts: list[Cuboids], dim: int = 0) -> Cuboids:
    """Several batches of boxes as one, joined along `dim`."""
    return Cuboids(
        torch.cat([part.size for part in parts], dim),
        torch.cat([part.center for part in parts], dim),
        torch.cat([part.axes for part in parts], dim),
    )
