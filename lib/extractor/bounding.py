"""Stage 6: the boxes of inner parts, made anew from what they hold, and parts seen from the box they lie in.

After rearranging and shortening the boxes a file gave to inner parts no longer fit. Each is replaced by a tight box
around its leaves. It stands upright, unless more than half of its leaves lean alike: then it leans with them, as the
back of a chair, and its leaves are upright in it. (The authors' program takes the box of smallest volume, which also
turns around parts that only happen to lie across each other.) Turning about the vertical does not count as leaning:
what holds a part is mostly above and below it, and says nothing about such a turn. The root's box stands upright,
and the whole shape is moved so that its center is the origin.
"""

from collections.abc import Sequence
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from ..interpreters.cuboids import Cuboids
from ..interpreters.shapeassembly.attaching import choose
from .partgraph import Part, PartGraph, stack
from .snapping import UPRIGHT, rename_axes, turning_axis

LEANING = 0.5  # how vertical (cosine) the axis of a turn may be to count as leaning


def refit(graph: PartGraph) -> PartGraph:
    """The graph with every inner box fitted to its leaves, centered at the origin."""
    graph = centered(graph)
    bounds = graph.leaves.bounds()

    def visit(part: Part) -> Part:
        if part.is_leaf:
            return part
        children = tuple(map(visit, part.children))
        return replace(part, children=children, box=enclosing_box(stack(part_leaves(children))))

    children = tuple(map(visit, graph.root.children))
    box = Cuboids(bounds[1] - bounds[0], torch.zeros(3).double(), torch.eye(3).double())
    return graph.with_root(replace(graph.root, children=children, box=box))


def part_leaves(parts: tuple[Part, ...]) -> list[Part]:
    return [leaf for part in parts for leaf in part.leaves()]


def centered(graph: PartGraph) -> PartGraph:
    """The graph moved so that the middle of its bounds is the origin."""
    middle = graph.leaves.bounds().mean(0)
    return graph.with_root(
        map_boxes(graph.root, lambda box: Cuboids(box.size, box.center - middle, box.axes))
    )


def enclosing_box(boxes: Cuboids) -> Cuboids:
    """A tight box (single) around boxes (n): upright, or leaning as more than half of them do."""
    axes = _common_axes(boxes)
    along = boxes.corners().reshape(-1, 3) @ axes.mT
    low, high = along.amin(0), along.amax(0)
    return rename_axes(Cuboids((high - low)[None], ((low + high) / 2 @ axes)[None], axes[None]))[0]


def _common_axes(boxes: Cuboids) -> Float[Tensor, "3 3"]:
    upright = torch.eye(3, dtype=torch.float64)
    axes = torch.cat([upright[None], boxes.axes])
    seen = (
        (boxes.axes.unsqueeze(0) @ axes.mT.unsqueeze(1)).abs().amax(-1)
    )  # how straight each box is in each frame
    leaning = turning_axis(rename_axes(boxes).axes)[:, 1].abs() < LEANING
    alike = (seen >= UPRIGHT).all(-1).sum(-1) * torch.cat(
        [torch.ones(1, dtype=torch.bool), leaning]
    )  # (n + 1)
    best = int(alike.argmax())  # the first of equals: upright before turned
    return axes[best] if 2 * alike[best] > len(boxes) else upright


def seen_from(box: Cuboids, parts: Sequence[Part]) -> list[Part]:
    """`parts` and all below them in the frame of `box`: its center is the origin, its axes are x, y, z."""
    tops = [sum(1 for _ in part.walk()) for part in parts]
    boxes = stack([below for part in parts for below in part.walk()])
    inside = Cuboids(boxes.size, (boxes.center - box.center) @ box.axes.mT, boxes.axes @ box.axes.mT)
    named = rename_axes(inside)  # what lies in a part will be seen from these axes
    start = torch.tensor([0, *tops]).cumsum(0)[:-1]
    own = torch.zeros(len(boxes), dtype=torch.bool)
    own[start] = True
    rows = iter(choose(own, named, inside))
    return [map_boxes(part, lambda _: next(rows)) for part in parts]


def map_boxes(part: Part, change) -> Part:
    """The same tree, `change` applied to each box, parents before children."""
    box = change(part.box)
    return replace(part, box=box, children=tuple(map_boxes(child, change) for child in part.children))
