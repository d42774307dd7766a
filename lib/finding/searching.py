"""The search within a time limit: from a greedy cover over exact programs to the exchange of two nodes at a time.

1. Greedy covers of several widths give matrices at once, and with them the most harm that a useful term may do.
2. The complement layer's own program bounds what any number of nodes can reach, and says which complements to take.
3. Every term that could help is listed, if there are not too many, and a program chooses among them: exact if it ends.
4. Else two nodes at a time are taken out, and a small program chooses what fits best beside those that stay.

A step is left out as soon as nothing can be better. The order of everything is fixed, chance has no part in it: where
the limit is not reached, the same points give the same matrices.
"""

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from .arrangement import Arrangement, Term
from .covering import best_cover, grow, prune
from .programming import choose
from .separating import separate
from .terms import every

WIDTHS = (1, 4, 16)  # of the greedy covers
MOST_ENTRIES = (
    60_000  # cells that the terms of one program hold: with more, HiGHS is long without looking at its clock
)
MOST_BRANCHES = 60_000
NEIGHBOURS = 250  # terms among which two nodes are exchanged
SIMPLER = 1.0  # seconds at most to look for simpler ones where nothing is better
SHARES = {"separate": 0.2, "list": 0.15, "choose": 0.5}  # of the time that is left, at most


class Search:
    """The best terms so far, and the weight that no terms can be less wrong by: `run` betters both until the time."""

    def __init__(self, arrangement: Arrangement, nodes: int, seconds: float):
        self.arrangement, self.nodes = arrangement, nodes
        self.deadline = time.perf_counter() + seconds
        self.terms, self.method, self.bound = self._cover(1), "greedy", arrangement.floor

    @property
    def error(self) -> float:
        return self.arrangement.error(self.terms)

    @property
    def left(self) -> float:
        """Seconds"""
        return self.deadline - time.perf_counter()

    @property
    def open(self) -> bool:
        """Whether there is something to gain, and time for it."""
        return self.left > 0 and self.error > self.bound + 1e-9 * self.arrangement.total

    def offer(self, terms: Sequence[Term] | None, method: str) -> bool:
        """Take these if they are better, or as good and simpler."""
        if terms is None or len(terms) > self.nodes or not self.arrangement.fits(terms):
            return False
        terms = prune(self.arrangement, terms)
        better = self.arrangement.rank(terms) < self.arrangement.rank(self.terms)
        if better:
            self.terms, self.method = terms, method
        return better

    def run(self) -> None:
        for width in WIDTHS[1:] if self.open else ():
            self.offer(self._cover(width), "greedy")
        if self.open and self.arrangement.coupled.any():
            self._separate()
        pool = self._list()
        exact = pool is not None and len(self._affordable(pool)) == len(pool)
        self._choose(pool if exact else self._grown(), exact)
        if self.open:
            self._exchange(pool or [])

    def _cover(self, width: int, allowed: np.ndarray | None = None) -> list[Term]:
        return best_cover(self.arrangement, self.nodes, width, allowed, self.deadline)

    def _separate(self) -> None:
        bound, allowed = separate(self.arrangement, self.left * SHARES["separate"])
        self.bound = max(self.bound, bound)
        if allowed is not None:
            for width in WIDTHS:
                self.offer(self._cover(width, allowed), "program")

    def _list(self) -> list[Term] | None:
        """Every term that better terms, or equally good and simpler ones, may hold; None if they are too many."""
        harm = self.error - self.arrangement.floor
        until = time.perf_counter() + self.left * SHARES["list"]
        return every(self.arrangement, harm, MOST_BRANCHES, until)

    def _grown(self) -> list[Term]:
        """Terms that a beam meets, of little harm, the most valuable first."""
        arrangement = self.arrangement
        allowed = np.ones(len(arrangement.literals), bool)
        return self._valuable(
            grow(arrangement, arrangement.value, allowed, 32, self.deadline), arrangement.value, NEIGHBOURS
        )

    def _choose(self, pool: list[Term], exact: bool) -> None:
        if exact and not pool:
            self.bound = self.error  # no term can help
        if not pool or self.left <= 0:
            return
        seconds = self.left * SHARES["choose"]
        answer = choose(self.arrangement, pool, self.nodes, seconds if self.open else min(seconds, SIMPLER))
        self.offer(answer.terms, "program")
        if exact:
            self.bound = max(self.bound, min(answer.bound, self.error))

    def _exchange(self, pool: list[Term]) -> None:
        """Until no two nodes can be exchanged for better ones."""
        tried: set[tuple[Term, ...]] = set()
        while self.open:
            staying = next((some for some in _without_two(self.terms) if some not in tried), None)
            if staying is None:
                return
            tried.add(staying)
            self._complete(staying, pool)

    def _complete(self, staying: tuple[Term, ...], pool: list[Term]) -> None:
        """The best terms beside those that stay."""
        arrangement = self.arrangement
        used = {literal for term in staying for literal in term}
        banned = [arrangement.opposite(x) for x in used if arrangement.coupled[x % arrangement.rows]]
        allowed = np.ones(len(arrangement.literals), bool)
        allowed[banned] = False
        value = np.where(arrangement.extents(staying).any(0), 0, arrangement.value)
        fitting = [term for term in (*pool, *self.terms) if not set(term) & set(banned)]
        terms = self._valuable(
            [*grow(arrangement, value, allowed, 12, self.deadline), *fitting], value, NEIGHBOURS
        )
        left = self.nodes - len(staying)
        answer = choose(replace(arrangement, value=value), terms, left, min(self.left, 1.0))
        if answer.terms is not None:
            self.offer([*staying, *answer.terms], "program")

    def _valuable(self, terms: Iterable[Term], value: np.ndarray, most: int) -> list[Term]:
        """The `most` terms that hold most value, without repetition; fewer where they hold many cells."""
        terms = sorted(set(terms))
        values = self.arrangement.extents(terms) @ value
        return self._affordable([terms[i] for i in np.argsort(-values, kind="stable")[:most]])

    def _affordable(self, terms: list[Term]) -> list[Term]:
        """As many of the first terms as one program may have."""
        entries = np.cumsum(self.arrangement.extents(terms).sum(1))
        return terms[: int(np.searchsorted(entries, MOST_ENTRIES, side="right"))]


def _without_two(terms: Sequence[Term]) -> Iterable[tuple[Term, ...]]:
    """The terms without two of them, in all ways; without one where there are fewer."""
    leaving = min(2, len(terms))
    return (tuple(sorted(some)) for some in combinations(terms, len(terms) - leaving))
