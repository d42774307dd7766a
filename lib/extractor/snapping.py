"""Stage 4: name each box's axes after the directions they point in, and straighten what is nearly straight.

A box looks the same under 24 ways to call its axes right, top and front. We take the one that needs the smallest
turn from upright, because an attachment also turns a cuboid by as little as it can. Boxes within five degrees of
upright are put exactly upright (paper, section 5.1); for a thin bar with a square cross-section only the direction
of the bar counts, since its roll is arbitrary and hardly seen.
"""

from itertools import permutations, product

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..interpreters.cuboids import Cuboids
from .partgraph import Part, PartGraph, stack

UPRIGHT = 0.9961947  # cosine of five degrees (the paper's allowance; the authors' program: 0.995)
SQUARE = 0.1  # sides that differ by less than this share of the longer one make a square cross-section
THIN = 0.1  # sides below this share of its length make a bar thin (the authors' program straightens thick ones too)


def _turns() -> Float[Tensor, "24 3 3"]:
    """The rotations of a cube, the identity first: rows say which axis, and its sign, plays right, top, front."""
    matrices = [
        torch.diag(torch.tensor(signs, dtype=torch.float64))[list(order)]
        for order in permutations(range(3))
        for signs in product([1, -1], repeat=3)
    ]
    return torch.stack([matrix for matrix in matrices if torch.linalg.det(matrix) > 0])


TURNS = _turns()


def rename_axes(boxes: Cuboids) -> Cuboids:
    """The same boxes (n), with axes called right, top and front so that the turn from upright is smallest."""
    # The trace of a rotation is 1 + 2 cos(angle): the largest trace is the smallest turn.
    trace = torch.einsum("tij,nji->nt", TURNS, boxes.axes)
    best = (trace >= trace.amax(-1, keepdim=True) - 1e-9).double().argmax(-1)  # the first of equals
    turn = TURNS[best]
    return Cuboids((turn.abs() @ boxes.size.unsqueeze(-1)).squeeze(-1), boxes.center, turn @ boxes.axes)


def turning_axis(axes: Float[Tensor, "*n 3 3"]) -> Float[Tensor, "*n 3"]:
    """The unit axis about which each box turns from upright to `axes` (rows right, top, front)."""
    skewed = torch.stack(
        [
            axes[..., 1, 2] - axes[..., 2, 1],
            axes[..., 2, 0] - axes[..., 0, 2],
            axes[..., 0, 1] - axes[..., 1, 0],
        ],
        -1,
    )
    return skewed / skewed.norm(dim=-1, keepdim=True).clamp(min=1e-12)


def is_upright(boxes: Cuboids) -> Bool[Tensor, " n"]:
    """Which boxes, their axes renamed, count as standing upright in their frame."""
    straight = torch.diagonal(boxes.axes, dim1=-2, dim2=-1) >= UPRIGHT
    first, second = (
        boxes.size[:, [1, 2, 0]],
        boxes.size[:, [2, 0, 1]],
    )  # the cross-section across axis 0, 1, 2
    thicker = torch.maximum(first, second)
    square_bar = ((first - second).abs() < SQUARE * thicker) & (thicker < THIN * boxes.size)
    return straight.all(-1) | (square_bar & straight).any(-1)


def snap(boxes: Cuboids) -> Cuboids:
    """Boxes (n) with their axes renamed, and exactly upright where they nearly are."""
    named = rename_axes(boxes)
    upright = torch.eye(3, dtype=torch.float64).expand_as(named.axes)
    return Cuboids(
        named.size, named.center, torch.where(is_upright(named)[:, None, None], upright, named.axes)
    )


def snap_leaves(graph: PartGraph) -> PartGraph:
    """The graph with every leaf snapped to the world's axes."""
    snapped = iter(snap(stack(graph.root.leaves())))
    return graph.with_root(graph.root.map_leaves(lambda part: Part(part.label, next(snapped), (), part.id)))
