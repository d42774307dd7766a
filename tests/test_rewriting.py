"""Programs rewritten for the ablations: what each leaves out is gone, and the shape is what it was."""

import pytest

from lib.datasets import CATEGORIES, examples
from lib.extractor import rewriting, unfolding
from lib.extractor.renaming import numbered
from lib.extractor.rewriting import ABLATIONS, MOST_CUBOIDS, apart, rewrite_many
from lib.extractor.unfolding import without_macros
from lib.extractor.validating import MIN_F_SCORE
from lib.interpreters.shapeassembly import Attach, Cuboid, Program, Shape, execute, execute_many, parse

EXACT = 1e-6  # divisors in the interpreter carry 1e-8, and copies go through local coordinates and back
ROUNDED = (
    2e-3  # three decimals, of a shape of about 1: half a thousandth for each of a few numbers on the way
)

NESTED = """Assembly Program_0 {
\tbbox = Cuboid(2.0, 1.0, 1.0, True)
\tcube0 = Cuboid(2.0, 0.1, 1.0, True)
\tProgram_1 = Cuboid(0.6, 0.9, 0.8, True)
\tattach(cube0, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5)
\tattach(Program_1, cube0, 0.5, 0.0, 0.5, 0.2, 1.0, 0.4)
\treflect(Program_1, X)
}
Assembly Program_1 {
\tbbox = Cuboid(0.6, 0.9, 0.8, True)
\tcube0 = Cuboid(0.5, 0.4, 0.2, True)
\tProgram_2 = Cuboid(0.3, 0.4, 0.2, True)
\tattach(cube0, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.2)
\tattach(Program_2, cube0, 0.5, 0.0, 0.5, 0.3, 1.0, 0.5)
\treflect(Program_2, Z)
}
Assembly Program_2 {
\tbbox = Cuboid(0.3, 0.4, 0.2, True)
\tcube0 = Cuboid(0.1, 0.4, 0.05, False)
\tcube1 = Cuboid(0.05, 0.1, 0.2, False)
\tattach(cube0, bbox, 0.5, 0.0, 0.5, 0.2, 0.0, 0.3)
\tattach(cube0, bbox, 0.5, 1.0, 0.5, 0.4, 1.0, 0.2)
\tattach(cube1, cube0, 0.0, 0.5, 0.5, 1.0, 0.7, 0.5)
}
"""
ROW = """Assembly Program_0 {{
\tbbox = Cuboid(2.0, 1.0, 1.0, True)
\tcube0 = Cuboid(2.0, 0.1, 1.0, True)
\tcube1 = Cuboid(0.1, 0.9, 0.1, True)
\tattach(cube0, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5)
\tattach(cube1, cube0, 0.5, 0.0, 0.5, 0.1, 1.0, 0.5)
\ttranslate(cube1, X, {}, 0.8)
}}
"""
LEANING = """Assembly Program_0 {
\tbbox = Cuboid(1.0, 1.0, 1.0, True)
\tcube0 = Cuboid(1.0, 0.1, 1.0, True)
\tcube1 = Cuboid(0.5, 0.4, 0.9, True)
\tattach(cube0, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5)
\tattach(cube1, cube0, 0.5, 0.0, 0.5, 0.3, 1.0, 0.5)
\tattach(cube1, bbox, 0.5, 1.0, 0.5, 0.7, 1.0, 0.5)
}
"""


def boxes_apart(one: Shape, other: Shape) -> float:
    return apart(one.cuboids, other.cuboids)


def changed(program: Program, ablation: str, name: str = "0") -> Program:
    (found,) = rewrite_many([program], ablation, [name])
    assert not found.reason, found
    return found.program


def commands(program: Program) -> set[str]:
    return {statement.command for _, _, statement in program.statements()}


def names_are_positions(program: Program) -> bool:
    blocks = [block.name for block in program.blocks]
    mentioned = ["Program_0"]
    for block in program.blocks:
        names = [s.name for s in block.statements if isinstance(s, Cuboid)][1:]
        mentioned += [name for name in names if name in blocks]
        if any(name not in (f"cube{i}", *blocks) for i, name in enumerate(names)):
            return False
    return blocks == mentioned == [f"Program_{k}" for k in range(len(blocks))]


# names


def test_names_are_positions_afterwards():
    text = NESTED.replace("Program_1", "Program_9").replace("cube0", "seat").replace("Program_2", "Program_1")
    program = parse(text)
    assert not names_are_positions(program)
    assert numbered(program) == parse(NESTED) == numbered(parse(NESTED))


# no macros


@pytest.mark.parametrize("name", examples())
def test_without_macros_the_examples_stay_what_they_are(name, monkeypatch):
    monkeypatch.setattr(unfolding, "DIGITS", 12)
    program = examples()[name]
    other = without_macros(program)
    assert commands(other) <= {"Cuboid", "attach"} and names_are_positions(other)
    assert boxes_apart(execute(program), execute(other)) < EXACT


@pytest.mark.parametrize("inner", "XYZ")
@pytest.mark.parametrize("outer", "XYZ")
def test_mirrored_copies_within_mirrored_copies(inner, outer, monkeypatch):
    """Every pair of axes, with a slanted part inside; the interpreter mirrors contents, but not theirs."""
    monkeypatch.setattr(unfolding, "DIGITS", 12)
    text = NESTED.replace("reflect(Program_1, X)", f"reflect(Program_1, {outer})")
    program = parse(text.replace("reflect(Program_2, Z)", f"reflect(Program_2, {inner})"))
    other = without_macros(program)
    assert [len(block.statements) for block in other.blocks] == [7, 7, 7, 6, 6, 6, 6]
    assert boxes_apart(execute(program), execute(other)) < EXACT
    monkeypatch.setattr(
        unfolding, "_product", lambda one, _: one
    )  # a copy that is not mirrored looks otherwise
    assert boxes_apart(execute(program), execute(without_macros(program))) > 0.05


def test_numbers_have_three_decimals():
    program = examples()["armchair"]
    other = without_macros(program)
    assert all(number == round(number, 3) for number in other.parameters().tolist())
    assert 0 < boxes_apart(execute(program), execute(other)) < ROUNDED


def test_a_copied_box_is_declared_as_large_as_its_block_says():
    other = without_macros(parse(NESTED))
    sizes = {block.name: block.statements[0].numbers for block in other.blocks}
    declared = [s for _, _, s in other.statements() if isinstance(s, Cuboid) and s.name in sizes]
    assert len(declared) == 6 and all(cuboid.numbers == sizes[cuboid.name] for cuboid in declared)


def test_as_many_cuboids_as_a_line_can_name_and_not_one_more():
    kept = changed(parse(ROW.format(MOST_CUBOIDS - 2)), "no_macros")
    assert sum(isinstance(s, Cuboid) for s in kept.blocks[0].statements) == 1 + MOST_CUBOIDS
    (refused,) = rewrite_many([parse(ROW.format(MOST_CUBOIDS - 1))], "no_macros")
    assert refused.program is None and refused.reason == "too many cuboids"


# no order


def test_without_order_the_same_boxes_in_another_order():
    program = parse(NESTED)
    others = [changed(program, "no_order", str(seed)) for seed in range(12)]
    assert changed(program, "no_order", "3") == others[3]
    assert len({other.to_text() for other in others}) > 3
    for other in others:
        assert names_are_positions(other)
        assert boxes_apart(execute(program), execute(other)) < EXACT
    firsts = {other.blocks[0].statements[1].name for other in others}
    assert firsts == {"cube0", "Program_1"}


# no align


def test_without_the_flag_only_bounding_boxes_are_aligned():
    other = changed(examples()["dining_table"], "no_align")
    aligned = {s.name: s.aligned for _, _, s in other.statements() if isinstance(s, Cuboid)}
    assert [name for name, flag in aligned.items() if flag] == ["bbox"]


def test_what_falls_apart_without_the_flag_is_extracted_anew(monkeypatch):
    """The block grows while it is aligned; else it leans, which is another shape, though not one below 75."""
    monkeypatch.setattr(rewriting, "MIN_F_SCORE", 99.0)
    (found,) = rewrite_many([parse(LEANING)], "no_align")
    assert found.extracted and found.f_score > 95
    assert not any(
        s.aligned for _, _, s in found.program.statements() if getattr(s, "name", "bbox") != "bbox"
    )


# flat


def test_flat_is_one_block(unchecked_shapes):
    """Also where mirrored parts that hang together would make a sub-program: NESTED has such."""
    for program in (parse(NESTED), *examples().values()):
        (found,) = rewrite_many([program], "flat", category="chair")
        assert found.reason == "too many cuboids" or len(found.program.blocks) == 1
        assert found.program is None or found.f_score > MIN_F_SCORE


# all of them


def test_another_ablation_there_is_none():
    with pytest.raises(ValueError, match="found the ablation 'small'; expected one of flat, no_order"):
        rewrite_many([], "small")


@pytest.mark.parametrize("ablation", ABLATIONS)
def test_nothing_becomes_nothing(ablation):
    assert rewrite_many([], ablation) == []


@pytest.mark.parametrize("ablation", ABLATIONS)
def test_real_programs(real_texts, ablation, unchecked_shapes):
    """A few of each category: they parse, run, name no more than can be named, and look like their originals."""
    for category in CATEGORIES:
        texts = dict(list(real_texts[category].items())[:300:25])
        programs = [parse(text) for text in texts.values()]
        found = rewrite_many(programs, ablation, list(texts), category)
        kept = [(program, each.program) for program, each in zip(programs, found) if each.program]
        assert len(kept) >= 6 and all(each.f_score >= MIN_F_SCORE for each in found if each.program)
        for (_, other), was, now in zip(kept, *map(execute_many, zip(*kept))):
            assert parse(other.to_text()) == other and names_are_positions(other)
            counts = [sum(isinstance(s, Cuboid) for s in block.statements) for block in other.blocks]
            assert max(counts) <= 1 + MOST_CUBOIDS
            if ablation in ("no_order", "no_macros"):
                assert boxes_apart(was, now) < (EXACT if ablation == "no_order" else ROUNDED)
            if ablation == "no_macros":
                assert {type(s) for _, _, s in other.statements()} <= {Cuboid, Attach}
            if ablation == "flat":
                assert len(other.blocks) == 1
