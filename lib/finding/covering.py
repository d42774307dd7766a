"""A greedy cover: intersection nodes one after the other, each the one that seems to right most points.

A term is grown literal by literal, from the whole space down, by what its cells are worth. What it then holds is worth
nothing any more, and the next term is grown for what is left. Fast, good on simple shapes, and easily fooled: literals
that pay only together are not found, and a large term that is wrong here and there (for a shape that fills most of its
surroundings, the whole space) shuts out several small ones that are right. A caution of more than 1 helps with the
latter: harm then counts as many times as much.
"""

import time
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from .arrangement import Arrangement, Term

CAUTIONS = (1.0, 3.0, 10.0, 1000.0)


def cover(
    arrangement: Arrangement,
    nodes: int,
    width: int = 1,
    caution: float = 1.0,
    allowed: Bool[np.ndarray, " l"] | None = None,
    deadline: float = np.inf,
) -> list[Term]:
    """At most `nodes` terms that fit; of each length of a term the `width` best ones are followed.

    allowed   (2 G) the literals to choose from, default all
    deadline  of time.perf_counter(): no literal is added after it
    """
    terms: list[Term] = []
    value = np.where(arrangement.value < 0, caution, 1.0) * arrangement.value
    allowed = np.ones(len(arrangement.literals), bool) if allowed is None else allowed.copy()
    while len(terms) < nodes and time.perf_counter() < deadline:
        term, gain = best(arrangement, grow(arrangement, value, allowed, width, deadline), value)
        if gain <= 0:
            break
        terms.append(term)
        value[arrangement.extent(term)] = 0
        taken = [arrangement.opposite(x) for x in term if arrangement.coupled[x % arrangement.rows]]
        allowed[taken] = False
    return prune(arrangement, terms)


def best_cover(
    arrangement: Arrangement,
    nodes: int,
    width: int = 1,
    allowed: Bool[np.ndarray, " l"] | None = None,
    deadline: float = np.inf,
) -> list[Term]:
    """The least wrong of the covers of several cautions, the simplest of equals."""
    covers = [cover(arrangement, nodes, width, caution, allowed, deadline) for caution in CAUTIONS]
    return min(covers, key=arrangement.rank)


def grow(
    arrangement: Arrangement,
    value: Float[np.ndarray, " m"],
    allowed: Bool[np.ndarray, " l"],
    width: int,
    deadline: float = np.inf,
) -> list[Term]:
    """Every term that a beam search meets: the `width` best of no literal, one, two, … by the values they hold.

    A literal is added only where it keeps a cell out that is worth less than 0, and some cell in that is worth more.
    """
    beam, extents, met = [()], np.ones((1, len(value)), bool), [()]
    kinds = np.stack([value, value < 0, value > 0]).astype(np.float32)[:, None]
    while beam and time.perf_counter() < deadline:
        worth, harmful, useful = (
            extents * kinds
        ) @ arrangement.held  # each (beam, 2 G): what a literal keeps in
        excludes = harmful < (extents * kinds[1]).sum(-1, keepdims=True)
        score = np.where(excludes & (useful > 0) & allowed, worth, -np.inf)
        beam, extents = _widest(arrangement, beam, extents, score, width)
        met += beam
    return met


def _widest(arrangement, beam, extents, score, width) -> tuple[list[Term], np.ndarray]:
    """The best `width` terms with one literal more, no two of the same cells."""
    found: dict[bytes, tuple[Term, np.ndarray]] = {}
    for place in np.argsort(-score, axis=None, kind="stable"):
        at, literal = divmod(int(place), score.shape[1])
        if len(found) == width or score[at, literal] == -np.inf:
            break
        extent = extents[at] & arrangement.literals[literal]
        found.setdefault(extent.tobytes(), (tuple(sorted((*beam[at], literal))), extent))
    return [term for term, _ in found.values()], np.array([extent for _, extent in found.values()], bool)


def best(
    arrangement: Arrangement, terms: Sequence[Term], value: Float[np.ndarray, " m"]
) -> tuple[Term, float]:
    """The term that holds most value, the first and shortest of equals, and that value."""
    values = arrangement.extents(terms) @ value
    at = int(np.argmax(values))
    return terms[at], float(values[at])


def prune(arrangement: Arrangement, terms: Sequence[Term]) -> list[Term]:
    """Fewer literals and nodes where that makes nothing worse, until nothing can be left away."""
    before, terms = None, list(terms)
    while terms != before:
        before, terms = terms, _pruned(arrangement, terms)
    return terms


def _pruned(arrangement: Arrangement, terms: list[Term]) -> list[Term]:
    terms = list(terms)
    extents = arrangement.extents(terms)
    for place, term in enumerate(terms):
        others = np.delete(extents, place, 0).any(0)
        terms[place] = _shortened(arrangement, term, np.where(others, 0, arrangement.value))
        extents[place] = arrangement.extent(terms[place])
    for place in sorted(range(len(terms)), key=lambda place: -len(terms[place])):
        others = np.delete(extents, place, 0).any(0)
        if arrangement.value[extents[place] & ~others].sum() <= 0:
            extents[place] = False
            terms[place] = None
    return [term for term in terms if term is not None]


def _shortened(arrangement: Arrangement, term: Term, value: Float[np.ndarray, " m"]) -> Term:
    """Without the literals that keep out nothing, or more good than harm."""
    lacking = (~arrangement.literals[list(term)]).sum(0)  # how many literals of the term each cell lacks
    kept = list(term)
    for literal in term:
        lacks = ~arrangement.literals[literal]
        if value[lacks & (lacking == 1)].sum() >= 0:
            kept.remove(literal)
            lacking = lacking - lacks
    return tuple(kept)
