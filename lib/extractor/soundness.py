"""Stage 0: is it a part graph that can be worked with? Files are checked when read; graphs made in memory are not."""

from dataclasses import replace

import torch

from .boxes import LARGEST, THINNEST
from .errors import RejectedError
from .nodes import MOST_LEVELS
from .partgraph import Part, PartGraph, stack

MOST_PARTS = 200  # leaves of a shape; PartNet's shapes have a tenth of that


def sound(graph: PartGraph) -> PartGraph:
    """The same graph in float64. Raises RejectedError ("unsound", "too many cuboids")."""
    if _depth(graph.root) > MOST_LEVELS:
        raise RejectedError("unsound", f"more than {MOST_LEVELS} parts within parts")
    leaves = graph.root.leaves()
    if len(leaves) > MOST_PARTS:
        raise RejectedError("too many cuboids", f"{len(leaves)} parts; at most {MOST_PARTS} are looked at")
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
    children = tuple(map(_in_double, part.children))
    return replace(part, box=part.box.detach().to("cpu", torch.float64), children=children)
