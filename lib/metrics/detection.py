"""How well objects are detected in pictures: average precision, as the PASCAL VOC benchmark defines it since 2010.

Detections of one class are taken in the order of their scores. One is right if, of the true boxes of that class in its
picture, the one that it overlaps most has IoU >= 0.5, and no detection before it found that box. After each, precision
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
    scores (n,). Raises ValueError where these are not equally many."""

    picture: Int[Tensor, " n"]
    corners: Float[Tensor, "n 4"]
    scores: Float[Tensor, " n"] | None = None

    def __post_init__(self):
        n = len(self.picture)
        if tuple(self.corners.shape) != (n, 4) or (
            self.scores is not None and tuple(self.scores.shape) != (n,)
        ):
            scores = "no" if self.scores is None else tuple(self.scores.shape)
            found = f"corners {tuple(self.corners.shape)} and {scores} scores for {n} boxes"
            raise ValueError(f"found {found}; expected ({n}, 4) and ({n},)")


def box_iou(a: Float[Tensor, "*n 4"], b: Float[Tensor, "*n 4"]) -> Float[Tensor, "*n"]:
    """Overlap of boxes, pair by pair: area of the intersection by that of the union; 0 where both are empty.

    Raises ValueError unless boxes have four corners.
    """
    if a.shape[-1:] != (4,) or b.shape[-1:] != (4,):
        raise ValueError(f"found boxes {tuple(a.shape)} and {tuple(b.shape)}; expected (…, 4)")
    low, high = torch.maximum(a[..., :2], b[..., :2]), torch.minimum(a[..., 2:], b[..., 2:])
    both = (high - low).clamp(min=0).prod(-1)
    either = sum((each[..., 2:] - each[..., :2]).prod(-1) for each in (a, b)) - both
    return torch.where(either > 0, both / either, 0.0)


def average_precision(found: Boxes, true: Boxes, overlap: float = OVERLAP) -> float:
    """Average precision of one class, 0 to 1; see above. Detections with equal scores keep the order they came in.

    Raises ValueError for detections without scores or with one that is no number, and where there are no true boxes.
    """
    if not len(true.picture):
        raise ValueError("found no true boxes; expected 1 or more")
    if found.scores is None or found.scores.isnan().any():
        raise ValueError(f"found detections with scores {found.scores}; expected a number for each")
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
    taken: set[int] = set()
    right = torch.zeros(len(found.picture), dtype=torch.bool)
    for detection in found.scores.sort(descending=True, stable=True).indices.tolist():
        if not (there := boxes.get(int(found.picture[detection]))):
            continue
        overlaps = box_iou(found.corners[detection].expand(len(there), 4), true.corners[there])
        best = there[int(overlaps.argmax())]
        if overlaps.max() >= overlap and best not in taken:
            right[detection] = True
            taken.add(best)
    return right
