"""The search for a stump's matrices: against enumeration of all matrices, on planted stumps, and within its time."""

import time
from itertools import product

import numpy as np
import pytest
import torch

from lib.finding.arrangement import Arrangement
from lib.finding.covering import best_cover, prune
from lib.finding.matrices import SearchError, greedy, solve
from lib.finding.programming import layers
from lib.finding.separating import separate
from lib.finding.terms import every
from lib.interpreters.stump.layers import binary


def discs(rng: np.random.Generator, count: int, points: int = 300) -> torch.Tensor:
    """Which random points of a square are in which random discs."""
    where = rng.uniform(-1, 1, (points, 2))
    apart = np.linalg.norm(where - rng.uniform(-0.7, 0.7, (count, 1, 2)), axis=-1)
    return torch.from_numpy(apart <= rng.uniform(0.3, 0.8, (count, 1)))


def shape(inside: torch.Tensor, complement, intersection, union) -> torch.Tensor:
    return binary(inside, complement, intersection, union)[1]


def wrong(found, inside, target, weights=None) -> float:
    """The objective by its definition."""
    weights = torch.ones(len(target), dtype=torch.float64) if weights is None else weights
    mistaken = shape(inside, found.complement, found.intersection, found.union) != target
    return float(weights[mistaken].sum() / weights.sum())


def least(inside: torch.Tensor, target: torch.Tensor, nodes: int) -> float:
    """The smallest objective of all matrices, each tried."""
    count, best = len(inside), float((target != 0).double().mean())  # no node: an empty shape
    every_node = torch.tensor(list(product((False, True), repeat=count)))
    for complement in every_node:
        held = binary(inside, complement, every_node.T, torch.ones(len(every_node), dtype=torch.bool))[0]
        for chosen in product(range(len(every_node)), repeat=nodes):
            best = min(best, float((held[list(chosen)].any(0) != target).double().mean()))
    return best


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("count, nodes", [(1, 1), (2, 2), (3, 1), (3, 2), (4, 1), (4, 2)])
def test_nothing_is_better_than_what_is_proven(count, nodes, seed):
    rng = np.random.default_rng([count, nodes, seed])
    inside = discs(rng, count, 60)
    if seed % 4 == 3:
        inside[-1] = inside[0]  # one primitive listed twice
    target = torch.from_numpy(rng.random(60) < 0.4) ^ inside[0]
    found = solve(inside, target, nodes=nodes)
    assert found.proven and found.objective == pytest.approx(least(inside, target, nodes), abs=1e-12)
    assert found.objective == pytest.approx(wrong(found, inside, target), abs=1e-12)
    assert len(found.union) <= nodes


@pytest.mark.parametrize("seed", range(4))
def test_the_paper_s_own_program_agrees(seed):
    rng = np.random.default_rng(seed)
    inside = discs(rng, 4)
    target = torch.from_numpy(rng.random(300) < 0.3) ^ (inside[0] & ~inside[1])
    arrangement = Arrangement.of(inside.numpy(), target.numpy(), np.ones(300))
    answer = layers(arrangement, 2, 20.0)
    found = solve(inside, target, nodes=2)
    assert arrangement.fits(answer.terms)
    assert arrangement.error(answer.terms) == answer.bound == pytest.approx(300 * found.objective)
    literals = sum(map(len, answer.terms)) + len(answer.terms)
    assert literals == int(found.intersection.sum()) + len(found.union)  # both are the simplest


def planted(rng: np.random.Generator, count: int, nodes: int, points: int = 1000):
    """(inside, target) of random matrices."""
    inside = discs(rng, count, points)
    complement = torch.from_numpy(rng.random(count) < 0.4)
    intersection = torch.from_numpy(rng.random((count, nodes)) < 2.5 / count)
    return inside, shape(inside, complement, intersection, torch.ones(nodes, dtype=torch.bool))


@pytest.mark.parametrize("seed", range(10))
def test_planted_stumps_are_found(seed):
    inside, target = planted(np.random.default_rng(seed), 10, 5)
    found = solve(inside, target, nodes=5, seconds=30)
    assert found.objective == 0 and found.proven
    assert torch.equal(shape(inside, found.complement, found.intersection, found.union), target)


@pytest.mark.parametrize("seed", range(6))
def test_a_search_is_never_worse_than_the_greedy_cover(seed):
    rng = np.random.default_rng(seed)
    inside, target = planted(rng, 12, 5)
    target ^= torch.from_numpy(rng.random(1000) < 0.1)
    weights = torch.from_numpy(rng.random(1000))
    cover, found = (
        greedy(inside, target, weights, nodes=4),
        solve(inside, target, weights, nodes=4, seconds=1),
    )
    for result in (cover, found):
        assert result.objective == pytest.approx(wrong(result, inside, target, weights), abs=1e-12)
        assert result.bound <= result.objective and len(result.union) <= 4
    assert cover.bound <= found.bound and found.objective <= cover.objective
    assert cover.method == "greedy" and found.method in ("greedy", "program")


def test_the_complement_is_one_for_all_nodes_unless_a_primitive_is_listed_twice():
    # Points in none, the first, the second, and both; wanted where just one holds: A and not B, or B and not A.
    inside = torch.tensor([[0, 1, 0, 1], [0, 0, 1, 1]]).bool().repeat(1, 5)
    target = inside[0] ^ inside[1]
    assert solve(inside, target).objective == pytest.approx(0.25) and solve(inside, target).proven
    twice = inside.repeat(2, 1)
    found = solve(twice, target)
    assert found.objective == 0 and found.intersection.sum() == 4 and len(found.union) == 2
    assert found.complement[:2].tolist() == [False, False] and found.complement[2:].tolist() == [True, True]
    negated = torch.cat([inside, ~inside])  # the complement may be in the list already
    assert solve(negated, target).objective == 0 == wrong(solve(negated, target), negated, target)


def test_a_plate_with_a_hole_is_read_at_a_glance():
    x = torch.linspace(-1, 1, 101)
    grid = torch.stack(torch.meshgrid(x, x, indexing="ij"), -1).reshape(-1, 2)
    plate, hole = grid.abs().amax(1) <= 0.8, grid.norm(dim=1) <= 0.3
    decoy = (grid - 0.1).norm(dim=1) <= 0.7
    found = solve(torch.stack([decoy, plate, hole]), plate & ~hole)
    assert found.intersection.tolist() == [[False], [True], [True]]  # no decoy, nothing said twice
    assert found.complement.tolist() == [False, False, True] and found.union.tolist() == [True]


@pytest.mark.parametrize("wanted, nodes", [(False, 0), (True, 1)])
def test_nothing_and_everything(wanted, nodes):
    inside = discs(np.random.default_rng(0), 3)
    found = solve(inside, torch.full((300,), wanted))
    assert found.objective == 0 and found.intersection.shape == (3, nodes) and not found.intersection.any()


@pytest.mark.parametrize("alike", [torch.zeros(2, 6), torch.ones(2, 6)])
def test_primitives_that_tell_nothing_apart(alike):
    target = torch.tensor([True, True, True, False, False, True])
    found = solve(alike.bool(), target)
    assert found.objective == pytest.approx(1 / 3) and found.proven


def test_points_without_weight_have_no_say():
    inside, target = planted(np.random.default_rng(1), 6, 3)
    weights = torch.ones(1000, dtype=torch.float64)
    weights[::3] = 0
    target[::3] ^= True
    assert solve(inside, target, weights, nodes=3).objective == 0


def test_repeated_points_are_weights():
    rng = np.random.default_rng(2)
    inside, target = discs(rng, 5, 80), torch.from_numpy(rng.random(80) < 0.5)
    times = torch.from_numpy(rng.integers(1, 4, 80))
    many = solve(inside.repeat_interleave(times, 1), target.repeat_interleave(times), nodes=3)
    weighed = solve(inside, target, times.double() / 7, nodes=3)
    assert many.objective == pytest.approx(weighed.objective) and many.bound == pytest.approx(weighed.bound)


def test_the_same_question_has_the_same_answer():
    inside, target = planted(np.random.default_rng(3), 12, 6)
    first, again = (solve(inside, target, nodes=6, seconds=30) for _ in range(2))
    for key in ("complement", "intersection", "union"):
        assert torch.equal(getattr(first, key), getattr(again, key))
    order = torch.randperm(1000, generator=torch.Generator().manual_seed(0))
    assert torch.equal(
        solve(inside[:, order], target[order], nodes=6, seconds=30).intersection, first.intersection
    )


def test_the_gap_is_honest_where_the_time_is_too_short():
    rng = np.random.default_rng(4)
    inside = discs(rng, 30, 2000)
    target = torch.from_numpy(rng.random(2000) < 0.5)
    found = solve(inside, target, nodes=8, seconds=0.05)
    assert not found.proven and 0 < found.gap == found.objective - found.bound
    longer = solve(inside, target, nodes=8, seconds=2)
    assert longer.objective <= found.objective and found.bound <= longer.objective


@pytest.mark.parametrize("seed", range(5))
def test_every_term_that_matters_is_listed_once(seed):
    """Against all sets of literals: each keeps out something harmful alone, and something useful stays in."""
    rng = np.random.default_rng(seed)
    inside, target = discs(rng, 4), torch.from_numpy(rng.random(300) < 0.5)
    arrangement = Arrangement.of(inside.numpy(), target.numpy(), np.ones(300))
    harm, expected = 0.3 * -arrangement.value.clip(max=0).sum(), []
    for some in product((False, True), repeat=8):
        term = tuple(np.flatnonzero(some).tolist())
        extent, bad = arrangement.extent(term), arrangement.value < 0
        needed = all((arrangement.extent(tuple(set(term) - {x})) & ~extent & bad).any() for x in term)
        if (
            needed
            and (extent & (arrangement.value > 0)).any()
            and -arrangement.value[extent & bad].sum() <= harm
        ):
            expected.append(term)
    assert every(arrangement, harm, 10**6, np.inf) == sorted(expected) and expected
    assert every(arrangement, harm, len(expected) - 1, np.inf) is None
    assert every(arrangement, harm, 10**6, time.perf_counter() - 1) is None


@pytest.mark.parametrize("seed", range(5))
def test_the_complements_alone_bound_all(seed):
    rng = np.random.default_rng(seed)
    inside, target = discs(rng, 4, 100), torch.from_numpy(rng.random(100) < 0.5)
    arrangement = Arrangement.of(inside.numpy(), target.numpy(), np.ones(100))
    bound, allowed = separate(arrangement, 10.0)
    assert bound == pytest.approx(
        100 * solve(inside, target, nodes=16).objective
    )  # 16 nodes are any number here
    assert (allowed[:4] ^ allowed[4:]).all()


def test_pruning_makes_nothing_worse():
    rng = np.random.default_rng(5)
    for _ in range(30):
        inside, target = discs(rng, 6), torch.from_numpy(rng.random(300) < 0.5)
        arrangement = Arrangement.of(inside.numpy(), target.numpy(), np.ones(300))
        literals = 2 * arrangement.rows
        terms = [tuple(np.flatnonzero(rng.random(literals) < 0.3).tolist()) for _ in range(4)]
        fewer = prune(arrangement, terms)
        assert arrangement.error(fewer) <= arrangement.error(terms) and len(fewer) <= 4
        assert prune(arrangement, best_cover(arrangement, 4)) == best_cover(arrangement, 4)


def test_no_term_can_help_where_every_cell_is_better_left_out():
    inside = discs(np.random.default_rng(6), 3)
    target = torch.arange(300) % 7 == 0  # scattered: no cell has more points that should be in
    found = solve(inside, target)
    assert found.proven and len(found.union) == 0 and found.objective == pytest.approx(43 / 300)


GOOD = {"inside": torch.ones(2, 3, dtype=torch.bool), "target": torch.ones(3, dtype=torch.bool)}


@pytest.mark.parametrize(
    "bad, found, expected",
    [
        ({"inside": torch.ones(0, 3).bool()}, "inside has no row", "one for each primitive"),
        ({"inside": torch.ones(2, 0).bool()}, "inside has no column", "one for each point"),
        ({"target": torch.ones(4).bool()}, "inside tells of 3 points, target of 4", "as many"),
        ({"inside": torch.ones(3).bool()}, "inside has the shape (3,)", "a matrix (K, N)"),
        ({"target": torch.ones(3, 1).bool()}, "target has the shape (3, 1)", "a vector (N)"),
        ({"inside": torch.ones(2, 3)}, "inside holds torch.float32", "distances <= 0"),
        ({"target": [True] * 3}, "target is a list", "tensor"),
        ({"weights": torch.ones(2)}, "weights have the shape (2,)", "(3,)"),
        ({"weights": torch.tensor([1.0, -1.0, 1.0])}, "negative", "at least 0"),
        ({"weights": torch.tensor([1.0, torch.nan, 1.0])}, "not finite", "at least 0"),
        ({"weights": torch.zeros(3)}, "all 0", "some more"),
        ({"weights": torch.full((3,), 1e308, dtype=torch.double)}, "a weight of 1e+308", "at most 1e+12"),
        ({"weights": "many"}, "weights are 'many'", "a vector (N) of numbers"),
        ({"nodes": 0}, "nodes is 0", "1 or more"),
        ({"nodes": 1.5}, "nodes is 1.5", "a whole number"),
        ({"seconds": 0}, "seconds is 0", "more than 0"),
        ({"seconds": float("nan")}, "seconds is nan", "more than 0"),
        ({"seconds": "long"}, "seconds is 'long'", "a time limit"),
    ],
)
def test_bad_questions(bad, found, expected, unchecked_shapes):
    with pytest.raises(SearchError) as error:
        solve(**GOOD | bad)
    assert found in error.value.found and expected in error.value.expected
    assert str(error.value) == f"{error.value.found}; expected {error.value.expected}"


def test_a_bad_width():
    with pytest.raises(SearchError, match="width is 0"):
        greedy(**GOOD, width=0)


def test_limits_may_be_numpy_s_and_greed_heeds_them_too(unchecked_shapes):
    limits = {"nodes": np.int64(4), "seconds": np.float32(1)}
    assert solve(**GOOD, **limits).objective == greedy(**GOOD, **limits).objective == 0
    inside, target = planted(np.random.default_rng(3), 12, 6)
    assert len(greedy(inside, target, seconds=1e-9).union) == 0 < len(greedy(inside, target).union)
    with pytest.raises(SearchError, match="seconds is 0"):
        greedy(**GOOD, seconds=0)
