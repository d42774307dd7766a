"""From the twelve numbers of each part to oriented boxes (see parsing.py for what the numbers are)."""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from ..interpreters.cuboids import Cuboids, cross
from .errors import PartGraphError
from .nodes import Node, shown

LARGEST = 1e6  # of any number in a box
THINNEST = 1e-9  # side of a box; below it, local coordinates lose their meaning
AXIS_ROUNDING = 1e-4  # how far lengths may be from 1 and cosines from 0 before anybody is told
AXIS_TOLERANCE = 1e-2  # how far before the axes count as wrong instead of rounded
BOX_NUMBERS = ["center x", "center y", "center z", "side 1", "side 2", "side 3"] + [
    f"axis {axis} {coordinate}" for axis in "12" for coordinate in "xyz"
]
_ANY_BOX = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]  # stands where a file has none


def oriented_boxes(nodes: list[Node]) -> tuple[Cuboids, list[Node]]:
    """The boxes of all parts, (n,), and the parts whose axes had to be repaired by more than rounding."""
    numbers = [_numbers(node) for node in nodes]
    table = torch.tensor([row or _ANY_BOX for row in numbers], dtype=torch.float64)  # (n, 12)
    axes, off = _orthonormal(table[:, 6:9], table[:, 9:])
    for at in (off > AXIS_TOLERANCE).nonzero().flatten().tolist():
        raise _axes_error(nodes[at], numbers[at][6:9], numbers[at][9:])
    boxes = Cuboids(table[:, 3:6], table[:, :3], axes)
    missing = [at for at, row in enumerate(numbers) if row is None]
    if missing:
        boxes = _with_bounds(boxes, nodes, missing)
    return boxes, [nodes[at] for at in (off > AXIS_ROUNDING).nonzero().flatten().tolist()]


def _numbers(node: Node) -> list[float] | None:
    """The twelve numbers of a part's box, or None for an inner part without one."""
    box = node.get("box")
    if box is None and node.get("children"):
        return None
    if box is None:
        raise node.error("a leaf without a box", f"{len(BOX_NUMBERS)} numbers")
    if not isinstance(box, list | tuple) or len(box) != len(BOX_NUMBERS):
        raise node.error(f"the box is {shown(box)}", f"a list of {len(BOX_NUMBERS)} numbers")
    for name, number in zip(BOX_NUMBERS, box):
        if not isinstance(number, int | float) or isinstance(number, bool):
            raise node.error(f"{name} of the box is {shown(number)}", "a number")
        if not abs(number) <= LARGEST:  # NaN is caught here too
            raise node.error(f"{name} of the box is {shown(number)}", f"a finite number, at most {LARGEST:g}")
        if name.startswith("side") and number < THINNEST:
            raise node.error(f"{name} of the box is {shown(number)}", "a length above 0")
    return [float(number) for number in box]


def _orthonormal(
    first: Float[Tensor, "n 3"], second: Float[Tensor, "n 3"]
) -> tuple[Float[Tensor, "n 3 3"], Float[Tensor, " n"]]:
    """Right-handed unit axes, and how far the given two were from that: in length, or in the cosine between them."""
    lengths = torch.stack([first.norm(dim=-1), second.norm(dim=-1)], -1)  # (n, 2)
    first = first / lengths[:, :1].clamp(min=THINNEST)
    second = second / lengths[:, 1:].clamp(min=THINNEST)
    cosine = (first * second).sum(-1, keepdim=True)
    off = torch.cat([lengths - 1, cosine], -1).abs().amax(-1)
    second = torch.nn.functional.normalize(second - cosine * first, dim=-1)
    return torch.stack([first, second, cross(first, second)], -2), off


def _axes_error(node: Node, first: list[float], second: list[float]) -> PartGraphError:
    for name, axis in (("axis 1", first), ("axis 2", second)):
        if abs(math.hypot(*axis) - 1) > AXIS_TOLERANCE:
            return node.error(f"{name} of the box has length {math.hypot(*axis):.4g}", "a length of 1")
    cosine = sum(a * b for a, b in zip(first, second)) / (math.hypot(*first) * math.hypot(*second))
    angle = math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
    return node.error(f"{angle:.4g} degrees between axis 1 and axis 2 of the box", "90 degrees")


def _with_bounds(boxes: Cuboids, nodes: list[Node], missing: list[int]) -> Cuboids:
    """The boxes, those of `missing` inner parts replaced by the bounds of their leaves."""
    corners = boxes.corners()
    low, high = corners.amin(-2), corners.amax(-2)  # (n, 3)
    inner = torch.tensor([bool(node.get("children")) for node in nodes])
    low[inner], high[inner] = math.inf, -math.inf
    number = {node: at for at, node in enumerate(nodes)}
    for at in reversed(range(1, len(nodes))):  # children before parents
        parent = number[nodes[at].parent]
        low[parent], high[parent] = torch.minimum(low[parent], low[at]), torch.maximum(high[parent], high[at])
    size, center, axes = boxes.size.clone(), boxes.center.clone(), boxes.axes
    size[missing], center[missing] = (high - low)[missing], (high + low)[missing] / 2
    return Cuboids(size, center, axes)
