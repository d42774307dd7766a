"""Stage 0: is it a part graph that can be worked with? Files are checked when read; graphs made in memory are not."""

from dataclasses import replace

import torch

from ..interpreters.cuboids import Cuboids
from .arranging import collapse
from .boxes import LARGEST, THINNEST
from .errors import RejectedError
from .nodes import MOST_LEVELS
from .partgraph import Part, PartGraph, stack

MOST_PARTS = 200  # leaves of a shape; PartNet's shapes have a tenth of that


def sound(graph: PartGraph) -> PartGraph:
    """The same graph in float64, all axes right-handed. Raises RejectedError ("unsound", "too many cuboids")."""
    if _depth(graph.root) > MOST_LEVELS:
        raise RejectedError("unsound", f"more than {MOST_LEVELS} parts within parts")
    leaves = [*graph.root.leaves(), *collapse(graph).root.leaves()]  # those that are, and those that will be
    if (count := len(graph.root.leaves())) > MOST_PARTS:
        raise RejectedError("too many cuboids", f"{count} parts; at most {MOST_PARTS} are looked at")
    boxes = stack(leaves)
    numbers = torch.cat([boxes.size, boxes.center, boxes.axes.flatten(1)], 1)
    if not numbers.isfinite().all() or numbers.abs().max() > LARGEST:
        raise RejectedError("unsound", f"a box has numbers that are not finite, or beyond {LARGEST:g}")
    if boxes.size.min() < THINNEST:
        raise RejectedError("unsound", f"a side of {float(boxes.size.min()):g}; at least {THINNEST:g}")
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
