"""Stage 0: is it a part graph that can be worked with? Files are checked when read; graphs made in memory are not."""

from dataclasses import replace

import torch

from ..interpreters.cuboids import Cuboids
from .arranging import collapse
from .boxes import AXIS_TOLERANCE, LARGEST, THINNEST
from .errors import RejectedError
from .nodes import MOST_LEVELS
from .partgraph import Part, PartGraph, stack

MOST_PARTS = 100  # leaves of a shape; a program declares at most 12, and a real one makes at most 51


def sound(graph: PartGraph) -> PartGraph:
    """The same graph in float64, axes right-handed. Raises RejectedError ("unsound", "empty", "too many cuboids")."""
    if _depth(graph.root) > MOST_LEVELS:
        raise RejectedError("unsound", f"more than {MOST_LEVELS} parts within parts")
    if graph.root.is_leaf:
        raise RejectedError("empty", "there are no parts below the root")
    leaves = [*graph.root.leaves(), *collapse(graph).root.leaves()]  # those that are, and those that will be
    if (count := len(graph.root.leaves())) > MOST_PARTS:
        raise RejectedError("too many cuboids", f"{count} parts; at most {MOST_PARTS} are looked at")
    boxes = stack(leaves)
    numbers = torch.cat([boxes.size, boxes.center, boxes.axes.flatten(1)], 1)
    if not numbers.isfinite().all() or numbers.abs().max() > LARGEST:
        raise RejectedError("unsound", f"a box has numbers that are not finite, or beyond {LARGEST:g}")
    if boxes.size.min() < THINNEST:
        raise RejectedError("unsound", f"a side of {float(boxes.size.min()):g}; at least {THINNEST:g}")
    crooked = (boxes.axes.double() @ boxes.axes.double().mT - torch.eye(3, dtype=torch.float64)).abs().max()
    if crooked > AXIS_TOLERANCE:
        raise RejectedError("unsound", "a box has axes that are not at right angles, or not of length 1")
    return graph.with_root(_in_double(graph.root))


def _depth(root: Part) -> int:
    """Levels of parts, counted without recursion."""
    depth, level = 0, [root]
    while level and depth <= MOST_LEVELS:
        depth, level = depth + 1, [child for part in level for child in part.children]
    return depth


def _in_double(part: Part) -> Part:
    box = part.box.detach().to("cpu", torch.float64)
    if torch.linalg.det(box.axes) < 0:  # a box looks the same with an axis pointing the other way
        box = Cuboids(
            box.size, box.center, box.axes * torch.tensor([[1.0], [1.0], [-1.0]], dtype=torch.float64)
        )
    return replace(part, box=box, children=tuple(map(_in_double, part.children)))
