"""The three matrices of a stump whose primitives are known, found by search: the paper's minimisation problem.

    minimise  the share of points with T != target     over W_C (K), W_I (K, C), W_U (C), all of 0 and 1
    where     F = O xor W_C     S_c = min of the F_k with W_I[k, c] = 1     T = max of the S_c with W_U[c] = 1

`solve` is a binary program (`programming`), given to HiGHS; `greedy` takes one node after the other (`covering`).
Both first merge points that lie in the same primitives into cells (`arrangement`), which changes nothing.
(CSG-Stump Net, Ren et al. 2021, "CSG-Stump Structure"; the search itself is ours, the paper names no method.)
"""

import time
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from .arrangement import Arrangement, Term
from .checks import check_count, is_number
from .covering import best_cover
from .searching import Search

EXACT = 1e-9  # shares closer than this are equal
HEAVIEST = 1e12  # weight: HiGHS takes a cost of 1e20 for infinite, and sums must keep the small ones


class SearchError(ValueError):
    """A search that cannot start: says what was found and what was expected."""

    def __init__(self, found: str, expected: str):
        super().__init__(f"{found}; expected {expected}")
        self.found, self.expected = found, expected


@dataclass(frozen=True, eq=False)
class Matrices:
    """What a search found: `Stump(primitives, found.complement, found.intersection, found.union)`.

    objective  share of the points' weight that is wrong, 0 to 1
    bound      no matrices with as many nodes can have a smaller one
    method     "program" or "greedy": who found these matrices
    seconds    how long the search took

    There are only as many nodes as are used, all united; none where an empty shape is best.
    """

    complement: Bool[Tensor, " k"]
    intersection: Bool[Tensor, "k c"]
    union: Bool[Tensor, " c"]
    objective: float
    bound: float
    method: str
    seconds: float

    @property
    def gap(self) -> float:
        """At most this share of the points could be righted by a longer search."""
        return self.objective - self.bound

    @property
    def proven(self) -> bool:
        """Whether no matrices with as many nodes are better."""
        return self.gap <= EXACT


def solve(
    inside: Bool[Tensor, "k n"],
    target: Bool[Tensor, " n"],
    weights: Float[Tensor, " n"] | None = None,
    nodes: int = 16,
    seconds: float = 10.0,
) -> Matrices:
    """The best matrices with at most `nodes` intersection nodes, within a time limit.

    inside[k, n]  whether point n is in primitive k. List a primitive twice if it may be used both ways: as the paper
                  has it, its complement is taken for all nodes or for none.
    target        which points should be in the shape; weights  what each of them counts, default 1, at least 0
    Raises SearchError for anything else.
    """
    start = time.perf_counter()
    arrangement = arrange(inside, target, weights)
    nodes, seconds = check_limits(nodes, seconds)
    search = Search(arrangement, nodes, seconds - (time.perf_counter() - start))
    search.run()
    return _result(arrangement, search.terms, search.bound, search.method, start)


def greedy(
    inside: Bool[Tensor, "k n"],
    target: Bool[Tensor, " n"],
    weights: Float[Tensor, " n"] | None = None,
    nodes: int = 16,
    seconds: float = 10.0,
    width: int = 1,
) -> Matrices:
    """Matrices by a greedy cover, arguments as in `solve`: after `seconds` no node is added. The bound is what no
    matrices could do better for lack of primitives: points in the same primitives, some to be in and others out."""
    start = time.perf_counter()
    arrangement = arrange(inside, target, weights)
    nodes, seconds = check_limits(nodes, seconds)
    width = check_count("width", width, 1, SearchError)
    terms = best_cover(arrangement, nodes, width, deadline=start + seconds)
    return _result(arrangement, terms, arrangement.floor, "greedy", start)


def _result(arrangement: Arrangement, terms: list[Term], bound: float, method: str, start: float) -> Matrices:
    complement, intersection = arrangement.matrices(terms)
    objective = arrangement.error(terms) / arrangement.total
    return Matrices(
        complement=torch.from_numpy(complement),
        intersection=torch.from_numpy(intersection),
        union=torch.ones(len(terms), dtype=torch.bool),
        objective=objective,
        bound=min(bound / arrangement.total, objective),
        method=method,
        seconds=time.perf_counter() - start,
    )


def arrange(inside, target, weights=None) -> Arrangement:
    """The arrangement of checked points. Raises SearchError."""
    inside, target = _booleans("inside", inside, 2), _booleans("target", target, 1)
    primitives, points = inside.shape
    if not primitives:
        raise SearchError("inside has no row", "one for each primitive, at least one")
    if not points:
        raise SearchError("inside has no column", "one for each point, at least one")
    if len(target) != points:
        raise SearchError(f"inside tells of {points} points, target of {len(target)}", "as many")
    return Arrangement.of(inside, target, _weights(weights, points))


def _booleans(name: str, given, dimensions: int) -> np.ndarray:
    expected = "a matrix (K, N) of bools" if dimensions == 2 else "a vector (N) of bools"
    if not isinstance(given, Tensor):
        raise SearchError(f"{name} is a {type(given).__name__}", f"{expected}, as a tensor")
    if given.dtype != torch.bool:
        raise SearchError(f"{name} holds {given.dtype}", f"{expected}, such as distances <= 0")
    if given.ndim != dimensions:
        raise SearchError(f"{name} has the shape {tuple(given.shape)}", expected)
    return given.cpu().numpy()


def _weights(given, points: int) -> np.ndarray:
    if given is None:
        return np.ones(points)
    try:
        weights = torch.as_tensor(given).detach().cpu().double().numpy()
    except (TypeError, ValueError, RuntimeError):
        raise SearchError(f"weights are {given!r:.40}", "a vector (N) of numbers") from None
    if weights.shape != (points,):
        raise SearchError(f"weights have the shape {weights.shape}", f"({points},), one for each point")
    if not (np.isfinite(weights).all() and (weights >= 0).all() and weights.any()):
        raise SearchError("weights that are negative, not finite, or all 0", "at least 0, and some more")
    if weights.max() > HEAVIEST:
        raise SearchError(f"a weight of {weights.max():g}", f"at most {HEAVIEST:g}: only their ratios matter")
    return weights


def check_limits(nodes, seconds) -> tuple[int, float]:
    """At most so many nodes, and the time limit. Raises SearchError."""
    if not is_number(seconds) or seconds <= 0:
        raise SearchError(f"seconds is {seconds!r:.40}", "a time limit, more than 0")
    return check_count("nodes", nodes, 1, SearchError), float(seconds)
