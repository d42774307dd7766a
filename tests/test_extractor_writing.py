"""The text of programs, what an extraction may leave out, and which programs are turned down."""

import math
import re

import pytest
import torch

from lib.extractor import REASONS, Options, RejectedError, extract, survey
from lib.extractor.regularising import regularise
from lib.extractor.validating import MAX_LEAVES, MIN_F_SCORE, judge_shape, sticking_out
from lib.extractor.writing import sides, size_digits, write_program
from lib.interpreters.shapeassembly import Attach, Cuboid, Reflect, Squeeze, Translate, execute, parse

from .graphs import (
    CATEGORIES,
    extract_all,
    extracted,
    furniture,
    graph,
    leaf,
    node,
    scaled,
    tensor,
    text,
    turn,
)
from .programs import run

ORDER = [Cuboid, Attach, Squeeze, Reflect, Translate]
TOP = leaf((10, 1, 10), (0, 7.5, 0), "top")
LEGS = [leaf((1, 7, 1), (x, 3.5, z), "leg") for x in (-4, 4) for z in (-4, 4)]
BARS = [leaf((0.6, 0.6, 7), (x, 2, 0), "bar") for x in (-4, 4)]
TABLE = graph(TOP, *LEGS, *BARS, name="table")


def accepted(count: int) -> list:
    return [e for category in CATEGORIES for e in extracted(category, count) if e.accepted]


# Text


def test_text_and_back():
    for extraction in accepted(30):
        assert parse(extraction.program.to_text()) == extraction.program


def test_names_and_the_order_of_statements():
    """Blocks breadth-first; cuboids by position; Cuboid, then attach and squeeze, then reflect and translate."""
    for extraction in accepted(30):
        blocks = extraction.program.blocks
        assert [block.name for block in blocks] == [f"Program_{i}" for i in range(len(blocks))]
        mentioned = ["Program_0"]
        for block in blocks:
            bbox, *cuboids = [s for s in block.statements if isinstance(s, Cuboid)]
            assert (bbox.name, bbox.aligned) == ("bbox", True)
            for i, cuboid in enumerate(cuboids):
                assert cuboid.name == f"cube{i}" or cuboid.name.startswith("Program_")
            mentioned += [c.name for c in cuboids if c.name.startswith("Program_")]
            kinds = [
                {Cuboid: 0, Attach: 1, Squeeze: 1, Reflect: 2, Translate: 2}[type(s)]
                for s in block.statements
            ]
            assert kinds == sorted(kinds)
        assert mentioned == [block.name for block in blocks]


def test_cuboids_come_by_rank_of_their_labels():
    graph_of = graph(leaf((9, 1, 9), (0, 5.5, 0), "chair_seat"), leaf((9, 5, 9), (0, 2.5, 0), "chair_base"))
    for category, first in (("chair", 5), ("table", 5), ("", 5)):
        program = extract(type(graph_of)(graph_of.root, category)).program
        assert (
            program.blocks[0].statements[1].numbers[1] == first
        )  # base before seat; else the lower one first
    lower = graph(leaf((9, 5, 9), (0, 2.5, 0), "chair_seat"), leaf((9, 1, 9), (0, 5.5, 0), "chair_base"))
    assert extract(type(lower)(lower.root, "chair")).program.blocks[0].statements[1].numbers[1] == 1


def test_numbers_have_three_decimals():
    for extraction in accepted(30):
        for number in re.findall(r"-?\d+\.\d+", extraction.program.to_text()):
            assert len(number.split(".")[1]) <= 3, number


@pytest.mark.parametrize(
    "size, digits", [(1, 3), (4.9, 3), (5.1, 2), (0.51, 3), (0.01, 5), (400, 1), (500, 0), (1e6, 0)]
)
def test_digits_of_sizes(size, digits):
    assert size_digits(tensor([size / 3, size, size / 2])) == digits


def test_sizes_never_vanish():
    assert sides(tensor([1.23456, 0.0001, 2]), 3) == (1.235, 0.001, 2.0)
    assert sides(tensor([123.456, 0.0001, 2]), 0) == (123.0, 1.0, 2.0)


@pytest.mark.parametrize("by", [500, 1 / 500])
def test_large_and_small_shapes(by):
    """The same program but for its sizes, where nothing is tilted: when a tilted cuboid counts as attached the language
    says in world units (1e-4, 0.01). And as good: sizes may be rounded up to
    five times as coarsely at this scale, which costs thin parts a little of their F-score."""
    usual, other, same = [], [], []
    for category in CATEGORIES:
        usual += extracted(category, 8)
        other += extract_all(
            [scaled(piece, by) for piece in furniture(category, 8)], Options(keep_rejected=True)
        )
    for one, two in zip(usual, other, strict=True):
        assert one.reason == two.reason
        if one.program:
            tilted = any(not s.aligned for _, _, s in one.program.statements() if isinstance(s, Cuboid))
            same.append(tilted or one.program.structure == two.program.structure)
            assert two.f_score == pytest.approx(one.f_score, abs=3)
            bbox, large = (
                one.program.blocks[0].statements[0].numbers,
                two.program.blocks[0].statements[0].numbers,
            )
            assert large == pytest.approx([side * by for side in bbox], rel=0.01)  # three digits of about 0.3
    assert len(same) > 20 and all(same)


# What may be left out


def test_without_the_aligned_flag():
    program = extract(TABLE, Options(aligned_flag=False)).program
    assert not any(
        s.aligned for _, _, s in program.statements() if isinstance(s, Cuboid) and s.name != "bbox"
    )
    assert all(block.statements[0].aligned for block in program.blocks)


def test_without_macros():
    extraction = extract(TABLE, Options(macros=False))
    assert {type(s) for _, _, s in extraction.program.statements()} == {Cuboid, Attach}
    assert len(extraction.program.blocks) == 1 and extraction.f_score > 99
    assert len(execute(extraction.program).cuboids) == len(TABLE.leaves)


def test_without_hierarchy():
    legs = node("legs", *LEGS)
    with_hierarchy, without = (
        extract(graph(TOP, legs), Options(hierarchy=h, macros=False)) for h in (True, False)
    )
    assert len(with_hierarchy.program.blocks) == 2 and len(without.program.blocks) == 1
    assert without.f_score > 99


def test_without_order():
    """Other lines in another order, the same for the same name, and the same shape."""
    usual, arbitrary = extract(TABLE), extract(TABLE, Options(canonical_order=False))
    assert arbitrary.accepted and text(arbitrary) != text(usual)
    assert text(extract(TABLE, Options(canonical_order=False))) == text(arbitrary)
    names = {
        text(extract(type(TABLE)(TABLE.root, "", str(i)), Options(canonical_order=False))) for i in range(6)
    }
    assert len(names) > 1
    assert sorted(map(len, text(usual).split())) == sorted(map(len, text(arbitrary).split()))


def test_without_order_on_furniture():
    """The shape stays: each box has its twin. 1e-9: the same arithmetic."""
    other = 0
    for category in CATEGORIES:
        usual = extracted(category, 8)
        for one, two in zip(usual, extract_all(furniture(category, 8), Options(False, keep_rejected=True))):
            assert one.reason == two.reason
            if one.program:
                a, b = execute(one.program).cuboids.corners(), execute(two.program).cuboids.corners()
                gap = torch.cdist(a.flatten(1), b.flatten(1))
                assert gap.amin(0).max() < 1e-9 and gap.amin(1).max() < 1e-9
                other += text(one) != text(two)
    assert other > 15


# What is turned down


def pillars(count: int):
    """Pillars that differ, between a floor and a ceiling."""
    row = [leaf((0.3, 6, 1 + 2 * i), (2.2 * (i - count / 2), 3, 0)) for i in range(count)]
    return graph(*row, *(leaf((2.5 * count, 1, 2.1 * count), (0, y, 0)) for y in (-0.5, 6.5)))


def test_at_most_twelve_cuboids():
    assert extract(pillars(MAX_LEAVES - 2)).accepted
    extraction = extract(pillars(MAX_LEAVES - 1))
    assert (extraction.reason, extraction.program) == ("too many cuboids", None)
    assert "13 leaf cuboids" in extraction.detail
    kept = extract(pillars(MAX_LEAVES - 1), Options(keep_rejected=True))
    assert kept.program is not None and kept.reason == "too many cuboids" and not kept.accepted


def test_macros_may_make_more():
    row = [leaf((0.3, 6, 0.3), (x, 3, 0)) for x in range(-10, 11)]
    extraction = extract(graph(*row, leaf((25, 1, 6), (0, -0.5, 0)), leaf((25, 1, 5), (0, 6.5, 0))))
    assert extraction.accepted and len(execute(extraction.program).cuboids) == 23


REACHED = {
    "unsound": graph(leaf((1, math.nan, 1))),
    "empty": graph(leaf((1, 1e-6, 1))),
    "disconnected": graph(leaf((1, 1, 1)), leaf((1, 1, 1), (5, 2.5, 5)), leaf((1, 1, 1), (0, 5, 0))),
    "too many cuboids": pillars(MAX_LEAVES),
    "different shape": graph(leaf((8, 1, 1), axes=turn(40, 1))),
    "not grounded": graph(
        node("a", leaf((1, 1, 1), (0, 0, 0)), leaf((1, 1, 1), (0, 9, 0))),
        node("b", leaf((1, 1, 1), (2, 9.5, 0)), leaf((9, 1, 1), (6, 4, 0))),
    ),
}


@pytest.mark.parametrize("reason", REACHED)
def test_reasons(reason):
    extraction = extract(REACHED[reason])
    assert (extraction.reason, extraction.program, extraction.accepted) == (reason, None, False)
    assert extraction.detail and reason in REASONS


def test_there_are_no_other_reasons():
    for category in CATEGORIES:
        assert {e.reason for e in extracted(category, 60)} <= {"", *REASONS}


@pytest.mark.parametrize("at, outside", [(1.0, True), (0.8, True), (0.77, False), (0.75, False)])
def test_a_program_that_sticks_out(at, outside):
    """Two cubes of half the box's length: by more than 5 % of that length, or not."""
    lines = [f"cube{i} = Cuboid(1, 1, 1, True)" for i in (0, 1)]
    lines += [f"attach(cube{i}, bbox, 0.5, 0.5, 0.5, {x}, 0.5, 0.5)" for i, x in ((0, at), (1, 1 - at))]
    shape = run(*lines)
    assert [name.split("/")[-1] for name in sticking_out(shape)] == (["cube0", "cube1"] if outside else [])
    reason, detail, score = judge_shape(
        shape, graph(*(leaf((1, 1, 1), (s * (2 * at - 1), 0, 0)) for s in (-1, 1)))
    )
    assert reason in (["outside"] if outside else ["", "not grounded"])
    assert ("cube0, " in detail or "cube1" in detail) == outside


def test_another_shape():
    shape = run("cube0 = Cuboid(2, 2, 2, True)", "attach(cube0, bbox, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)")
    reason, detail, score = judge_shape(shape, graph(leaf((1, 2, 1))))
    assert reason == "different shape" and score < MIN_F_SCORE and f"{score:.1f}" in detail


def test_a_program_whose_geometry_is_none(monkeypatch):
    """No part graph is known that leads there: a program is put in its place."""
    endless = parse(
        "Assembly Program_0 {\n\tbbox = Cuboid(1e308, 1e308, 1e308, True)\n\tcube0 = Cuboid(1e308, 1, 1, True)\n"
        "\tattach(cube0, bbox, 0.5, 0.0, 0.5, 1e3, 1e3, 0.5)\n}\n"
    )
    monkeypatch.setattr("lib.extractor.extracting.write_program", lambda facts: endless)
    assert extract(graph(leaf((1, 1, 1)))).reason == "not finite"


def test_a_text_that_the_language_refuses(monkeypatch):
    def refuse(facts):
        return parse("Assembly {")

    monkeypatch.setattr("lib.extractor.extracting.write_program", refuse)
    extraction = extract(graph(leaf((1, 1, 1))))
    assert extraction.reason == "not a program" and "line 1" in extraction.detail


def test_what_an_extraction_knows():
    extraction = extract(TABLE)
    assert extraction.accepted and extraction.reason == extraction.detail == "" and extraction.f_score > 99
    assert write_program(extraction.facts) == extraction.program
    assert write_program(survey(regularise(TABLE).root, "")) == extraction.program
    with pytest.raises(RejectedError):
        survey(REACHED["disconnected"].root, "")
