"""The checkers of notebook 09 are quiet while unanswered, hint at wrong answers, and accept right ones only."""

import math

import numpy as np
import pytest
import torch

from lib.exercises import csgnet as exercises
from lib.exercises.csgnet import check_blind, check_fooled, check_rules, check_seen, check_step
from lib.interpreters.csg import execute, parse, vocabulary_of
from lib.models.csgnet import SIDE, CSGNet, CSGNetConfig
from tests.csgnets import random_network
from tests.verdicts import hints

COMPACT = CSGNetConfig.compact()
NETWORK = random_network(0, tokens=400)


def seen(answer):
    return check_seen(answer, COMPACT)


def fooled(answer):
    return check_fooled(answer, NETWORK)


CHECKS = [seen, check_rules, check_blind, check_step, fooled]


def may_follow(parts, room):
    return {letter for letter, may in {"P": parts < room, "O": parts > 1, "$": parts == 1}.items() if may}


def step(totals, odds, k):
    return [divmod(p, odds.shape[1]) for p in (totals[:, None] + odds).flatten().topk(k).indices.tolist()]


def test_functions_that_are_not_written_yet():
    assert check_rules(lambda parts, room: None) == check_step(lambda *_: None) == "not answered yet"


@pytest.mark.parametrize("config", [COMPACT, CSGNetConfig(norm="batch"), CSGNetConfig.compact(3)])
def test_seen_pixels_are_those_that_a_number_depends_on(config):
    """By the gradient of one number in the middle of the last maps, with weights and pixels above 0 so that nothing
    cancels. Maxima look at one of their pixels only: they are replaced by means."""
    encoder = CSGNet(config).encoder.eval()
    for layer in encoder:
        for weights in layer.parameters():
            torch.nn.init.constant_(weights, 0.1)
    layers = [torch.nn.AvgPool2d(m.kernel_size) if isinstance(m, torch.nn.MaxPool2d) else m for m in encoder]
    layers = [m for m in layers if not isinstance(m, torch.nn.GroupNorm)]  # looks at everything
    pixels = torch.ones(1, 1, *(SIDE,) * config.dimensions, dtype=torch.float, requires_grad=True)
    maps = torch.nn.Sequential(*layers)(pixels)
    maps[0, 0][(maps.shape[2] // 2,) * config.dimensions].backward()
    width = int((pixels.grad[0, 0].flatten(1) != 0).any(1).sum())
    assert width == min(SIDE, exercises.seen_pixels(config))


def test_seen():
    assert seen(38) == seen(38.0) == "ok"
    assert "strides multiply" in seen(12) and "neighbours are apart" in seen(8)
    assert "too few" in seen(30) and "too many" in seen(64)


def test_rules():
    assert check_rules(may_follow) == "ok"
    assert check_rules(lambda *place: "".join(may_follow(*place))) == "ok"
    wrong = {
        "too long": lambda p, r: may_follow(p, r + 1),
        "P may come, too": lambda p, r: may_follow(p, r - (p == 2)),
        "$ may come, too": lambda p, r: may_follow(p, r) - {"$"},
        "O leads to no program": lambda p, r: may_follow(p, r) | {"O"},
        "the letters are P, O and $": lambda p, r: ["P", "+"],
        "it raises ZeroDivisionError": lambda p, r: 1 / 0,
    }
    for expected, function in wrong.items():
        assert hints(check_rules(function)) and expected in check_rules(function)


def test_blind():
    right = (2 * math.log(396) + math.log(3)) / 4
    assert check_blind(right) == check_blind(round(right, 2)) == "ok"
    assert "mean over its tokens" in check_blind(4 * right)
    assert "the end is a token" in check_blind(4 * right / 3)
    assert "does not know the rules" in check_blind(math.log(400))
    assert "too little" in check_blind(1) and "too much" in check_blind(5)


def test_a_step_of_beam_search():
    assert check_step(step) == "ok"
    assert "the beginnings have probabilities" in check_step(lambda t, o, k: step(0 * t, o, k))
    assert "the likeliest should come first" in check_step(lambda t, o, k: step(t, o, k)[::-1])
    assert "returns 0 pairs" in check_step(lambda t, o, k: step(t, o, 0))
    assert "it raises TypeError" in check_step(lambda t, o, k: [1] * k)
    assert "the likeliest is" in check_step(lambda t, o, k: step(t, -o, k))

    def in_place(totals, odds, k):
        odds += totals[:, None]
        return step(0 * totals, odds, k)

    assert check_step(in_place) == "ok"


def test_fooled(unchecked_shapes):
    """A network with random weights is fooled by everything but what it happens to write."""
    program = parse("c(32,32,16)s(40,40,12)-")
    assert exercises.missed_by(NETWORK, program) >= exercises.MISSED
    assert fooled(program) == fooled(program.to_text()) == "ok"
    assert "not among the 400 tokens" in fooled("c(33,32,16)")
    assert "program of space" in fooled("sp(32,32,32,8)")
    assert "15 tokens" in fooled("s(32,32,28)" + "c(32,32,8)-" * 7)
    assert "0 pixels are ON" in fooled("c(16,16,8)c(48,48,8)*")


def test_what_the_network_writes_does_not_fool_it(unchecked_shapes, monkeypatch):
    tokens = vocabulary_of(2).program(np.array([10])).tokens()
    monkeypatch.setattr(exercises, "beam_search", Found(tokens.view(1, 1, 1)))
    program = vocabulary_of(2).program(tokens)
    assert execute(program).on >= exercises.LEAST_ON
    assert "the best of 10 is 0.00 px away" in fooled(program)


class Found:
    """Stands in for a beam search: always the same programs."""

    def __init__(self, tokens):
        self.tokens = tokens

    def __call__(self, *_):
        return self
