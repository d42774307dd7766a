"""Random programs, as many as one likes: the generator that CSGNet was trained with but that was never published.

The paper states its rules in words (Sharma et al. 2018, supplementary 6.1; quoted in brackets). Where they leave a
choice, this is ours:

    a  [primitives inside the canvas] Primitives come from the vocabulary, which has no others; all kinds end up equally
       frequent [section 4.1: types are uniform]. Every tree of a length is as likely as every other.
    b  [each operation changes the number of ON pixels by at least 10 % of the sum of pixels in two shapes] The result
       differs from both operands, A and B, in at least a tenth of |A| + |B| pixels.
    c  [the number of ON pixels in the final image is above a threshold] At least as many as the vocabulary's smallest
       square or cube has: 12^2 pixels or 7^3 voxels. The paper tells no number. Operands need not reach it.
    d  [boost subtract and intersect] Most pairs of shapes can only be united. So they are tried first for intersections
       and subtractions, with several partners, and united only when all fail; and of the programs that end with a
       union, an intersection, a subtraction as many are kept.
    e  [remove duplicates] No two programs have the same tokens.

How programs grow until they follow these rules is told in `growing`.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Int
from torch import Tensor

from ..checks import whole
from ..threads import one_thread
from .errors import ProgramError
from .program import Program
from .vocabulary import vocabulary_of

LENGTHS = {2: (3, 5, 7, 9, 11, 13), 3: (3, 5, 7)}  # tokens, by dimension; the paper's Table 1
SMALLEST = {2: 12, 3: 7}  # pixels along a side of the vocabulary's smallest square and cube, by dimension
LONGEST_SAMPLED = 51  # tokens: far more than the paper's, in seconds; twice as many would take half a minute
UNION, INTERSECT, SUBTRACT = range(3)  # operations as they follow the primitives in a vocabulary
_FEWEST = 128  # programs grown together: among fewer, partners are rare
_MOST = {2: 4096, 3: 2048}  # programs grown together, by dimension: what fits the memory of a small laptop
_EQUAL = 3  # batches in a row that bring nothing before all operations are tried equally often
_BARREN = 20  # and before we give up


@dataclass(frozen=True)
class Rules:
    """What a random program must be like; switch a rule off to see what it is there for.

    change    rule b: the least share of |A| + |B| in which an operation's result differs from A and from B
    side      rule c: the final shape has at least as many pixels as a square or cube of this side; None: SMALLEST
    balanced  rule d: all three operations as often; else they are tried equally often, whatever comes of it
    """

    change: float = 0.1
    side: int | None = None
    balanced: bool = True

    def least_on(self, dimensions: int) -> int:
        """Rule c: how many pixels or voxels are enough."""
        side = SMALLEST[dimensions] if self.side is None else self.side
        return max(1, side**dimensions)

    def meets_change(
        self,
        a: Int[Tensor, " n"],
        b: Int[Tensor, " n"],
        both: Int[Tensor, " n"],
        operation: Int[Tensor, " n"],
    ) -> Bool[Tensor, " n"]:
        """Rule b, from how many pixels are ON in A, in B and in both, for operations 0 union, 1 intersect, 2 subtract.

        Union and intersection differ from A and from B by what only one of them has. A without B differs from A by
        what both have, and from B by all the rest, which is always enough.
        """
        least = self.change * (a + b)
        return torch.where(operation == SUBTRACT, both >= least, torch.minimum(a, b) - both >= least)


def sample(
    rng: np.random.Generator, dimensions: int = 2, length: int | None = None, rules: Rules = Rules()
) -> Program:
    """One random program that follows the rules; its length is one of the paper's, unless given (an odd number).

    Raises ProgramError like `sample_many`.
    """
    _check_generator(rng)
    vocabulary = vocabulary_of(dimensions)
    length = int(rng.choice(LENGTHS[dimensions])) if length is None else length
    return vocabulary.program(sample_many(rng, 1, length, dimensions, rules)[0])


@one_thread()
def sample_many(
    rng: np.random.Generator, number: int, length: int, dimensions: int = 2, rules: Rules = Rules()
) -> Int[Tensor, "number length"]:
    """Tokens of `number` different random programs of `length` tokens each, all following the rules, in random order.

    Raises ProgramError for what is no Generator, for a number or a length that cannot be, and where hardly a program
    follows the rules.
    """
    from .growing import grow

    _check_generator(rng)
    number, length = _check_number(number), _check_length(length)
    vocabulary = vocabulary_of(dimensions)
    quotas = _quotas(rng, number) if rules.balanced and length > 1 else None
    found, before, barren = torch.empty((0, length), dtype=torch.int64), -1, 0
    while True:
        kept, missing = _kept(found[:, -1] - len(vocabulary.primitives), number, quotas)
        if not missing:
            return found[kept][torch.from_numpy(rng.permutation(number))]  # rare endings were found last
        barren, before = barren + 1 if len(kept) == before else 0, len(kept)
        if barren == _BARREN:
            what = f"found only {before} programs of {length} tokens that follow {rules}"
            raise ProgramError(what, expected=f"{number} of them: choose weaker rules, or longer programs")
        # Where next to any pair follows the rules, intersections and subtractions, tried first, leave none to unite.
        weights = rules if barren < _EQUAL else replace(rules, balanced=False)
        more = grow(rng, min(max(2 * missing, _FEWEST), _MOST[dimensions]), length, vocabulary, weights)
        found = _distinct(torch.cat([found, more]))


def _check_generator(rng) -> None:
    if not isinstance(rng, np.random.Generator):
        expected = "a numpy Generator, such as np.random.default_rng(0)"
        raise ProgramError(f"found {rng!r:.40}", expected=expected)


def _check_number(given) -> int:
    number = whole(given)
    if number is None or number < 0:
        raise ProgramError(f"{given!r:.40} programs", expected="a whole number, at least 0")
    return number


def _check_length(given) -> int:
    length = whole(given)
    if length is None or length % 2 == 0 or not 1 <= length <= LONGEST_SAMPLED:
        expected = f"an odd number from 1 to {LONGEST_SAMPLED}: longer ones take minutes to sample"
        raise ProgramError(f"programs of {given!r:.40} tokens", expected=expected)
    return length


def _quotas(rng: np.random.Generator, number: int) -> list[int]:
    """How many programs shall end with each operation: as equal as can be."""
    extra = set(rng.permutation(3)[: number % 3].tolist())
    return [number // 3 + (operation in extra) for operation in range(3)]


def _kept(last: Int[Tensor, " found"], number: int, quotas: list[int] | None) -> tuple[Tensor, int]:
    """Which of the programs found so far to keep, given what they end with, and about how many are missing."""
    if quotas is None:
        return torch.arange(min(number, len(last))), max(0, number - len(last))
    rows = [(last == operation).nonzero().squeeze(1) for operation in range(3)]
    missing = max(quota - len(each) for quota, each in zip(quotas, rows))
    return torch.cat([each[:quota] for each, quota in zip(rows, quotas)]), max(0, 3 * missing)


def _distinct(tokens: Tensor) -> Tensor:
    """The rows without repetitions, each where it came first."""
    _, first = np.unique(tokens.numpy(), axis=0, return_index=True)
    return tokens[np.sort(first)]
