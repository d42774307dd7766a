"""Every checker is quiet while unanswered, hints at wrong answers, and accepts right ones."""

import pytest
import torch

from lib.datasets import example
from lib.exercises.extraction import check_groups, check_mended, groups_of, loose_shelf, rack
from lib.exercises.gradients import check_fit, check_loss, check_prediction, lamp_center_truth
from lib.exercises.language import check_expansion, check_height, check_repair, check_table
from lib.exercises.parts import assemble, box, reordered, with_box
from lib.extractor import extract
from lib.interpreters.shapeassembly import Attach, Squeeze, execute, parse

SQUEEZE = Squeeze("cube2", "cube0", "cube1", "right", (0.3, 0.8))
RIGHT = [
    Attach("cube2", "cube0", (1.0, 0.5, 0.5, 0.0, 0.3, 0.8)),
    Attach("cube2", "cube1", (0.0, 0.5, 0.5, 1.0, 0.3, 0.8)),
]
TABLE = """Assembly Program_0 {
    bbox = Cuboid(1.4, 0.75, 0.8, True)
    cube0 = Cuboid(1.4, 0.05, 0.8, True)
    cube1 = Cuboid(0.07, 0.7, 0.07, True)
    cube2 = Cuboid(0.07, 0.7, 0.07, True)
    attach(cube0, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5)
    squeeze(cube1, cube0, bbox, top, 0.05, 0.1)
    squeeze(cube2, cube0, bbox, top, 0.05, 0.9)
    reflect(cube1, X)
    reflect(cube2, X)
}"""


BENCH = """Assembly Program_0 {
    bbox = Cuboid(1.6, 0.5, 0.5, True)
    cube0 = Cuboid(1.6, 0.06, 0.5, True)
    cube1 = Cuboid(0.08, 0.44, 0.4, True)
    cube2 = Cuboid(1.2, 0.06, 0.06, True)
    attach(cube0, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5)
    squeeze(cube1, cube0, bbox, top, 0.1, 0.5)
    attach(cube2, cube1, 0.0, 0.5, 0.5, 1.0, 0.5, 0.5)
    reflect(cube1, X)
}"""


@pytest.fixture(scope="module")
def stool():
    return example("stool")


def test_unanswered(stool):
    cloud = torch.zeros(3, 3)
    quiet = [check_height(None, stool, 1), check_table(None), check_expansion(None, SQUEEZE), check_repair(None),
             check_prediction(None, {}), check_loss(None, stool), check_fit(None, stool, cloud, 0.08),
             check_mended(None, loose_shelf()), check_groups(None, rack())]  # fmt: skip
    assert set(quiet) == {"not answered yet"}


def test_height(stool):
    lower = stool.parameters()
    lower[1] = 0.75
    assert check_height(stool.with_parameters(lower), stool, 0.75) == "ok"
    assert "should be 0.75" in check_height(stool, stool, 0.75)
    assert "numbers only" in check_height(parse(TABLE), stool, 0.75)
    assert "should be a Program" in check_height(TABLE, stool, 0.75)
    lower[0] *= 2
    assert "width or depth" in check_height(stool.with_parameters(lower), stool, 0.75)


WRONG_TABLES = {
    "number": ("Cuboid(1.4, 0.05", "Cuboid(x, 0.05", "not a number"),
    "three legs": ("    reflect(cube2, X)\n", "", "five"),
    "one side": ("0.05, 0.9", "0.05, 0.1", "2 of the four corners"),
    "name": ("squeeze(cube1", "squeeze(cube9", "unknown cuboid"),
}


@pytest.mark.parametrize("old, new, hint", WRONG_TABLES.values(), ids=WRONG_TABLES)
def test_table(old, new, hint):
    assert check_table(TABLE) == "ok"
    assert hint in check_table(TABLE.replace(old, new))


def test_a_table_needs_a_top():
    posts = TABLE.replace("cube0, bbox, top", "bbox, bbox, top").replace(
        "Cuboid(1.4, 0.05, 0.8", "Cuboid(0.4, 0.05, 0.4"
    )
    assert "to be the top" in check_table(posts)


def test_a_table_may_be_built_otherwise():
    attached = TABLE.replace(
        "squeeze(cube1, cube0, bbox, top, 0.05, 0.1)", "attach(cube1, cube0, 0.5, 1, 0.5, 0.05, 0, 0.1)"
    )
    assert check_table(attached) == "ok"


@pytest.mark.parametrize("height", [0.3, 0.9])
def test_a_tables_legs_reach_from_floor_to_top(height):
    hanging = check_table(TABLE.replace("Cuboid(0.07, 0.7,", f"Cuboid(0.07, {height},"))
    assert "corners" in hanging or "underside" in hanging


def test_a_table_may_not_be_long():
    longer = TABLE.replace(
        "    reflect(cube1", "    attach(cube1, bbox, 0, 0, 0, 0, 0, 0)\n    reflect(cube1"
    )
    assert "10 statements" in check_table(longer)


def test_expansion():
    assert check_expansion(RIGHT, SQUEEZE) == "ok" and check_expansion(tuple(RIGHT), SQUEEZE) == "ok"
    assert "two Attach" in check_expansion(RIGHT[:1], SQUEEZE) and "two Attach" in check_expansion(
        [1, 2], SQUEEZE
    )
    assert "attach 1 should move cube2 to cube0" in check_expansion(RIGHT[::-1], SQUEEZE)
    turned = [Attach("cube2", "cube0", (0.0, *RIGHT[0].numbers[1:])), RIGHT[1]]
    assert "which one" in check_expansion(turned, SQUEEZE)
    elsewhere = [RIGHT[0], Attach("cube2", "cube1", (*RIGHT[1].numbers[:3], 1.0, 0.8, 0.3))]
    assert "attach 2 ends" in check_expansion(elsewhere, SQUEEZE)


def test_repair():
    assert "keep all eight" in check_repair(TABLE)
    assert check_repair(BENCH) == "ok"
    for wrong in ("reflect(cube2, X)", "reflect(cube0, X)", "reflect(cube1, Z)"):
        assert "mirror image" in check_repair(BENCH.replace("reflect(cube1, X)", wrong))
    assert "rail" in check_repair(BENCH.replace("1.0, 0.5, 0.5)\n    reflect", "1.0, 0.9, 0.5)\n    reflect"))
    assert check_repair("Assembly {").startswith("not yet: line 1")


def test_gradients(stool):
    lamp = parse(TABLE)
    names = ("Program_0:0:Cuboid:1", "Program_0:1:Cuboid:1")
    truth = lamp_center_truth(lamp, names)
    assert check_prediction(dict(truth), truth) == "ok"
    assert "what about" in check_prediction({}, truth)
    for wrong in (9.0, float("nan")):
        assert "is not it" in check_prediction(dict.fromkeys(names, wrong), truth)
    assert "is a number" in check_prediction(dict.fromkeys(names, "-1/2"), truth)
    assert "dictionary" in check_prediction([0.5], truth)


def test_loss(stool):
    def right(program, parameters):
        low, high = execute(program, parameters).bounds()
        return ((high - low)[1] - 1) ** 2

    assert check_loss(right, stool) == "ok"
    assert "away from 1" in check_loss(lambda *given: -right(*given), stool)
    assert "gradient is zero" in check_loss(lambda program, parameters: 0 * parameters.sum(), stool)
    assert "one number" in check_loss(lambda program, parameters: parameters, stool)
    assert "one number" in check_loss(lambda program, parameters: 3.0, stool)
    assert "one number" in check_loss(lambda program, parameters: program.nonsense, stool)
    assert "away from 1" in check_loss(
        lambda *given: execute(*given).bounds()[1, 1], stool
    )  # only ever shrinks


def test_fit(stool):
    cloud = execute(stool).surface_points(600, seed=5)
    assert check_fit(stool.parameters(), stool, cloud, 0.08) == "ok"
    assert check_fit(stool.parameters().float(), stool, cloud, 0.08) == "ok"
    assert "Chamfer distance is" in check_fit(stool.parameters() * 2, stool, cloud, 0.08)
    assert "no parameter vector" in check_fit(stool.parameters()[:4], stool, cloud, 0.08)
    assert "no parameter vector" in check_fit([1, 2], stool, cloud, 0.08)


def test_mended():
    broken, whole = loose_shelf(), (0.96, 0.03, 0.36)
    assert extract(broken).reason == "disconnected"
    assert check_mended(with_box(broken, 6, (0, 0.85, 0), whole), broken) == "ok"
    assert check_mended(with_box(broken, 6, center=(0.18, 0.85, 0)), broken) == "ok"
    for vanishing in (
        with_box(broken, 6, size=(0.6, 0.0005, 0.36)),
        with_box(broken, 6, center=(0.05, 1.18, 0)),
    ):
        assert "a part is gone" in check_mended(vanishing, broken)
    assert "beyond the bookcase" in check_mended(with_box(broken, 6, size=(2, 0.03, 0.36)), broken)
    assert "0 boxes differ" in check_mended(broken, broken)
    assert "2 boxes differ" in check_mended(
        with_box(with_box(broken, 6, size=whole), 5, size=(1, 1, 1)), broken
    )
    assert "still rejected: disconnected" in check_mended(
        with_box(broken, 6, size=(0.62, 0.03, 0.36)), broken
    )
    for side in (0.0, float("nan")):
        assert "finite" in check_mended(with_box(broken, 6, size=(side, 0.03, 0.36)), broken)
    assert "keep all parts" in check_mended(rack(), broken)
    assert "keep all parts" in check_mended(reordered(broken, lambda parts: parts[::-1]), broken)
    assert "should be a PartGraph" in check_mended((0.96, 0.03, 0.36), broken)


def test_groups():
    graph, right = rack(), [{2, 4}, {6, 7, 8}]
    assert groups_of(graph) == {frozenset(group) for group in right}
    assert check_groups(right, graph) == check_groups([(8, 7, 6), [4, 2]], graph) == "ok"
    assert "1 of 2 groups" in check_groups(right[:1], graph) and "0 of 2 groups" in check_groups([], graph)
    assert "not a group" in check_groups([{2, 4}, {6, 7}], graph)
    assert "in two groups" in check_groups([{2, 4}, {2, 3}], graph)
    assert "no leaf with the id 0, 9" in check_groups([{0, 9}], graph)
    for strange in (7, [7], [{2}, None]):
        assert "list of sets" in check_groups(strange, graph)
    assert groups_of(assemble("table", *(box("leg", (x, 0, 0), (1e-4, 1, 1)) for x in (-1, 1)))) == set()
