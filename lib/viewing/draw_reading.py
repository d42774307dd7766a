"""A drawing read by a CSGNet: beam search, the nearest of its programs, and then better numbers, sweep by sweep.

reading = read(network, image)        what the network wrote
reading = improved(reading)           after one sweep of refinement; the same one, `done`, when nothing was better
reading = finished(reading)           after all sweeps
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool
from torch import Tensor

from lib.finding.picture_choice import best_of
from lib.finding.picture_refining import LEAST_GAIN, MOST_SWEEPS, refine
from lib.interpreters.csg import Program, vocabulary_of
from lib.interpreters.threads import one_thread
from lib.models.csgnet import SIDE, CSGNet, check_reader
from lib.models.csgnet_beams import beam_search
from lib.viewing.canvas import image_of

BEAMS = 10
HINT = "Draw a filled shape with the mouse, a finger or the keys, or choose an example."


class DrawingError(ValueError):
    """A drawing that cannot be read; the message says what to do."""


@dataclass(frozen=True, eq=False)
class Reading:
    """What was found for one drawing.

    image      the drawing, image[y, x]
    programs   the network's, then the better one after each sweep of refinement
    distances  of their pictures from the drawing, Chamfer distance, px
    done       a sweep found nothing better
    """

    image: Bool[Tensor, "64 64"]
    programs: tuple[Program, ...]
    distances: tuple[float, ...]
    done: bool = False

    @property
    def sweeps(self) -> int:
        """How many sweeps made it better."""
        return len(self.programs) - 1


def check_network(network: CSGNet) -> None:
    """Raises TypeError for what is no CSGNet, ValueError for one of space or with another vocabulary."""
    if not isinstance(network, CSGNet):
        raise TypeError(f"found a {type(network).__name__}; expected a CSGNet")
    check_reader(network, 2)


def drawing_of(picture) -> Bool[Tensor, "64 64"]:
    """The pixels of a picture, a program, its text, or an image[y, x], blank or not. Raises ValueError or TypeError."""
    image = image_of(picture)
    if image.shape != (SIDE, SIDE):
        raise ValueError(f"found an image {image.shape}; expected ({SIDE}, {SIDE})")
    return torch.from_numpy(image.copy())


@one_thread()
@torch.no_grad()
def read(network: CSGNet, picture, k: int = BEAMS) -> Reading:
    """The nearest of the k likeliest programs for a drawing. The network's mode, training or not, stays as it was.

    Raises DrawingError for a drawing without an outline, else what `check_network` and `drawing_of` raise.
    """
    check_network(network)
    image = drawing_of(picture)
    if not image.any():
        raise DrawingError(HINT)
    if image.all():
        raise DrawingError("The whole canvas is inked, so there is no outline to read: erase some of it.")
    training, device = network.training, next(network.parameters()).device
    network.eval()
    try:
        tokens = beam_search(network, image[None].to(device), k).tokens.cpu()
    finally:
        network.train(training)
    choice = best_of(image[None], tokens)
    distance = choice.of_best.item()
    return Reading(image, (vocabulary_of(2).program(choice.tokens[0]),), (distance,), done=distance == 0)


def improved(reading: Reading) -> Reading:
    """The reading after one more sweep of refinement."""
    found = refine(reading.programs[-1:], reading.image[None], sweeps=1)
    distance = found.distances[-1].item()
    if not distance < reading.distances[-1] - LEAST_GAIN:
        return replace(reading, done=True)
    programs, distances = (*reading.programs, *found.programs), (*reading.distances, distance)
    return Reading(reading.image, programs, distances, done=distance == 0 or len(programs) > MOST_SWEEPS)


def finished(reading: Reading) -> Reading:
    """The reading after all sweeps that make it better."""
    while not reading.done:
        reading = improved(reading)
    return reading
