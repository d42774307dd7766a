"""Unions of intersections of literals, on whole numbers: what is redundant in them, and what is left.

A term is an intersection, written as the bits of one whole number: bit 2k stands for the literal "in primitive k", bit
2k + 1 for "outside of it"; no bits, the whole space. A list of terms is their union; no terms, the empty set. One term
lies within another if it has all of the other's literals.
"""

from collections.abc import Collection, Iterable, Sequence
from functools import reduce
from operator import or_


def literals(terms: Iterable[int]) -> list[int]:
    """The numbers of the bits that occur, in order."""
    union = _all(terms)
    found = []
    while union:
        found.append((union & -union).bit_length() - 1)
        union &= union - 1
    return found


def united(left: Sequence[int], right: Sequence[int]) -> list[int]:
    """The union of two unions in which nothing is redundant: again one in which nothing is."""
    if 0 in left or 0 in right:
        return [0]
    return list(_Terms([*left, *right]) if _all(left) & _all(right) else [*left, *right])


def intersected(left: Sequence[int], right: Sequence[int]) -> list[int]:
    """The intersection of two unions in which nothing is redundant, each term with each: again such a union."""
    one, other = _all(left), _all(right)
    if not (one | _opposite(one)) & other:  # of different primitives: nothing can become redundant
        return [a | b for a in left for b in right]
    products = {a | b for a in left for b in right}
    return list(_Terms([term for term in products if not term & _opposite(term)]))


def shortened(terms: Iterable[int]) -> list[int]:
    """Shorter terms with the same union, in the order of their literals.

    A literal goes where its opposite is already covered: B * not A = B if A * B lies within another term. This turns
    A + B * not A into A + B, and A * B + A * not B into A.
    """
    terms = set(terms)
    while True:
        known = _Terms(terms)
        shorter = {_shorter(term, known) for term in known}
        if shorter == terms:
            return sorted(terms, key=lambda term: literals([term]))
        terms = shorter


def _shorter(term: int, known: "_Terms") -> int:
    """The term without literals whose opposite is covered; `known` need not hold what was dropped on the way."""
    for literal in literals([term & _opposite(known.occurring)]):
        rest = term & ~(1 << literal)
        if known.cover(rest | 1 << (literal ^ 1)):
            term = rest
    return term


class _Terms:
    """Terms of which none lies within another, and which of them have each literal: asking for all costs a few
    operations on long numbers, where comparing one by one would be slow for thousands."""

    def __init__(self, terms: Collection[int]):
        self._terms: list[int] = []
        self.occurring = _all(terms)
        self._whole = 0  # the place of the term without literals, as a bit
        self._having: dict[int, int] = {}  # a literal's bit: the places of the terms that have it, as bits
        for term in sorted(set(terms), key=int.bit_count):  # a shorter term never lies within a longer one
            if not self.cover(term):
                for literal in literals([term]):
                    self._having[1 << literal] = self._having.get(1 << literal, 0) | 1 << len(self._terms)
                self._whole |= (term == 0) << len(self._terms)
                self._terms.append(term)

    def __iter__(self):
        return iter(self._terms)

    def cover(self, term: int) -> bool:
        """Does the term lie within one of these, that is: does one of them have none but its literals?"""
        candidates = self._whole
        for literal in literals([term]):
            candidates |= self._having.get(1 << literal, 0)
        for literal, having in self._having.items():
            if not candidates:
                return False
            if not term & literal:
                candidates &= ~having
        return candidates != 0


def _all(terms: Iterable[int]) -> int:
    """All literals that occur."""
    return reduce(or_, terms, 0)


def _opposite(term: int) -> int:
    """Each literal the other way: bits 2k and 2k + 1 change places."""
    even = (1 << 2 * (term.bit_length() // 2 + 1)) // 3  # bits 0, 2, 4 …
    return (term & even) << 1 | term >> 1 & even
