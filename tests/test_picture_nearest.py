"""Nearest neighbours among known programs: the same as looking at all of them."""

import numpy as np
import pytest
import torch

from lib.finding import picture_nearest
from lib.finding.picture_nearest import nearest
from lib.interpreters.csg import Primitive, Program, ProgramError, Vocabulary, execute_many, vocabulary_of
from lib.interpreters.csg.packing import pack

from .conftest import unchecked
from .csg_programs import random_mixture, random_tokens

PLANE, SPACE = vocabulary_of(2), vocabulary_of(3)
FULL_OR_BLANK = Vocabulary([Primitive("s", (32, 32, 64)), Primitive("c", (32, 32, 8))])


def all_distances(targets: torch.Tensor, tokens: torch.Tensor, vocabulary: Vocabulary) -> np.ndarray:
    """(targets, programs): in how many pixels each pair differs, counted pixel by pixel."""
    shapes = execute_many(tokens, vocabulary)
    known = (shapes.images if vocabulary.dimensions == 2 else shapes.grids).flatten(1).numpy()
    ones = np.unpackbits(np.ascontiguousarray(targets.numpy()).view(np.uint8), axis=1, bitorder="little")
    return np.stack([(known != one.astype(bool)).sum(1) for one in ones])


def agrees(targets: torch.Tensor, tokens: torch.Tensor, vocabulary: Vocabulary) -> bool:
    """Is what is found as near as the nearest of all, and as near as it says?"""
    found = nearest(targets, tokens, vocabulary)
    distances = all_distances(targets, tokens, vocabulary)
    own = distances[np.arange(len(targets)), found.index.numpy()]
    return (own == found.pixels.numpy()).all() and (distances.min(1) == own).all()


@pytest.fixture(autouse=True)
def small_steps(monkeypatch):
    """So that many steps up and down are needed for a few programs."""
    monkeypatch.setattr(picture_nearest, "DRAWN_AT_ONCE", {2: 16, 3: 8})
    monkeypatch.setattr(picture_nearest, "BLOCK", 8)
    monkeypatch.setattr(picture_nearest, "WORDS_AT_ONCE", 1 << 12)


@pytest.mark.parametrize("seed", range(4))
def test_as_near_as_the_nearest_of_all_in_the_plane(seed, unchecked_shapes):
    rng = np.random.default_rng(seed)
    known = random_mixture(rng, (1, 3, 5, 9), 40 + seed, PLANE)
    targets = execute_many(random_mixture(rng, (3, 7), 15, PLANE)).words
    assert agrees(targets, known, PLANE)


def test_as_near_as_the_nearest_of_all_in_space(unchecked_shapes):
    rng = np.random.default_rng(5)
    known = random_mixture(rng, (1, 3), 20, SPACE)
    assert agrees(execute_many(random_tokens(rng, 9, 3, SPACE), SPACE).words, known, SPACE)


def test_pictures_that_are_no_programs(unchecked_shapes):
    rng = np.random.default_rng(6)
    noise = torch.from_numpy(rng.random((20, 64, 64)) < rng.random((20, 1, 1)))
    assert agrees(pack(noise), random_mixture(rng, (1, 5), 60, PLANE), PLANE)


@pytest.mark.parametrize("steps", [(1, 1), (3, 5), (4096, 64)])
def test_the_size_of_steps_and_blocks_does_not_matter(steps, monkeypatch, unchecked_shapes):
    monkeypatch.setattr(picture_nearest, "DRAWN_AT_ONCE", {2: steps[0]})
    monkeypatch.setattr(picture_nearest, "BLOCK", steps[1])
    rng = np.random.default_rng(7)
    assert agrees(
        execute_many(random_tokens(rng, 12, 5, PLANE)).words, random_tokens(rng, 30, 3, PLANE), PLANE
    )


@pytest.mark.parametrize("known", ["$", "s", "cc-", "s$$|$$$", "ss-|s$$|c$$"])
def test_blank_and_full_canvases(known):
    """All blank, all full, and both: the targets too."""
    letters = {"s": 0, "c": 1, "+": 2, "*": 3, "-": 4, "$": 5}
    tokens = torch.tensor([[letters[each] for each in row] for row in known.split("|")]).repeat(20, 1)
    words = torch.tensor([0, -1, 1, -2])[:, None].repeat(1, 64)  # nothing, everything, and in between
    assert agrees(words, tokens, FULL_OR_BLANK)
    one_pixel = words.clone()
    one_pixel[:, 1:] = 0
    assert agrees(one_pixel, tokens, FULL_OR_BLANK)


@pytest.mark.parametrize("count", [1, 7, 8, 9, 17])
def test_a_known_program_is_its_own_nearest(count):
    """Also where one target is left for the last block."""
    known = random_tokens(np.random.default_rng(8), 50, 3, PLANE)
    words = execute_many(known).words
    found = nearest(words[:count], known, PLANE)
    assert found.pixels.tolist() == [0] * count
    assert torch.equal(words[found.index], words[:count])


def test_one_target_and_one_program_in_the_module_s_own_steps(monkeypatch):
    monkeypatch.undo()
    tokens = torch.tensor([[5]])
    found = nearest(execute_many(tokens).words, tokens, PLANE)
    assert found.index.tolist() == [0] and found.pixels.tolist() == [0]


def test_of_equally_near_ones_one_is_found():
    tokens = torch.tensor([[3], [3], [3], [9], [9]])
    found = nearest(execute_many(tokens[:1]).words, tokens, PLANE)
    assert found.index.item() in (0, 1, 2) and found.pixels.item() == 0


def test_programs_that_are_not_valid_are_blank():
    tokens = torch.tensor([[PLANE.index("+")] * 3, [0, 1, PLANE.stop], [0, PLANE.stop, PLANE.stop]])
    found = nearest(torch.zeros((1, 64), dtype=torch.int64), tokens, PLANE)
    assert found.index.item() in (0, 1) and found.pixels.item() == 0


def test_a_vocabulary_of_one_s_own():
    program = Program((Primitive("c", (20, 20, 9)),))
    shapes = execute_many([program])
    assert nearest(shapes.words, shapes.tokens, shapes.vocabulary).pixels.tolist() == [0]


def test_no_targets_have_no_neighbours():
    found = nearest(torch.zeros((0, 64), dtype=torch.int64), torch.tensor([[5]]), PLANE)
    assert found.index.shape == found.pixels.shape == (0,)


def test_targets_that_are_not_contiguous():
    known = random_tokens(np.random.default_rng(9), 20, 3, PLANE)
    words = execute_many(known).words
    strided = torch.stack([words, ~words], 2)[..., 0]
    assert nearest(strided, known, PLANE).pixels.tolist() == [0] * 20


WORDS = torch.zeros((2, 64), dtype=torch.int64)


@pytest.mark.parametrize(
    "targets, tokens, message",
    [
        (WORDS, torch.zeros((0, 3), dtype=torch.long), "found no programs"),
        (WORDS[:, :63], torch.tensor([[0]]), r"targets \(2, 63\) of torch.int64; expected packed canvases"),
        (WORDS[0], torch.tensor([[0]]), r"targets \(64,\)"),
        (WORDS.int(), torch.tensor([[0]]), "of torch.int32"),
        (torch.zeros((2, 64, 64), dtype=torch.bool), torch.tensor([[0]]), "of torch.bool"),
    ],
)
def test_what_does_not_fit_is_named(targets, tokens, message):
    with unchecked(), pytest.raises(ValueError, match=message):
        nearest(targets, tokens, PLANE)


@pytest.mark.parametrize("tokens", [torch.tensor([[400]]), torch.tensor([[-1]]), torch.tensor([[0.5]])])
def test_what_are_no_tokens_are_named(tokens):
    with unchecked(), pytest.raises(ProgramError, match="token"):
        nearest(WORDS, tokens, PLANE)
