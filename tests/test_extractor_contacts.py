"""Do two boxes meet, and where: geometry against a linear program and a convex hull, then places by hand."""

import numpy as np
import pytest
import torch
from scipy.optimize import linprog
from scipy.spatial import HalfspaceIntersection

from lib.extractor.contacts import (
    BBOX_REACH,
    BOTTOM,
    FACE_TO_FACE,
    IN_FACE,
    MIDDLE,
    REACH,
    TOP,
    connecting_contacts,
    find_contacts,
    floating,
    grown,
    mark_firm,
    meet,
    shared_middle,
)
from lib.interpreters.cuboids import Cuboids

from .graphs import batch, between, box, random_boxes, tensor, turn

HUGE = tensor([1000.0, 1000.0, 1000.0])  # a block whose top and bottom are far away
PAIRS = 250


# Against other people's geometry


def halfspaces(*boxes: Cuboids) -> np.ndarray:
    """Rows (normal, offset): normal . x + offset <= 0 in all of the boxes (single)."""
    rows = []
    for b in boxes:
        for axis, side in zip(b.axes.numpy(), b.size.numpy()):
            middle = axis @ b.center.numpy()
            rows += [[*axis, -middle - side / 2], [*-axis, middle - side / 2]]
    return np.array(rows)


def deepest(a: Cuboids, b: Cuboids) -> tuple[float, np.ndarray]:
    """How far a point can be inside both boxes at once, below 0 if none is, and the point."""
    rows = halfspaces(a, b)
    result = linprog(
        [0, 0, 0, -1],
        A_ub=np.c_[rows[:, :3], np.ones(len(rows))],
        b_ub=-rows[:, 3],
        bounds=[(None, None)] * 4,
    )
    return -result.fun, result.x[:3]


@pytest.fixture(scope="module")
def pairs() -> tuple[Cuboids, Cuboids, list]:
    """Random pairs, some upright, some alike in an axis; and what the linear program says about each."""
    a, b = random_boxes(1, PAIRS), random_boxes(2, PAIRS, spread=1.3)
    axes = b.axes.clone()
    axes[::5], axes[1::5] = a.axes[::5], turn(90, 1) @ a.axes[1::5]  # parallel edges and faces
    b = Cuboids(b.size, b.center, axes)
    return a, b, [deepest(a[i], b[i]) for i in range(PAIRS)]


def test_boxes_meet_where_a_linear_program_finds_a_point(pairs):
    """Pairs within 1e-7 of touching are left out: that is what the solver rounds by."""
    a, b, depth = pairs
    found = meet(a, b)
    clear = [i for i in range(PAIRS) if abs(depth[i][0]) > 1e-7]
    assert len(clear) > 0.95 * PAIRS and 0.2 * PAIRS < sum(found.tolist()) < 0.8 * PAIRS
    assert [found[i].item() for i in clear] == [depth[i][0] > 0 for i in clear]
    assert torch.equal(meet(b, a), found)


def test_the_middle_of_what_they_share(pairs):
    """Halfway between the bounds of the polytope's corners. 1e-6: qhull merges corners nearer than that."""
    a, b, depth = pairs
    middle = shared_middle(a, b)
    met = [i for i in range(PAIRS) if depth[i][0] > 1e-3]  # qhull wants a point well inside
    assert len(met) > 50
    for i in met:
        corners = HalfspaceIntersection(halfspaces(a[i], b[i]), depth[i][1]).intersections
        wanted = (corners.min(0) + corners.max(0)) / 2
        np.testing.assert_allclose(middle[i].numpy(), wanted, rtol=0, atol=1e-6)
    torch.testing.assert_close(shared_middle(b, a)[met], middle[met], rtol=0, atol=1e-9)


def test_boxes_that_share_a_face_or_a_corner_meet():
    cube = batch(between((0, 0, 0), (1, 1, 1)))
    for low in ((1, 0, 0), (1, 1, 0), (1, 1, 1)):
        other = batch(between(low, [x + 1 for x in low]))
        assert meet(cube, other).item()
        assert shared_middle(cube, other)[0].tolist() == pytest.approx([1 if x else 0.5 for x in low])
    assert not meet(cube, batch(between((1 + 1e-9, 0, 0), (2, 1, 1)))).item()


def test_one_box_inside_another():
    small, large = batch(box((1, 1, 1), (0.2, 0.3, 0.4), turn(30, 1))), batch(box((9, 9, 9)))
    for a, b in ((small, large), (large, small)):
        assert meet(a, b).item()
        assert shared_middle(a, b)[0].tolist() == pytest.approx([0.2, 0.3, 0.4])


def test_crossed_edges_that_only_an_edge_direction_separates():
    """Two edges pass each other: no face of either box lies between them."""
    a = Cuboids(tensor([[1, 1, 4]]), tensor([[0, 0, 0]]), turn(45, 2)[None])
    for gap, met in ((-0.01, True), (0.01, False)):
        b = Cuboids(tensor([[4, 1, 1]]), tensor([[0, 2**0.5 + gap, 0]]), turn(45, 0)[None])
        assert meet(a, b).item() == met


# Places by hand


def only(*boxes: Cuboids, size=HUGE):
    """The single contact of a block, its place rounded to 1e-6."""
    (contact,) = find_contacts(batch(*boxes), torch.as_tensor(size, dtype=torch.float64))
    return contact


def places(contact) -> list[float]:
    return [round(x, 6) + 0.0 for x in (*contact.at_first, *contact.at_second)]


SEAT = between((0, 5, 0), (10, 6, 10))


def test_a_leg_under_a_seat_is_face_to_face():
    contact = only(between((1, 0, 1), (2, 5, 2)), SEAT)
    assert (contact.kind, contact.first, contact.second) == (FACE_TO_FACE, 0, 1)
    assert places(contact) == [0.5, 1, 0.5, 0.15, 0, 0.15]
    assert contact.point == pytest.approx((1.5, 5, 1.5))
    assert (contact.partner(0), contact.partner(1)) == (1, 0)
    assert contact.at(0) == contact.at_first and contact.at(1) == contact.at_second


def test_the_face_center_of_the_smaller_one_counts():
    """The seat's own face centers lie elsewhere."""
    contact = only(SEAT, between((1, 0, 1), (2, 5, 2)))
    assert contact.kind == FACE_TO_FACE and places(contact) == [0.15, 0, 0.15, 0.5, 1, 0.5]


def test_a_bar_that_ends_within_another_is_in_face():
    """Its end is in the post, not on the side where it came in."""
    post, bar = between((0, 0, 0), (4, 10, 4)), between((2, 5, 1), (9, 6, 2))
    contact = only(post, bar)
    assert contact.kind == IN_FACE and places(contact) == [0.5, 0.55, 0.375, 0, 0.5, 0.5]


def test_a_tilted_bar_on_a_post_is_in_face():
    bar = box((1, 6, 1), (3, 3, 0), turn(60, 2))  # its lower end lies at (3, 3) + 3 (sin 60, -cos 60)
    bar = Cuboids(bar.size, bar.center, bar.axes)
    low = bar.world(tensor([0.5, 0, 0.5]))
    post = box((1, 8, 2), (low[0].item(), 0, 0))
    contact = only(bar, post)
    assert contact.kind == IN_FACE and places(contact)[:3] == [0.5, 0, 0.5]


def test_boards_that_cross_touch_in_the_middle_of_what_they_share():
    contact = only(between((0, 0, 0), (10, 1, 2)), between((2, 0.5, -3), (3, 1.5, 9)))
    assert contact.kind == MIDDLE and contact.point == pytest.approx(
        (2.5, 0.75, 1), abs=0.15
    )  # 0.12 is the reach
    assert places(contact)[0] == 0.25


def swapped(contacts, count: int) -> list:
    """The contacts as if the boxes had been listed backwards."""
    rows = []
    for c in contacts:
        first = count - 1 - c.first
        second = c.second if c.second < 0 else count - 1 - c.second
        if 0 <= second < first:
            rows.append((second, first, c.at_second, c.at_first, c.kind, c.point))
        else:
            rows.append((first, second, c.at_first, c.at_second, c.kind, c.point))
    return sorted(rows, key=lambda row: row[:2])


def test_the_order_of_boxes_does_not_matter(unchecked_shapes):
    """For boxes without symmetry, where no two places are equally good. 1e-9: rounding in boxes of about 1."""
    found = 0
    for seed in range(30):
        boxes = random_boxes(seed, 6)
        forwards, backwards = (
            find_contacts(b, tensor([2, 2, 2])) for b in (boxes, boxes[[5, 4, 3, 2, 1, 0]])
        )
        rows = sorted((c.first, c.second, c.at_first, c.at_second, c.kind, c.point) for c in forwards)
        assert [row[:2] for row in rows] == [row[:2] for row in swapped(backwards, 6)]
        for row, other in zip(rows, swapped(backwards, 6)):
            assert row[4] == other[4]
            for p, q in zip((row[2], row[3], row[5]), (other[2], other[3], other[5])):
                assert p == pytest.approx(q, abs=1e-9)
        found += len(rows)
    assert found > 200


def test_moving_and_scaling_a_pair_changes_nothing(unchecked_shapes):
    """1e-6: distances of places are compared after rounding to that many digits of a block's sides."""
    boxes = random_boxes(11, 8, spread=1.5)
    wanted = find_contacts(boxes, HUGE)
    assert len(wanted) > 5
    for by in (1e-3, 1e3):
        moved = Cuboids(boxes.size * by, boxes.center * by, boxes.axes)
        found = find_contacts(moved, HUGE * by)
        assert [(c.first, c.second, c.kind) for c in found] == [(c.first, c.second, c.kind) for c in wanted]
        for c, w in zip(found, wanted):
            assert places(c) == pytest.approx(places(w), abs=1e-6)


# Reach


@pytest.mark.parametrize("gap, touching", [(0.99 * REACH, True), (1.01 * REACH, False)])
def test_how_far_apart_they_may_be(gap, touching):
    """A share of the longest side of the two, here 10."""
    boxes = batch(between((0, 0, 0), (10, 1, 1)), between((0, 1 + 10 * gap, 0), (1, 2 + 10 * gap, 1)))
    assert bool(find_contacts(boxes, HUGE)) == touching


@pytest.mark.parametrize("gap, touching", [(0.49 * BBOX_REACH, True), (1.01 * BBOX_REACH, False)])
def test_top_and_bottom_of_the_bounding_box(gap, touching):
    size = tensor([4, 20, 4])
    post = box(
        (1, 20 * (1 - 2 * gap), 1)
    )  # ends that far, as a share of the height, from the top and the bottom
    contacts = find_contacts(batch(post), size)
    assert [c.second for c in contacts] == ([BOTTOM, TOP] if touching else [])
    if touching:
        bottom, top = contacts
        assert bottom.at_first == pytest.approx((0.5, 0, 0.5)) and top.at_first == pytest.approx(
            (0.5, 1, 0.5)
        )
        assert bottom.at_second == pytest.approx((0.5, gap, 0.5), abs=1e-6)  # where it is, in the whole block
        assert top.at_second == pytest.approx((0.5, 1 - gap, 0.5), abs=1e-6)


def test_the_sides_of_the_bounding_box_hold_nothing():
    assert find_contacts(batch(box((4, 1, 4))), tensor([4, 20, 4])) == []


@pytest.mark.parametrize("gap, held", [(0.5, True), (1.5, True), (3.5, True), (4.5, False)])
def test_a_wider_reach_where_a_block_falls_apart(gap, held):
    """In reaches of 2 % of 10: tried once, twice and four times as far."""
    gap *= 10 * REACH
    boxes = batch(between((0, -5, 0), (10, -1, 1)), between((0, -1 + gap, 0), (1, gap, 1)))
    contacts = connecting_contacts(boxes, tensor([20, 10, 2]))
    assert (floating(2, contacts) == set()) == held


def test_reach_stays_narrow_while_everything_is_held():
    """The third board is near the first one, but held by the second."""
    boxes = batch(
        between((0, -5, 0), (10, -4, 1)), between((0, -4, 0), (1, 0, 1)), between((1, -3.7, 0), (9, -3.5, 1))
    )
    contacts = connecting_contacts(boxes, tensor([20, 10, 2]))
    assert {(c.first, c.second) for c in contacts if c.second >= 0} == {(0, 1), (1, 2)}


def test_what_floats():
    boxes = batch(*(between((0, y, 0), (1, y + 1, 1)) for y in (-5, -4, -3, 0, 1)))
    contacts = find_contacts(boxes, tensor([9, 10, 9]))
    assert floating(5, contacts) == {3, 4}
    assert floating(5, []) == {0, 1, 2, 3, 4} and floating(0, []) == set()


def test_firm_and_loose():
    """The boxes of two inner parts overlap; what is in them touches in one case only."""
    boxes = batch(box((2, 2, 2)), box((2, 2, 2), (1, 0, 0)), box((1, 1, 1), (9, 9, 9)))
    (contact,) = find_contacts(boxes, HUGE)
    corner, far, near = (
        between((-1, -1, -1), (0, 0, 0)),
        between((1, 0, 0), (2, 1, 1)),
        between((0, -1, -1), (2, 1, 1)),
    )
    single = batch(box((1, 1, 1), (9, 9, 9)))
    for second, firm in ((far, False), (near, True)):
        (marked,) = mark_firm([contact], [batch(corner, corner), batch(second, second), single])
        assert marked.firm == firm
        assert (marked.first, marked.second, marked.point) == (contact.first, contact.second, contact.point)


def test_leaves_are_always_firm():
    boxes = batch(between((0, 0, 0), (1, 1, 1)), between((1, 0, 0), (2, 1, 1)))
    contacts = find_contacts(boxes, HUGE)
    assert mark_firm(contacts, [boxes[:1], boxes[1:]]) == contacts and contacts[0].firm
    assert mark_firm([], [boxes[:1], boxes[1:]]) == []


def test_grown_boxes():
    larger = grown(batch(box((1, 2, 3), (4, 5, 6), turn(30, 1))), tensor([0.5]))
    assert larger.size.tolist() == [[2, 3, 4]] and larger.center.tolist() == [[4, 5, 6]]


@pytest.mark.parametrize("degrees, held", [(0, False), (20, True)])
def test_tilted_cuboids_reach_farther_for_the_bounding_box(degrees, held):
    """A post that ends 12 % of the height below the top: too far for an upright one, near enough for a tilted one."""
    height = 20.0
    post = box((1, 10, 1), axes=turn(degrees, 2))
    top = float(batch(post).corners()[..., 1].max())
    moved = Cuboids(post.size, post.center + tensor([0, height / 2 - 0.12 * height - top, 0]), post.axes)
    contacts = find_contacts(batch(moved), tensor([20, height, 4]))
    assert (TOP in [c.second for c in contacts]) == held
