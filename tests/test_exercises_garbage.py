"""Whatever is handed to a checker, its verdict is a short hint, never an exception."""

import math

import numpy as np
import pytest
import torch

from tests import (
    test_exercises_csgnet,
    test_exercises_measuring,
    test_exercises_reinforce,
    test_exercises_stump,
    test_exercises_stump_net,
    test_exercises_training,
    test_exercises_writing,
)
from tests.verdicts import hints

FILES = (
    test_exercises_csgnet, test_exercises_measuring, test_exercises_reinforce, test_exercises_stump,
    test_exercises_stump_net, test_exercises_training, test_exercises_writing,
)  # fmt: skip
CHECKS = [check for file in FILES for check in file.CHECKS]
GARBAGE = [
    -7, 1j, "", "hello", b"F1", "x" * 10_000, "F1 = circle(radius=1)", "T = nothing", "Assembly P {\n}", object(),
    [], {}, {0, 1}, [1, 2], [1, 2, "x"], [[1]], [("a",)], (None, 1), (None, None), (None, None, None),
    ([[]], [[]], [[]]), ("a", "b", "c"), [[0], [1], [2]], {("cube9", "bbox")}, math.inf, math.nan, (math.nan, 1),
    [math.inf] * 63, [math.nan] * 63, [10**400] * 63, torch.zeros(3, 3), np.zeros(2), len, str, lambda: 0,
    True, lambda answer: "a", [10**400] * 3, 10**400, "c(99999999999999999999,1,1)", "c(32,32,8)+" * 5000,
]  # fmt: skip


@pytest.mark.parametrize("check", CHECKS)
def test_unanswered(check):
    assert check(None) == "not answered yet"


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("answer", GARBAGE, ids=range(len(GARBAGE)))
def test_garbage_becomes_a_hint(check, answer):
    assert hints(check(answer))


@pytest.mark.parametrize("check", CHECKS)
def test_a_function_that_returns_nothing(check):
    assert check(lambda *_: None) == "not answered yet" or hints(check(lambda *_: None))
