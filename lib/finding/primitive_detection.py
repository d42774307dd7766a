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

    beams  k programs for each picture;  truth  the program that drew it
    Raises ValueError where these are not tokens of so many programs, of a vocabulary of the plane, and where there is
    no true primitive of a kind.
    """
    _check(beams, truth, vocabulary)
    boxes = primitive_boxes(vocabulary)
    kinds = torch.tensor([list(KINDS).index(primitive.kind) for primitive in vocabulary.primitives])
    present, frequency = (_frequencies(tokens, vocabulary.stop) for tokens in (truth.unsqueeze(1), beams))
    found = {}
    for kind, name in enumerate(KINDS.values()):
        picture, primitive = (present * (kinds == kind)).nonzero(as_tuple=True)
        if not len(picture):
            raise ValueError(f"found no {name} in any true program; expected 1 or more of each kind")
        true = Boxes(picture, boxes[primitive])
        picture, primitive = (frequency * (kinds == kind)).nonzero(as_tuple=True)
        found[name] = average_precision(Boxes(picture, boxes[primitive], frequency[picture, primitive]), true)
    return found | {"mean": sum(found.values()) / len(found)}


def _check(beams: Tensor, truth: Tensor, vocabulary: Vocabulary) -> None:
    if not (isinstance(beams, Tensor) and isinstance(truth, Tensor)):
        found = f"a {type(beams).__name__} and a {type(truth).__name__}"
        raise ValueError(f"found {found}; expected tensors of tokens")
    if beams.ndim != 3 or not beams.shape[1] or truth.ndim != 2 or len(beams) != len(truth):
        found = f"programs {tuple(beams.shape)} and true ones {tuple(truth.shape)}"
        raise ValueError(f"found {found}; expected (n, k, length) and (n, length)")
    for tokens in (beams, truth):
        if tokens.dtype != torch.int64 or ((tokens < 0) | (tokens > vocabulary.stop)).any():
            raise ValueError(f"found other tokens than 0 to {vocabulary.stop} of torch.int64")


def primitive_boxes(vocabulary: Vocabulary) -> Float[Tensor, "primitives 4"]:
    """The box around the pixels of each primitive: left, top, right, bottom, px.

    Raises ValueError for a vocabulary of space.
    """
    if vocabulary.dimensions != 2:
        raise ValueError(f"found {vocabulary}; expected a vocabulary of the plane")
    images = unpack(vocabulary.canvases())
    spans = []
    for axis in (1, 2):  # which columns have a pixel, which rows
        there = images.any(axis).long()
        spans.append((there.argmax(1), there.shape[1] - there.flip(1).argmax(1)))
    (left, right), (top, bottom) = spans
    return torch.stack([left, top, right, bottom], 1).float()


def _frequencies(tokens: Int[Tensor, "n k length"], stop: int) -> Float[Tensor, "n primitives"]:
    """In which share of its k programs, which end at the first `$`, each primitive stands."""
    tokens = tokens.masked_fill((tokens == stop).cumsum(2) > 0, stop)
    there = torch.zeros((*tokens.shape[:2], stop + 1), dtype=torch.bool)
    there.scatter_(2, tokens, True)
    return there[..., : stop - 3].float().mean(1)
