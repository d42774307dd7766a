"""Stump -> shape, one or many; many answer together."""

import operator
from collections.abc import Iterator, Sequence

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..checks import check_points
from ..threads import one_thread
from . import layers
from .bounds import window as window_of
from .errors import ProgramError
from .primitives import Batches
from .program import Stump
from .shape import Picture, Shape, Solid, step

Window = Float[Tensor, "2 d"] | Sequence | None
_CELLS = 1 << 24  # of the padded matrices of the stumps that answer in one go


def execute(program: Stump, window: Window = None) -> Shape:
    """The shape of one stump: a Picture or a Solid. window: see Shape.

    Raises ProgramError for what is no Stump, and for no window.
    """
    if not isinstance(program, Stump):
        raise ProgramError(f"found a {type(program).__name__}", expected="a Stump, see parse(text)")
    window = window_of(program) if window is None else _checked(window, program.dimensions)
    return (Solid if program.dimensions == 3 else Picture)(program, window)


def execute_many(programs: Sequence[Stump], window: Window = None) -> "Shapes":
    """The shapes of many stumps, in order; window: one for all, else each has its own.

    Raises ProgramError for what are no Stumps, for Stumps of both dimensions or on two devices, and for no window.
    """
    if isinstance(programs, Stump):
        raise ProgramError("found one Stump", expected="a sequence of them, or execute(stump)")
    if isinstance(programs, str) or not hasattr(programs, "__iter__"):
        found = f"found a {type(programs).__name__}"
        raise ProgramError(found, expected="a sequence of Stumps, see parse(text)")
    programs = tuple(programs)
    for place, program in enumerate(programs):
        _check_item(program, place, programs[0])
    if window is not None and programs:
        window = _checked(window, programs[0].dimensions)
    return Shapes(programs, window)


def _check_item(program, place: int, first: Stump) -> None:
    if not isinstance(program, Stump):
        found = f"item {place} is a {type(program).__name__}"
        raise ProgramError(found, expected="a Stump, see parse(text)")
    if program.dimensions != first.dimensions:
        found = f"item {place} has {program.dimensions} dimensions"
        raise ProgramError(found, expected=f"{first.dimensions}, as the first one has")
    if _device(program) != _device(first):
        found = f"item {place} is on {_device(program)}"
        raise ProgramError(found, expected=f"{_device(first)}, where the first one is")


def _device(program: Stump) -> torch.device:
    return program.primitives[0].translation.device


def _checked(window, dimensions: int) -> Float[Tensor, "2 d"]:
    """The window in float64. Raises ProgramError for what is none."""
    expected = f"lowest and highest coordinates, (2, {dimensions}) finite numbers, low < high"
    try:
        window = torch.as_tensor(window, dtype=torch.float64, device="cpu")
    except (TypeError, ValueError, RuntimeError):
        raise ProgramError(f"the window is {window!r:.40}", expected=expected) from None
    if window.shape != (2, dimensions):
        raise ProgramError(f"the window has the shape {tuple(window.shape)}", expected=expected)
    if not (window.isfinite().all() and (window[0] < window[1]).all()):
        raise ProgramError(f"the window is {window.tolist()}", expected=expected)
    return window


class Shapes(Sequence):
    """Executed stumps: `shapes[i]` is a Shape, `shapes[2:5]` are Shapes."""

    def __init__(self, programs: tuple[Stump, ...], window: Float[Tensor, "2 d"] | None):
        self.programs, self.window = programs, window

    def __len__(self) -> int:
        return len(self.programs)

    def __getitem__(self, index):
        """A number gives a Shape; a slice, or a tensor of numbers or of bools, gives Shapes."""
        if isinstance(index, slice):
            return Shapes(self.programs[index], self.window)
        if isinstance(index, Tensor) and index.ndim == 1:
            chosen = torch.arange(len(self))[index.cpu()].tolist()
            return Shapes(tuple(self.programs[i] for i in chosen), self.window)
        index = operator.index(index)
        if not -len(self) <= index < len(self):
            raise IndexError(f"shape {index} of {len(self)}")
        return execute(self.programs[index], self.window)

    def __repr__(self) -> str:
        return f"Shapes({len(self)} stumps)"

    @one_thread()
    @torch.no_grad()
    def occupancy(self, points) -> Bool[Tensor, "stumps m"]:
        """Is each point (m, d) inside each shape, surfaces included? Raises ValueError for what are no points.

        All stumps are computed as one batch, or as a few where their matrices are large.
        """
        if not self.programs:  # of either dimension
            flat = isinstance(points, Tensor | np.ndarray) and points.shape[1:] == (2,)
            return torch.zeros(0, len(check_points(points, "xy" if flat else "xyz")), dtype=torch.bool)
        points = check_points(points, "xyz"[: self.programs[0].dimensions])
        points = points.to(_device(self.programs[0]))
        return torch.cat([_Pack(part).occupancy(points) for part in _parts(self.programs)])


def _parts(programs: Sequence[Stump]) -> Iterator[list[Stump]]:
    """The stumps in order, in lists whose padded intersection matrices have no more than _CELLS cells if possible."""
    part, rows, nodes = [], 0, 0
    for program in programs:
        k, c = program.intersection.shape
        rows, nodes = max(rows, k), max(nodes, c)
        if part and (len(part) + 1) * rows * max(1, nodes) > _CELLS:
            yield part
            part, rows, nodes = [], k, c
        part.append(program)
    yield part


class _Pack:
    """Stumps as one batch: their matrices padded by zeros, which select nothing."""

    def __init__(self, programs: list[Stump]):
        device = _device(programs[0])
        counts = torch.tensor([program.intersection.shape for program in programs])  # (stumps, 2) K, C
        rows, nodes = counts.amax(0).tolist()
        self.batches = Batches([primitive for program in programs for primitive in program.primitives])
        starts = counts[:, :1].cumsum(0) - counts[:, :1]
        used = torch.arange(rows) < counts[:, :1]
        # (stumps, K) the row of each primitive among all; 0 for padding
        self.places = torch.where(used, starts + torch.arange(rows), 0).to(device)
        shapes = (len(programs), rows), (len(programs), rows, nodes), (len(programs), nodes)
        self.matrices = [torch.zeros(shape, dtype=torch.bool, device=device) for shape in shapes]
        for i, program in enumerate(programs):
            for padded, matrix in zip(self.matrices, program.matrices):
                padded[(i, *map(slice, matrix.shape))] = matrix.to(device)

    def occupancy(self, points: Tensor) -> Bool[Tensor, "stumps m"]:
        parts = points.split(step(self.places.numel(), points.device))
        return torch.cat([self._inside(part) for part in parts], 1)

    def _inside(self, points: Tensor) -> Bool[Tensor, "stumps m"]:
        inside = (self.batches.distances(points) <= 0)[self.places]
        return layers.binary(inside, *self.matrices)[1] & points.isfinite().all(1)
