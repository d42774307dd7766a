"""The best of several programs for a picture or a grid."""

import numpy as np
import pytest
import torch

from lib.finding import picture_choice
from lib.finding.picture_choice import best_of
from lib.interpreters.csg import ProgramError, execute_many, parse, vocabulary_of
from lib.metrics.images import BLANK_PX, image_chamfer, iou

from .conftest import unchecked
from .csg_programs import random_tokens

PLANE, SPACE = vocabulary_of(2), vocabulary_of(3)
TEXTS = ("c(32,32,16)", "c(32,32,20)", "c(40,32,16)s(16,16,8)+", "s(32,32,16)")


def tokens_of(*texts: str, length: int = 6) -> torch.Tensor:
    programs = [parse(text) for text in texts]
    return torch.stack([each.tokens(vocabulary_of(each.dimensions), length) for each in programs])


@pytest.fixture(scope="module")
def several() -> tuple[torch.Tensor, torch.Tensor]:
    """40 random pictures, and for each six random programs, of which some are blank."""
    rng = np.random.default_rng(3)
    return execute_many(random_tokens(rng, 40, 5, PLANE)).images, random_tokens(rng, 240, 5, PLANE).view(
        40, 6, 5
    )


def test_the_measure_is_that_of_every_program(several):
    targets, tokens = several
    choice = best_of(targets, tokens)
    for k in range(tokens.shape[1]):
        expected = image_chamfer(targets, execute_many(tokens[:, k]).images)
        assert torch.equal(choice.measure[:, k], expected)
    assert torch.equal(choice.of_best, choice.measure.amin(1))
    assert torch.equal(choice.tokens, tokens[torch.arange(40), choice.best])


def test_a_program_that_draws_the_target_wins():
    tokens = tokens_of(*TEXTS)
    choice = best_of(execute_many(tokens).images, tokens.expand(4, -1, -1))
    assert choice.best.tolist() == [0, 1, 2, 3]
    assert choice.of_best.tolist() == [0, 0, 0, 0]


def test_of_equal_ones_the_first_wins():
    tokens = tokens_of(TEXTS[3], TEXTS[0], TEXTS[0], TEXTS[0])
    assert best_of(execute_many(tokens[1:2]).images, tokens[None]).best.tolist() == [1]


def test_another_order_of_the_programs_changes_nothing(several):
    targets, tokens = several
    order = torch.tensor([3, 1, 5, 0, 4, 2])
    assert torch.equal(best_of(targets, tokens).of_best, best_of(targets, tokens[:, order]).of_best)


def test_what_cannot_be_executed_is_16_px_away():
    plus = PLANE.index("+")
    tokens = torch.tensor([[[plus, plus, plus], [0, 1, PLANE.stop], [PLANE.stop] * 3, [0, PLANE.stop, plus]]])
    choice = best_of(execute_many(tokens[0, 3:]).images, tokens)
    assert choice.measure.tolist() == [[BLANK_PX, BLANK_PX, BLANK_PX, 0]]
    assert choice.best.tolist() == [3]


def test_in_space_the_greatest_overlap_wins(unchecked_shapes):
    tokens = tokens_of("sp(32,32,32,16)", "sp(32,32,32,20)", "cu(32,32,32,16)", "sp(32,32,32,16)")
    grids = execute_many(tokens[:2], SPACE).grids
    choice = best_of(grids, tokens.expand(2, -1, -1))
    assert choice.best.tolist() == [0, 1]
    assert choice.of_best.tolist() == [1, 1]
    assert choice.measure[0, 1] == iou(grids[0], grids[1], dims=3)


def test_what_cannot_be_executed_overlaps_nothing(unchecked_shapes):
    tokens = torch.tensor([[[SPACE.stop], [SPACE.index("+")], [0]]])
    choice = best_of(execute_many(tokens[0, 2:], SPACE).grids, tokens)
    assert choice.measure.tolist() == [[0, 0, 1]]
    blank = best_of(torch.zeros(1, 64, 64, 64, dtype=torch.bool), tokens)
    assert blank.measure.tolist() == [[0, 0, 0]]  # neither does it draw what is blank


def test_parts_make_the_same_as_all_at_once(several, monkeypatch, unchecked_shapes):
    whole = best_of(*several)
    monkeypatch.setattr(picture_choice, "CANVASES_AT_ONCE", {2: 7})  # one target at a time
    parts = best_of(*several)
    assert torch.equal(whole.measure, parts.measure) and torch.equal(whole.best, parts.best)


def test_nothing_to_choose_for_no_targets():
    choice = best_of(torch.zeros((0, 64, 64), dtype=torch.bool), torch.zeros((0, 3, 5), dtype=torch.long))
    assert choice.tokens.shape == (0, 5) and choice.measure.shape == (0, 3)


BLANK = torch.zeros((2, 64, 64), dtype=torch.bool)
STOPS = torch.full((2, 3, 5), PLANE.stop)


@pytest.mark.parametrize(
    "targets, tokens, message",
    [
        (BLANK, STOPS[:1], r"targets \(2, 64, 64\) and programs \(1, 3, 5\); expected"),
        (BLANK, STOPS[0], r"programs \(3, 5\); expected"),
        (BLANK[:, :32], STOPS, r"targets \(2, 32, 64\)"),
        (BLANK[0], STOPS, r"targets \(64, 64\)"),
        (BLANK.tolist(), STOPS, "targets in a list and programs in a Tensor"),
        (BLANK, STOPS[:, :0], "found 0 programs for each target"),
        (BLANK.float(), STOPS, "has to be bool"),
    ],
)
def test_what_does_not_fit_is_named(targets, tokens, message):
    with unchecked(), pytest.raises(ValueError, match=message):
        best_of(targets, tokens)


@pytest.mark.parametrize("tokens", [STOPS + 1, -STOPS, STOPS.double() / 2])
def test_what_are_no_tokens_are_named(tokens):
    with unchecked(), pytest.raises(ProgramError, match="token"):
        best_of(BLANK, tokens)
