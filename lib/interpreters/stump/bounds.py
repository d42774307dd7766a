"""How far a stump reaches, told from its primitives' boxes: a box that holds the shape, seldom the smallest one.

A node lies in the common part of the boxes of its primitives that are not complemented, the shape in the hull of its
united nodes. Where that goes on for ever, in some direction, the shape is looked at through a window. All numbers here
are float64 on the processor, wherever the primitives are.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from .poses import matrices
from .primitives import Box, Circle, Cone, Cylinder, HalfPlane, Primitive, Sphere, Square, Triangle
from .program import Stump

REACH = 0.5  # shapes of diagonal 1 around the origin lie within
_MARGIN = 1.25
_STRAIGHT = 1e-9  # a boundless cylinder so little off an axis, by rounding, follows it


def window(stump: Stump) -> Float[Tensor, "2 d"]:
    """Lowest and highest coordinates to look at: the bounds, where they are finite.

    Where the shape goes on for ever, and where there is no shape: -REACH and REACH, or a quarter more than the farthest
    coordinate of a primitive, complemented ones included, if that is farther out.
    """
    low, high = bounds(stump)
    boxes = torch.stack([primitive_bounds(primitive) for primitive in stump.primitives])
    places = torch.stack([primitive.translation.detach().cpu().double() for primitive in stump.primitives])
    farthest = torch.cat([boxes[boxes.isfinite()], places.flatten()]).abs().max()
    reach = max(REACH, _MARGIN * float(farthest))
    return torch.stack([torch.where(low.isfinite(), low, -reach), torch.where(high.isfinite(), high, reach)])


def bounds(stump: Stump) -> Float[Tensor, "2 d"]:
    """Lowest and highest coordinates that the shape may have, perhaps infinite; NaN where there is no shape."""
    boxes = torch.stack([primitive_bounds(primitive) for primitive in stump.primitives])  # (K, 2, d)
    complement, intersection, union = (matrix.cpu() for matrix in stump.matrices)
    boxes[complement] = boxes.new_tensor([-torch.inf, torch.inf]).unsqueeze(-1)
    nodes = []
    for column in intersection[:, union].T:
        low = boxes[column, 0].amax(0) if column.any() else boxes.new_full((stump.dimensions,), -torch.inf)
        high = boxes[column, 1].amin(0) if column.any() else -low
        if (low <= high).all():
            nodes.append(torch.stack([low, high]))
    if not nodes:
        return boxes.new_full((2, stump.dimensions), torch.nan)
    nodes = torch.stack(nodes)
    return torch.stack([nodes[:, 0].amin(0), nodes[:, 1].amax(0)])


def primitive_bounds(primitive: Primitive) -> Float[Tensor, "2 d"]:
    """Lowest and highest coordinates of one primitive, perhaps infinite."""
    single = primitive.to("cpu", torch.float64)
    axes = matrices(single.rotation.detach())  # rows: the primitive's own axes in the world
    center, reach = _extent(single, axes)
    return torch.stack([center - reach, center + reach])


def _extent(p: Primitive, axes: Tensor) -> tuple[Tensor, Tensor]:
    """The middle of a primitive's box and half of its sides."""
    middle, sizes = p.translation.detach(), p.sizes.detach().abs()
    endless = torch.full_like(middle, torch.inf)
    if isinstance(p, Box | Square):
        return middle, (sizes.unsqueeze(-1) * axes).abs().sum(0)
    if isinstance(p, Sphere | Circle):
        return middle, sizes.expand_as(middle)
    if isinstance(p, Triangle):
        left, right, height = sizes.tolist()
        corners = middle + middle.new_tensor([[-left, 0], [right, 0], [0, height]]) @ axes
        return (corners.amin(0) + corners.amax(0)) / 2, (corners.amax(0) - corners.amin(0)) / 2
    if isinstance(p, Cylinder):
        along, disc = axes[2].abs(), (1 - axes[2] ** 2).clamp(min=0).sqrt() * sizes[0]
        if p.height is None:  # bounded only across an axis that it follows exactly
            return middle, torch.where(along < _STRAIGHT, disc, torch.inf)
        return middle, along * sizes[1] / 2 + disc
    if isinstance(p, Cone) and p.height is not None:
        disc = (1 - axes[2] ** 2).clamp(min=0).sqrt() * sizes[0] * sizes[1]
        base = middle + axes[2] * sizes[1]
        low, high = torch.minimum(middle, base - disc), torch.maximum(middle, base + disc)
        return (low + high) / 2, (high - low) / 2
    if isinstance(p, Cone | HalfPlane):
        return torch.zeros_like(middle), endless
    raise TypeError(f"found a {type(p).__name__}; expected one of the eight primitives")
