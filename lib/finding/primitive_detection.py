"""Primitives as detected objects: a program's primitives, whatever its operations do with them (CSGNet, section 4.3.2).

    truth        the different primitives of the program that drew a picture
    detections   the primitives of k programs that beam search found; the score of one is the share of these programs
                 in which it stands

A box goes around the pixels of a primitive: left, top and one past right and bottom, px.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from lib.interpreters.csg import Vocabulary
from lib.interpreters.csg.packing import unpack
from lib.metrics.detection import Boxes, average_precision

KINDS = {"c": "circle", "s": "square", "t": "triangle"}


def detection_precision(
    beams: Int[Tensor, "n k length"], truth: Int[Tensor, "n length"], vocabulary: Vocabulary
) -> dict[str, float]:
    """Average precision of each kind of primitive in the plane, by name, and their mean, 0 to 1; by IoU 0.5 of boxes.

    Raises ValueError where there is no true primitive of a kind.
    """
    boxes = primitive_boxes(vocabulary)
    kinds = torch.tensor([list(KINDS).index(primitive.kind) for primitive in vocabulary.primitives])
    present, frequency = (_frequencies(tokens, len(kinds)) for tokens in (truth.unsqueeze(1), beams))
    found = {}
    for kind, name in enumerate(KINDS.values()):
        picture, primitive = (frequency * (kinds == kind)).nonzero(as_tuple=True)
        detected = Boxes(picture, boxes[primitive], frequency[picture, primitive])
        picture, primitive = (present * (kinds == kind)).nonzero(as_tuple=True)
        found[name] = average_precision(detected, Boxes(picture, boxes[primitive]))
    return found | {"mean": sum(found.values()) / len(found)}


def primitive_boxes(vocabulary: Vocabulary) -> Float[Tensor, "primitives 4"]:
    """The box around the pixels of each primitive of the plane: left, top, right, bottom, px."""
    images = unpack(vocabulary.canvases())
    spans = []
    for axis in (1, 2):  # which columns have a pixel, which rows
        there = images.any(axis).long()
        spans.append((there.argmax(1), there.shape[1] - there.flip(1).argmax(1)))
    (left, right), (top, bottom) = spans
    return torch.stack([left, top, right, bottom], 1).float()


def _frequencies(tokens: Int[Tensor, "n k length"], primitives: int) -> Float[Tensor, "n primitives"]:
    """In which share of its k programs each primitive stands."""
    there = torch.zeros((*tokens.shape[:2], primitives + 4), dtype=torch.bool)
    there.scatter_(2, tokens, True)
    return there[..., :primitives].float().mean(1)
