"""The checkers of notebook 08 are quiet while unanswered, hint at wrong answers, and accept right ones only."""

import re

import pytest
import torch

from lib.exercises.csg import (
    LONG_WINDED,
    check_empty,
    check_house,
    check_large,
    check_short,
    check_validity,
    house,
)  # fmt: skip
from lib.interpreters.csg import OPERATIONS, execute, parse, vocabulary_of
from lib.interpreters.csg.packing import count
from lib.metrics.images import iou

PICTURES = [check_empty, check_large, check_short, check_house]
HOUSE = "s(32,40,24)t(32,24,24)+s(32,48,12)-c(32,24,8)-"
SHORT = "c(24,32,20)s(40,40,16)-"


def depths(tokens):
    depth, found = 0, []
    for token in tokens:
        depth += -1 if token in OPERATIONS else 1
        found.append(depth)
    return found


def right(tokens):
    return bool(tokens) and min(depths(tokens)) > 0 and depths(tokens)[-1] == 1


WRONG = {
    "counts only": (
        lambda tokens: sum(t in OPERATIONS for t in tokens) * 2 + 1 == len(tokens),
        "it says True",
    ),
    "never ends": (lambda tokens: bool(tokens) and min(depths(tokens)) > 0, "it says True"),
    "empty": (lambda tokens: not tokens or right(tokens), r"for \[\] it says True"),
    "always": (lambda tokens: True, r"for \[\]"),
    "never": (lambda tokens: False, "it says False"),
    "no single primitive": (lambda tokens: len(tokens) > 1 and right(tokens), "it says False"),
    "one symbol": (lambda tokens: right([t.replace("*", "c") for t in tokens]), "it says"),
    "raises": (lambda tokens: min(depths(tokens)) > 0, r"for \[\] it raises ValueError"),
    "no yes or no": (lambda tokens: torch.zeros(2), "it raises RuntimeError"),
    "no function": ("def", "is a function"),
    "called": (True, "without brackets"),
}


@pytest.mark.parametrize("check", [*PICTURES, check_validity])
def test_unanswered(check):
    assert check(None) == "not answered yet"


def test_validity():
    assert check_validity(right) == "ok"
    assert check_validity(lambda tokens: None) == "not answered yet"
    assert check_validity(lambda tokens: True if right(tokens) else None) == "ok"

    def greedy(tokens):  # eats the list it was given
        waiting = 0
        while tokens:
            if tokens.pop(0) in OPERATIONS:
                if waiting < 2:
                    return False
                waiting -= 1
            else:
                waiting += 1
        return waiting == 1

    assert check_validity(greedy) == "ok"


@pytest.mark.parametrize("answer, expected", WRONG.values(), ids=WRONG)
def test_a_wrong_validity(answer, expected):
    verdict = check_validity(answer)
    assert verdict.startswith("not yet: ") and re.search(expected, verdict)


@pytest.mark.parametrize("check", PICTURES)
@pytest.mark.parametrize(
    "answer, expected",
    [
        ("", "the program is empty"),
        (7, "this is of type int"),
        (["c(32,32,8)"], "this is of type list"),
        ("c(32,32,8", "not closed"),
        ("c(32,32,8)+", "finds 1 shape"),
        ("c(33,32,8)c(32,32,8)+", "c(33,32,8) is not among the 400 tokens: centers are 8, 16"),
        ("c(32,32,8)c(32,32,30)+", "sizes 8, 12, … 32"),
        ("c(32,32,8)c(8,32,12)+", "nothing sticks out of the canvas"),
        ("sp(32,32,32,8)", "program of space"),
        ("cu(32,32,32,8)sp(32,32,32,8)+", "program of space"),
    ],
)
def test_what_is_no_program_becomes_a_hint(check, answer, expected):
    verdict = check(answer)
    assert verdict.startswith("not yet: ") and expected in verdict


def test_empty():
    assert check_empty("c(16,16,8)c(48,48,8)*s(32,32,16)*") == "ok"
    assert check_empty(parse("c(16,16,8)c(16,16,8)-c(16,16,8)*")) == "ok"
    assert "3 tokens, write 5" in check_empty("c(16,16,8)c(48,48,8)*")
    assert "pixels are still ON" in check_empty("c(16,16,8)c(48,48,8)*s(32,32,16)+")


def test_large():
    assert check_large("s(24,40,32)s(40,24,32)+s(16,16,24)+") == "ok"
    assert "3,600 will do" in check_large("s(24,24,32)s(40,40,32)+c(32,32,28)+")
    assert "7 tokens" in check_large("s(24,24,32)s(40,40,32)+s(24,40,32)s(40,24,32)++")


def test_the_door_reaches_the_ground():
    last = int(house().any(1).nonzero().max())
    assert not house()[last, 23:41].any() and house()[last, 22] and house()[last, 41]


def test_the_most_that_five_tokens_can_switch_on():
    """The solutions search all triples and find 3,653; here a sample of large ones, for none may have more."""
    words = vocabulary_of(2).canvases()
    squares = [i for i, p in enumerate(vocabulary_of(2).primitives) if p.numbers[2] >= 24]
    best = execute(parse("s(24,40,32)s(40,24,32)+s(16,16,24)+"))
    generator = torch.Generator().manual_seed(0)
    picked = torch.tensor(squares)[torch.randint(len(squares), (20_000, 3), generator=generator)]
    united = words[picked[:, 0]] | words[picked[:, 1]] | words[picked[:, 2]]
    assert best.on == 3653 and int(count(united).max()) <= best.on


def test_short():
    assert check_short(SHORT) == "ok"
    assert "13 tokens" in check_short(LONG_WINDED)
    assert "differs in" in check_short("s(40,40,16)c(24,32,20)-")
    assert "5 tokens" in check_short("c(24,32,20)s(40,40,16)-s(40,40,16)-")


def test_house():
    assert check_house(HOUSE) == "ok" and iou(execute(parse(HOUSE)).image, house()) == 1
    assert (
        check_house(HOUSE.replace("c(32,24,8)", "s(32,24,8)")) == "ok"
    )  # a square window is just good enough
    without = {"door": "s(32,40,24)t(32,24,24)+c(32,24,8)-", "window": "s(32,40,24)t(32,24,24)+s(32,48,12)-"}
    for part, text in without.items():
        assert "will do" in check_house(text), part
    assert "15 tokens" in check_house(HOUSE + "s(32,48,12)-" * 4)
    assert "will do" in check_house("c(16,16,8)c(48,48,8)*")


class _Rude:
    def __str__(self):
        raise RuntimeError

    __repr__ = __str__


def _leaves(tokens):
    raise SystemExit


@pytest.mark.parametrize("answer", [lambda tokens: _Rude(), _leaves, lambda tokens: "x" * 10**6])
def test_the_validity_checker_survives_rude_answers(answer):
    verdict = check_validity(answer)
    assert verdict.startswith("not yet") and len(verdict) < 300
