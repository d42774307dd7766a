"""What people ask shapes for, checked: points, resolutions, segments of a circle. Every language says the same."""

import operator

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

MOST_SEGMENTS = 1024  # corners of a full circle: a sphere of so many has half a million triangles


def whole(number) -> int | None:
    """The number as an int, numpy's and torch's too; None for what is no whole number: 2.0, True, a text."""
    try:
        return None if isinstance(number, bool) else operator.index(number)
    except TypeError:
        return None


def sizes(*numbers) -> bool:
    """Whether all are whole numbers, at least 1: what layers, lists and grids can be made of."""
    return all((whole(number) or 0) >= 1 for number in numbers)


def check_points(points, axes: str) -> Tensor:
    """(n, axes) numbers. Raises ValueError for everything else."""
    expected = f"(n, {len(axes)}) numbers: {', '.join(axes)}"
    found = f"a {type(points).__name__}"
    try:
        if isinstance(points, np.ndarray):  # torch takes neither negative strides nor foreign byte orders
            found = f"an array of {points.dtype}"
            points = np.ascontiguousarray(points, dtype=points.dtype.newbyteorder("="))
        made = torch.as_tensor(points)
        if not isinstance(points, Tensor | np.ndarray) and not made.is_complex():
            made = torch.as_tensor(points, dtype=torch.float64)  # what Python's own numbers are
    except (TypeError, ValueError, RuntimeError):
        raise ValueError(f"found {found}; expected points {expected}") from None
    if made.is_complex():
        raise ValueError(f"found complex points; expected {expected}")
    if made.ndim != 2 or made.shape[1] != len(axes):
        raise ValueError(f"found points of shape {tuple(made.shape)}; expected {expected}")
    return made


def check_resolution(resolution: int) -> int:
    """Cells along a side as an int. Raises ValueError for what cannot be one."""
    number = whole(resolution)
    if number is None or number < 1:
        raise ValueError(f"found a resolution of {resolution}; expected a whole number, at least 1")
    return number


def check_segments(segments: int) -> int:
    """The number of corners of a circle as an int. Raises ValueError for what cannot be one."""
    number = whole(segments)
    if number is None or number % 4 or not 4 <= number <= MOST_SEGMENTS:
        raise ValueError(f"found {segments} segments; expected a multiple of 4 from 4 to {MOST_SEGMENTS}")
    return number


def draw(points_on, surface, n: int, seed: int) -> Float[Tensor, "n d"]:
    """points_on(surface, n, seed) as a tensor. Raises ValueError for a count that is none."""
    number = whole(n)
    if number is None or number < 0:
        raise ValueError(f"found {n} points; expected a whole number, at least 0")
    return torch.from_numpy(points_on(surface, number, seed)).float()


def check_inside(made, error: type[ValueError]):
    """The rings or the mesh. Raises the language's error where there are none."""
    if not len(getattr(made, "faces", made)):
        raise error("the shape has no inside", expected="a program that leaves something over")
    return made
