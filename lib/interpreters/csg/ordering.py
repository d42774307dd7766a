"""One of the many programs that say the same: operands of unions and intersections in a fixed order.

    A + B = B + A,  (A + B) + C = A + (B + C), and the same for intersections; nothing is moved across a subtraction

What is united (or intersected) in a row is sorted, longer parts first, then by tokens, and joined from left to right.
The picture stays the same, to the bit, and so does the length.
"""

from collections.abc import Iterable

import torch
from jaxtyping import Int
from torch import Tensor

from .errors import ProgramError
from .vocabulary import Vocabulary

Part = tuple[
    int | None, tuple[tuple[int, ...], ...]
]  # the operation that joins them or None, and the parts' tokens


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
            stack.append((None, ((token,),)))
            continue
        if len(stack) < 2:
            raise ValueError("an operation finds no two shapes")
        right, left = stack.pop(), stack.pop()
        if token == union + 2:
            stack.append((None, ((*_joined(left), *_joined(right), token),)))
        else:
            stack.append((token, (*_operands(left, token), *_operands(right, token))))
    if len(stack) > 1:
        raise ValueError(f"it ends with {len(stack)} shapes")
    written = _joined(stack[0]) if stack else ()
    return [*written, *tokens[len(written) :]]


def _operands(part: Part, operation: int) -> Iterable[tuple[int, ...]]:
    """What a part unites if it is a union and joins a larger one; else the part itself."""
    return part[1] if part[0] == operation else (_joined(part),)


def _joined(part: Part) -> tuple[int, ...]:
    operation, operands = part
    first, *others = sorted(operands, key=lambda tokens: (-len(tokens), tokens))
    return first + tuple(token for each in others for token in (*each, operation))
