"""Leaves that run into others become shorter, and nobody sees a difference."""

import pytest
import torch

from lib.extractor import PartGraph, extract
from lib.extractor.regularising import in_order
from lib.extractor.shortening import DEEPEST, INSIDE, shorten, shorten_boxes
from lib.interpreters.cuboids import Cuboids

from .graphs import batch, between, box, corner_set, graph, leaf, node, random_boxes, shuffled, tensor, turn

SEAT = between((0, 5, 0), (10, 6, 10))


def shortened(*boxes: Cuboids) -> list[list[list[float]]]:
    """Lowest and highest corner of each box that is left."""
    result, hidden = shorten_boxes(batch(*boxes))
    kept = [result[i : i + 1].bounds() for i in range(len(boxes)) if i not in hidden]
    return [pytest.approx(bounds.flatten().tolist()) for bounds in kept]


def bounds(*boxes: Cuboids) -> list[list[float]]:
    return [[*low, *high] for b in boxes for low, high in [batch(b).bounds().tolist()]]


# By hand


@pytest.mark.parametrize("top", [5.1, 5.5, 6.0])
def test_a_leg_that_runs_into_the_seat_ends_below_it(top):
    leg = between((1, 0, 1), (2, top, 2))
    assert bounds(between((1, 0, 1), (2, 5, 2)), SEAT) == shortened(leg, SEAT)


def test_a_leg_through_the_seat_stays():
    """What sticks out above would be lost."""
    leg = between((1, 0, 1), (2, 6.5, 2))
    assert bounds(leg, SEAT) == shortened(leg, SEAT)


def test_a_leg_that_only_touches_stays():
    leg = between((1, 0, 1), (2, 5, 2))
    assert bounds(leg, SEAT) == shortened(leg, SEAT)


def test_a_leg_half_inside_the_seat_stays():
    """Not all of its top lies in the seat."""
    leg = between((-0.5, 0, 1), (0.5, 5.5, 2))
    assert bounds(leg, SEAT) == shortened(leg, SEAT)


@pytest.mark.parametrize("out, inside", [(0.5 * INSIDE, True), (3 * INSIDE, False)])
def test_a_little_outside_still_counts_as_inside(out, inside):
    """A share of the longest side, 10, above the seat or beside it."""
    above = between((1, 0, 1), (2, 6 + 10 * out, 2))
    beside = between((-10 * out, 0, 1), (1, 5.5, 2))
    for leg in (above, beside):
        assert (shortened(leg, SEAT) != bounds(leg, SEAT)) == inside


def test_a_bar_between_two_legs_is_cut_at_both_ends():
    legs = [between((x, 0, 0), (x + 2, 10, 2)) for x in (0, 8)]
    bar = between((0.5, 4, 0.5), (9.5, 5, 1.5))
    assert bounds(*legs, between((2, 4, 0.5), (8, 5, 1.5))) == shortened(*legs, bar)


def test_an_L_joint_belongs_to_the_larger_board():
    lying, standing = between((0, 0, 0), (10, 1, 5)), between((0, 0, 0), (1, 8, 5))
    assert bounds(lying, between((0, 1, 0), (1, 8, 5))) == shortened(lying, standing)
    assert bounds(between((0, 1, 0), (1, 8, 5)), lying) == shortened(standing, lying)


def test_a_tilted_leg_ends_where_its_last_corner_leaves():
    """Turned by 30 degrees, 1 wide: 1 + sin 30 = 1.5 along the seat, so its corners leave apart from each other."""
    leg = Cuboids(tensor([1, 8, 1]), tensor([5.0, 2.0, 5]), turn(30, 2))
    result, hidden = shorten_boxes(batch(leg, SEAT))
    corners = result[:1].corners()[0]
    assert not hidden
    assert corners[:, 1].max() == pytest.approx(
        5.5, abs=1e-9
    )  # one corner 0.5 above: the other one is at the bottom
    upper = corners[corners[:, 1].argsort()[-4:], 1]
    assert upper.min() == pytest.approx(5.0, abs=1e-9)
    assert corners[:, 1].min() == pytest.approx(batch(leg).corners()[..., 1].min().item())  # the foot stays


def test_hidden_parts_go():
    assert bounds(SEAT) == shortened(between((1, 5.2, 1), (2, 5.8, 2)), SEAT)
    screw, cover = leaf((1, 1, 1), label="screw"), leaf((4, 4, 4), label="cover")
    after = shorten(graph(node("screws", screw), cover))
    assert after.labels == ["cover"] and len(after.root.children) == 1  # and nodes that they leave empty


def test_of_equal_parts_one_is_left():
    assert len(shortened(*[SEAT] * 5)) == 1
    assert shorten(graph(*(leaf((1, 1, 1), label=str(i)) for i in range(5)))).labels == ["4"]


def test_a_part_can_be_hidden_by_two():
    """Neither board alone covers it."""
    boards = [between((0, 0, 0), (5, 9, 9)), between((5, 0, 0), (10, 9, 9))]
    assert bounds(*boards) == shortened(*boards, between((3, 3, 3), (7, 4, 4)))


@pytest.mark.parametrize("share, cut", [(DEEPEST - 0.01, True), (DEEPEST + 0.01, False)])
def test_what_is_buried_deeper_stays(share, cut):
    """A part that is half buried does not end where it leaves."""
    block, post = between((0, 0, 0), (20, 10, 20)), between((5, 10 - 8 * share, 5), (6, 18 - 8 * share, 6))
    assert (shortened(block, post) != bounds(block, post)) == cut


def test_tiny_cuts_are_left_alone():
    """Below 0.002 of the leg's length."""
    for into, cut in ((0.009, False), (0.012, True)):
        leg = between((1, 0, 1), (2, 5 + into, 2))
        assert (shortened(leg, SEAT) != bounds(leg, SEAT)) == cut


def test_one_part_alone():
    assert bounds(SEAT) == shortened(SEAT)


def test_labels_and_ids_stay():
    leg = leaf((1, 5.5, 1), (2, 2.75, 2), "leg")
    seat = leaf((10, 1, 10), (5, 5.5, 5), "seat")
    after = shorten(graph(node("base", leg), seat, category="chair", name="mine"))
    assert (after.labels, after.category, after.name) == (["leg", "seat"], "chair", "mine")
    assert after.root.leaves()[0].box.size.tolist() == pytest.approx([1, 5, 1])
    assert extract(after).accepted


# Laws


def scene(seed: int) -> Cuboids:
    """Two thick boxes, and six bars that end somewhere in one of them; every other scene is upright."""
    boxes, generator = random_boxes(seed, 8, spread=1.0), torch.Generator().manual_seed(seed)
    size = torch.cat([boxes.size[:2] + 0.2, boxes.size[2:] * tensor([0.1, 1.5, 0.2])])
    axes = boxes.axes if seed % 2 else torch.eye(3, dtype=torch.float64).expand(8, 3, 3)
    end = boxes[:2].world_many(0.2 + 0.6 * torch.rand(3, 3, generator=generator, dtype=torch.float64))
    center = end.flatten(0, 1) - axes[2:, 1] * size[2:, 1:2] / 2
    return Cuboids(size, torch.cat([boxes.center[:2], center]), axes)


def test_the_union_stays(unchecked_shapes):
    """Whatever was inside is inside or just outside: a face counts as inside another part when it sticks out by
    INSIDE of the longest side, and what covers it may be cut itself: a little over twice that much."""
    generator, shorter = torch.Generator().manual_seed(0), 0
    for seed in range(60):
        boxes = scene(seed)
        result, hidden = shorten_boxes(boxes)
        kept = result[[i for i in range(len(boxes)) if i not in hidden]]
        shorter += bool(hidden) or not torch.equal(result.size, boxes.size)
        q = torch.rand(len(boxes), 300, 3, generator=generator, dtype=torch.float64)
        points, margin = boxes.world_many(q).reshape(-1, 3), 2.1 * INSIDE * boxes.size.max()
        assert Cuboids(kept.size + 2 * margin, kept.center, kept.axes).contains(points).all(), seed
        own = kept.world_many(torch.rand(len(kept), 300, 3, generator=generator, dtype=torch.float64))
        assert boxes.contains(own.reshape(-1, 3)).all(), seed  # nothing grows
    assert shorter >= 40  # or the test says nothing


def test_order_does_not_matter(unchecked_shapes):
    """The smallest come first, wherever they stand in the list; equal ones by their place."""
    changed = 0
    for seed in range(30):
        boxes = scene(seed)
        parts = [
            leaf(b.size.tolist(), b.center.tolist(), axes=b.axes) for b in map(boxes.__getitem__, range(8))
        ]
        before = graph(*parts, leaf((0.2, 0.5, 0.3), (0.1, 0, 0)), leaf((0.3, 0.5, 0.2), (-0.1, 0.1, 0)))
        results = [shorten(in_order(shuffled(before, k))).leaves for k in range(3)]
        changed += corner_set(results[0]) != corner_set(in_order(before).leaves)
        assert (
            sorted(corner_set(results[0])) == sorted(corner_set(results[1])) == sorted(corner_set(results[2]))
        )
    assert changed >= 25


def test_nothing_is_left_to_shorten(unchecked_shapes):
    """A second pass over furniture-like joints finds nothing new; parts that were cut may hide less, not more."""
    legs = [leaf((1, 6, 1), (x, 3, z)) for x in (1, 9) for z in (1, 9)]
    bars = [leaf((10, 1, 1), (5, 2, z)) for z in (1, 9)]
    once = shorten(graph(*legs, *bars, leaf((10, 1, 10), (5, 5.5, 5))))
    assert isinstance(once, PartGraph)
    assert torch.equal(shorten(once).leaves.size, once.leaves.size)


def test_two_boxes_through_each_other_stay():
    cross = [box((10, 1, 1)), box((1, 10, 1)), box((1, 1, 10))]
    assert bounds(*cross) == shortened(*cross)


def test_a_thin_board_does_not_vanish_into_its_neighbour():
    """Far thinner than what counts as inside, but it lies on the seat, not in it."""
    veneer = between((0, 6, 0), (10, 6 + INSIDE * 10 * 0.6, 10))
    assert shortened(veneer, SEAT) == bounds(veneer, SEAT)
