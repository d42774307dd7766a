"""Signed distances of the primitives in their own coordinates: negative inside, zero on the surface, positive outside.

    box        ||max(q, 0)|| + min(max(q_x, q_y, q_z), 0)    q = |p| - half       (also a square in the plane)
    sphere     ||p|| - r                                                          (also a circle)
    cylinder   ||(p_x, p_y)|| - r                            along z for ever; with a height, a box of (rho, z)
    cone       (rho - a p_z) / sqrt(1 + a^2)                 apex at the origin, opening to +z for ever; a = slope,
               ||p|| where p_z < 0                           the tangent of half its angle; with a height, exact
    triangle   the distance to the nearest edge, by its side
    half-plane p_y

Sizes count without their sign. The boundless cone is that of the paper's program, jump at p_z = 0 included: just below
the apex's plane it measures to the apex, just above it to the mantle's straight continuation. All is differentiable;
where the true gradient is undefined (at a center, on an axis, on an edge) some finite one comes out.
"""

import torch
from jaxtyping import Float
from torch import Tensor

Points = Float[Tensor, "*n m d"]
Sizes = Float[Tensor, "*n s"]
Distances = Float[Tensor, "*n m"]


def norm(vectors: Float[Tensor, "*n d"]) -> Float[Tensor, "*n"]:
    """Length. At zero the gradient is 0 instead of NaN."""
    # Not vector_norm: that is thirty times slower where, as here, the last dimension is not the last in memory.
    squares = vectors.square().sum(-1)
    zero = squares == 0
    return squares.masked_fill(zero, 1).sqrt().masked_fill(zero, 0)


def box(points: Points, half: Sizes) -> Distances:
    return _from_faces(points.abs() - half.abs().unsqueeze(-2))


def sphere(points: Points, radius: Sizes) -> Distances:
    return norm(points) - radius.abs()


def cylinder(points: Points, radius: Sizes) -> Distances:
    return norm(points[..., :2]) - radius.abs()


def capped_cylinder(points: Points, sizes: Sizes) -> Distances:
    """sizes: radius, height; the origin is in the middle."""
    radius, height = sizes.abs().unsqueeze(-2).unbind(-1)
    return _from_faces(_beside(norm(points[..., :2]) - radius, points[..., 2].abs() - height / 2))


def cone(points: Points, slope: Sizes) -> Distances:
    return torch.where(points[..., 2] >= 0, mantle(points, slope), norm(points))


def mantle(points: Points, slope: Sizes) -> Distances:
    """Of the boundless cone, without a jump; below the apex's plane too small, but of the right sign."""
    slope = slope.abs()
    return (norm(points[..., :2]) - slope * points[..., 2]) / (1 + slope**2).sqrt()


def capped_cone(points: Points, sizes: Sizes) -> Distances:
    """sizes: slope, height; the apex is at the origin, the base at z = height."""
    slope, height = sizes.abs().unsqueeze(-2).unbind(-1)
    section = _beside(norm(points[..., :2]), points[..., 2])
    apex, rim = torch.zeros_like(sizes[..., :2]), torch.stack([slope * height, height], -1).squeeze(-2)
    foot = torch.stack([torch.zeros_like(height), height], -1).squeeze(-2)
    nearest = torch.minimum(_to_segment(section, apex, rim), _to_segment(section, rim, foot))
    inside = (section[..., 0] <= slope * section[..., 1]) & (section[..., 1] <= height)
    return torch.where(inside, -nearest, nearest)


def triangle(points: Points, sizes: Sizes) -> Distances:
    """sizes: left, right, height; the base from (-left, 0) to (right, 0), the apex at (0, height)."""
    left, right, height = sizes.abs().unbind(-1)
    zero = torch.zeros_like(left)
    corners = [torch.stack(corner, -1) for corner in ((-left, zero), (right, zero), (zero, height))]
    nearest, inside = [], torch.ones_like(points[..., 0], dtype=torch.bool)
    for start, end in zip(corners, (*corners[1:], corners[0])):
        nearest.append(_to_segment(points, start, end))
        (ex, ey), (px, py) = (end - start).unbind(-1), (points - start.unsqueeze(-2)).unbind(-1)
        inside = inside & (ex.unsqueeze(-1) * py >= ey.unsqueeze(-1) * px)  # on the left of every edge
    nearest = torch.stack(nearest).amin(0)
    return torch.where(inside, -nearest, nearest)


def half_plane(points: Points, sizes: Sizes) -> Distances:
    """No sizes: what lies below the line y = 0."""
    return points[..., 1] + 0 * sizes.sum(-1, keepdim=True)


def _beside(x: Distances, y: Distances) -> Float[Tensor, "*n m 2"]:
    """Points of the plane, all x before all y in memory, as `Primitive.local` makes them."""
    return torch.stack([x, y], -2).mT


def _from_faces(q: Float[Tensor, "*n m d"]) -> Distances:
    """From how far a point is beyond each pair of faces."""
    return norm(q.clamp(min=0)) + q.amax(-1).clamp(max=0)


def _to_segment(points: Points, start: Sizes, end: Sizes) -> Distances:
    """Distance without sign to the segment from `start` to `end`."""
    along, offset = (end - start).unsqueeze(-2), points - start.unsqueeze(-2)
    length = (along**2).sum(-1, keepdim=True).clamp(min=torch.finfo(points.dtype).tiny)
    share = ((offset * along).sum(-1, keepdim=True) / length).clamp(0, 1)
    return norm(offset - share * along)


WHOLE = {  # by the primitives' names
    "box": box, "sphere": sphere, "cylinder": capped_cylinder, "cone": capped_cone,
    "square": box, "circle": sphere, "triangle": triangle, "halfplane": half_plane,
}  # fmt: skip
ENDLESS = {"cylinder": cylinder, "cone": cone}  # without a height
