"""How random programs grow: short ones are paired to make longer ones, from primitives up.

To make programs of a length, parts of two shorter lengths are paired at random and an operation is drawn for each pair.
Pairs that meet the rules (see `sampling`) are kept; the others are shuffled and tried again with other partners and
operations. What has found no partner after some tries is dropped, and no part is used twice. All pairs of a length are
tried at once, on packed canvases, and most that cannot meet the rules are told by the boxes around them alone.
"""

from dataclasses import dataclass
from functools import cache
from math import comb

import numpy as np
import torch
from jaxtyping import Int
from torch import Tensor

from .packing import count
from .primitives import CENTER, KINDS
from .sampling import INTERSECT, SUBTRACT, UNION, Rules
from .vocabulary import Vocabulary

# Rule d, by dimension: how often a part is paired for an intersection or a subtraction before it is united, and which
# share of these tries are intersections. Chosen such that inside programs all three operations are found equally often;
# a last pair is tried more often, because it is cheap (nobody needs its canvas) and its surplus of unions is dropped.
_TRIES, _INTERSECTING = {2: 8, 3: 34}, {2: 0.54, 3: 0.345}
_LAST_TRIES, _LAST_INTERSECTING = {2: 40, 3: 100}, {2: 0.8, 3: 0.33}
# How often each kind is drawn, chosen such that all are found equally often in programs that follow the rules.
_KINDS = {"c": 0.322, "s": 0.318, "t": 0.36, "cu": 0.335, "cy": 0.34, "sp": 0.325}
_UNITING = 4  # how often a part is paired for a union, in the end
_MARGIN = 1.15  # how many more parts are grown than are needed, for those that find no partner
_WORKSPACE = 1 << 17  # words compared in one go: what a core's cache holds


@dataclass(frozen=True)
class _Parts:
    """Programs of one length; their canvases stand in some rows of a table."""

    tokens: Int[Tensor, "n length"]
    on: Int[Tensor, " n"]  # how many pixels are ON
    box: Int[Tensor, "n 2 dimensions"]  # all of them lie between these two corners
    row: Int[Tensor, " n"]
    table: Int[Tensor, "rows words"]

    def __len__(self) -> int:
        return len(self.on)

    def __getitem__(self, which) -> "_Parts":
        return _Parts(self.tokens[which], self.on[which], self.box[which], self.row[which], self.table)

    @property
    def words(self) -> Int[Tensor, "n words"]:
        return self.table.index_select(0, self.row)


@dataclass(frozen=True)
class _Pairs:
    """Operands that found one another, their operation (0 union, 1 intersect, 2 subtract), and the result's pixels."""

    left: _Parts
    right: _Parts
    operation: Int[Tensor, " n"]
    on: Int[Tensor, " n"]

    def tokens(self, union: int) -> Int[Tensor, "n length"]:
        """The longer programs; union is the token of the union."""
        return torch.cat([self.left.tokens, self.right.tokens, union + self.operation.unsqueeze(1)], 1)


def grow(
    rng: np.random.Generator, number: int, length: int, vocabulary: Vocabulary, rules: Rules
) -> Int[Tensor, "about_number length"]:
    """Tokens of random programs that follow the rules, in random order, perhaps with repetitions."""
    need, splits = {length: number + 1}, {}
    for size in range(length, 1, -2):  # how many programs of each length, and from which two lengths each
        splits[size] = rng.multinomial(need[size], _split_chances(size // 2)).tolist()
        for left, many in enumerate(splits[size]):
            for part in (2 * left + 1, size - 2 - 2 * left):
                need[part] = need.get(part, 0) + int(many * (_MARGIN if part > 1 else 1)) + 1
    least, union = rules.least_on(vocabulary.dimensions), len(vocabulary.primitives)
    parts = {1: _draw(rng, need[1], vocabulary)}
    for size in range(3, length, 2):
        parts[size] = _joined(rng, _pairs(rng, parts, splits[size], vocabulary.dimensions, rules), union)
    if length == 1:
        return parts[1].tokens[parts[1].on >= least]
    final = _pairs(rng, parts, splits[length], vocabulary.dimensions, rules, least)
    tokens = torch.cat([each.tokens(union) for each in final])
    return tokens[torch.from_numpy(rng.permutation(len(tokens)))]


def _split_chances(operations: int) -> np.ndarray:
    """How likely the left operand has 0, 1, 2, … operations, where every tree is as likely as every other."""
    trees = [comb(2 * k, k) // (k + 1) for k in range(operations)]  # with k operations: the Catalan numbers
    ways = [a * b for a, b in zip(trees, reversed(trees))]  # of long programs, more than 64 bits can hold
    return np.array([way / sum(ways) for way in ways])


def _draw(rng: np.random.Generator, number: int, vocabulary: Vocabulary) -> _Parts:
    """Random primitives: the kind first, then one of its members."""
    kinds = [primitive.kind for primitive in vocabulary.primitives]
    # Members of a kind stand together.
    names, first, many = np.unique(kinds, return_index=True, return_counts=True)
    kind = rng.choice(len(names), size=number, p=[_KINDS[name] for name in names])
    tokens = torch.from_numpy(first[kind] + rng.integers(many[kind]))
    on, boxes = _measured(vocabulary)
    return _Parts(tokens.unsqueeze(1), on[tokens], boxes[tokens], tokens, vocabulary.canvases())


@cache
def _measured(
    vocabulary: Vocabulary,
) -> tuple[Int[Tensor, " primitives"], Int[Tensor, "primitives 2 dimensions"]]:
    """How many pixels each primitive has, and a box around it, lowest and highest corner, from its numbers alone."""
    boxes = []
    for primitive in vocabulary.primitives:
        number = dict(zip(KINDS[primitive.kind].fields, primitive.numbers))
        wide = number.get("r", number.get("s", 0) // 2)  # radius, or half a side
        reach = {"x": wide, "y": wide, "z": number.get("h", 2 * wide) // 2}
        boxes.append([[number[k] - reach[k], number[k] + reach[k]] for k in CENTER if k in number])
    return count(vocabulary.canvases()), torch.tensor(boxes).transpose(1, 2)


def _pairs(
    rng: np.random.Generator,
    parts: dict[int, _Parts],
    split: list[int],
    dimensions: int,
    rules: Rules,
    least: int = 0,
) -> list[_Pairs]:
    """Pairs of one length: split[k] of them shall have k operations on the left. Takes what it uses out of `parts`.

    least  pixels that a final result must have; 0 for parts of longer programs.
    """
    tries, intersecting = (_LAST_TRIES, _LAST_INTERSECTING) if least else (_TRIES, _INTERSECTING)
    chances = [(0, intersecting[dimensions], 1 - intersecting[dimensions])] * tries[dimensions]
    chances += [(1, 0, 0)] * _UNITING
    if not rules.balanced:
        chances = [(1 / 3, 1 / 3, 1 / 3)] * len(chances)
    pairs = []
    for operations, many in enumerate(split):
        operands = []
        for size in (2 * operations + 1, 2 * (len(split) - operations) - 1):
            operands.append(parts[size][:many])
            parts[size] = parts[size][many:]
        pairs.append(_pair(rng, *operands, chances, max(1, least), rules))
    return pairs


def _pair(
    rng: np.random.Generator, lefts: _Parts, rights: _Parts, chances: list[tuple], least: int, rules: Rules
) -> _Pairs:
    """Those left operands that find a right one and an operation such that the rules are met, sorted by operation.

    chances  of union, intersect and subtract in each try.
    """
    left = right = torch.arange(min(len(lefts), len(rights)))
    found = []
    for each in chances:
        operation = torch.from_numpy(rng.choice(3, size=len(left), p=each))
        a, b = lefts[left], rights[right]
        both = _in_both(a, b, operation, least, rules)
        on = torch.where(
            operation == UNION, a.on + b.on - both, torch.where(operation == SUBTRACT, a.on - both, both)
        )
        good = rules.meets_change(a.on, b.on, both, operation) & (on >= least)
        found.append(torch.stack([left, right, operation, on])[:, good])
        left, right = left[~good], right[~good]
        right = right[torch.from_numpy(rng.permutation(len(right)))]
    found = torch.cat(found, 1)
    left, right, operation, on = found[:, found[2].sort(stable=True).indices]
    return _Pairs(lefts[left], rights[right], operation, on)


def _in_both(a: _Parts, b: _Parts, operation: Tensor, least: int, rules: Rules) -> Int[Tensor, " n"]:
    """How many pixels are ON in both operands; 0 where the boxes tell that the operation cannot meet the rules."""
    low, high = torch.maximum(a.box, b.box)[:, 0], torch.minimum(a.box, b.box)[:, 1]
    most = torch.minimum((high - low + 1).clamp(min=0).prod(1), torch.minimum(a.on, b.on))
    enough = torch.where(operation == SUBTRACT, rules.change * (a.on + b.on), 1)
    enough[operation == INTERSECT] = least
    both = torch.zeros_like(most)
    for some in (most >= enough).nonzero().squeeze(1).split(max(1, _WORKSPACE // a.table.shape[1])):
        both[some] = count(a[some].words & b[some].words)
    return both


def _joined(rng: np.random.Generator, pairs: list[_Pairs], union: int) -> _Parts:
    """Parts made of pairs, in random order: those that found a partner soon are not like the others."""
    tokens = torch.cat([each.tokens(union) for each in pairs])
    on = torch.cat([each.on for each in pairs])
    box, table = (torch.cat([make(each) for each in pairs]) for make in (_boxes, _canvases))
    row = torch.from_numpy(rng.permutation(len(on)))
    return _Parts(tokens[row], on[row], box[row], row, table)


def _boxes(pairs: _Pairs) -> Int[Tensor, "n 2 dimensions"]:
    """A box around each result: not always the smallest."""
    a, b, kind = pairs.left.box, pairs.right.box, pairs.operation.view(-1, 1, 1)
    smaller, larger = torch.minimum(a, b), torch.maximum(a, b)
    around = torch.stack([smaller[:, 0], larger[:, 1]], 1)
    inside = torch.stack([larger[:, 0], smaller[:, 1]], 1)
    return torch.where(kind == UNION, around, torch.where(kind == INTERSECT, inside, a))


def _canvases(pairs: _Pairs) -> Int[Tensor, "n words"]:
    """The results' canvases."""
    table, right = pairs.left.words, pairs.right
    step, start = max(1, _WORKSPACE // table.shape[1]), 0
    for kind, many in enumerate(pairs.operation.bincount(minlength=3).tolist()):  # pairs are sorted by it
        for first in range(start, start + many, step):
            rows = slice(first, min(first + step, start + many))
            a, b = table[rows], right[rows].words
            if kind == UNION:
                a |= b
            else:
                a &= b if kind == INTERSECT else b.bitwise_not_()
        start += many
    return table
