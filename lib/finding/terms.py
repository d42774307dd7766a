"""Every term that the best matrices could need, listed without repetition.

A literal that keeps out no cell worth less than 0 is better left away: the term then holds more cells worth having. So
only terms count in which each literal keeps out a harmful cell that no other literal of the term does. And matrices
with a term are wrong at every harmful cell it holds: of terms with more harm than the best known error nothing better
can come. What is left are the sets of literals that hit every harmful cell but a few, minimal ones: they are found by
branching on one such cell, which is hit by one of its literals, or suffered. (Murakami and Uno 2014, "Efficient
algorithms for dualizing large-scale hypergraphs", for sets that hit all.)

Sets of cells are whole numbers here, a bit a cell: Python's are fast at this, and as long as need be.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .arrangement import Arrangement, Term, distinct


class TooMany(Exception):
    """There are more terms than asked for, or it took longer."""


def every(arrangement: Arrangement, harm: float, most: int, deadline: float) -> list[Term] | None:
    """All terms of at most this harm; None where more than `most` branches or time.perf_counter() > deadline."""
    try:
        return sorted(_Branching(arrangement, harm, most, deadline).terms())
    except TooMany:
        return None


@dataclass(frozen=True)
class _Branch:
    """term, the cells for which each of its literals alone is responsible, what it holds, what it may still take."""

    term: Term
    critical: tuple[int, ...]
    useful: int
    harmful: int  # held, and not yet suffered
    allowed: tuple[int, ...]
    suffered: float


class _Branching:
    def __init__(self, arrangement: Arrangement, harm: float, most: int, deadline: float):
        useful, harmful = arrangement.value > 0, np.flatnonzero(arrangement.value < 0)
        # Cells that the same literals hit are one cell.
        columns, which = distinct(arrangement.literals[:, harmful].T)
        self.weights = np.bincount(which, -arrangement.value[harmful], len(columns))
        self.holds_useful = [_bits(row) for row in arrangement.literals[:, useful]]
        self.hits = [_bits(row) for row in ~columns.T]
        self.hitters = [_bits(column) for column in ~columns]
        self.cells = len(columns)
        self.everything = _bits(np.ones(useful.sum(), bool))
        self.harm, self.left, self.deadline = harm * (1 + 1e-9) + 1e-12, most, deadline

    def terms(self) -> Iterator[Term]:
        if not self.everything:
            return
        literals = tuple(range(len(self.hits)))
        # A stack of its own: a term may have more literals than Python allows calls within calls.
        branches = [_Branch((), (), self.everything, (1 << self.cells) - 1, literals, 0.0)]
        while branches:
            branch = branches.pop()
            self.left -= 1
            if self.left < 0 or time.perf_counter() > self.deadline:
                raise TooMany
            if not branch.harmful:
                yield tuple(sorted(branch.term))
            else:
                branches += self._next(branch)

    def _next(self, branch: _Branch) -> Iterator[_Branch]:
        allowed = [x for x in branch.allowed if self.hits[x] & branch.harmful and self._fits(branch, x)]
        cell, hitters = self._narrowest(branch.harmful, allowed)
        others = [x for x in allowed if x not in hitters]
        suffered = branch.suffered + self.weights[cell]
        if suffered <= self.harm:
            rest = branch.harmful & ~(1 << cell)
            yield _Branch(branch.term, branch.critical, branch.useful, rest, tuple(others), suffered)
        for literal in hitters:
            yield self._with(branch, literal, tuple(others))
            others.append(literal)  # later branches may use it too, so that each set comes once

    def _fits(self, branch: _Branch, literal: int) -> bool:
        """Whether the term still holds something useful, and each of its literals is still responsible for a cell."""
        hit = self.hits[literal]
        return bool(branch.useful & self.holds_useful[literal]) and all(own & ~hit for own in branch.critical)

    def _with(self, branch: _Branch, literal: int, allowed: tuple[int, ...]) -> _Branch:
        hit = self.hits[literal]
        return _Branch(
            (*branch.term, literal),
            (*(own & ~hit for own in branch.critical), branch.harmful & hit),
            branch.useful & self.holds_useful[literal],
            branch.harmful & ~hit,
            allowed,
            branch.suffered,
        )

    def _narrowest(self, harmful: int, allowed: list[int]) -> tuple[int, list[int]]:
        """The cell that the fewest allowed literals hit, the first of equals, and these."""
        usable = sum(1 << x for x in allowed)
        cells = (cell for cell in range(self.cells) if harmful >> cell & 1)
        cell = min(cells, key=lambda cell: ((self.hitters[cell] & usable).bit_count(), cell))
        return cell, [x for x in allowed if self.hitters[cell] >> x & 1]


def _bits(flags: np.ndarray) -> int:
    return int.from_bytes(np.packbits(flags, bitorder="little").tobytes(), "little")
