"""The checkers of notebook 06 are quiet while unanswered, hint at wrong answers, and accept right ones only."""

import pytest
import torch

from lib.exercises.measuring import (
    CLOUD_A,
    CLOUD_B,
    TIPPY,
    boxes,
    check_clouds,
    check_cover,
    check_foot,
    check_legs,
    check_twins,
    cover,
    table_on_legs,
)
from lib.interpreters.shapeassembly import execute, parse
from lib.metrics.rootedness import is_rooted
from lib.metrics.stability import stable
from tests.verdicts import hints

STOOL = """
Assembly Program_0 {
    bbox = Cuboid(0.5, 0.5, 0.5, True)
    cube0 = Cuboid(0.5, 0.06, 0.5, True)
    cube1 = Cuboid(0.05, 0.44, 0.5, True)
    attach(cube0, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5)
    squeeze(cube1, cube0, bbox, top, 0.05, 0.5)
    reflect(cube1, X)
}"""
TWIN = STOOL.replace("    reflect(cube1, X)\n", "    squeeze(cube2, cube0, bbox, top, 0.95, 0.5)\n").replace(
    "    attach(cube0", "    cube2 = Cuboid(0.05, 0.44, 0.5, True)\n    attach(cube0"
)
# Shapes on a line, at 0, 1, 2, 10, 11 and 20: three of them cover the rest best from 1, from 10 or 11, and from 20.
PLACES = torch.tensor([0.0, 1, 2, 10, 11, 20]).double()
DISTANCES = (PLACES[:, None] - PLACES).abs()


def check_line(answer):
    return check_cover(answer, DISTANCES)


def check_stool(answer):
    return check_twins(answer, parse(STOOL))


CHECKS = [check_legs, check_foot, check_clouds, check_line, check_stool]


def test_boxes():
    one = boxes((1, 2, 3, 4, 5, 6))
    assert one.bounds().tolist() == [[3.5, 4, 4.5], [4.5, 6, 7.5]] and len(boxes()) == 0


def test_legs():
    shortest = 0.7 - 0.02 * (1.2**2 + 0.75**2 + 0.8**2) ** 0.5  # by hand: 2 % of the diagonal may be missing
    assert is_rooted(table_on_legs(shortest + 1e-6)) and not is_rooted(table_on_legs(shortest - 1e-6))
    assert check_legs(shortest + 1e-6) == check_legs(round(shortest + 0.001, 3)) == "ok"
    assert "still floats" in check_legs(shortest - 1e-4) and "shorter" in check_legs(shortest + 0.003)
    assert "0.70" in check_legs(0.71) and "0.70" in check_legs(0)


def tippy(foot: str, column: float = 0.67, top: str = "1.0, 0.05, 0.8") -> str:
    """TIPPY with another foot, column and top."""
    text = TIPPY.replace("0.18, 0.03, 0.18", foot).replace("1.0, 0.05, 0.8", top)
    return text.replace("0.06, 0.67, 0.06", f"0.06, {column}, 0.06")


def test_the_table_on_one_foot_falls():
    assert not stable(execute(parse(TIPPY)).cuboids)


@pytest.mark.parametrize("thick", [0.15, 0.2, 0.3, 0.4])
def test_a_heavy_foot(thick):
    assert check_foot(tippy(f"0.18, {thick}, 0.18", round(0.7 - thick, 3))) == "ok"


@pytest.mark.parametrize(
    "answer, said",
    [
        (TIPPY, "still falls"),
        (tippy("0.18, 0.3, 0.18"), "high now"),
        (tippy("0.6, 0.03, 0.18"), "wider"),
        (tippy("0.18, 0.03, 0.18", top="0.3, 0.05, 0.3"), "as large"),
        (TIPPY.replace("attach(cube2, cube1, 0.5", "attach(cube2, cube1, 0.6"), "one above the other"),
        (TIPPY.replace("    attach(cube2, cube1, 0.5, 0.0, 0.5, 0.5, 1.0, 0.5)\n", ""), "statements"),
    ],
)
def test_a_wrong_table(answer, said):
    verdict = check_foot(answer)
    assert hints(verdict) and said in verdict


def test_clouds():
    """By hand: 3 and 0 from a; 3, 0 and 1 from b; so 1.5 + 4/3, precision 1/2, recall 2/3."""
    assert check_clouds((2.83, 57.1)) == check_clouds([1.5 + 4 / 3, 400 / 7]) == "ok"
    assert "sum" in check_clouds((1.42, 57.1)) and "another" in check_clouds((4.2, 57.1))
    assert "F-score" in check_clouds((2.83, 0.571)) and "two numbers" in check_clouds(2.83)
    assert len(CLOUD_A) == 2 and len(CLOUD_B) == 3


def test_cover():
    assert cover(DISTANCES, [1, 3, 5]) == pytest.approx(3 / 6)
    assert check_line([1, 3, 5]) == check_line((5, 4, 1)) == check_line({1, 4, 5}) == "ok"
    assert "of the 20 choices are better" in check_line([0, 1, 2])
    for wrong in ([1, 1, 3], [1, 3], [1, 3, 4, 5], "135"):
        assert "3 different" in check_line(wrong)
    assert "numbered from 0 to 5" in check_line([1, 3, 6]) and "numbered" in check_line([1, 3, 5.0])


def test_twins():
    assert check_stool(TWIN) == check_stool(parse(TWIN)) == "ok"
    assert "edit distance is 0" in check_stool(STOOL)
    assert "lies elsewhere" in check_stool(TWIN.replace("0.95", "0.9"))
    assert "2 boxes instead of 3" in check_stool(STOOL.replace("    reflect(cube1, X)\n", ""))
    order = TWIN.replace("cube1", "cubeX").replace("cube2", "cube1").replace("cubeX", "cube2")
    assert check_stool(order) == "ok"  # in any order
