"""How well objects are detected in pictures: average precision, as the PASCAL VOC benchmark defines it since 2010.

Detections of one class are taken in the order of their scores. One is right if a box of that class in its picture that
no detection before it took overlaps it by IoU >= 0.5; it takes the one with the largest overlap. After each, precision
is the share of right ones so far, recall the share of the true boxes found. Average precision is the area below the
precision, made falling from the right, over recall: 1 if all are found before anything wrong.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

OVERLAP = 0.5


@dataclass(frozen=True)
class Boxes:
    """Boxes of one class in many pictures: picture (n,), corners (n, 4) left, top, right, bottom, px, and perhaps
    scores (n,)."""

    picture: Int[Tensor, " n"]
    corners: Float[Tensor, "n 4"]
    scores: Float[Tensor, " n"] | None = None


def box_iou(a: Float[Tensor, "*n 4"], b: Float[Tensor, "*n 4"]) -> Float[Tensor, "*n"]:
    """Overlap of boxes, pair by pair: area of the intersection by that of the union; 0 where both are empty."""
    low, high = torch.maximum(a[..., :2], b[..., :2]), torch.minimum(a[..., 2:], b[..., 2:])
    both = (high - low).clamp(min=0).prod(-1)
    either = sum((each[..., 2:] - each[..., :2]).prod(-1) for each in (a, b)) - both
    return torch.where(either > 0, both / either, 0.0)


def average_precision(found: Boxes, true: Boxes, overlap: float = OVERLAP) -> float:
    """Average precision of one class, 0 to 1; see above. Detections with equal scores keep the order they came in.

    Raises ValueError for detections without scores, and where there are no true boxes.
    """
    if found.scores is None or not len(true.picture):
        raise ValueError(
            f"found {len(true.picture)} true boxes, scores {found.scores}; expected one or more of both"
        )
    right = _right(found, true, overlap)
    order = found.scores.sort(descending=True, stable=True).indices
    hits = right[order].cumsum(0).double()
    precision = hits / torch.arange(1, len(hits) + 1)
    falling = precision.flip(0).cummax(0).values.flip(0)
    return float((falling * right[order]).sum() / len(true.picture))


def _right(found: Boxes, true: Boxes, overlap: float) -> Tensor:
    """Which detections are right; each true box counts once."""
    boxes: dict[int, list[int]] = {}
    for number, picture in enumerate(true.picture.tolist()):
        boxes.setdefault(picture, []).append(number)
    right = torch.zeros(len(found.picture), dtype=torch.bool)
    for detection in found.scores.sort(descending=True, stable=True).indices.tolist():
        free = boxes.get(int(found.picture[detection]), [])
        if not free:
            continue
        overlaps = box_iou(found.corners[detection].expand(len(free), 4), true.corners[free])
        best = int(overlaps.argmax())
        if overlaps[best] >= overlap:
            right[detection] = True
            free.pop(best)
    return right
