"""Steps whose size is known."""

import pytest
import torch

from lib.interpreters.shapeassembly import execute_many
from lib.metrics.interpolation import StepSize, geometric_steps, scales, step_size, still_step

from .programs import program


def box(x: float, axis: str | None = None):
    """A box of 0.1 at x, mirrored or not."""
    return program(
        "cube0 = Cuboid(0.1, 0.1, 0.1, True)",
        f"attach(cube0, bbox, 0.5, 0, 0.5, {x}, 0, 0.5)",
        *([f"reflect(cube0, {axis})"] if axis else []),
    )


def test_the_scale_is_the_diagonal():
    wide = program("cube0 = Cuboid(1, 2, 2, True)", "attach(cube0, bbox, 0.5, 0, 0.5, 0.5, 0, 0.5)")
    assert scales(execute_many([wide, box(0.5)])).tolist() == pytest.approx([3, 0.1 * 3**0.5])


def test_a_far_step_is_its_way():
    """Two boxes a way of 1 apart: twice the way, but for some of their size, by their diagonal."""
    step = geometric_steps(execute_many([box(0), box(0.5), box(1)]))
    assert step.shape == (2,)
    assert step.tolist() == pytest.approx(2 * [2 / (0.1 * 3**0.5)], rel=0.1)  # the size is 10 % of the way


def test_a_step_of_nothing_is_the_distance_of_two_clouds():
    shapes = execute_many([box(0.5)] * 5)
    steps = geometric_steps(shapes)
    assert steps.mean() == pytest.approx(still_step(shapes), rel=0.05)  # other points each time
    assert 0 < still_step(shapes) < 0.1


def test_program_steps_by_hand():
    sequence = [box(0), box(0.1), box(0.1, "X"), box(0.1, "Z")]  # 0, 3 and 1 edits
    assert step_size([sequence]).program == pytest.approx(4 / 3)


def test_each_step_counts_once_and_none_leads_from_one_sequence_to_the_next():
    one, other = [box(0), box(0.02), box(0.04)], [box(0.9, "X"), box(0.9, "X")]
    found = step_size([one, other])
    assert found.program == 0
    steps = geometric_steps(execute_many(one + other))[torch.tensor([True, True, False, True])]
    assert found.geometric == pytest.approx(float(steps.mean()))
    assert steps.max() < 1  # the way to the other sequence is longer: it would show


def test_seeded():
    sequence = [[box(0), box(0.1)]]
    assert step_size(sequence) == step_size(sequence)
    assert step_size(sequence).geometric != step_size(sequence, seed=1).geometric
    assert isinstance(step_size(sequence), StepSize)


def test_a_sequence_has_two_ends():
    with pytest.raises(ValueError, match="sequence 1 has 1 programs; expected at least 2"):
        step_size([[box(0), box(1)], [box(0)]])
    with pytest.raises(ValueError, match="no sequences"):
        step_size([])
