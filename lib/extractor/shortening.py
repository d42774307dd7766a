"""Stage 5: leaves that run into others are shortened until they just touch (paper, Appendix C, "Part Shortening").

If a face lies inside another leaf, everything between it and where it would leave that leaf can be cut off without
changing what one sees. Where that is follows from geometry: the other leaf is convex, so a face that moves inward stays
inside it until the first of its four corners crosses a side. (The authors step a sampled face by one percent.)
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from ..interpreters.cuboids import Cuboids
from .arranging import prune
from .partgraph import PartGraph, stack

INSIDE = 0.005  # how far outside still counts as inside: a share of the longest side of the two leaves
OF_ITSELF = (
    0.2  # and at most this share of the leaf's thinnest side: a veneer does not vanish into what it lies on
)
WORTH_IT = 0.002  # cuts below this share of the leaf's side are left alone
DEEPEST = 0.3  # cuts beyond this share are left alone too: a part that is half buried does not end there
THINNEST = 0.01  # a leaf of which less than this share of its side would remain is hidden by the others

# (face, corner) -> local coordinates: faces left, right, bottom, top, back, front
_FACE_CORNERS = torch.stack([
    torch.tensor([[side if k == axis else other[(k - axis - 1) % 3] for k in range(3)]
                  for other in ((0, 0), (0, 1), (1, 0), (1, 1))], dtype=torch.float64)
    for axis in range(3) for side in (0, 1)
])  # fmt: skip


def shorten(graph: PartGraph) -> PartGraph:
    """The graph with its leaves shortened, the smallest first; leaves hidden inside another one are removed.

    Raises RejectedError ("empty") when nothing is left, which two equal boxes cannot cause.
    """
    leaves = graph.root.leaves()
    boxes, hidden = shorten_boxes(stack(leaves))
    changed = {id(leaf): replace(leaf, box=boxes[i]) for i, leaf in enumerate(leaves)}
    gone = {id(changed[id(leaf)]) for i, leaf in enumerate(leaves) if i in hidden}
    shortened = graph.with_root(graph.root.map_leaves(lambda part: changed[id(part)]))
    return prune(shortened, lambda part: id(part) not in gone) if gone else shortened


def shorten_boxes(boxes: Cuboids) -> tuple[Cuboids, set[int]]:
    """Boxes (n) shortened where they run into one another, and which of them are hidden inside another."""
    affected = (_cuts(boxes, boxes) > WORTH_IT).any(-1).any(-1)
    hidden: set[int] = set()
    size, center = boxes.size.clone(), boxes.center.clone()
    for i in boxes.volume().argsort(stable=True).tolist():
        if not affected[i]:
            continue
        others = [k for k in range(len(boxes)) if k != i and k not in hidden]
        box, rest = Cuboids(size, center, boxes.axes)[[i]], Cuboids(size, center, boxes.axes)[others]
        cut = _cuts(box, rest, same=False)[0].amax(0) if others else torch.zeros(6).double()
        low, high = cut[0::2], cut[1::2]  # at the left, bottom, back and at the right, top, front face
        if bool((low + high > 1 - THINNEST).any()):
            hidden.add(i)
            continue
        low, high = (torch.where((side > WORTH_IT) & (side < DEEPEST), side, 0.0) for side in (low, high))
        size[i] = box.size[0] * (1 - low - high)
        center[i] = box.center[0] + ((low - high) / 2 * box.size[0]) @ boxes.axes[i]
    return Cuboids(size, center, boxes.axes), hidden


def _cuts(boxes: Cuboids, others: Cuboids, same: bool = True) -> Float[Tensor, "n m 6"]:
    """By which share of its side each face of each box can move inward while it lies inside each other box.

    0 where the face does not lie inside; `same`: the two batches are one, and no box cuts itself.
    """
    corners = boxes.world_many(_FACE_CORNERS.flatten(0, 1))  # (n, 24, 3)
    axis = torch.arange(6) // 2
    inward = boxes.axes * boxes.size.unsqueeze(-1)  # (n, axis, 3): all the way to the opposite face
    inward = inward[:, axis] * (1 - 2 * (torch.arange(6) % 2)).view(1, 6, 1)
    offset = corners.unsqueeze(1) - others.center.view(1, -1, 1, 3)  # (n, m, 24, 3)
    q = torch.einsum("nmck,mik->nmci", offset, others.axes).unflatten(2, (6, 4))  # (n, m, face, corner, axis)
    step = torch.einsum("nfk,mik->nmfi", inward, others.axes).unsqueeze(3)
    half = others.size.view(1, -1, 1, 1, 3) / 2
    longest = torch.maximum(boxes.size.amax(-1)[:, None], others.size.amax(-1))[..., None]  # (n, m, 1)
    allowed = torch.minimum(INSIDE * longest, OF_ITSELF * boxes.size.amin(-1)[:, None, None])  # (n, m, 1)
    inside = (q.abs() <= half + allowed[..., None, None]).all(-1).all(-1)
    # Each coordinate reaches its far side after (side - q) / step of the way.
    still = step.abs() < 1e-9 * longest[..., None, None]
    leave = torch.where(still, torch.inf, (half * step.sign() - q) / torch.where(still, 1.0, step))
    cut = torch.where(inside, leave.amin(-1).amin(-1).clamp(0, 1), 0.0)
    return cut * ~torch.eye(len(boxes), dtype=torch.bool).unsqueeze(-1) if same else cut
