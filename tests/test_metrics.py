"""Metrics on things whose answer is known by hand."""

import numpy as np
import pytest
import torch
from scipy.optimize import minimize

from lib.interpreters.cuboids import Cuboids
from lib.interpreters.shapeassembly import execute_many, parse
from lib.metrics.points import chamfer_distance, squared_chamfer_distance
from lib.metrics.programs import PAPER_GROUND_TRUTH, program_statistics
from lib.metrics.rootedness import box_distance, connected_to_ground, is_rooted

FLAT = """Assembly Program_0 {
    bbox = Cuboid(1, 1, 1, True)
    cube0 = Cuboid(0.2, 1, 0.2, True)
    squeeze(cube0, bbox, bbox, top, 0.1, 0.5)
    reflect(cube0, X)
}"""
NESTED = """Assembly Program_0 {
    bbox = Cuboid(1, 1, 1, True)
    Program_1 = Cuboid(1, 1, 1, True)
    attach(Program_1, bbox, 0.5, 0, 0.5, 0.5, 0, 0.5)
}
Assembly Program_1 {
    bbox = Cuboid(1, 1, 1, True)
    cube0 = Cuboid(0.1, 1, 0.1, True)
    attach(cube0, bbox, 0.5, 0, 0.5, 0.1, 0, 0.5)
    translate(cube0, X, 3, 0.6)
}"""


def boxes(*rows: tuple) -> Cuboids:
    """Axis-aligned boxes from (center, size) pairs."""
    center, size = (torch.tensor(column, dtype=torch.float64) for column in zip(*rows))
    return Cuboids(size, center, torch.eye(3, dtype=torch.float64).expand(len(rows), 3, 3))


def random_boxes(rng: np.random.Generator, count: int) -> Cuboids:
    turned, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    return Cuboids(*map(torch.tensor, (rng.uniform(0.1, 1, (count, 3)), rng.normal(size=(count, 3)), turned)))


def test_program_statistics_by_hand():
    programs = [parse(FLAT), parse(NESTED)]  # 4 and 3 + 4 lines; one reflect, one translate, one squeeze
    found = program_statistics(programs, execute_many(programs))
    assert (found.programs, found.lines, found.leaves) == (2, 11 / 2, (2 + 4) / 2)
    assert found.macros == {"reflect": 1 / 11, "translate": 1 / 11, "squeeze": 1 / 11}
    assert found.macros_per_line == pytest.approx(3 / 11)
    assert found.as_row()["lines"] == 5.5


def test_no_programs_have_no_statistics():
    with pytest.raises(ValueError, match="no programs"):
        program_statistics([], execute_many([]))


@pytest.mark.parametrize("category", PAPER_GROUND_TRUTH)
def test_the_real_programs_count_as_in_the_paper(category, real_texts, unchecked_shapes):
    """To the digits the paper prints (it truncates), but for its two entries that contradict themselves."""
    programs = [parse(text) for text in real_texts[category].values()]
    found, paper = program_statistics(programs, execute_many(programs)), PAPER_GROUND_TRUTH[category]
    assert found.programs == paper.programs and found.lines == pytest.approx(paper.lines, abs=0.1)
    assert found.leaves == pytest.approx(paper.leaves, abs=0.15)  # storage: 10.68 against 10.8
    for macro, share in paper.macros.items():
        assert found.macros[macro] == pytest.approx(
            share, abs=0.0011 if (category, macro) != ("chair", "reflect") else 0.005
        )


def test_chamfer_distance_by_hand():
    a = torch.tensor([[0.0, 0, 0], [1, 0, 0]])
    b = torch.tensor([[0.0, 0, 2]])
    assert chamfer_distance(a, b) == pytest.approx((2 + 5**0.5) / 2 + 2)  # means of both ways, added
    assert chamfer_distance(a, a) == 0 and chamfer_distance(a, b) == chamfer_distance(b, a)
    assert chamfer_distance(torch.stack([a, a]), torch.stack([b, b])).shape == (2,)
    with pytest.raises(ValueError, match="both clouds need points"):
        chamfer_distance(a, a[:0])


def test_chamfer_distance_pulls_points_together():
    a = torch.tensor([[0.0, 0, 0]], requires_grad=True)
    chamfer_distance(a, torch.tensor([[0.0, 3, 0]])).backward()
    assert a.grad.tolist() == [[0, -2, 0]]


def test_squared_chamfer_distance_by_hand():
    a = torch.tensor([[0.0, 0, 0], [1, 0, 0]])
    b = torch.tensor([[0.0, 0, 2]])
    assert squared_chamfer_distance(a, b) == pytest.approx(((4 + 5) / 2 + 4) / 2)  # the mean of both ways
    assert squared_chamfer_distance(a, a) == 0
    assert squared_chamfer_distance(a, b) == squared_chamfer_distance(b, a)
    assert squared_chamfer_distance(3 * a, 3 * b) == pytest.approx(9 * ((4 + 5) / 2 + 4) / 2)
    for pair in ((a, a[:0]), (a[:0], a)):
        with pytest.raises(ValueError, match="both clouds need points, got [02] and [02]"):
            squared_chamfer_distance(*pair)


def test_squared_chamfer_distances_of_a_batch_are_those_of_its_pairs():
    """And those of every pair of points, squared, without a search."""
    generator = torch.Generator().manual_seed(0)
    a, b = (torch.rand(2, 3, n, 3, generator=generator, dtype=torch.float64) for n in (40, 50))
    found = squared_chamfer_distance(a, b)
    assert found.shape == (2, 3)
    squares = (a.unsqueeze(3) - b.unsqueeze(2)).square().sum(-1)
    torch.testing.assert_close(found, (squares.amin(3).mean(2) + squares.amin(2).mean(2)) / 2)
    for i in range(2):
        for j in range(3):
            torch.testing.assert_close(found[i, j], squared_chamfer_distance(a[i, j], b[i, j]))


def test_squared_chamfer_distance_has_the_gradient_of_its_formula():
    a = torch.tensor([[0.0, 0, 0]], requires_grad=True)
    squared_chamfer_distance(a, torch.tensor([[0.0, 3, 0]])).backward()
    assert a.grad.tolist() == [[0, -6, 0]]
    generator = torch.Generator().manual_seed(0)
    pair = [torch.rand(n, 3, generator=generator, dtype=torch.float64).requires_grad_() for n in (5, 7)]
    assert torch.autograd.gradcheck(squared_chamfer_distance, pair)
    same = torch.zeros(2, 3, requires_grad=True)
    squared_chamfer_distance(same, same.detach()).backward()
    assert not same.grad.any()  # finite where points coincide


@pytest.mark.parametrize(
    "other, distance",
    [
        ((0.5, 0, 0), 0),
        ((1, 0, 0), 0),
        ((3, 0, 0), 2),
        ((2, 2, 0), 2**0.5),
        ((2, 2, 2), 3**0.5),
        ((0, 0, 0), 0),
    ],
    ids=["overlapping", "touching", "faces", "edges", "corners", "the same"],
)
def test_box_distance_of_unit_cubes(other, distance):
    pair = boxes(((0, 0, 0), (1, 1, 1)), (other, (1, 1, 1)))
    assert box_distance(pair[:1], pair[1:]).item() == pytest.approx(distance, abs=1e-9)


def test_box_distance_agrees_with_a_numerical_search():
    rng = np.random.default_rng(0)
    a, b = random_boxes(rng, 30), random_boxes(rng, 30)
    found = box_distance(a, b)
    for i in range(30):

        def squared(q, i=i):
            ends = a[[i]].world(torch.tensor(q[None, :3])) - b[[i]].world(torch.tensor(q[None, 3:]))
            return float((ends**2).sum())

        nearest = minimize(
            squared, np.full(6, 0.5), bounds=[(0, 1)] * 6, method="L-BFGS-B", options={"ftol": 1e-14}
        )
        assert found[i].item() == pytest.approx(nearest.fun**0.5, abs=1e-3)  # what the search reaches
    assert (found == 0).any() and (found > 0).any()


def test_rootedness_by_hand():
    table = boxes(((0, 1, 0), (2, 0.1, 1)), ((0, 0.5, 0), (0.1, 0.9, 0.1)))
    assert is_rooted(table)
    lamp = ((0, 1.5, 0), (0.2, 0.2, 0.2))  # 0.35 above the table: more than 2 % of any diagonal here
    shelf = boxes(((0, 1, 0), (2, 0.1, 1)), ((0, 0.5, 0), (0.1, 0.9, 0.1)), lamp)
    assert connected_to_ground(shelf).tolist() == [True, True, False] and not is_rooted(shelf)


def test_a_gap_of_two_percent_of_the_diagonal_still_connects():
    def stack(gap: float) -> bool:
        return is_rooted(boxes(((0, 0.5, 0), (1, 1, 1)), ((0, 1.5 + gap, 0), (1, 1, 1))))

    diagonal = (1 + 1 + 2.04**2) ** 0.5
    assert stack(0.019 * diagonal) and not stack(0.022 * diagonal)


def test_nothing_is_rooted():
    assert is_rooted(boxes(((0, 0, 0), (1, 1, 1)))[:0])


def test_one_real_chair_is_not_rooted(real_texts):
    """Known of the data set: of the chairs looked at, number 39400 alone is in two pieces."""
    names = ["39400", *sorted(real_texts["chair"])[:40]]
    rooted = [
        is_rooted(shape.cuboids) for shape in execute_many([parse(real_texts["chair"][n]) for n in names])
    ]
    assert rooted == [False] + [True] * 40
