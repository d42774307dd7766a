"""Random stumps: what they promise, and what they refuse."""

import numpy as np
import pytest
import torch

from lib.interpreters.stump import KINDS, ProgramError, parse, sample
from lib.interpreters.stump.bounds import bounds
from lib.interpreters.stump.sampling import FILLED, MOST_PRIMITIVES
from tests.conftest import unchecked
from tests.stumps import masks, stump_occupancy


@pytest.fixture(scope="module", params=[2, 3])
def stumps(request):
    rng = np.random.default_rng(request.param)
    with unchecked():
        return [sample(rng, request.param) for _ in range(100)]


def cube(dimensions: int) -> torch.Tensor:
    """Points that the sampler does not know."""
    points = np.random.default_rng(9).uniform(-0.5, 0.5, (6000, dimensions))
    return torch.from_numpy(points)


def test_sizes_and_kinds(stumps):
    dimensions = stumps[0].dimensions
    assert {len(stump.primitives) for stump in stumps} == set(range(2, 9))
    assert {len(stump.union) for stump in stumps} == {1, 2, 3, 4}
    kinds = {primitive.name for stump in stumps for primitive in stump.primitives}
    assert kinds == {name for name, kind in KINDS.items() if kind.dimensions == dimensions}
    assert 20 < sum(bool(stump.complement.any()) for stump in stumps) < 90
    assert any(bool((stump.intersection.sum(1) > 1).any()) for stump in stumps)  # shared between nodes


def test_all_is_used_and_bounded(stumps):
    for stump in stumps:
        assert stump.union.all() and stump.intersection.any(1).all()
        assert bounds(stump).isfinite().all()


def test_the_cube_is_neither_empty_nor_full_and_every_node_counts(stumps, unchecked_shapes):
    """Points of its own are told from a grid; other points see them where the part is not too small."""
    points = cube(stumps[0].dimensions)
    for stump in stumps:
        inside = masks(list(stump.primitives), points)
        whole = stump_occupancy(stump, inside)
        assert 0.7 * FILLED[0] < whole.double().mean() < 1.1 * FILLED[1]
        for node in range(len(stump.union)):
            without = stump.union.clone()
            without[node] = False
            other = type(stump)(stump.primitives, stump.complement, stump.intersection, without)
            assert not torch.equal(stump_occupancy(other, inside), whole)


def test_texts_are_readable(stumps):
    for stump in stumps:
        assert parse(stump.to_text()) == stump
        numbers = stump.parameters()
        assert torch.equal(numbers, numbers.mul(1000).round().div(1000))


def test_equal_seeds_equal_stumps(unchecked_shapes):
    assert sample(np.random.default_rng(3)) == sample(np.random.default_rng(3))
    assert sample(np.random.default_rng(3)) != sample(np.random.default_rng(4))


@pytest.mark.parametrize("primitives, nodes", [(1, 1), (1, None), (5, 5), (8, 1), (16, 4), (None, 6)])
@pytest.mark.parametrize("dimensions", [2, 3])
def test_as_many_as_asked_for(dimensions, primitives, nodes, unchecked_shapes):
    stump = sample(np.random.default_rng(1), dimensions, primitives, nodes)
    assert primitives is None or len(stump.primitives) == primitives
    assert nodes is None or len(stump.union) == nodes


@pytest.mark.parametrize(
    "given, words",
    [
        ({"rng": 7}, "found 7; expected a numpy Generator"),
        ({"dimensions": 4}, "4 dimensions; expected 2 or 3"),
        ({"dimensions": [3]}, "3. dimensions; expected 2 or 3"),
        ({"primitives": 0}, f"0 primitives; expected a whole number from 1 to {MOST_PRIMITIVES}"),
        ({"primitives": 17}, f"17 primitives; expected a whole number from 1 to {MOST_PRIMITIVES}"),
        ({"primitives": 2.0}, "2.0 primitives; expected a whole number"),
        ({"primitives": True}, "True primitives; expected a whole number"),
        ({"primitives": 3, "nodes": 4}, "4 nodes; expected a whole number from 1 to 3"),
        ({"nodes": 0}, "0 nodes; expected a whole number"),
        ({"nodes": "two"}, "'two' nodes; expected a whole number"),
    ],
)
def test_what_cannot_be_sampled(given, words):
    with unchecked(), pytest.raises(ProgramError, match=words):
        sample(**{"rng": np.random.default_rng(0), **given})
