"""Stump -> shape, one or many."""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from .bounds import window as window_of
from .errors import ProgramError
from .program import Stump
from .shape import Shape


def execute(program: Stump, window: Float[Tensor, "2 d"] | Sequence | None = None) -> Shape:
    """The shape of one stump. window: see Shape. Raises ProgramError for what is no Stump, and for no window."""
    if not isinstance(program, Stump):
        raise ProgramError(f"found a {type(program).__name__}", expected="a Stump, see parse(text)")
    return Shape(
        program, window_of(program) if window is None else torch.as_tensor(window, dtype=torch.float64)
    )
