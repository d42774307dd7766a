"""Programs without the parts that nobody sees: the same picture, to the bit, in fewer tokens.

    A + B = A  where B lies in A,   A * B = A  where A lies in B,   A - B = A  where they do not meet

and for + and * with A and B exchanged. A part may also be hidden by a later operation, so nothing is concluded from the
operands: one operand of an operation is put in the place of the operation, the whole is drawn again, and where
the picture is the same the shorter program stays. That is repeated until every part is needed.
"""

import torch
from jaxtyping import Bool, Int
from torch import Tensor

from .executing import checked, execute_many
from .vocabulary import Vocabulary

_WORKSPACE = 1 << 20  # words of pictures that are compared in one go


def pruned(tokens: Int[Tensor, "programs length"], vocabulary: Vocabulary) -> Int[Tensor, "programs length"]:
    """Programs, padded with `$`, with nothing in them that their pictures do not need, as int64.

    Of parts that can be left out the longest goes first. Rows that are no programs stay as they are. Raises
    ProgramError for numbers that are no tokens. Takes long for hundreds of parts: all are tried, one after the other.
    """
    tokens = checked(tokens, vocabulary).clone()
    words = vocabulary.canvases().shape[1] * max(1, tokens.shape[1])
    for some in torch.arange(len(tokens), device=tokens.device).split(max(1, _WORKSPACE // words)):
        while tokens[some].numel():
            shorter, changed = _shorter(tokens[some], vocabulary)
            some = some[changed]
            tokens[some] = shorter[changed]
    return tokens


def _shorter(
    tokens: Int[Tensor, "n length"], vocabulary: Vocabulary
) -> tuple[Int[Tensor, "n length"], Bool[Tensor, " n"]]:
    """Each program without the longest part that it does not need, and which programs have one."""
    shapes = execute_many(tokens, vocabulary)
    ended = (tokens == vocabulary.stop).cummax(1).values
    tried = torch.where(shapes.valid.unsqueeze(1) & ~ended, tokens, vocabulary.stop)
    program, dropped = _omissions(tried, vocabulary)
    kept = torch.where(dropped, vocabulary.stop, tried[program])
    kept = kept.gather(1, dropped.byte().argsort(dim=1, stable=True))  # what is dropped goes to the end
    same = (execute_many(kept, vocabulary).words == shapes.words[program]).all(1).nonzero().squeeze(1)
    # How much is dropped, and by which try, as one number: the largest is the one wanted.
    best = torch.zeros(len(tokens), dtype=torch.int64, device=tokens.device)
    best.scatter_reduce_(0, program[same], dropped[same].sum(1) * len(kept) + same, "amax")
    changed, shorter = best > 0, tokens.clone()
    shorter[changed] = kept[best[changed] % len(kept)]
    return shorter, changed


def _omissions(
    tokens: Int[Tensor, "n length"], vocabulary: Vocabulary
) -> tuple[Int[Tensor, " tries"], Bool[Tensor, "tries length"]]:
    """Every way to put an operand in its operation's place: of which program, and which tokens go."""
    places = torch.arange(tokens.shape[1], device=tokens.device)
    operates = (tokens >= len(vocabulary.primitives)) & (tokens < vocabulary.stop)
    change = torch.where(
        operates, -1, (tokens < vocabulary.stop).long()
    )  # of the number of pictures on the stack
    depth = change.cumsum(1)
    before = depth - change
    # A part that ends at i begins at the last place j up to i where the stack was one lower before it.
    begins = (before.unsqueeze(1) == depth.unsqueeze(2) - 1) & (places <= places.unsqueeze(1))
    begin = torch.where(begins, places, 0).amax(2)
    program, end = operates.nonzero().unbind(1)
    whole, right = begin[program, end], begin[program, end - 1]
    end, whole, right = (each.unsqueeze(1) for each in (end, whole, right))
    without_right = (places >= right) & (places <= end)
    without_left = (places >= whole) & (places < right) | (places == end)
    return program.repeat(2), torch.cat([without_right, without_left])
