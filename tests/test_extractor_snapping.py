"""Naming the axes of boxes, and putting upright what nearly is."""

import math

import pytest
import torch

from lib.extractor.snapping import TURNS, is_upright, rename_axes, snap, snap_leaves, turning_axis
from lib.interpreters.cuboids import Cuboids

from .graphs import batch, box, corner_set, graph, leaf, node, random_boxes, turn

UPRIGHT = torch.eye(3, dtype=torch.float64)


def renamed(boxes: Cuboids, names: torch.Tensor) -> Cuboids:
    """The same boxes, their axes called otherwise."""
    return Cuboids((names.abs() @ boxes.size.unsqueeze(-1)).squeeze(-1), boxes.center, names @ boxes.axes)


# Names


def test_there_are_24_names():
    assert len({tuple(names.flatten().tolist()) for names in TURNS}) == 24
    assert (torch.linalg.det(TURNS) == 1).all()
    assert torch.equal(TURNS[0], UPRIGHT)


def test_names_do_not_matter():
    """Random boxes never have two best names; 1e-12: a permutation rounds nothing but the sum of the trace."""
    boxes = random_boxes(seed=0, count=50)
    wanted = rename_axes(boxes)
    for names in TURNS:
        found = rename_axes(renamed(boxes, names))
        for name in ("size", "center", "axes"):
            torch.testing.assert_close(getattr(found, name), getattr(wanted, name), rtol=0, atol=1e-12)


def test_the_names_chosen_need_the_smallest_turn():
    boxes = random_boxes(seed=1, count=200)
    trace = rename_axes(boxes).axes.diagonal(dim1=-2, dim2=-1).sum(-1)
    others = torch.stack([renamed(boxes, names).axes.diagonal(dim1=-2, dim2=-1).sum(-1) for names in TURNS])
    torch.testing.assert_close(trace, others.amax(0), rtol=0, atol=1e-9)  # ties are broken within 1e-9
    turned = torch.rad2deg(torch.arccos(((trace - 1) / 2).clamp(max=1)))
    assert (
        turned.max() < 62.8
    )  # no box is farther from one of its names: arccos((2 sqrt 2 + 1) / 4 - 1/2) + rounding


def test_a_box_keeps_its_corners():
    boxes = random_boxes(seed=2, count=100)
    assert corner_set(rename_axes(boxes)) == corner_set(boxes)
    assert (torch.linalg.det(rename_axes(boxes).axes) > 0).all()


@pytest.mark.parametrize("names", range(24))
def test_an_upright_box_by_any_name_is_upright(names):
    found = snap(renamed(batch(box((1, 2, 3))), TURNS[names]))
    assert found.size.tolist() == [[1, 2, 3]]
    assert torch.equal(found.axes[0], UPRIGHT)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_axis_of_a_turn(axis):
    found = turning_axis(turn(20, axis))
    torch.testing.assert_close(found, UPRIGHT[axis])


def test_what_is_not_turned_has_no_axis():
    assert turning_axis(UPRIGHT).isfinite().all()


# Five degrees


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("degrees, straight", [(4.99, True), (-4.99, True), (5.01, False), (-5.01, False)])
def test_five_degrees(axis, degrees, straight):
    leaning = batch(box((1, 2, 3), (4, 5, 6), turn(degrees, axis)))
    snapped = snap(leaning)
    assert is_upright(rename_axes(leaning)).tolist() == [straight]
    assert torch.equal(snapped.axes[0], UPRIGHT if straight else leaning.axes[0])
    assert snapped.size.tolist() == [[1, 2, 3]] and snapped.center.tolist() == [[4, 5, 6]]


def test_almost_a_quarter_turn_is_upright_by_another_name():
    """Turned by 86 degrees about z, 1 wide and 2 high is 2 wide and 1 high."""
    snapped = snap(batch(box((1, 2, 3), (0, 0, 0), turn(86, 2))))
    assert snapped.size.tolist() == [[2, 1, 3]] and torch.equal(snapped.axes[0], UPRIGHT)


@pytest.mark.parametrize("lean, straight", [(4.9, True), (5.1, False)])
@pytest.mark.parametrize("roll", [10, 30, 44, 60])
def test_the_roll_of_a_thin_square_bar_does_not_count(roll, lean, straight):
    """Rolled about its own length, then leant."""
    for long in range(3):
        size = [0.05, 0.05, 0.05]
        size[long] = 1
        axes = turn(roll, long) @ turn(lean, (long + 1) % 3)
        snapped = snap(batch(box(size, (1, 2, 3), axes)))
        assert torch.equal(snapped.axes[0], UPRIGHT) == straight
        if straight:
            assert snapped.size.tolist() == [size]


BARS = [
    ((0.099, 1, 0.099), True),
    ((0.101, 1, 0.101), False),  # sides of a tenth of the length: not thin
    ((0.05, 1, 0.0451), True),
    ((0.05, 1, 0.0449), False),  # sides that differ by a tenth: not square
    ((0.5, 0.5, 0.5), False),
    ((1, 0.05, 1), False),  # a plate is no bar, though its base is square
]


@pytest.mark.parametrize("size, rolls", BARS)
def test_only_thin_square_bars_roll(size, rolls):
    assert is_upright(batch(box(size, axes=turn(30, 1)))).tolist() == [rolls]


def test_a_bar_moves_by_no_more_than_its_roll_shows():
    """The corners of a thin square bar move by no more than its cross-section's diagonal, a seventh of its length."""
    rolled = batch(box((0.09, 1, 0.09), (0, 0, 0), turn(45, 1)))
    moved = torch.cdist(snap(rolled).corners(), rolled.corners()).amin(-1).max()
    assert 0 < moved < math.hypot(0.09, 0.09)


def test_snapping_twice_changes_nothing():
    boxes = random_boxes(seed=3, count=100)
    once = snap(boxes)
    for name in ("size", "center", "axes"):
        assert torch.equal(getattr(snap(once), name), getattr(once, name))


def test_leaves_are_snapped_and_nothing_else_changes():
    leant = leaf((1, 2, 3), (1, 1, 1), "back", turn(3, 0))
    before = graph(node("a", leant), leaf((1, 1, 1), axes=turn(30, 1)), name="mine", category="chair")
    after = snap_leaves(before)
    back, turned = after.root.leaves()
    assert (back.label, back.id, after.name, after.category) == ("back", leant.id, "mine", "chair")
    assert torch.equal(back.box.axes, UPRIGHT) and torch.equal(turned.box.axes, turn(30, 1))
    assert after.root.children[0].box is before.root.children[0].box
