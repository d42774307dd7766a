"""What an executed program is: pixels or voxels, and the questions one asks of a shape.

In the plane x grows right and y DOWN, image[y, x]; in space grid[x, y, z], z up. Pixel k has its center at k.
"""

from collections.abc import Sequence
from functools import cached_property

from jaxtyping import Bool, Int
from torch import Tensor

from .errors import ProgramError
from .packing import SIDE, count, unpack
from .program import Program


class Shape:
    """One executed program; `words` are its packed pixels (see packing)."""

    def __init__(self, program: Program, words: Int[Tensor, " lines"]):
        self.program, self.words = program, words

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.program.to_text()!r}, {self.on} of {SIDE**self.dimensions} ON)"

    @property
    def dimensions(self) -> int:
        return self.program.dimensions

    @property
    def on(self) -> int:
        """How many pixels or voxels are ON."""
        return int(count(self.words))


class Picture(Shape):
    """A shape in the plane."""

    @cached_property
    def image(self) -> Bool[Tensor, "64 64"]:
        """The pixels, [row y, column x]."""
        return unpack(self.words)


class Solid(Shape):
    """A shape in space."""

    @cached_property
    def grid(self) -> Bool[Tensor, "64 64 64"]:
        """The voxels, [x, y, z]."""
        return unpack(self.words).view(SIDE, SIDE, SIDE)


class Shapes(Sequence):
    """Executed programs: `shapes[i]` is a Shape, `shapes[2:5]` are Shapes; the pixels of all stay packed in `words`."""

    def __init__(
        self,
        words: Int[Tensor, "programs lines"],
        valid: Bool[Tensor, " programs"],
        tokens: Tensor,
        vocabulary,
    ):
        self.words, self.valid, self.tokens, self.vocabulary = words, valid, tokens, vocabulary

    def __len__(self) -> int:
        return len(self.words)

    def __getitem__(self, index):
        """Raises ProgramError for a program that is not valid, saying why."""
        if isinstance(index, slice):
            return Shapes(self.words[index], self.valid[index], self.tokens[index], self.vocabulary)
        if not -len(self) <= index < len(self):
            raise IndexError(f"shape {index} of {len(self)}")
        program = self.vocabulary.program(self.tokens[index])
        return (Solid if self.dimensions == 3 else Picture)(program, self.words[index])

    def __repr__(self) -> str:
        return f"Shapes({len(self)} of {self.dimensions}D programs, {int(self.valid.sum())} valid)"

    @property
    def dimensions(self) -> int:
        return self.vocabulary.dimensions

    @property
    def on(self) -> Int[Tensor, " programs"]:
        """How many pixels or voxels of each shape are ON."""
        return count(self.words)

    @property
    def images(self) -> Bool[Tensor, "programs 64 64"]:
        """The pictures of programs of the plane, [program, row y, column x]; blank where a program is not valid."""
        self._require(2, "grids")
        return unpack(self.words)

    @property
    def grids(self) -> Bool[Tensor, "programs 64 64 64"]:
        """The voxels of programs of space, [program, x, y, z]; blank where a program is not valid."""
        self._require(3, "images")
        return unpack(self.words).view(-1, SIDE, SIDE, SIDE)

    def _require(self, dimensions: int, instead: str) -> None:
        if self.dimensions != dimensions:
            raise ProgramError(
                f"these are programs with {self.dimensions} dimensions", expected=f"shapes.{instead}"
            )
