"""Beam search: with room for all programs it finds all of them; with less, what a plain search by lists finds."""

import pytest
import torch

from lib.models.csgnet import CSGNet
from lib.models.csgnet_beams import Beams, beam_search
from lib.models.csgnet_decoding import write
from tests.csgnets import (
    all_programs,
    choices_of,
    is_program,
    log_probability,
    random_canvases,
    random_network,
)

CLOSE = 1e-4  # float32, logarithms of up to fourteen probabilities
TOKENS = 7  # three primitives
FEW = 6  # two


def shape_of(row: list[int], tokens: int) -> list:
    """The stack that tokens leave, of parts as texts; operands of + and * in alphabetic order."""
    stop, stack = tokens - 1, []
    for token in row:
        if token == stop:
            break
        if token < stop - 3:
            stack.append(f"p{token}")
            continue
        right, left = stack.pop(), stack.pop()
        symbol = "+*-"[token - stop + 3]
        left, right = (left, right) if symbol == "-" else sorted((left, right))
        stack.append(f"({left}{symbol}{right})")
    return stack


def by_lists(
    network: CSGNet, canvas: torch.Tensor, k: int, longest: int, grammar: bool = True, merge: bool = False
) -> list[tuple[list[int], float]]:
    """Programs and their log probabilities, found by a search that sorts a list of all candidates in each step."""
    tokens, beams = network.config.tokens, [([], 0.0)]
    while any(network.stop not in row for row, _ in beams):
        candidates = [beam for beam in beams if network.stop in beam[0]]
        for row, total in beams:
            if network.stop in row:
                continue
            choices = list(choices_of(row, tokens, longest, grammar))
            odds = network(canvas.unsqueeze(0), torch.tensor([[*row, 0]]))[0, -1][choices].log_softmax(0)
            candidates += [([*row, t], total + odd) for t, odd in zip(choices, odds.tolist())]
        beams = sorted(candidates, key=by_probability)
        if merge:  # the first of those that leave the same stack; as in lib, not more than 3 k are looked at
            beams = list(
                {str(shape_of(row, tokens)): (row, odd) for row, odd in beams[: 3 * k][::-1]}.values()
            )
            beams = sorted(beams, key=by_probability)
        beams = beams[:k]
    return beams


def by_probability(beam: tuple[list[int], float]) -> float:
    return -beam[1]


def pairs_of(found: Beams, row: int, stop: int) -> list[tuple[list[int], float]]:
    """What was found for one shape, cut after the first `$`; without what there was not."""
    rows = zip(found.tokens[row].tolist(), found.log_probability[row].tolist())
    return [(each[: each.index(stop) + 1], odd) for each, odd in rows if odd > -torch.inf]


def assert_same(found: list[tuple[list[int], float]], expected: list[tuple[list[int], float]]) -> None:
    assert [row for row, _ in found] == [row for row, _ in expected]
    assert [odd for _, odd in found] == pytest.approx([odd for _, odd in expected], abs=CLOSE)


@pytest.mark.parametrize("longest", range(1, 6))
@pytest.mark.usefixtures("unchecked_shapes")
def test_with_room_for_all_it_finds_all_programs(longest):
    """Each once, sorted, with the probability that teacher forcing gives it; the rest of the room stays empty."""
    network, canvas = random_network(1, FEW, sharpness=3.0), random_canvases(2, 1)
    rows = all_programs(FEW, longest)
    found = beam_search(network, canvas, len(rows) + 20, longest, merge=False)
    with torch.no_grad():
        odds = [log_probability(network, canvas[0], row, longest).item() for row in rows]
    assert_same(pairs_of(found, 0, network.stop), sorted(zip(rows, odds), key=by_probability))
    assert found.log_probability[0].exp().sum().item() == pytest.approx(1, abs=CLOSE)
    assert found.tokens.shape[:2] == (1, len(rows) + 20)
    assert found.log_probability[0, len(rows) :].isneginf().all()
    assert (found.tokens[0, len(rows) :] == network.stop).all()


@pytest.mark.parametrize("longest", range(1, 6))
@pytest.mark.usefixtures("unchecked_shapes")
def test_merged_it_finds_one_of_each_kind(longest):
    """Of those that are the same up to the order of operands exactly one."""
    network, canvas = random_network(3, FEW, sharpness=3.0), random_canvases(4, 1)
    found = pairs_of(beam_search(network, canvas, 200, longest), 0, network.stop)
    kinds = {str(shape_of(row, FEW)) for row in all_programs(FEW, longest)}
    assert sorted(str(shape_of(row, FEW)) for row, _ in found) == sorted(kinds)
    for row, odd in found:
        with torch.no_grad():
            assert odd == pytest.approx(log_probability(network, canvas[0], row, longest).item(), abs=CLOSE)


@pytest.mark.parametrize("grammar, merge", [(True, False), (True, True), (False, False)])
@pytest.mark.parametrize("k", [1, 2, 5, 12])
@pytest.mark.usefixtures("unchecked_shapes")
def test_it_finds_what_a_search_by_lists_finds(k, grammar, merge):
    for seed, sharpness in ((5, 2.0), (6, 20.0)):
        network, canvases = random_network(seed, TOKENS, sharpness=sharpness), random_canvases(seed, 3)
        found = beam_search(network, canvases, k, 7, grammar, merge)
        for row, canvas in enumerate(canvases):
            with torch.no_grad():
                expected = by_lists(network, canvas, k, 7, grammar, merge)
            assert_same(pairs_of(found, row, network.stop), expected)


@pytest.mark.parametrize("grammar", [True, False], ids=["grammar", "free"])
@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.usefixtures("unchecked_shapes")
def test_one_beam_is_greedy(dimensions, grammar):
    for seed in range(5):
        network = random_network(seed, dimensions=dimensions, sharpness=5.0)
        canvases = random_canvases(seed, 6, dimensions)
        found, greedy = (
            beam_search(network, canvases, 1, grammar=grammar),
            write(network, canvases, grammar=grammar),
        )
        assert torch.equal(found.tokens[:, 0], greedy.tokens)
        assert torch.allclose(found.log_probability[:, 0], greedy.log_probability, atol=CLOSE)


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.usefixtures("unchecked_shapes")
def test_shapes_are_searched_together_as_alone(dimensions):
    """Also where some are done before others."""
    network = random_network(7, 12, dimensions, sharpness=8.0, norm="batch")
    canvases = random_canvases(8, 6, dimensions)
    together = beam_search(network, canvases, 4)
    for row in range(6):
        alone = beam_search(network, canvases[row : row + 1], 4)
        assert_same(pairs_of(together, row, network.stop), pairs_of(alone, 0, network.stop))


@pytest.mark.parametrize("longest", [1, 2, 3, 7, 13])
@pytest.mark.parametrize("merge", [True, False])
@pytest.mark.usefixtures("unchecked_shapes")
def test_laws_of_what_is_found(longest, merge):
    """Programs, different ones, the likeliest first, with their own probabilities, that end at `$`."""
    network, canvases = random_network(9, 40, sharpness=10.0), random_canvases(10, 4)
    found = beam_search(network, canvases, 10, longest, merge=merge)
    assert found.tokens.shape[:2] == found.log_probability.shape == (4, 10)
    assert (found.log_probability.diff(dim=1) <= 0).all()
    for canvas, rows, odds in zip(canvases, found.tokens.tolist(), found.log_probability.tolist()):
        assert all(is_program(row, 40, longest) for row in rows)
        kinds = {str(shape_of(row, 40)) if merge else str(row) for row in rows}
        assert len(kinds) == 10
        with torch.no_grad():
            expected = [log_probability(network, canvas, row, longest).item() for row in rows]
        assert odds == pytest.approx(expected, abs=CLOSE)


@pytest.mark.usefixtures("unchecked_shapes")
def test_it_does_not_go_on_after_the_end():
    """Where `$` is what the network wants as soon as it may, no program is longer than another needs to be."""
    network = random_network(11, 40, sharpness=1.0)
    with torch.no_grad():
        network.scores.bias[network.stop] += 1000
    found = beam_search(network, random_canvases(12, 2), 10)
    assert found.tokens.shape == (2, 10, 2)
    assert (found.tokens[..., 0] < 36).all() and (found.tokens[..., 1] == network.stop).all()


@pytest.mark.usefixtures("unchecked_shapes")
def test_merging_makes_room_for_others():
    """A network that does not care finds the same programs twice unless they are merged."""
    network, canvases = random_network(13, FEW, sharpness=0.1), random_canvases(14, 3)
    merged, plain = (beam_search(network, canvases, 12, 3, merge=merge) for merge in (True, False))
    for row in range(3):
        different, all_found = (
            {str(shape_of(each, FEW)) for each, _ in pairs_of(found, row, FEW - 1)}
            for found in (merged, plain)
        )
        assert len(different) == 12 > len(all_found)  # of 14 programs that there are, two are there twice


@pytest.mark.usefixtures("unchecked_shapes")
def test_the_order_of_a_subtraction_is_kept():
    """A - B and B - A are two programs, A + B and B + A one."""
    found = beam_search(random_network(15, FEW, sharpness=0.5), random_canvases(16, 1), 200, 3)
    kinds = [str(shape_of(row, FEW)) for row, _ in pairs_of(found, 0, FEW - 1)]
    assert kinds.count("['(p0-p1)']") == kinds.count("['(p1-p0)']") == 1
    assert kinds.count("['(p0+p1)']") == 1 and len(kinds) == 2 + 3 + 3 + 4


def test_no_shapes_no_programs():
    found = beam_search(random_network(17), random_canvases(18, 1)[:0], 3, 3)
    assert found.tokens.shape[:2] == (0, 3)


def test_gradients_are_off():
    assert not beam_search(random_network(19), random_canvases(20, 1), 2, 3).log_probability.requires_grad


@pytest.mark.parametrize("wrong", [{"k": 0}, {"longest": 0}])
def test_nothing_to_find_is_an_error(wrong):
    with pytest.raises(ValueError, match="expected at least one of each"):
        beam_search(random_network(21), random_canvases(22, 1), **wrong)
