"""Stage 6: the boxes of inner parts, made anew from what they hold, and parts seen from the box they lie in.

After rearranging and shortening the boxes a file gave to inner parts no longer fit. Each is replaced, from the
leaves up, by the smallest box around its leaves among those that are turned like the world or like one of the leaves
(a smallest box around boxes has a face flush with some face or edge; these are the turns that furniture uses).
The root's box stands upright, and the whole shape is moved so that its center is the origin.
"""

from dataclasses import replace

import torch

from ..interpreters.cuboids import Cuboids
from .partgraph import Part, PartGraph, stack
from .snapping import rename_axes

WORTH_TURNING = 0.95  # a turned box must have less than this share of the upright one's volume


def refit(graph: PartGraph) -> PartGraph:
    """The graph with every inner box fitted to its leaves, centered at the origin."""
    bounds = graph.leaves.bounds()
    shift = -bounds.mean(0)

    def visit(part: Part) -> Part:
        if part.is_leaf:
            return replace(part, box=moved(part.box, shift))
        children = tuple(map(visit, part.children))
        return replace(part, children=children, box=enclosing_box(stack(part_leaves(children))))

    children = tuple(map(visit, graph.root.children))
    box = Cuboids(bounds[1] - bounds[0], torch.zeros(3).double(), torch.eye(3).double())
    return graph.with_root(replace(graph.root, children=children, box=box))


def part_leaves(parts: tuple[Part, ...]) -> list[Part]:
    return [leaf for part in parts for leaf in part.leaves()]


def moved(box: Cuboids, shift) -> Cuboids:
    return Cuboids(box.size, box.center + shift, box.axes)


def enclosing_box(boxes: Cuboids) -> Cuboids:
    """A small box (single) around boxes (n): upright, or turned like one of them where that saves enough."""
    axes = torch.cat([torch.eye(3, dtype=torch.float64).unsqueeze(0), boxes.axes])
    along = boxes.corners().reshape(-1, 3) @ axes.mT  # (turns, corners, 3)
    low, high = along.amin(1), along.amax(1)
    volume = (high - low).prod(-1)
    volume[0] *= WORTH_TURNING
    best = int((volume <= volume.min() * (1 + 1e-9)).double().argmax())  # the first of equals
    center = (low[best] + high[best]) / 2 @ axes[best]
    return rename_axes(Cuboids((high - low)[[best]], center.unsqueeze(0), axes[[best]]))[0]


def seen_from(box: Cuboids, part: Part) -> Part:
    """`part` and all below it in the frame of `box`: its center is the origin, its axes are x, y, z."""
    boxes = stack(list(part.walk()))
    inside = Cuboids(boxes.size, (boxes.center - box.center) @ box.axes.mT, boxes.axes @ box.axes.mT)
    own = rename_axes(inside[:1])  # what lies in it will be seen from these axes
    rows = iter([own[0], *inside[1:]])
    return map_boxes(part, lambda _: next(rows))


def map_boxes(part: Part, change) -> Part:
    """The same tree, `change` applied to each box, parents before children."""
    box = change(part.box)
    return replace(part, box=box, children=tuple(map_boxes(child, change) for child in part.children))
