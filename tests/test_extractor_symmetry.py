"""Copies: mirrored pairs, rows, joined sub-assemblies; what is no group; and that copies are where members were."""

import math
from dataclasses import replace

import pytest
import torch

from lib.extractor import Group, Options, Part, extract, regularise, survey
from lib.extractor.symmetry import (
    ALIKE,
    ALIKE_IF_MANY,
    UNEVEN,
    corner_gap,
    even_runs,
    find_groups,
    find_rows,
    mirror_images,
)
from lib.interpreters.cuboids import Cuboids
from lib.interpreters.shapeassembly import execute
from lib.interpreters.shapeassembly.program import AXES

from .graphs import CATEGORIES, batch, blocks, box, extracted, facts_of, graph, leaf, node, tensor, turn

TOP = leaf((10, 1, 10), (0, 7.5, 0), "top")
LEGS = [leaf((1, 7, 1), (x, 3.5, z), "leg") for x in (-4, 4) for z in (-4, 4)]


def facts(*parts: Part):
    return survey(regularise(graph(*parts)).root, "")


def found(*parts: Part) -> list[tuple]:
    """(kind, axis, how many) of the groups, in order."""
    return sorted((g.kind, g.axis, len(g.members)) for g in facts(*parts).groups)


def lines(*parts: Part) -> str:
    return extract(graph(*parts)).program.to_text()


def upright(*xs: float, size=(0.6, 8, 0.6), label: str = "slat") -> list[Part]:
    return [leaf(size, (x, 0, 0), label) for x in xs]


RAILS = [leaf((10, 1, 1), (0, y, 0), "rail") for y in (-4.5, 4.5)]


# Groups by hand


@pytest.mark.parametrize("axis", [0, 2])
def test_a_pair_of_legs(axis):
    legs = []
    for side in (-4, 4):
        center = [0, 3.5, 0]
        center[axis] = side
        legs.append(leaf((1, 7, 1), center))
    assert found(TOP, *legs) == [("reflect", AXES[axis], 2)]


def test_mirrored_across_the_middle_of_the_height():
    """Two brackets on a post that spans the block."""
    brackets = [leaf((3, 1, 1), (2, y, 0)) for y in (-3, 3)]
    assert found(leaf((1, 10, 1)), *brackets) == [("reflect", "Y", 2)]


def test_four_legs_are_two_pairs():
    assert found(TOP, *LEGS) == [("reflect", "X", 2)] * 2
    assert lines(TOP, *LEGS).count("reflect(") == 2


def test_an_even_row():
    text = lines(*RAILS, *upright(-3.6, -1.2, 1.2, 3.6))
    assert "translate(cube0, X, 3, 0.72)" in text and "reflect" not in text


@pytest.mark.parametrize("share, even", [(0.8, True), (1.3, False)])
def test_how_even_a_row_must_be(share, even):
    """The second of three moved by a share of what is allowed; here corners count: a tenth of the spacing is more."""
    allowed = ALIKE * 10
    assert allowed < UNEVEN * 4
    groups = found(*RAILS, *upright(-4, share * allowed, 4))
    assert (("translate", "X", 3) in groups) == even


def test_a_long_row_before_pairs():
    groups = found(*RAILS, *upright(-3, -1, 1, 3))
    assert groups == [("translate", "X", 4)]


def test_an_uneven_row_may_still_be_pairs():
    groups = found(*RAILS, *upright(-4.5, -1, 1, 4.5))
    assert ("reflect", "X", 2) in groups and not any(kind == "translate" and n > 2 for kind, _, n in groups)


def test_two_at_one_place_are_no_row():
    same = [leaf((1, 1, 1), (2, 0, 0)) for _ in range(3)]
    assert find_rows(same, batch(*(part.box for part in same)), tensor([10, 10, 10])) == []
    assert even_runs([0, 1], [0.0, 0.0], 0.1) == []


def test_runs():
    assert even_runs([0, 1, 2, 3], [0.0, 1.0, 2.0, 3.0], 0.1) == [[0, 1, 2, 3]]
    assert even_runs([3, 1, 2], [1.0, 2.0, 4.0, 0.0], 0.1) == [[3, 1, 2]]
    assert even_runs([0, 1, 2, 3, 4], [0.0, 1.0, 2.0, 7.0, 8.0], 0.1) == [[0, 1, 2], [3, 4]]
    assert even_runs([0], [0.0], 0.1) == even_runs([], [], 0.1) == []


def test_parts_of_different_size_are_no_copies():
    near, far = leaf((1, 7, 1), (-4, 3.5, 0)), leaf((1, 7, 1 + 2.5 * ALIKE * 10), (4, 3.5, 0))
    assert found(TOP, near, far) == []
    almost = leaf((1, 7, 1 + 1.5 * ALIKE * 10), (4, 3.5, 0))  # half of it at each corner
    assert found(TOP, near, almost) == [("reflect", "X", 2)]


def test_a_part_on_the_middle_plane_is_no_copy_of_itself():
    facts = facts_of(leaf((1, 2, 1)), leaf((1, 2, 1), (1e-9, 0, 0)))
    assert not mirror_images(facts.parts, facts.boxes, facts.size).any()


def test_tilted_pairs():
    legs = [leaf((1, 8, 1), (x, 3.5, 0), axes=turn(-10 * x / 3, 2)) for x in (-3, 3)]
    assert found(TOP, *legs) == [("reflect", "X", 2)]
    alike = [leaf((1, 8, 1), (x, 3.5, 0), axes=turn(10, 2)) for x in (-3, 3)]
    assert found(TOP, *alike) == [("translate", "X", 2)]


# Contents


def stack_of(x: float, *sizes) -> Part:
    """Two boards side by side, mirrored with x."""
    side = math.copysign(1, x)
    return node("stack", *(leaf(size, (x + side * (k - 0.5), 3.5, 0)) for k, size in enumerate(sizes)))


def test_what_is_in_them_is_compared():
    """The boxes of both stacks are equal: only what is in them tells the difference."""
    thick, thin = (1, 7, 3), (1, 7, 1)
    assert found(TOP, stack_of(-3, thick, thin), stack_of(3, thick, thin)) == [("reflect", "X", 2)]
    assert ("reflect", "X", 2) not in found(TOP, stack_of(-3, thick, thin), stack_of(3, thin, thick))
    assert ("translate", "X", 2) in found(TOP, stack_of(-3, thick, thin), stack_of(3, thin, thick))


def test_a_leaf_is_no_copy_of_an_inner_part():
    assert found(TOP, stack_of(-3, (1, 7, 3), (1, 7, 3)), leaf((2, 7, 3), (3, 3.5, 0))) == []


# What would fall, or fit worse


PAIR = [leaf((1, 7, 1), (x, 3.5, 0), "leg") for x in (-4, 4)]


def test_no_copy_where_it_holds_what_would_fall():
    shelf = leaf((4, 0.5, 1), (6.5, 3, 0), "shelf")
    other = leaf((4, 0.5, 1), (-6.5, 5, 0), "shelf")  # so that the legs are still mirrored in the block's box
    assert found(TOP, *PAIR, shelf, other) == []
    assert extract(graph(TOP, *PAIR, shelf, other)).accepted


def test_no_copy_where_something_would_fit_worse():
    """A brace from leg to leg needs both of them to be turned right."""
    degrees = math.degrees(math.atan2(3, 7))
    brace = leaf((math.hypot(7, 3), 0.5, 0.5), (0, 3.5, 0), "brace", turn(degrees, 2))
    assert found(TOP, *PAIR, brace) == []
    assert found(TOP, *PAIR) == [("reflect", "X", 2)]


def test_members_must_be_held_by_something_in_common():
    """Each slab stands on a foot of its own; nothing else touches them but the top and the bottom."""
    assert found(*[leaf((2, 6, 2), (x, 0, 0)) for x in (-3, 3)]) == [
        ("reflect", "X", 2)
    ]  # both on the bottom
    feet = [leaf((3, 1, 3 + (x > 0)), (x, -3.5, 0)) for x in (-3, 3)]
    slabs = [leaf((2, 6, 2), (x, 0, 0)) for x in (-3, 3)]
    roof = leaf((1, 9, 1), (0, 0.5, 0))
    assert found(*feet, *slabs, roof) == []


def test_no_part_is_in_two_groups():
    for category in CATEGORIES:
        for extraction in extracted(category, 20):
            for block in blocks(extraction.facts) if extraction.facts else []:
                members = [member for group in block.groups for member in group.members]
                assert len(members) == len(set(members))
                assert block.copies.isdisjoint(block.written)
                assert sorted(block.copies | set(block.written)) == list(range(len(block.parts)))


# Sub-assemblies


SIDE_BARS = [leaf((0.6, 0.6, 7), (x, 2, 0), "bar") for x in (-4, 4)]


def test_an_H_leg():
    """The paper's own example: two legs joined by a bar, mirrored as a whole."""
    program = extract(graph(TOP, *LEGS, *SIDE_BARS)).program
    root, side = program.blocks
    assert [s.command for s in root.statements].count("Cuboid") == 3  # bbox, the side, the top
    assert "reflect(Program_1, X)" in root.to_text() and "reflect(cube0, Z)" in side.to_text()
    assert len(execute(program).cuboids) == 7


def test_an_H_leg_the_other_way():
    bars = [leaf((7, 0.6, 0.6), (0, 2, z), "bar") for z in (-4, 4)]
    assert "reflect(Program_1, Z)" in lines(TOP, *LEGS, *bars)


def test_halves_that_touch_different_parts_are_not_joined():
    """A shelf between the two legs of one side: the other side's half would be held by something else."""
    shelf = leaf((3, 0.5, 9), (-2, 4, 0), "shelf")
    assert len(extract(graph(TOP, *LEGS, *SIDE_BARS, shelf)).program.blocks) == 1


def test_no_sub_assembly_without_macros():
    assert len(extract(graph(TOP, *LEGS, *SIDE_BARS), Options(macros=False)).program.blocks) == 1


# Laws


def copies_of(group: Group, block) -> Cuboids:
    """The boxes that the macro makes of the source's box, worked out from the text's rounded numbers."""
    source, axis = block.boxes[group.members[0]], AXES.index(group.axis)
    count, along = len(group.members) - 1, torch.eye(3, dtype=torch.float64)[axis]
    if group.kind == "reflect":
        mirror = torch.eye(3, dtype=torch.float64) - 2 * torch.outer(along, along)
        return Cuboids(source.size[None], (source.center @ mirror)[None], (source.axes @ mirror)[None])
    step = round(group.distance, 3) * block.size[axis] / count
    centers = torch.stack([source.center + k * step * along for k in range(1, count + 1)])
    return Cuboids(source.size.expand(count, 3), centers, source.axes.expand(count, 3, 3))


def test_macros_make_what_was_there():
    """No corner farther off than copies may be (looser where there were too many cuboids), and half a digit of the
    row's length; sqrt 2: a place along the row and its corners may both be off."""
    kinds = set()
    for category in CATEGORIES:
        for extraction in extracted(category, 30):
            for block in blocks(extraction.facts) if extraction.facts else []:
                for group in block.groups:
                    members = block.boxes[list(group.members[1:])]
                    gap = corner_gap(copies_of(group, block).corners(), members.corners()).diagonal()
                    assert gap.max() <= (ALIKE_IF_MANY + 0.0005) * block.size.max() * 2**0.5
                    kinds.add((group.kind, group.axis, len(group.members) > 2))
    assert {("reflect", "X", False), ("translate", "X", True), ("translate", "Y", True)} <= kinds


def test_executed_copies_are_where_the_parts_were():
    for parts in ([TOP, *LEGS], [TOP, *LEGS, *SIDE_BARS], [*RAILS, *upright(-3.6, -1.2, 1.2, 3.6)]):
        made, wanted = execute(extract(graph(*parts)).program).cuboids, regularise(graph(*parts)).leaves
        gap = corner_gap(made.corners(), wanted.corners())
        assert gap.shape == (len(parts), len(parts))
        assert (
            gap.amin(0).max() < 0.02 and gap.amin(1).max() < 0.02
        )  # local coordinates have three digits, of 10


def test_names_of_axes_do_not_matter():
    """A box whose axes are called otherwise is the same box: corners are compared, not sizes."""
    a = batch(box((1, 2, 3), (4, 5, 6), turn(20, 0)))
    b = batch(box((2, 1, 3), (4, 5, 6), turn(90, 2) @ turn(20, 0)))
    assert corner_gap(a.corners(), b.corners()).item() < 1e-12
    c = replace(a, center=a.center + tensor([0.3, 0, 0.4]))
    assert corner_gap(a.corners(), c.corners()).item() == pytest.approx(0.5)


def test_stricter_and_looser():
    """`alike` decides how exact copies must be."""
    block = facts_of(
        *(leaf((1, 2, 1), (x, 0, 0)) for x in (-2.9, 3)), leaf((8, 1, 2), (0, -1.5, 0)), size=(8, 4, 4)
    )
    assert [g.kind for g in find_groups(block, 0.001)] == ["translate"]  # in a row they may stand anywhere
    assert [g.kind for g in find_groups(block, 0.05)] == ["reflect"]
