"""Tokens that have a number in common learn together, and what is left is a network without sharing."""

import torch

from lib.interpreters.csg import parse, vocabulary_of
from lib.models.csgnet_grammar import OPERATIONS
from lib.training.csgnet_sharing import numbers_of, share, unshare
from tests.csgnets import random_canvases, random_network

WORDS = vocabulary_of(2)


def tokens(*texts: str) -> list[int]:
    return [WORDS.primitives.index(parse(text).statements[0]) for text in texts]


def test_which_numbers_a_token_has():
    """Three of x, y, r, and what kind it is; nothing for operations and `$`."""
    found = numbers_of(WORDS)
    circle, other, square, far = tokens("c(16,24,8)", "c(16,32,12)", "s(16,24,8)", "c(48,40,12)")
    assert (found[: -OPERATIONS - 1].sum(1) == 4).all() and (found[-OPERATIONS - 1 :] == 0).all()
    shared = found @ found.T
    assert shared[circle, other] == 2  # both are circles with x = 16
    assert shared[circle, square] == 0 and shared[circle, far] == 1


def test_one_token_teaches_those_that_share_its_numbers():
    network, canvases = random_network(2, tokens=len(WORDS)), random_canvases(2, 3)
    program = torch.tensor([tokens("c(16,24,8)")]).expand(3, 1)
    before = network(canvases, program)
    share(network)
    assert torch.allclose(network(canvases, program), before, atol=1e-6)
    descent = torch.optim.SGD(network.parameters(), lr=0.1)
    own, other, square = tokens("c(16,24,8)", "c(16,32,12)", "s(16,24,8)")
    network(canvases, program)[:, 0, own].sum().backward()
    start = network.scores.weight.detach().clone()
    descent.step()
    moved = (network.scores.weight.detach() - start).abs().sum(1)
    assert moved[own] > moved[other] > 0 and moved[square] == 0
    taught = network(canvases, program).detach()
    unshare(network)
    assert torch.allclose(network(canvases, program), taught, atol=1e-6)
    assert not any("of_numbers" in name for name in network.state_dict())
