"""The checkers of notebook 10 are quiet while unanswered, hint at wrong answers, and accept right ones only."""

import math

import torch

from lib.exercises.reinforce import (
    arrow,
    check_arrow,
    check_baseline_function,
    check_estimates,
    check_power,
    check_quiet_baseline,
)
from lib.finding.picture_refining import refine
from lib.interpreters.csg import parse
from tests.verdicts import hints

CHECKS = [check_estimates, check_quiet_baseline, check_baseline_function, check_power, check_arrow]
ROUGH = "t(32,24,16)s(32,40,8)+s(32,48,8)+"


def others(rewards):
    return (rewards.sum(1, keepdim=True) - rewards) / (rewards.shape[1] - 1)


def test_a_function_that_returns_nothing_is_unanswered():
    assert check_baseline_function(lambda rewards: None) == "not answered yet"


def test_estimates():
    assert check_estimates((0.14, -0.24, 0.064)) == check_estimates([0.14, -0.24, 0.064]) == "ok"
    assert "arm 0 has the wrong sign" in check_estimates((0.14, 0.24, 0.064))
    assert "arm 1 is not 0.7" in check_estimates((0.7, -0.24, 0.064))
    assert "exact slope is not -0.1" in check_estimates((0.14, -0.24, -0.1))
    assert "3 numbers" in check_estimates((0.14, -0.24))


def test_the_baseline_without_noise():
    assert check_quiet_baseline(0.38) == "ok"
    assert "mean reward" in check_quiet_baseline(0.62)
    assert hints(check_quiet_baseline(0.0)) and "mean reward" not in check_quiet_baseline(0.0)


def test_the_mean_of_the_others():
    assert check_baseline_function(others) == "ok"
    assert "own reward" in check_baseline_function(lambda r: r.mean(1, keepdim=True))
    assert "own reward" in check_baseline_function(lambda r: r.mean(1, keepdim=True).expand_as(r))
    assert "every picture" in check_baseline_function(lambda r: r.mean())
    assert "should be" in check_baseline_function(lambda r: 0 * r)
    assert "an error (no)" in check_baseline_function(lambda r: fails())
    assert "an error" in check_baseline_function(lambda r: torch.zeros(7, 7))


def test_the_function_may_change_what_it_is_given():
    def in_place(rewards):
        found = others(rewards)
        rewards.zero_()
        return found

    assert check_baseline_function(in_place) == "ok"


def test_the_power():
    power = math.log(0.1) / math.log(1 - 4 / (64 * 2**0.5))
    assert check_power(power) == check_power(51) == check_power(torch.tensor(51.0)) == "ok"
    assert "it earns 0.4" in check_power(20)
    assert "above 0" in check_power(-3)


def test_the_arrow():
    found = refine([parse(ROUGH)], arrow()[None]).programs[0]
    assert check_arrow(found) == check_arrow(found.to_text()) == "ok"
    assert "px from the arrow" in check_arrow(ROUGH)
    assert "15 tokens" in check_arrow("c(32,32,8)" + "c(32,32,8)+" * 7)
    assert "of space" in check_arrow("sp(32,32,32,8)")
    assert hints(check_arrow("c(32,32")) and hints(check_arrow("c(32,32,8)c(32,32,8)"))


def test_one_square_is_not_enough():
    assert hints(check_arrow(refine([parse("t(32,24,16)s(32,40,12)+")], arrow()[None]).programs[0]))


def fails():
    raise RuntimeError("no")
