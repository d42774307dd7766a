"""Rearranging the hierarchy, one stage at a time, on small part graphs whose right answer is known."""

import pytest
import torch

from lib.extractor import Options, Part, PartGraph, RejectedError, extract, regularise, stages
from lib.extractor.arranging import (
    collapse,
    flat,
    flatten,
    hold,
    limit_levels,
    shorten_chains,
    without_slivers,
)
from lib.extractor.bounding import enclosing_box, refit
from lib.extractor.soundness import MOST_PARTS, sound

from .graphs import CATEGORIES, batch, box, furniture, graph, leaf, node, scaled, tree, turn


def named(label: str) -> Part:
    return leaf((1, 1, 1), label=label)


def tree_of(result: PartGraph) -> tuple:
    return tree(result.root)[1:]


def inner(label: str, *below) -> Part:
    """A tree from labels: `inner("seat", "top", inner("frame", "bar"))`."""
    return node(label, *(named(child) if isinstance(child, str) else child for child in below))


# Which parts there are


@pytest.mark.parametrize(
    "category, label",
    [("chair", "caster"), ("table", "drawer"), ("storage", "cabinet_door"), ("storage", "mirror")],
)
def test_detail_collapses_to_its_own_box(category, label):
    detail = inner(label, "handle", inner("body", "front", "side"))
    before = graph(named("leg"), inner("x", detail), category=category)
    after = collapse(before)
    assert tree_of(after) == ("leg", ("x", label))
    assert after.root.children[1].children[0].box is detail.box  # its own box stands for what was inside


@pytest.mark.parametrize("category", ["", "chair", "spaceship"])
def test_what_is_no_detail_does_not_collapse(category):
    """A drawer is detail in a table, not in a chair; and nobody knows what is in a spaceship."""
    before = graph(inner("drawer", "handle", "body"), category=category)
    assert tree_of(collapse(before)) == (("drawer", "handle", "body"),)


def test_flattened_parts_have_their_leaves_as_children():
    back = inner("chair_back", inner("back_frame", "bar", inner("bars", "bar", "rail")), "surface")
    before = graph(inner("body", back), inner("other", inner("x", "y")), category="chair")
    after = tree_of(flatten(before))
    assert after == (("body", ("chair_back", "bar", "bar", "rail", "surface")), ("other", ("x", "y")))
    assert tree_of(flatten(PartGraph(before.root))) == tree_of(before)  # without a category nothing happens


def test_collapsed_before_flattened():
    """A base with casters keeps each caster as one leaf."""
    base = inner("chair_base", inner("foot", "leg", inner("caster", "wheel", "stem")))
    after = dict(stages(graph(base, named("chair_seat"), category="chair")))
    assert ("chair_base", "caster", "leg") in tree_of(after["flatten"])


def test_a_frame_holds_what_is_between_its_sides():
    frame = inner("cabinet_frame", "side", "side")
    before = graph(frame, inner("drawer", "box"), named("shelf"), named("cabinet_base"), category="storage")
    assert tree_of(hold(before)) == (
        ("cabinet_frame", "side", "side", ("drawer", "box"), "shelf"),
        "cabinet_base",
    )


@pytest.mark.parametrize(
    "parts, category",
    [
        ((inner("frame", "side"), named("shelf")), "storage"),  # no frame by that name
        ((named("cabinet_frame"), named("shelf")), "storage"),  # a frame that is one solid box holds nothing
        (
            (inner("cabinet_frame", "side"), inner("x", "shelf")),
            "storage",
        ),  # the shelf is not next to the frame
        ((inner("cabinet_frame", "side"), named("shelf")), "table"),
    ],
)
def test_what_no_frame_holds_stays(parts, category):
    before = graph(*parts, category=category)
    assert tree_of(hold(before)) == tree_of(before)


def test_of_two_frames_the_first_holds():
    before = graph(
        inner("cabinet_frame", "a"), inner("cabinet_frame", "b"), named("shelf"), category="storage"
    )
    assert tree_of(hold(before)) == (("cabinet_frame", "a", "shelf"), ("cabinet_frame", "b"))


def test_chains_keep_the_topmost_label():
    before = graph(inner("a", inner("b", inner("c", "d", "e"))), inner("f", inner("g", "h")))
    assert tree_of(shorten_chains(before)) == (("a", "d", "e"), "f")


def test_labels_that_rules_go_by_survive_in_chains():
    chain = inner("legs", inner("chair_base", "leg", "leg"))
    assert tree_of(shorten_chains(graph(chain, named("x"), category="chair"))) == (
        ("chair_base", "leg", "leg"),
        "x",
    )
    assert tree_of(shorten_chains(graph(chain, named("x")))) == (("legs", "leg", "leg"), "x")


def test_a_frame_below_a_chain_still_holds():
    """As PartNet has it: storage_furniture > cabinet > what matters."""
    cabinet = inner(
        "cabinet", inner("cabinet_frame", "side", "side"), "shelf", inner("drawer", "box", "front")
    )
    after = dict(stages(graph(cabinet, category="storage")))["hold"]
    assert (
        unordered(after.root)[1]
        == unordered(node("", inner("cabinet_frame", "side", "side", "shelf", "drawer")))[1]
    )


def test_a_chain_from_the_root():
    assert tree(shorten_chains(graph(inner("a", inner("b", "c", "d")))).root) == ("root", "c", "d")
    single = shorten_chains(graph(inner("a", inner("b", "c"))))
    assert tree(single.root) == ("root", "c")  # one leaf is still a root with one child
    assert tree(shorten_chains(single).root) == ("root", "c")


def test_levels_below_the_last_give_their_leaves_up():
    before = graph(inner("1", inner("2", inner("3", inner("4", "a"), "b"), "c"), "d"))
    assert tree_of(limit_levels(before)) == (("1", ("2", "a", "b", "c"), "d"),)
    assert tree_of(limit_levels(before, 1)) == ("a", "b", "c", "d")
    assert tree_of(limit_levels(before, 9)) == tree_of(before)


def test_flat_has_leaves_only():
    assert tree_of(flat(graph(inner("1", inner("2", "a"), "b"), named("c")))) == ("a", "b", "c")


@pytest.mark.parametrize("thickness, kept", [(0.0401, True), (0.0399, False)])
def test_slivers_go(thickness, kept):
    """Below 0.004 of the shape's longest side, here 10 long."""
    board = leaf((10, 1, 1), label="board")
    for size in ((thickness, 1, 1), (1, thickness, 1), (1, 1, thickness)):
        after = without_slivers(graph(board, node("trim", leaf(size, label="strip"))))
        assert tree_of(after) == (("board", ("trim", "strip")) if kept else ("board",))


def test_nothing_but_slivers_is_empty():
    sheet = graph(leaf((1, 0.001, 1)), leaf((1, 0.001, 1)))
    with pytest.raises(RejectedError) as error:
        without_slivers(sheet)
    assert error.value.reason == extract(sheet).reason == "empty"


def test_too_many_parts_to_look_at():
    row = [leaf((1, 1, 1), (i, 0, 0)) for i in range(MOST_PARTS + 1)]
    assert tree_of(sound(graph(*row[1:]))) == ("other",) * MOST_PARTS
    with pytest.raises(RejectedError, match="too many cuboids"):
        sound(graph(*row))


# Their order


STAGES = """input in_order without_slivers shorten_chains collapse flatten hold flat snap_leaves shorten
    shorten_chains_again limit_levels refit""".split()


def test_the_stages_have_names():
    pieces = graph(leaf((1, 1, 1)), leaf((1, 1, 1), (0, 1, 0)))
    assert [name for name, _ in stages(pieces)] == [name for name in STAGES if name != "flat"]
    assert [name for name, _ in stages(pieces, Options(hierarchy=False))] == STAGES
    assert stages(pieces)[0][1] is pieces
    assert tree(regularise(pieces).root) == tree(stages(pieces)[-1][1].root)


def unordered(part: Part) -> tuple:
    return part.label, tuple(sorted(map(unordered, part.children)))


def test_every_stage_is_done_once_and_for_all(unchecked_shapes):
    """What is regular already stays as it is; 1e-9: moving to the center again rounds."""
    for category in CATEGORIES:
        for piece in furniture(category, 6):
            once = regularise(piece)
            again = regularise(once)
            assert unordered(again.root) == unordered(once.root)  # shorter parts come in another order
            assert (again.leaves.bounds() - once.leaves.bounds()).abs().max() < 1e-9


# Boxes


def test_inner_boxes_are_tight_and_the_whole_is_centered():
    """1e-12: a few roundings of numbers of about 10."""
    legs = inner_box = node("legs", leaf((1, 2, 1), (10, 1, 0)), leaf((1, 3, 1), (14, 1.5, 0)))
    after = refit(graph(Part("legs", box((99, 99, 99)), legs.children), leaf((5, 1, 1), (12, 3.5, 0))))
    assert after.leaves.bounds().mean(0).abs().max() < 1e-12
    assert after.root.box.size.tolist() == pytest.approx([5, 4, 1]) and (after.root.box.center == 0).all()
    assert after.root.children[0].box.size.tolist() == pytest.approx(inner_box.box.size.tolist())
    assert after.root.children[0].box.center.tolist() == pytest.approx([0, -0.5, 0], abs=1e-12)


def slats(leaning: int, upright: int, axes) -> object:
    boxes = [box((0.1, 2, 0.1), (i, 0, 0), axes) for i in range(leaning)]
    return enclosing_box(batch(*boxes, *(box((0.1, 2, 0.1), (i, 0, 3)) for i in range(upright))))


@pytest.mark.parametrize(
    "leaning, upright, leans", [(3, 0, True), (3, 2, True), (2, 2, False), (1, 2, False)]
)
def test_a_box_leans_with_more_than_half_of_its_leaves(leaning, upright, leans):
    around = slats(leaning, upright, turn(15, 0))
    wanted = turn(15, 0) if leans else torch.eye(3, dtype=torch.float64)
    torch.testing.assert_close(around.axes, wanted)


def test_half_of_the_leaves_are_not_enough():
    """Two lean alike, and each of the others in its own way."""
    boxes = [box((0.1, 2, 0.1), (i, 0, 0), turn(degrees, 0)) for i, degrees in enumerate((15, 15, -40, 38))]
    assert torch.equal(enclosing_box(batch(*boxes)).axes, torch.eye(3, dtype=torch.float64))


def test_turning_about_the_vertical_is_not_leaning():
    assert torch.equal(slats(3, 0, turn(30, 1)).axes, torch.eye(3, dtype=torch.float64))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_box_around_others_touches_them_on_every_side(axis):
    """1e-9: rounding in turned boxes of about 2 units."""
    boxes = batch(*(box((1, 2, 0.3), (i, i * i / 3, 0), turn(20, axis)) for i in range(4)))
    inside = enclosing_box(boxes).local_many(boxes.corners().reshape(-1, 3))
    assert inside.amin(0).abs().max() < 1e-9 and (inside.amax(0) - 1).abs().max() < 1e-9


def test_scale_does_not_matter_to_the_stages(unchecked_shapes):
    """Powers of two round alike, so thresholds in world units would show."""
    for category in CATEGORIES:
        for piece in furniture(category, 3):
            for by in (2.0**-9, 2.0**9):
                after = regularise(scaled(piece, by))
                assert tree(after.root) == tree(regularise(piece).root)
                torch.testing.assert_close(
                    after.leaves.size / by, regularise(piece).leaves.size, rtol=1e-9, atol=0
                )
