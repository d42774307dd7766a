"""The checkers of notebook 05 are quiet while unanswered, hint at wrong answers, and accept right ones only."""

import pytest
import torch

from lib import datasets
from lib.exercises.writing import (
    HALF_WRITTEN,
    check_arc,
    check_best_pair,
    check_outside,
    check_pairs,
    check_taller,
    half_written,
    has_arms,
    slenderness,
)
from lib.interpreters.shapeassembly import execute, parse
from lib.models.exploring import arc, codes
from lib.models.pretrained import pretrained
from lib.models.program_vae import ProgramVAE
from lib.models.weights import load
from lib.models.writing import sample
from tests.conftest import unchecked
from tests.verdicts import hints

PAIRS = {
    ("cube2", "bbox"), ("cube2", "cube0"), ("cube2", "cube1"), ("cube0", "bbox"), ("cube1", "bbox"),
}  # fmt: skip
OUTSIDE = """Assembly Program_0 {
    bbox = Cuboid(1.0, 1.0, 1.0, True)
    cube0 = Cuboid(0.6, 0.5, 0.6, True)
    attach(cube0, bbox, 0.5, 0.0, 0.5, 0.85, 0.0, 0.5)
}
"""
CHAIRS = datasets.examples()


def check_chairs(answer):
    return check_taller(answer, ProgramVAE(), [CHAIRS["stool"]])


CHECKS = [check_pairs, check_best_pair, check_outside, check_arc, check_chairs]


def best_pair(first, second, allowed):
    if not allowed.any():
        return None
    scores = (first[:, None] + second[None, :]).masked_fill(~allowed, -torch.inf)
    return torch.unravel_index(scores.argmax(), scores.shape)


def on_arc(a, b, share):
    angle = torch.acos(a @ b / a.norm() / b.norm())
    return (((1 - share) * angle).sin() * a + (share * angle).sin() * b) / angle.sin()


def test_pairs():
    assert check_pairs(PAIRS) == check_pairs([list(pair) for pair in PAIRS]) == "ok"
    assert len(parse(HALF_WRITTEN).blocks[0].statements) == 6
    assert half_written().declared.tolist() == [4]


@pytest.mark.parametrize(
    "answer, said",
    [
        (PAIRS - {("cube0", "bbox")}, "1 more is"),
        (set(), "5 more are"),
        (PAIRS | {("cube0", "cube1")}, "forbidden"),
        (PAIRS | {("cube1", "cube0")}, "forbidden"),
        (PAIRS | {("bbox", "cube1")}, "forbidden"),
        (PAIRS | {("cube0", "cube2")}, "forbidden"),
        (PAIRS | {("cube3", "bbox")}, "no cuboid 'cube3'"),
    ],
)
def test_wrong_pairs(answer, said):
    verdict = check_pairs(answer)
    assert hints(verdict) and said in verdict


def test_best_pair():
    assert check_best_pair(best_pair) == "ok"


def moved_first(first, second, allowed):
    moved = int(first.argmax())
    if not allowed[moved].any():
        return None
    return moved, int(second.masked_fill(~allowed[moved], -torch.inf).argmax())


@pytest.mark.parametrize(
    "answer, said",
    [
        (moved_first, "has no partner"),
        (lambda first, second, allowed: best_pair(first, second, allowed | True), "has no partner"),
        (lambda first, second, allowed: best_pair(first, second, allowed.T), "has no partner"),
        (lambda first, second, allowed: best_pair(first, second, allowed) or (0, 0), "nothing allowed"),
        (lambda first, second, allowed: best_pair(second, first, allowed), "everything allowed"),
        (lambda first, second, allowed: first[99], "raised IndexError"),
    ],
)
def test_a_wrong_best_pair(answer, said):
    verdict = check_best_pair(answer)
    assert hints(verdict) and said in verdict


@pytest.mark.parametrize("answer", [OUTSIDE, OUTSIDE.replace("0.85", "0.12")])
def test_outside(answer):
    assert check_outside(answer) == "ok"


@pytest.mark.parametrize(
    "old, new, said",
    [
        ("0.85", "0.5", "0% of a half side"),
        ("0.85", "0.72", "4% of a half side"),
        ("0.85", "1.0", "60% of a half side is too far"),
        ("Cuboid(0.6, 0.5", "Cuboid(1.4, 0.5", "larger than the bbox"),
        ("0.85, 0.0", "0.85, 0.5", "near its bottom"),
        ("    attach(cube0, bbox, 0.5, 0.0, 0.5, 0.85, 0.0, 0.5)\n", "", "attached to nothing"),
        ("attach(cube0, bbox", "attach(cube0, box", "line 4"),
        (
            "    cube0 = Cuboid(0.6, 0.5, 0.6, True)\n    attach(cube0, bbox, 0.5, 0.0, 0.5, 0.85, 0.0, 0.5)\n",
            "",
            "one",
        ),
    ],
)
def test_a_wrong_outside(old, new, said):
    assert old in OUTSIDE
    verdict = check_outside(OUTSIDE.replace(old, new))
    assert hints(verdict) and said in verdict


@pytest.mark.parametrize("answer", [on_arc, lambda a, b, share: arc(a, b, 5)[round(4 * share)]])
def test_arc(answer):
    assert check_arc(answer) == "ok"


@pytest.mark.parametrize(
    "answer, said",
    [
        (lambda a, b, share: (1 - share) * a + share * b, "half-way the code is"),
        (lambda a, b, share: on_arc(b, a, share), "share 0 should give a"),
        (lambda a, b, share: on_arc(a, b, share**2 if share != 0.5 else share), "of the angle"),
        (lambda a, b, share: a[:3], "256 numbers"),
        (lambda a, b, share: a / 0 * torch.nan, "share 0 should give a"),
    ],
)
def test_a_wrong_arc(answer, said):
    verdict = check_arc(answer)
    assert hints(verdict) and said in verdict


def test_taller():
    with unchecked():
        network = load(ProgramVAE, pretrained("program_vae_chair"))
        programs = sample(network, 120, seed=1).programs
        order = sorted(programs, key=lambda program: slenderness(execute(program)))
        change = 2 * (codes(network, order[-20:]).mean(0) - codes(network, order[:20]).mean(0))
        assert check_taller(change, network, programs[:12]) == "ok"
        assert "height / width was" in check_taller(0 * change, network, programs[:12])
        assert "height / width was" in check_taller((-change).tolist(), network, programs[:12])
        assert hints(check_taller(change / 0, network, programs[:12]))


@pytest.mark.parametrize("name", ["armchair", "sofa", "bench"])
def test_arms_are_told_by_a_rule_of_thumb(name):
    assert has_arms(execute(CHAIRS[name]))


@pytest.mark.parametrize("name", ["dining_chair", "slanted_chair", "stool", "coffee_table", "bookshelf"])
def test_what_has_no_arms_has_none(name):
    assert not has_arms(execute(CHAIRS[name]))


def test_slenderness_is_height_by_width():
    program = parse(
        "Assembly Program_0 {\n\tbbox = Cuboid(1.0, 1.0, 1.0, True)\n\tcube0 = Cuboid(0.5, 0.8, 0.3, True)\n}"
    )
    assert slenderness(execute(program)) == pytest.approx(1.6)
