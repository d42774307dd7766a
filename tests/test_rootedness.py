"""Rootedness of many shapes at once. That of single ones is in test_metrics."""

import numpy as np
import torch

from lib.interpreters.cuboids import Cuboids
from lib.interpreters.shapeassembly import execute_many
from lib.metrics.rootedness import PAIRS_AT_ONCE, Links, box_distance, connected_to_ground, is_rooted, rooted

from .test_metrics import boxes, random_boxes

CUBE = boxes(((0, 0, 0), (1, 1, 1)))
APART = boxes(((0, 0, 0), (1, 1, 1)), ((0, 3, 0), (1, 1, 1)))
SIDE_BY_SIDE = boxes(((0, 0, 0), (1, 1, 1)), ((3, 0, 0), (1, 1, 1)), ((3, 1, 0), (1, 1, 1)))


def test_each_shape_by_itself_though_all_are_looked_at_together():
    """The shapes lie on top of one another; what a box of another shape touches does not count."""
    assert rooted([CUBE, APART, CUBE[:0], SIDE_BY_SIDE, APART]).tolist() == [True, False, True, True, False]


def test_no_shapes():
    assert rooted([]).tolist() == [] and rooted([CUBE[:0]]).tolist() == [True]


def test_components_by_hand():
    found = Links.of([APART, CUBE[:0], SIDE_BY_SIDE, CUBE]).components()
    assert [part.tolist() for part in found] == [[0, 1], [], [0, 1, 1], [0]]  # the ground connects nothing


def brute_force(cuboids: Cuboids) -> list[bool]:
    """Grounded boxes found by spreading from the ground, every pair measured."""
    low, high = cuboids.bounds()
    reach, count = 0.02 * (high - low).norm(), len(cuboids)
    one, other = torch.cartesian_prod(torch.arange(count), torch.arange(count)).T
    near = (box_distance(cuboids[one], cuboids[other]) <= reach).view(count, count)
    found = cuboids.corners()[..., 1].amin(1) - low[1] <= reach
    for _ in range(count):
        found = found | near[found].any(0)
    return found.tolist()


def test_as_when_every_pair_is_measured(unchecked_shapes):
    rng = np.random.default_rng(0)
    shapes = [random_boxes(rng, int(count)) for count in rng.integers(1, 12, 150)]
    assert sum(len(shape) * (len(shape) - 1) // 2 for shape in shapes) > PAIRS_AT_ONCE  # more than one part
    expected = [brute_force(shape) for shape in shapes]
    assert [connected_to_ground(shape).tolist() for shape in shapes] == expected
    answers = rooted(shapes)
    assert answers.tolist() == [all(each) for each in expected] and 0 < answers.mean() < 1


def test_shapes_of_programs_are_taken_as_they_are(programs):
    shapes = execute_many(programs)
    assert rooted(shapes).tolist() == [is_rooted(shape.cuboids) for shape in shapes]


def test_single_precision_and_gradients_do_not_matter():
    single = Cuboids(*(each.float().requires_grad_() for each in vars(SIDE_BY_SIDE).values()))
    assert rooted([single, SIDE_BY_SIDE]).all()


def test_what_is_nowhere_is_not_rooted():
    assert not is_rooted(boxes(((0, float("nan"), 0), (1, 1, 1))))
