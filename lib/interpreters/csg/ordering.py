"""One of the many programs that say the same: operands in a fixed order, and what is cut away comes last.

    A + B = B + A,  (A + B) + C = A + (B + C),  and the same for intersections
    A - (B + C) = A - B - C = A - C - B,        (A - B) * C = A * (C - B) = A * C - B

What is united in a row is sorted, longer parts first, then by tokens, and joined from left to right. So is what is
intersected in a row, from which then everything that any of them lost is subtracted, one after the other, sorted too.
The picture stays the same, to the bit, and so does the length.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Int
from torch import Tensor

from .errors import ProgramError
from .vocabulary import Vocabulary

Tokens = tuple[int, ...]


@dataclass(frozen=True)
class Part:
    """A part of a program: the union of `kept`; or, if it is `cut`, their intersection, less each of `removed`."""

    kept: tuple[Tokens, ...]
    removed: tuple[Tokens, ...] = ()
    cut: bool = False

    def written(self, union: int) -> Tokens:
        """Its tokens, where `union` is the token + and the next ones are * and -."""
        first, *others = _sorted(self.kept)
        joined = [*first, *(token for each in others for token in (*each, union + self.cut))]
        return (*joined, *(token for each in _sorted(self.removed) for token in (*each, union + 2)))

    def united(self, union: int) -> tuple[Tokens, ...]:
        """It is the union of these."""
        return (self.written(union),) if self.cut else self.kept

    def intersected(self, union: int) -> tuple[Tokens, ...]:
        """It is the intersection of these, less those that are removed."""
        return self.kept if self.cut else (self.written(union),)


def _sorted(parts: tuple[Tokens, ...]) -> list[Tokens]:
    return sorted(parts, key=lambda tokens: (-len(tokens), tokens))


def ordered(tokens: Int[Tensor, "programs length"], vocabulary: Vocabulary) -> Int[Tensor, "programs length"]:
    """Programs, padded with `$`, with operands in order. Empty ones, nothing but `$`, stay as they are.

    Raises ProgramError, naming the row, for what is no program.
    """
    if tokens.ndim != 2 or tokens.is_floating_point():
        found = f"the tokens are a tensor {tuple(tokens.shape)} of {tokens.dtype}"
        raise ProgramError(found, expected="whole numbers (programs, length)")
    rows = []
    for number, row in enumerate(tokens.tolist()):
        try:
            rows.append(_ordered(row, len(vocabulary.primitives)))
        except ValueError as error:
            raise ProgramError(f"row {number} is no program: {error}", expected="valid programs") from None
    return torch.tensor(rows, dtype=tokens.dtype, device=tokens.device).view(tokens.shape)


def _ordered(tokens: list[int], union: int) -> list[int]:
    """One program; from `union` on tokens are + * - and `$`. Raises ValueError for what is none."""
    stack: list[Part] = []
    for token in tokens:
        if token == union + 3:
            break
        if not 0 <= token < union + 3:
            raise ValueError(f"'{token}' is not a token")
        if token < union:
            stack.append(Part(((token,),)))
            continue
        if len(stack) < 2:
            raise ValueError("an operation finds no two shapes")
        right, left = stack.pop(), stack.pop()
        stack.append(_combined(left, right, token - union, union))
    if len(stack) > 1:
        raise ValueError(f"it ends with {len(stack)} shapes")
    written = stack[0].written(union) if stack else ()
    return [*written, *tokens[len(written) :]]


def _combined(left: Part, right: Part, operation: int, union: int) -> Part:
    """Two parts joined by + (0), * (1) or - (2)."""
    if operation == 0:
        return Part(left.united(union) + right.united(union))
    kept = left.intersected(union)
    if operation == 1:
        return Part(kept + right.intersected(union), left.removed + right.removed, cut=True)
    return Part(kept, left.removed + right.united(union), cut=True)
