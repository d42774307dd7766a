"""What people give primitives and stumps, as tensors: any numbers, one field's, and the batch of several fields."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from .errors import ProgramError

Numbers = Tensor | Sequence[float] | float | None


def native(given):
    """An array as torch takes it, without negative strides and foreign byte orders; all else as it is."""
    if isinstance(given, np.ndarray):
        return np.array(given, dtype=given.dtype.newbyteorder("="), order="C")
    return given


def as_numbers(given: Numbers) -> Tensor:
    """A floating tensor stays what it is, all else becomes float64. Raises ProgramError for what are no numbers."""
    try:
        has_dtype = isinstance(given, Tensor | np.ndarray | np.generic)
        made = torch.as_tensor(native(given), dtype=None if has_dtype else torch.float64)
    except OverflowError:
        raise ProgramError(
            "found a number that is too large", expected="numbers in float64's range"
        ) from None
    except (TypeError, ValueError, RuntimeError):
        raise ProgramError(f"found {given!r:.40}", expected="numbers") from None
    if made.is_complex() or made.layout != torch.strided:
        found = f"found a tensor of {made.dtype}, {made.layout}"
        raise ProgramError(found, expected="real numbers, not sparse")
    return made if isinstance(given, Tensor) and made.is_floating_point() else made.double()


def model(given: Sequence[Numbers]) -> Tensor:
    """A tensor of the type and on the device that all should have: the first floating one's."""
    floating = (value for value in given if isinstance(value, Tensor) and value.is_floating_point())
    return next(floating, torch.zeros((), dtype=torch.float64))


def as_field(
    what: str, given: Numbers, width: int, is_rotation: bool, before: dict[str, torch.Size]
) -> tuple[Tensor, torch.Size]:
    """The numbers of one field, and the shape of its batch. Raises ProgramError for a wrong count of numbers.

    Sizes of width 1 are scalars; before: the batches of the fields before it.
    """
    value = as_numbers(given)
    if width == 1 and not is_rotation:
        return value, value.shape
    if width == 1 and (value.shape in before.values() or value.shape[-1:] != (1,)):
        value = value.unsqueeze(-1)  # in the plane one may write rotation=0.5
    if value.shape[-1:] != (width,):
        raise ProgramError(f"{what} has the shape {tuple(value.shape)}", expected=f"{width} numbers")
    return value, value.shape[:-1]


def shared_batch(name: str, batches: dict[str, torch.Size]) -> torch.Size:
    """The shape of the whole batch. Raises ProgramError for a field that does not broadcast to those before it."""
    batch = torch.Size()
    for key, shape in batches.items():
        try:
            if shape and shape != batch:
                batch = torch.broadcast_shapes(batch, shape) if batch else shape
        except RuntimeError:
            found = f"{key} of a {name} is a batch of shape {tuple(shape)}"
            raise ProgramError(found, expected=f"{tuple(batch)}, as before it, or a single one") from None
    return batch
