"""Which tokens may come next, so that what is written is a program that can be executed, within a largest length.

With d finished parts on the stack and room for n more tokens before `$`:

    a primitive   if the d operations that d + 1 parts need still fit after it: d <= n - 1
    an operation  if there are two parts to join: d >= 2
    `$`           if there is one part, the picture: d = 1

At least one of these always holds, and every program of at most that length can be written. (The paper's network has no
such mask: its programs may be invalid, and learning has to avoid them.)
"""

from functools import cache

import torch
from jaxtyping import Bool, Int
from torch import Tensor

LONGEST = {2: 13, 3: 7}  # tokens of the paper's programs, by dimension; `$` not counted
OPERATIONS = 3  # the vocabulary ends with these and with `$`
PRIMITIVE, OPERATION, STOP = range(3)


@cache
def kinds(tokens: int, device: torch.device | None = None) -> Int[Tensor, " tokens"]:
    """What each token of a vocabulary is: PRIMITIVE, OPERATION or STOP. Shared: do not change it."""
    kind = torch.zeros(tokens, dtype=torch.long, device=device)
    kind[tokens - 1 - OPERATIONS :] = OPERATION
    kind[tokens - 1] = STOP
    return kind


def allowed(
    depth: Int[Tensor, " rows"], running: Bool[Tensor, " rows"], room: int, tokens: int
) -> Bool[Tensor, "rows tokens"]:
    """Which tokens may come next in each row. After its end, where a row is not running, that is `$` again.

    depth   how many parts stand on the stack;  room  how many tokens may still come before `$`
    """
    primitive = running & (depth < room)
    operation = running & (depth >= 2)
    stop = ~running | (depth == 1)
    return torch.stack([primitive, operation, stop], 1).index_select(1, kinds(tokens, depth.device))


def deeper(depth: Int[Tensor, "*rows"], token: Int[Tensor, "*rows"], tokens: int) -> Int[Tensor, "*rows"]:
    """The number of parts after a token: a primitive is one more, an operation makes one of two."""
    return depth + _changes(tokens, depth.device)[token]


@cache
def _changes(tokens: int, device: torch.device) -> Int[Tensor, " tokens"]:
    """What each token adds to the number of parts."""
    return torch.tensor([1, -1, 0], device=device)[kinds(tokens, device)]
