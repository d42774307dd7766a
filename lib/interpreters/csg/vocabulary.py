"""The tokens that networks write: primitives on a coarse grid, the three operations, and `$`.

A token is an index: first the primitives, then `+`, `*`, `-`, `$`. The vocabulary of the plane has 400 tokens, that of
space 6,635. By rule (Sharma et al. 2018, section 4.1: centers 8:8:56, sizes 8:4:32, completely on the canvas):

    plane   every corner of circle, square, triangle, rounded as when drawn, lies in 0..63: 91 + 169 + 136 = 396
    space   sphere r <= x,y,z <= 64 - r;  cube s/2 <= x,y,z < 64 - s/2;  cylinder r <= x,y <= 64 - r and
            h/2 <= z < 64 - h/2: 649 + 1,341 + 4,641 = 6,631

The rule of the plane gives the authors' own list. Their list of space is not public: its rule is inferred from the
number 6,631. Primitives are sorted as the authors sort theirs: as strings, those of space without their first letter.
"""

import operator
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import product

import torch
from jaxtyping import Int
from torch import Tensor

from ..quoting import quoted
from .errors import ProgramError
from .packing import SIDE
from .primitives import KINDS, Primitive, draw, square_corners, triangle_corners
from .program import OPERATIONS, STOP, Operation, Program

CENTERS, SIZES = range(8, 57, 8), range(8, 33, 4)
_SPANS = [f"{numbers[0]}, {numbers[1]}, … {numbers[-1]}" for numbers in (CENTERS, SIZES)]
WORDS = "centers are {}, sizes {}, and nothing sticks out of the canvas".format(*_SPANS)  # for messages


class Vocabulary:
    """Distinct primitives of one dimension, numbered from 0, and after them `+ * - $`."""

    def __init__(self, primitives: Iterable[Primitive], dimensions: int = 2):
        """dimensions: 2 or 3, of a vocabulary without primitives; else theirs.

        Raises ProgramError for primitives of both dimensions, and for one that comes twice.
        """
        self.primitives = tuple(primitives)
        _check_distinct(self.primitives)
        self.texts = (*map(str, self.primitives), *OPERATIONS, STOP)
        self.dimensions = max((p.dimensions for p in self.primitives), default=dimensions)
        self._indices = {text: index for index, text in enumerate(self.texts)}
        self._canvases: dict[torch.device, Tensor] = {}

    def __len__(self) -> int:
        """How many tokens: the primitives and four more."""
        return len(self.texts)

    def __repr__(self) -> str:
        others = " ".join((*OPERATIONS, STOP))
        return f"Vocabulary({self.dimensions}D: {len(self.primitives)} primitives, then {others})"

    @property
    def stop(self) -> int:
        """The token `$`."""
        return len(self.texts) - 1

    def index(self, text: str, place: int | None = None) -> int:
        """The token of a text such as "c(32,32,8)" or "+". Raises ProgramError; `place` is where it stood."""
        if text not in self._indices:
            found = f"{quoted(text)} is not among the {len(self)} tokens of the vocabulary"
            advice = f": {WORDS}" if self is vocabulary_of(self.dimensions) else ""
            raise ProgramError(found, place, text, f"one such as {self.texts[0]} or {self.texts[-2]}{advice}")
        return self._indices[text]

    def canvases(self, device: torch.device | str = "cpu") -> Int[Tensor, "primitives lines"]:
        """Every primitive drawn, kept for the next time (200 KB for the vocabulary of the plane, 217 MB for space)."""
        device = torch.device(device)
        if device not in self._canvases:
            self._canvases[device] = draw(self.primitives, self.dimensions, device)
        return self._canvases[device]

    def program(self, tokens: Sequence[int] | Int[Tensor, " tokens"]) -> Program:
        """The program that indices spell, up to the first `$`. Raises ProgramError for what is no program."""
        statements = []
        for place, token in enumerate(tokens.tolist() if isinstance(tokens, Tensor) else tokens):
            index = operator.index(token) if hasattr(token, "__index__") else -1
            if not 0 <= index <= self.stop:
                expected = self.expected_for(index, "vocabulary_of(3)")
                raise ProgramError(f"{quoted(str(token))} is not a token", place, str(token), expected)
            if index == self.stop:
                break
            is_primitive = index < len(self.primitives)
            statements.append(self.primitives[index] if is_primitive else Operation(self.texts[index]))
        return Program(tuple(statements))

    def expected_for(self, index: int, advice: str) -> str:
        """For messages: which tokens there are, and `advice` where an index that is none of them is one in space."""
        in_space = self is vocabulary_of(2) and 0 <= index < len(vocabulary_of(3))
        hint = f" (tokens of space: {advice})" if in_space else ""
        return f"0 to {self.stop}, where {self.stop} is {STOP}{hint}"


def _check_distinct(primitives: Sequence[Primitive]) -> None:
    """Raises ProgramError unless these are distinct primitives of one dimension."""
    before: set[Primitive] = set()
    for place, primitive in enumerate(primitives):
        if not isinstance(primitive, Primitive):
            raise ProgramError(f"item {place} is a {type(primitive).__name__}", expected="a Primitive")
        text = str(primitive)
        if primitive in before:
            raise ProgramError(f"{quoted(text)} is there twice", token=text, expected="distinct primitives")
        if primitive.dimensions != primitives[0].dimensions:
            found = f"{quoted(str(primitives[0]))} and {quoted(text)} are not of one dimension"
            raise ProgramError(found, token=text, expected="all in the plane or all in space")
        before.add(primitive)


@cache
def vocabulary_of(dimensions: int) -> Vocabulary:
    """The networks' vocabulary of the plane (2) or of space (3). Raises ValueError for another number."""
    if dimensions not in (2, 3):
        raise ValueError(f"found {dimensions} dimensions; expected 2 or 3")
    kinds = [kind for kind in KINDS.values() if kind.dimensions == dimensions]
    grid = (
        Primitive(kind.letters, numbers)
        for kind in kinds
        for numbers in product(*(CENTERS if field in "xyz" else SIZES for field in kind.fields))
    )
    return Vocabulary(sorted(filter(_fits, grid), key=lambda p: str(p)[dimensions - 2 :]))


def _fits(primitive: Primitive) -> bool:
    """Does the rule above hold?"""
    if primitive.kind in ("s", "t"):
        corners = square_corners if primitive.kind == "s" else triangle_corners
        return all(0 <= int(corner) < SIDE for corner in corners(torch.tensor(primitive.numbers)))
    *center, size = primitive.numbers[: primitive.dimensions + 1]
    if primitive.kind == "c":
        return all(size <= k < SIDE - size for k in center)
    if primitive.kind == "sp":
        return all(size <= k <= SIDE - size for k in center)
    if primitive.kind == "cu":
        return all(_has_room(k, size) for k in center)
    return all(size <= k <= SIDE - size for k in center[:2]) and _has_room(center[2], primitive.numbers[-1])


def _has_room(center: int, length: int) -> bool:
    return length / 2 <= center < SIDE - length / 2
