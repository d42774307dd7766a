"""The checkers of notebook 04 are quiet while unanswered, hint at wrong answers, and accept right ones only."""

import math

import pytest
import torch

from lib.datasets import example
from lib.exercises.training import (
    CUBOIDS,
    SHELF,
    check_kl,
    check_line,
    check_price,
    check_silent,
    check_steps,
)  # fmt: skip
from lib.models.program_lines import FIELD, line_of
from tests.verdicts import hints

STOOL = example("stool")


def steps(answer):
    return check_steps(answer, [4, 2, 2])


def silent(answer):
    return check_silent(answer, STOOL)


def price(answer):
    return check_price(answer, 50.0)


CHECKS = [check_line, steps, silent, price, check_kl]


def kl(mean, log_variance):
    return (mean**2 + log_variance.exp() - 1 - log_variance).sum(1) / 2


def test_a_line():
    line = line_of(SHELF, CUBOIDS)
    assert check_line(line) == check_line(torch.tensor(line)) == "ok"
    for name, where in FIELD.items():
        wrong = line.copy()
        wrong[where.start] = 1.0 - wrong[where.start]
        assert hints(check_line(wrong)) and repr(name) in check_line(wrong)


@pytest.mark.parametrize(
    "lengths, answer",
    [([4, 2, 2], [3, 3, 3, 3, 1, 1]), ([0], [1, 1]), ([1, 3], [2, 2, 2, 1, 1])],
)
def test_steps(lengths, answer):
    assert check_steps(answer, lengths) == check_steps(torch.tensor(answer), lengths) == "ok"
    assert hints(check_steps(answer[:-1], lengths)) and hints(check_steps([9, *answer[1:]], lengths))


def test_silent_terms():
    right = {"face", "uv", "count", "distance"}  # the stool has Cuboid, attach and reflect
    assert silent(right) == silent(sorted(right)) == "ok"
    assert "3 of 4" in silent(right - {"uv"})
    assert "'point' is asked of this one: attach" in silent(right | {"point"})
    assert "'kl' is asked of every program" in silent(right | {"kl"})
    assert "no term 'weight'" in silent(right | {"weight"})


def test_price():
    assert price(math.log(2) / 50) == price(0.0139) == "ok"
    assert "that costs 1" in price(0.02)


def test_kl():
    assert check_kl(kl) == "ok"
    assert "twice too large" in check_kl(lambda mean, log: 2 * kl(mean, log))
    assert "wrong for other means" in check_kl(lambda mean, log: kl(0 * mean, log))
    assert "wrong for other variances" in check_kl(lambda mean, log: kl(mean, 0 * log))
    assert "5 divergences" in check_kl(lambda mean, log: kl(mean, log).mean())
    assert "an error (no)" in check_kl(lambda mean, log: fails())


def fails():
    raise RuntimeError("no")
