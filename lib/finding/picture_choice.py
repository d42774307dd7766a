"""Which of several programs draws a picture, or a grid of voxels, best. (CSGNet's beam search ends so.)"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from lib.interpreters.csg import execute_many, vocabulary_of
from lib.interpreters.csg.packing import SIDE
from lib.metrics.images import image_chamfer, iou

CANVASES_AT_ONCE = {2: 4096, 3: 64}  # little enough for memory


@dataclass(frozen=True)
class Choice:
    """For each target the best of its programs: tokens, its number among them, and the measure of all of them.

    measure  Chamfer distance, px, of pictures (16 for what cannot be executed); IoU of grids (0 for that)
    """

    tokens: Int[Tensor, "n length"]
    best: Int[Tensor, " n"]
    measure: Float[Tensor, "n k"]

    @property
    def of_best(self) -> Float[Tensor, " n"]:
        """The measure of the best program of each target."""
        return self.measure.gather(1, self.best.unsqueeze(1)).squeeze(1)


def best_of(targets: Bool[Tensor, "n *canvas"], tokens: Int[Tensor, "n k length"]) -> Choice:
    """The program nearest to each target: of least Chamfer distance in the plane, of greatest IoU in space.

    targets  images (64, 64) or grids (64, 64, 64);  tokens  k programs for each, in the networks' vocabulary
    Of equal ones the first. Raises ValueError where these are not k programs, one or more, for each target, and for
    targets that are not bool; ProgramError, which is one, for numbers that are no tokens.
    """
    tensors = isinstance(targets, Tensor) and isinstance(tokens, Tensor)
    canvases, programs = (tuple(each.shape) if tensors else () for each in (targets, tokens))
    if canvases[1:] not in ((SIDE,) * 2, (SIDE,) * 3) or len(programs) != 3 or programs[0] != canvases[0]:
        found = f"targets {canvases} and programs {programs}"
        if not tensors:
            found = f"targets in a {type(targets).__name__} and programs in a {type(tokens).__name__}"
        raise ValueError(
            f"found {found}; expected tensors (n, 64, 64) or (n, 64, 64, 64), and (n, k, length)"
        )
    if not programs[1]:
        raise ValueError("found 0 programs for each target; expected 1 or more")
    dimensions = targets.ndim - 1
    step = max(1, CANVASES_AT_ONCE[dimensions] // tokens.shape[1])
    parts = zip(targets.split(step), tokens.split(step))
    measure = torch.cat([_measured(*part, dimensions) for part in parts])
    best = measure.argmin(1) if dimensions == 2 else measure.argmax(1)
    return Choice(tokens[torch.arange(len(tokens)), best], best, measure)


def _measured(targets: Tensor, tokens: Tensor, dimensions: int) -> Float[Tensor, "n k"]:
    shapes = execute_many(tokens.flatten(0, 1), vocabulary_of(dimensions))
    repeated = targets.repeat_interleave(tokens.shape[1], 0)
    if dimensions == 3:
        return iou(repeated, shapes.grids, dims=3).masked_fill(~shapes.valid, 0).view(tokens.shape[:2])
    return image_chamfer(repeated, shapes.images).view(tokens.shape[:2])  # what is not valid is blank
