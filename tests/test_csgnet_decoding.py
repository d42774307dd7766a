"""CSGNet writes: only programs, every program, and each as often as it says."""

from itertools import product
from math import log

import pytest
import torch

from lib.interpreters.csg import vocabulary_of
from lib.models.csgnet_decoding import write
from lib.models.csgnet_grammar import LONGEST, allowed, deeper
from tests.csgnets import (
    all_programs,
    choices_of,
    is_program,
    log_probability,
    random_canvases,
    random_network,
)

CLOSE = 1e-4  # float32, logarithms of up to fourteen probabilities
MANY = 20_000  # programs that are drawn to be counted


def noise(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@pytest.mark.parametrize("longest", range(1, 8))
def test_the_rule_allows_all_programs_and_nothing_else(longest):
    """Of all rows of tokens with one primitive, those whose every token is allowed are those that are programs."""
    tokens = 5
    rows = torch.tensor(list(product(range(tokens), repeat=longest)))
    rows = torch.cat([rows, torch.full_like(rows[:, :1], tokens - 1)], 1)
    depth, running = torch.zeros(len(rows), dtype=torch.long), torch.ones(len(rows), dtype=torch.bool)
    fine = running
    for place, token in enumerate(rows.unbind(1)):
        fine = fine & allowed(depth, running, longest - place, tokens).gather(1, token.unsqueeze(1)).squeeze(
            1
        )
        depth, running = deeper(depth, token, tokens), running & (token != tokens - 1)
    assert fine.tolist() == [is_program(row, tokens, longest) for row in rows.tolist()]


@pytest.mark.parametrize("longest", range(1, 8))
def test_programs_are_counted_as_trees_are(longest):
    """Catalan numbers: 1, 1, 2, 5 binary trees with 0 to 3 operations; 2 primitives, 3 operations."""
    trees = [catalan * 3**n * 2 ** (n + 1) for n, catalan in enumerate((1, 1, 2, 5))]
    assert len(all_programs(6, longest)) == sum(trees[: (longest + 1) // 2])


@pytest.mark.parametrize("longest", range(1, 14))
@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.usefixtures("unchecked_shapes")
def test_whatever_is_written_is_a_program(dimensions, longest):
    """Random networks: some nearly always want the same token, some do not care."""
    for seed, sharpness in enumerate((0.0, 5.0, 100.0)):
        network = random_network(10 * longest + seed, 9, dimensions, sharpness)
        canvases = random_canvases(seed, 20 if dimensions == 2 else 4, dimensions)
        for written in (
            write(network, canvases, longest=longest),
            write(network, canvases, noise(seed), copies=5, longest=longest),
        ):
            assert all(is_program(row, 9, longest) for row in written.tokens.tolist())
            assert written.log_probability.isfinite().all() and (written.log_probability <= 0).all()


@pytest.mark.parametrize("dimensions, tokens", [(2, 400), (3, 6635)])
def test_programs_of_the_real_vocabularies_are_programs_of_the_interpreter(dimensions, tokens):
    network = random_network(1, tokens, dimensions, sharpness=1.0)
    with torch.no_grad():
        network.scores.bias[-4:] += 4  # operations and `$` are few among so many
    written = write(network, random_canvases(2, 3, dimensions), noise(3), copies=8)
    programs = [vocabulary_of(dimensions).program(row) for row in written.tokens]  # raises if one is none
    assert max(map(len, programs)) == LONGEST[dimensions] > min(map(len, programs))


@pytest.mark.parametrize("longest", range(1, 6))
@pytest.mark.usefixtures("unchecked_shapes")
def test_every_program_can_be_written(longest):
    """Each has a probability, and all of them together have 1: nothing is lost on what is no program."""
    network, canvas = random_network(4, 6, sharpness=3.0), random_canvases(5, 1)[0]
    with torch.no_grad():
        found = torch.stack(
            [log_probability(network, canvas, row, longest) for row in all_programs(6, longest)]
        )
    assert found.isfinite().all()
    assert found.exp().sum().item() == pytest.approx(1, abs=CLOSE)


@pytest.mark.usefixtures("unchecked_shapes")
def test_programs_are_drawn_as_often_as_they_say():
    """Counts of 20,000 drawn programs against their probabilities: no farther than five standard deviations."""
    network, canvas, longest = random_network(6, 6, sharpness=3.0), random_canvases(7, 1), 3
    written = write(network, canvas, noise(8), MANY, longest)
    rows, counts = written.tokens.unique(dim=0, return_counts=True)
    seen = {tuple(row): count for row, count in zip(rows.tolist(), counts.tolist())}
    for row in all_programs(6, longest):
        share = log_probability(network, canvas[0], row, longest).exp().item()
        count = seen.pop(tuple(row + [network.stop] * (rows.shape[1] - len(row))), 0)
        assert abs(count - MANY * share) <= 5 * (MANY * share * (1 - share)) ** 0.5 + 1
    assert not seen


@pytest.mark.parametrize("grammar", [True, False], ids=["grammar", "free"])
@pytest.mark.parametrize("drawn", [True, False], ids=["drawn", "greedy"])
@pytest.mark.usefixtures("unchecked_shapes")
def test_log_probability_is_that_of_teacher_forcing(grammar, drawn):
    """Also of programs that end before the others do."""
    network, canvases, longest = random_network(9, sharpness=5.0), random_canvases(10, 12), 5
    with torch.no_grad():
        network.scores.bias[network.stop] += 2
    written = write(network, canvases, noise(11) if drawn else None, longest=longest, grammar=grammar)
    assert not drawn or (written.tokens != network.stop).sum(1).unique().numel() > 1
    for canvas, row, found in zip(canvases, written.tokens.tolist(), written.log_probability):
        expected = log_probability(network, canvas, row, longest, grammar)
        assert found.item() == pytest.approx(expected.item(), abs=CLOSE)


@pytest.mark.parametrize("grammar", [True, False], ids=["grammar", "free"])
@pytest.mark.usefixtures("unchecked_shapes")
def test_greedy_takes_the_likeliest_token_each_time(grammar):
    network, canvases, longest = random_network(12), random_canvases(13, 5), 7
    rows = write(network, canvases, longest=longest, grammar=grammar).tokens.tolist()
    for canvas, row in zip(canvases, rows):
        written: list[int] = []
        while network.stop not in written:
            scores = network(canvas.unsqueeze(0), torch.tensor([[*written, 0]]))[0, -1]
            choices = choices_of(written, 9, longest, grammar)
            written.append(max(choices, key=scores.tolist().__getitem__))
        assert row == written + [network.stop] * (len(row) - len(written))


@pytest.mark.parametrize("dimensions", [2, 3])
def test_shapes_are_read_together_as_alone(dimensions):
    network, canvases = random_network(14, 9, dimensions, norm="batch"), random_canvases(15, 4, dimensions)
    together = write(network, canvases)
    for row in range(4):
        alone = write(network, canvases[row : row + 1])
        padded = torch.nn.functional.pad(
            alone.tokens[0], (0, together.tokens.shape[1] - alone.tokens.shape[1]), value=network.stop
        )
        assert torch.equal(padded, together.tokens[row])
        assert alone.log_probability[0].item() == pytest.approx(
            together.log_probability[row].item(), abs=CLOSE
        )


def test_copies_stand_one_after_another():
    network, canvases = random_network(16), random_canvases(17, 3)
    once, thrice = write(network, canvases), write(network, canvases, copies=3)
    assert torch.equal(thrice.tokens, once.tokens.repeat_interleave(3, 0))
    assert len(once.tokens.unique(dim=0)) > 1  # else any order would do


def test_copies_are_drawn_one_by_one():
    """With probability of nearly one, a hundred copies with a hundred coins are not all the same."""
    network = random_network(18, sharpness=1.0)
    assert len(write(network, random_canvases(19, 1), noise(20), 100).tokens.unique(dim=0)) > 10


def test_same_seed_same_programs():
    network, canvases = random_network(21, sharpness=2.0), random_canvases(22, 5)
    first, again, other = (write(network, canvases, noise(seed), 4) for seed in (1, 1, 2))
    assert torch.equal(first.tokens, again.tokens)
    assert torch.equal(first.log_probability, again.log_probability)
    assert first.tokens.shape != other.tokens.shape or not torch.equal(first.tokens, other.tokens)


@pytest.mark.usefixtures("unchecked_shapes")
def test_without_grammar_anything_may_be_written():
    """Up to the largest length, `$` from its end on; also nothing at all, and what is no program."""
    network = random_network(23, sharpness=1.0)
    rows = write(network, random_canvases(24, 10), noise(25), 50, longest=5, grammar=False).tokens.tolist()
    ends = [row.index(network.stop) for row in rows]
    assert set(ends) == set(range(6)) and {len(row) for row in rows} == {6}
    assert all(set(row[end:]) == {network.stop} for row, end in zip(rows, ends))
    assert 0 < sum(is_program(row, 9, 5) for row in rows) < len(rows)


def test_the_empty_program_is_one_token_long():
    """Without grammar a network that wants nothing but `$` writes it once."""
    network = random_network(26)
    with torch.no_grad():
        network.scores.bias[network.stop] += 1000
    written = write(network, random_canvases(27, 2), grammar=False)
    assert written.tokens.tolist() == [[network.stop]] * 2
    assert written.log_probability.tolist() == [0, 0]


def test_no_shapes_no_programs():
    assert len(write(random_network(28), random_canvases(29, 1)[:0]).tokens) == 0


def test_a_network_that_does_not_care_draws_evenly():
    """All scores the same: the first token is one of five primitives, each as likely."""
    network = random_network(30, sharpness=0.0)
    with torch.no_grad():
        network.scores.bias.zero_()
    written = write(network, random_canvases(31, 1), longest=1)
    assert written.log_probability.item() == pytest.approx(-log(5), abs=CLOSE)


@pytest.mark.usefixtures("unchecked_shapes")
def test_gradients_are_those_of_teacher_forcing():
    """REINFORCE follows them: the gradient of what was drawn, as if it had been given."""
    network, canvases = random_network(32, sharpness=2.0), random_canvases(33, 3)
    written = write(network, canvases, noise(34), longest=7)
    rows = zip(canvases, written.tokens.tolist())
    forced = torch.stack([log_probability(network, canvas, row, 7) for canvas, row in rows])
    weights = torch.tensor([0.5, -1.0, 2.0])  # rewards
    found = torch.autograd.grad((weights * written.log_probability).sum(), list(network.parameters()))
    expected = torch.autograd.grad((weights * forced).sum(), list(network.parameters()))
    assert all(torch.allclose(a, b, atol=1e-3, rtol=1e-3) for a, b in zip(found, expected))
    assert all(gradient.abs().sum() > 0 for gradient in found)


@pytest.mark.usefixtures("unchecked_shapes")
def test_gradients_of_all_programs_cancel():
    """Probabilities add up to 1 whatever the weights are: the mean of the score over all programs is 0."""
    network, canvas = random_network(35, 6, sharpness=1.0), random_canvases(36, 1)[0]
    rows = [log_probability(network, canvas, row, 3) for row in all_programs(6, 3)]
    mean = sum(found.exp().detach() * found for found in rows)
    gradients = torch.autograd.grad(mean, [network.scores.weight, network.gru.weight_hh])
    assert all(gradient.abs().max() < 1e-5 for gradient in gradients)


@pytest.mark.usefixtures("unchecked_shapes")
def test_one_batch_is_learnt_by_heart():
    """Six noisy pictures and a program for each: after training, greedy writes these programs."""
    network = random_network(37, sharpness=1.0).train()
    canvases, rows = random_canvases(38, 6), all_programs(9, 3)[::13][:6]
    tokens = torch.tensor([row + [network.stop] * (4 - len(row)) for row in rows])
    optimizer = torch.optim.Adam(network.parameters(), 0.02)
    for _ in range(150):
        optimizer.zero_grad()
        torch.nn.functional.cross_entropy(
            network(canvases, tokens).flatten(0, 1), tokens.flatten()
        ).backward()
        optimizer.step()
    assert torch.equal(write(network.eval(), canvases, longest=3).tokens, tokens)


@pytest.mark.parametrize("wrong", [{"copies": 0}, {"longest": 0}, {"longest": -3}])
def test_nothing_to_write_is_an_error(wrong):
    with pytest.raises(ValueError, match="expected at least one of each"):
        write(random_network(39), random_canvases(40, 1), **wrong)


@pytest.mark.usefixtures("unchecked_shapes")
def test_a_network_of_the_plane_writes_for_no_grid():
    with pytest.raises(ValueError, match="expected a bool tensor"):
        write(random_network(41), random_canvases(42, 1, 3))
