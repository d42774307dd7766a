"""The checkers of notebook 11 are quiet while unanswered, hint at wrong answers, and accept right ones only."""

import pytest
import torch

from lib.exercises.stump import (
    BLIND,
    SOFT_ERROR,
    check_hole,
    check_matrices,
    check_openscad,
    check_plate,
    check_sharpness,
    four,
    plate_picture,
    soft_error,
    washer,
)  # fmt: skip
from lib.interpreters.csg import parse as parse_csg
from lib.interpreters.openscad import write
from lib.interpreters.stump import Circle, Cylinder, Stump, execute, parse
from lib.interpreters.stump.poses import unturned
from tests.verdicts import hints

PLATE = """F1 = square(half=(0.5, 0.3))
F2 = not circle(radius=0.15, translation=(-0.25, 0))
F3 = not square(half=(0.2, 0.05), translation=(0.2, 0))
S1 = F1 & F2 & F3
T = S1
"""
HOLED = BLIND.replace("cylinder(radius=0.15, height=0.1, translation=(-0.2, 0.0, 0.05))",
                      "not cylinder(radius=0.15, translation=(-0.2, 0, 0))")  # fmt: skip


def with_another(text: str, primitive: str) -> str:
    """A right answer of one node, united with one primitive more."""
    number = text.count("= ") - 1
    text = text.replace("S1 =", f"F{number} = {primitive}\nS1 =")
    return text.replace("T = S1", f"S2 = F{number}\nT = S1 | S2")


DISC = parse("F1 = circle(radius=0.3)\nS1 = F1\nT = S1\n")
GRID = torch.cartesian_prod(*[torch.linspace(-0.5, 0.5, 80, dtype=torch.float64)] * 2)


def check_disc(answer):
    return check_sharpness(answer, DISC, GRID)


CHECKS = [check_plate, check_matrices, check_hole, check_disc, check_openscad]


def test_the_picture_is_the_plate():
    picture = plate_picture(120)
    assert (
        picture[60, 54] and not picture[60, 35] and not picture[60, 80]
    )  # between, in the hole, in the slot
    assert picture.double().mean().item() * 1.44 == pytest.approx(0.6 - 3.1416 * 0.15**2 - 0.04, rel=0.02)


@pytest.mark.parametrize(
    "answer",
    [
        PLATE,
        parse(PLATE),
        PLATE.replace("S1 = F1 & F2 & F3", "S1 = F1 & F2 & F3\nS2 = F2 & F1 & F3").replace(
            "T = S1", "T = S1 | S2"
        ),
        PLATE.replace("radius=0.15", "radius=0.151"),
        # The hole from below, above and beside instead: half-planes say the same rectangle.
        """F1 = halfplane(translation=(0, 0.3))
F2 = not halfplane(translation=(0, -0.3))
F3 = square(half=(0.5, 9))
F4 = not circle(radius=0.15, translation=(-0.25, 0))
F5 = not square(half=(0.05, 0.2), translation=(0.2, 0), rotation=1.5707963)
S1 = F1 & F2 & F3 & F4 & F5
T = S1
""",
    ],
)
def test_plate(answer):
    assert check_plate(answer) == "ok"


@pytest.mark.parametrize(
    "answer, said",
    [
        (PLATE.replace(" & F3", ""), "are too many, around (0."),
        (PLATE.replace("not circle", "circle"), "are missing"),
        (PLATE.replace("T = S1", "T = nothing"), "are missing"),
        (PLATE.replace("0.15", "0.2"), "are missing, around (-0."),
        (PLATE.replace("S1 = F1 & F2 & F3", "S1 = everything"), "are too many"),
        (
            with_another(PLATE, "circle(radius=0.001, translation=(9, 9))"),
            "far from the plate, around (9.00, 9.00)",
        ),
        (PLATE.replace("square(half", "square(side"), "line 1"),
        (HOLED, "a stump of space; write one of the plane"),
    ],
)
def test_a_wrong_plate(answer, said):
    verdict = check_plate(answer)
    assert hints(verdict) and said in verdict


RIGHT = ([0, 0, 0, 1], [[1, 0], [0, 1], [1, 1], [1, 1]], [1, 1])


def test_all_sixteen_cases_have_a_place():
    inside = Stump(four(), [0] * 4, torch.zeros(4, 0), []).distances(GRID) <= 0
    assert len(torch.unique(inside, dim=1).T) == 16


def test_matrices():
    assert check_matrices(RIGHT) == "ok"
    assert check_matrices([torch.tensor(matrix) for matrix in RIGHT]) == "ok"
    swapped = (RIGHT[0], [[0, 1, 1], [1, 0, 0], [1, 1, 0], [1, 1, 0]], [1, 1, 0])  # an idle node does no harm
    assert check_matrices(swapped) == "ok"
    three = (RIGHT[0], [[1, 0, 1], [0, 1, 1], [1, 1, 1], [1, 1, 1]], [1, 1, 1])
    assert "unites 3 nodes; 2 will do" in check_matrices(three)


@pytest.mark.parametrize(
    "answer, said",
    [
        (([0] * 4, *RIGHT[1:]), "inside A, C only is not in the shape now, it should be in the shape"),
        ((RIGHT[0], RIGHT[1], [1, 0]), "1 of 16 cases are wrong; a point inside B, C only"),
        ((RIGHT[0], RIGHT[1], [0, 0]), "3 of 16"),
        (
            (RIGHT[0], [[0, 0]] * 4, [1, 1]),
            "13 of 16 cases are wrong; a point outside of all four is in the shape",
        ),
        ((RIGHT[0], RIGHT[1], [1, 1, 1]), "union"),
        (([0, 0, 0], *RIGHT[1:]), "complement"),
        (([0, 0, 0, 2], *RIGHT[1:]), "0 and 1"),
        (RIGHT[:2], "three matrices"),
    ],
)
def test_wrong_matrices(answer, said):
    verdict = check_matrices(answer)
    assert hints(verdict) and said in verdict


@pytest.mark.parametrize(
    "answer",
    [
        HOLED,
        HOLED.replace("0, 0))", "0, 0.05))"),
        HOLED.replace("radius=0.15", "radius=0.15, height=0.2"),
        HOLED + "# by the other way: nothing is complemented twice\n",
    ],
)
def test_hole(answer):
    assert check_hole(answer) == "ok"


@pytest.mark.parametrize(
    "answer, said",
    [
        (BLIND, "of the plate itself is gone"),
        (
            BLIND.replace("= cylinder", "= not cylinder"),
            "of the hole is still filled, z from -0.10 to 0.00",
        ),
        (HOLED.replace(" & F2", ""), "no hole"),
        (HOLED.replace("radius=0.15", "radius=0.25"), "of the plate itself is gone"),
        (HOLED.replace("(-0.2, 0, 0)", "(0.2, 0, 0)"), "of the plate itself is gone, around (0.2"),
        (HOLED.replace("radius=0.15", "radius=0.1"), "of the hole is still filled"),
        (
            HOLED.replace("S1 = F1 & F2", "S1 = F1 & F2\nS2 = F2").replace("T = S1", "T = S1 | S2"),
            "beyond the plate",
        ),
        (
            with_another(HOLED, "sphere(radius=0.01, translation=(5, 5, 5))"),
            "far from the plate, around (",
        ),
        (
            with_another(HOLED, "box(half=(0.2, 0.2, 0.0001), translation=(-0.2, 0, 0.03))"),
            "a thin skin closes the hole, around (-0.2",
        ),
        (HOLED.replace("radius=0.15", "radius=0.15, height=0.1992"), "a thin skin closes the hole"),
        (HOLED.replace("T = S1", "T = nothing"), "100% of the plate itself is gone"),
        (PLATE, "a stump of the plane; write one of space"),
    ],
)
def test_a_wrong_hole(answer, said):
    verdict = check_hole(answer)
    assert hints(verdict) and said in verdict


def smallest() -> float:
    low, high = 1.0, 1e5
    for _ in range(60):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if soft_error(DISC, GRID, middle) > SOFT_ERROR else (low, middle)
    return high


def test_the_soft_error_falls():
    errors = [soft_error(DISC, GRID, sharpness) for sharpness in (1, 10, 100, 1000)]
    assert errors == sorted(errors, reverse=True)


def test_sharpness():
    best = smallest()
    assert check_sharpness(best, DISC, GRID) == check_sharpness(torch.tensor(1.05 * best), DISC, GRID) == "ok"
    assert "is it sharp enough" in check_sharpness(0.95 * best, DISC, GRID)
    assert "a smaller sharpness will do" in check_sharpness(1.2 * best, DISC, GRID)
    for answer in (0, -5, float("inf")):
        assert "a number above 0" in check_sharpness(answer, DISC, GRID)
    assert "there are no points" in check_sharpness(best, DISC, GRID[:0])


FILE = washer().to_openscad()


def test_openscad():
    edited = FILE.replace("F2_radius = 0.12;", "F2_radius = 0.24;")
    assert edited != FILE and check_openscad(edited) == "ok"
    assert check_openscad(FILE.replace("F2_radius = 0.12;", "F2_radius = 2 * 0.12;")) == "ok"
    assert check_openscad(edited.replace("$fn = 48;", "$fn = 96;")) == "ok"


@pytest.mark.parametrize(
    "old, new, said",
    [
        ("", "", "as it was"),
        ("F2_radius = 0.12;", "F2_radius = 0.2;", "are too many, around ("),
        ("F2_radius = 0.12;", "F2_radius = 0.3;", "are missing"),
        ("F1_radius = 0.4;", "F1_radius = 0.8;", "are too many"),
        ("F2_radius = 0.12;", "F2_radius = 0.24", "line "),
        ("F2_radius = 0.12;", "", "F2_radius"),
        ("module T() S1();", "module T() S2();", "S2"),
        ("F2_radius = 0.12;", "F2_radius = 0.24 + 1e-6;", "something else is changed"),
    ],
)
def test_a_wrong_edit(old, new, said):
    text = FILE.replace(old, new) if old else FILE
    assert old in FILE
    verdict = check_openscad(text)
    assert hints(verdict) and said in verdict


def test_an_edit_that_moves_the_hole_a_little_is_no_answer():
    disc, drill = washer().primitives
    moved = Stump((disc, Cylinder(2 * drill.radius, None, (1e-4, 0, 0))), *washer().matrices)
    assert hints(check_openscad(moved.to_openscad()))


def test_another_language_is_no_answer():
    assert "no stump of space" in check_openscad(write(parse_csg("sp(32,32,32,8)")))
    assert "no stump of space" in check_openscad(write(Stump([Circle(1.0)], [0], [[1]], [1])))


def test_the_washer_is_one():
    mesh = execute(washer()).mesh()
    assert mesh.is_watertight and mesh.euler_number == 0
    assert washer().primitives[1].height is None and washer().primitives[1].rotation.tolist() == unturned(3)
