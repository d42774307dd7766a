"""The search against measuring every pair, and Table 4's three numbers on clouds counted by hand."""

import pytest
import torch

from lib.interpreters.shapeassembly import execute_many
from lib.metrics.chamfer import PAPER, Novelty, coverage, generalisation, novelty, variety
from lib.metrics.cloud_search import FIRST, nearest_clouds, paired_distances
from lib.metrics.clouds import surface_points_many
from lib.metrics.points import chamfer_distance

from .programs import program


def points(*coordinates: float) -> torch.Tensor:
    """Clouds of one point each, on the x axis: their Chamfer distance is twice the way between them."""
    return torch.tensor([[[x, 0, 0]] for x in coordinates], dtype=torch.float64)


def boxes(count: int, seed: int, points: int = 48) -> torch.Tensor:
    """Clouds on the surfaces of random boxes that stand on the ground."""
    random = torch.Generator().manual_seed(seed)
    size = 0.2 + torch.rand(count, 1, 3, generator=random, dtype=torch.float64)
    q = torch.rand(count, points, 3, generator=random, dtype=torch.float64)
    axis = torch.randint(3, (count, points, 1), generator=random)
    q = q.scatter(2, axis, q.gather(2, axis).round())
    return (q - torch.tensor([0.5, 0, 0.5])) * size


def every_pair(queries: torch.Tensor, others: torch.Tensor) -> torch.Tensor:
    return torch.stack(
        [chamfer_distance(query.expand_as(others[:, : len(query)]), others) for query in queries]
    )


def test_the_three_numbers_by_hand():
    generated, train, validation = points(0, 1, 10), points(0, 2), points(-1, 4)
    assert generalisation(generated, train) == pytest.approx(2 * (0 + 1 + 8) / 3)
    assert coverage(generated, validation) == pytest.approx(2 * (1 + 3) / 2)
    assert variety(generated) == pytest.approx(2 * (1 + 1 + 9) / 3)


def test_who_is_nearest():
    found = nearest_clouds(points(0, 1, 10), points(11, 0.4))
    assert found.index.tolist() == [1, 1, 0]
    assert found.distance.tolist() == pytest.approx([0.8, 1.2, 2])
    assert nearest_clouds(points(0, 1, 10)).index.tolist() == [1, 0, 1]


def test_the_search_finds_what_measuring_every_pair_finds():
    """Far more candidates than are measured in any case, and no two nearly alike by construction."""
    queries, others = boxes(12, seed=1), boxes(200, seed=2)
    assert len(others) > 5 * FIRST[-1]
    distance, index = every_pair(queries, others).min(1)
    found = nearest_clouds(queries, others)
    assert torch.equal(found.index, index)
    torch.testing.assert_close(found.distance, distance)  # two ways to add up the same numbers


def test_the_nearest_other_one():
    clouds = boxes(60, seed=3)
    distances = every_pair(clouds, clouds).fill_diagonal_(torch.inf)
    found = nearest_clouds(clouds)
    assert torch.equal(found.index, distances.argmin(1))
    torch.testing.assert_close(found.distance, distances.amin(1))


def test_a_giant_does_not_spoil_the_search():
    queries, others = boxes(12, seed=1), boxes(200, seed=2)
    queries[0] *= 1_000
    assert torch.equal(nearest_clouds(queries, others).index, every_pair(queries, others).argmin(1))


def test_a_twin_is_always_found():
    """A cloud among the others is its own nearest, at 0; among its own kind it is not asked."""
    others = boxes(100, seed=4)
    found = nearest_clouds(others[40:60], others)
    assert found.index.tolist() == list(range(40, 60)) and not found.distance.any()
    assert variety(torch.cat([others, others])) == 0
    assert variety(others) > 0


def test_threads_and_units_do_not_matter():
    queries, others = boxes(10, seed=1), boxes(80, seed=2)
    found = nearest_clouds(queries, others)
    assert torch.equal(found.index, nearest_clouds(queries, others, workers=1).index)
    larger = nearest_clouds(queries * 1_000 + 7, others * 1_000 + 7)  # millimetres, elsewhere
    assert torch.equal(found.index, larger.index)
    torch.testing.assert_close(larger.distance, 1_000 * found.distance)


@pytest.mark.parametrize("flat", [[2], [1, 2], [0, 1, 2]])
def test_flat_clouds(flat):
    queries, others = boxes(4, seed=1), boxes(50, seed=2)
    queries[..., flat], others[..., flat] = 0.5, 0.5
    found = nearest_clouds(queries, others)
    torch.testing.assert_close(found.distance, every_pair(queries, others).amin(1))


def test_pairs():
    a, b = boxes(6, seed=1, points=40), boxes(6, seed=2, points=70)
    torch.testing.assert_close(paired_distances(a, b), chamfer_distance(a, b))


@pytest.mark.parametrize(
    "queries, others, message",
    [
        (points(0), None, "found 1 clouds; expected another"),
        (points(0), points(0)[:0], "found 0 clouds; expected another"),
        (points(0, 1)[:, :0], None, r"queries: found an array \(2, 0, 3\)"),
        (points(0, 1), points(float("nan")), "others: found points that are not finite"),
    ],
)
def test_what_cannot_be_compared(queries, others, message):
    with pytest.raises(ValueError, match=message):
        nearest_clouds(queries, others)


def test_pairs_need_a_partner(unchecked_shapes):
    with pytest.raises(ValueError, match="found 2 and 1 clouds; expected pairs"):
        paired_distances(points(0, 1), points(0))


def test_a_row_of_programs():
    """Boxes of 1, 2 and 3: each set has its own points, so a copy is not at 0, but it is nearest."""
    shapes = [execute_many([box(side) for side in sides]) for sides in ((1, 2), (1, 2, 3), (3,))]
    row = novelty(*shapes)
    clouds = [surface_points_many(shape, 1_024, seed) for seed, shape in enumerate(shapes)]
    assert row == Novelty(generalisation(*clouds[:2]), coverage(clouds[0], clouds[2]), variety(clouds[0]))
    assert 0 < row.generalisation < row.coverage
    assert nearest_clouds(*clouds[:2]).index.tolist() == [0, 1]
    assert novelty(*shapes) == row != novelty(*shapes, seed=1)
    assert novelty(*shapes[:2]).coverage is None
    assert novelty(*shapes[:2]).as_row()["coverage"] is None


def box(side: float):
    return program(
        f"cube0 = Cuboid({side}, {side}, {side}, True)", "attach(cube0, bbox, 0.5, 0, 0.5, 0.5, 0, 0.5)"
    )


def test_real_validation_shapes_are_as_far_as_in_the_paper(real_texts, unchecked_shapes):
    """Variety of the storage validation split: the definition of the distance gives the paper's number."""
    from lib.datasets import DataError, shapeassembly
    from lib.interpreters.shapeassembly import parse

    try:
        ids = shapeassembly("storage", "val").ids
        programs = [parse(real_texts["storage"][each]) for each in ids]
    except (DataError, KeyError):
        pytest.skip("the list of validation programs was not fetched")
    found = variety(surface_points_many(execute_many(programs), 1_024, seed=2))
    assert found == pytest.approx(
        PAPER["storage"]["validation"].variety, abs=0.002
    )  # found 0.1242 with other points


def test_no_queries_are_told():
    with pytest.raises(ValueError, match="found no queries"):
        nearest_clouds(torch.zeros(0, 4, 3), torch.zeros(2, 4, 3))
