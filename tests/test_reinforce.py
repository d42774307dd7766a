"""REINFORCE: rewards and baselines by hand, the mean of its gradients against the exact one, the command."""

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import pytest
import torch

from lib.datasets import silhouettes
from lib.interpreters.csg import Vocabulary, execute, execute_many, parse, vocabulary_of
from lib.metrics.images import image_chamfer
from lib.models import csgnet_decoding
from lib.models.csgnet import CSGNet, CSGNetConfig
from lib.models.csgnet_decoding import write
from lib.models.weights import load, read, save
from lib.training import commands, reinforce, reinforce_command
from lib.training.__main__ import COMMANDS
from lib.training.checkpoints import KIND
from lib.training.loop import CHECKPOINT, LOG, Schedule, TrainingError, fit
from lib.training.reinforce import BASELINES, Actor, ReinforceTask, rewards_of
from tests.conftest import unchecked
from tests.csgnets import all_programs, allowed_next, random_network

ROOT = Path(__file__).parents[1]
PLANE = vocabulary_of(2)
TINY = CSGNetConfig(2, 400, (4,), (8,), (8,), (1,), "batch", embedding=8, hidden=16, dropout=0.0)
TINY_3D = CSGNetConfig(3, 6635, (2,), (16,), (16,), (1,), "none", embedding=4, hidden=8, dropout=0.0)


@pytest.fixture(autouse=True)
def embedded(tmp_path, monkeypatch):
    """The silhouettes that are made on the spot, and no shape checks: other tests have them."""
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "none"))
    with unchecked():
        yield


def tiny(config: CSGNetConfig = TINY, seed: int = 0) -> CSGNet:
    torch.manual_seed(seed)
    return CSGNet(config)


def noise(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def drawn(*texts: str) -> torch.Tensor:
    return torch.stack([execute(parse(text)).image for text in texts])


def task_of(network: CSGNet, images: torch.Tensor, **changes) -> ReinforceTask:
    options = {"samples": 4, "baseline": "running", "power": 20, "grammar": True, "about": {}} | changes
    return ReinforceTask(Actor(network), images, images, **options)


# ---- rewards ----


def test_rewards_by_hand():
    image = drawn("c(32,32,16)")[0]
    texts = ["c(32,32,16)", "c(32,32,12)", "s(8,8,8)", "c(32,32,16)c(32,32,16)-"]
    invalid = [[PLANE.stop] * 4, [PLANE.index("+"), 0, 0, PLANE.stop], [0, 0, PLANE.stop, PLANE.stop]]
    tokens = torch.cat([torch.stack([parse(t).tokens(PLANE, 4) for t in texts]), torch.tensor(invalid)])
    earned, valid = rewards_of(image.expand(7, 64, 64), tokens)
    distances = [image_chamfer(image, drawn(text)[0]).item() for text in texts]
    assert distances[0] == 0 and distances[3] == 16  # the last is blank
    # Two circles around one center lie about as far apart as their radii differ.
    assert distances[1] == pytest.approx(4, abs=0.5)
    assert earned.tolist() == pytest.approx(
        [(1 - d / (64 * 2**0.5)) ** 20 for d in distances] + [0.0] * 3, rel=1e-4
    )
    assert earned[3].item() == pytest.approx(0.0204, abs=1e-4)  # executed, and blank: what the authors pay
    assert valid.tolist() == [True] * 4 + [False] * 3
    other = rewards_of(image.expand(7, 64, 64), tokens, 2)[0]
    assert other.tolist() == pytest.approx(
        [(1 - d / (64 * 2**0.5)) ** 2 for d in distances] + [0.0] * 3, rel=1e-4
    )


# ---- baselines ----


def test_the_running_baseline_is_of_past_rewards():
    actor = Actor(tiny())
    batches = [torch.tensor(rows) for rows in ([[1.0, 0.0]], [[0.2, 0.4], [0.0, 0.0]], [[1.0, 1.0]])]
    found = [actor.baseline(rewards, "running") for rewards in batches]
    assert [each.shape for each in found] == [(1, 1)] * 3
    # There is no past before the first batch: its own mean. Then means 0.5 and 0.15, of which the older counts 0.9.
    assert [each.item() for each in found] == pytest.approx([0.5, 0.5, 0.9 * 0.5 + 0.1 * 0.15])
    assert actor.average.item() == pytest.approx(0.9 * 0.465 + 0.1 * 1.0) and actor.averaged == 3


def test_the_baseline_of_an_image_is_the_mean_of_its_other_rewards():
    actor = Actor(tiny())
    rewards = torch.tensor([[1.0, 0.0, 0.5], [0.3, 0.3, 0.3]])
    expected = torch.tensor([[0.25, 0.75, 0.5], [0.3, 0.3, 0.3]])
    torch.testing.assert_close(actor.baseline(rewards, "image"), expected)
    for row, place in product(
        range(2), range(3)
    ):  # a program's own reward is not in what is subtracted from it
        other = rewards.clone()
        other[row, place] = 9.0
        assert actor.baseline(other, "image")[row, place].item() == pytest.approx(expected[row, place].item())


def test_no_baseline_is_zero():
    actor = Actor(tiny())
    assert actor.baseline(torch.ones(2, 3), "none").tolist() == [[0.0]]
    assert actor.baseline(torch.ones(2, 3), "none").tolist() == [[0.0]]


def test_what_makes_no_sense_is_refused():
    images = drawn("c(32,32,16)")
    for wrong, told in (
        ({"baseline": "best"}, "baseline 'best' with 4 programs"),
        ({"baseline": "image", "samples": 1}, "'image' with 1 programs a picture; .*two or more"),
        ({"samples": 0}, "with 0 programs"),
        ({"power": 0}, "power 0 of the reward; expected a number above 0"),
        ({"power": math.nan}, "power nan"),
        ({"power": math.inf}, "power inf"),
    ):
        with pytest.raises(ValueError, match=told):
            task_of(tiny(), images, **wrong)
    assert task_of(tiny(), images, samples=1).samples == 1


# ---- the loss ----


@pytest.mark.parametrize("grammar", [True, False], ids=["grammar", "free"])
@pytest.mark.parametrize("baseline", BASELINES)
def test_the_loss_by_hand(baseline, grammar):
    """- mean of (R - b) log p, program by program; the log's figures beside it."""
    images, network = drawn("c(32,32,16)", "s(24,24,20)", "t(40,40,16)"), tiny()
    with torch.no_grad():
        network.scores.bias[PLANE.stop] += (
            6  # about every second token is `$`: some texts are valid without grammar
        )
    task = task_of(network, images, samples=8, baseline=baseline, grammar=grammar)
    task.module.average.fill_(0.125)
    task.module.averaged.fill_(3)
    loss, told = task.loss(task.module.train(), [2, 0], noise(4), 0.0)
    written = write(network, images[[2, 0]], noise(4), copies=8, grammar=grammar)
    total, rewards, valid, length = 0.0, [], [], []
    for row, tokens in enumerate(written.tokens):
        [earned], [fine] = rewards_of(images[[2, 0]][row // 8][None], tokens[None])
        rewards.append(earned.item())
        valid.append(fine.item())
        length.append(tokens.tolist().index(PLANE.stop))
    for row, log_probability in enumerate(written.log_probability.tolist()):
        own = rewards[row // 8 * 8 : row // 8 * 8 + 8]
        less = {"running": 0.125, "none": 0.0, "image": (sum(own) - rewards[row]) / 7}[baseline]
        total -= (rewards[row] - less) * log_probability / 16
    assert loss.item() == pytest.approx(total, rel=1e-4, abs=1e-6)
    assert [told[name].item() for name in ("reward", "valid", "length")] == pytest.approx(
        [sum(rewards) / 16, sum(valid) / 16, sum(length) / 16]
    )
    assert all(valid) if grammar else 0 < sum(valid) < 16
    loss.backward()
    assert network.scores.weight.grad.abs().max() > 0 and network.encoder[0].weight.grad.abs().max() > 0


def test_the_report_is_of_the_likeliest_programs():
    images = drawn("c(32,32,16)", "s(24,24,20)", "t(40,40,16)")
    task = task_of(tiny(), images, power=7.0)
    task.module.eval()
    found = task.report(task.module)
    tokens = write(task.module.network, images).tokens
    distance = image_chamfer(images, execute_many(tokens).images)
    assert found["val_cd"] == pytest.approx(distance.mean().item(), rel=1e-5)
    expected = ((1 - distance / (64 * 2**0.5)) ** 7).mean().item()
    assert found["val_reward"] == pytest.approx(expected, rel=1e-5)


# ---- the gradient, where every program can be counted ----

LONGEST = 3  # tokens, of a vocabulary of two primitives: 14 programs; 156 texts where anything may be written
FEW = Vocabulary(parse(text).primitives[0] for text in ("c(24,32,16)", "c(40,32,16)"))
TARGETS = drawn("c(24,32,16)c(40,32,16)+", "c(24,32,16)c(40,32,16)-")
CALLS, REPEATS, COPIES = 120, 13, 4


def texts_of(grammar: bool) -> list[list[int]]:
    """All that can be written, each with its `$`."""
    if grammar:
        return all_programs(len(FEW), LONGEST)
    return [[*row, FEW.stop] for n in range(LONGEST + 1) for row in product(range(FEW.stop), repeat=n)]


@pytest.fixture
def countable(monkeypatch):
    """REINFORCE in that vocabulary."""
    monkeypatch.setitem(csgnet_decoding.LONGEST, 2, LONGEST)
    monkeypatch.setattr(reinforce, "execute_many", partial(execute_many, vocabulary=FEW))


def expected_reward(network: CSGNet, grammar: bool) -> torch.Tensor:
    """Mean over the targets of the sum of p(y) R(y) over all texts y: what REINFORCE climbs, with its exact gradient.

    The probability of a text is the product over its tokens, each among those that may follow; when there is no room
    left, that is `$` alone.
    """
    texts, total = texts_of(grammar), torch.zeros(())
    for target in TARGETS:
        probabilities = []
        for text in texts:
            scores = network(target[None], torch.tensor([text]))[0]
            odds = torch.zeros(())
            for place, token in enumerate(text):
                choices = list(range(len(FEW))) if place < LONGEST else [FEW.stop]
                choices = list(allowed_next(text[:place], len(FEW), LONGEST)) if grammar else choices
                odds = odds + scores[place, token] - scores[place, choices].logsumexp(0)
            probabilities.append(odds.exp())
        total = total + torch.stack(probabilities) @ table_of(texts, target) / len(TARGETS)
        assert sum(p.item() for p in probabilities) == pytest.approx(1, abs=1e-5)  # nothing was forgotten
    return total


def table_of(texts: list[list[int]], target: torch.Tensor) -> torch.Tensor:
    """The reward of each text."""
    width = LONGEST + 1
    tokens = torch.tensor([text + [FEW.stop] * (width - len(text)) for text in texts])
    return reinforce.rewards_of(target.expand(len(texts), 64, 64), tokens)[0]


def flat(network: CSGNet) -> torch.Tensor:
    return torch.cat([weight.grad.flatten() for weight in network.parameters()])


@pytest.fixture
def known_rewards(countable, monkeypatch):
    """The same rewards, from a table: thousands of programs are drawn."""
    texts = texts_of(grammar=False)
    kept = {
        (n, *text): r for n, t in enumerate(TARGETS) for text, r in zip(texts, table_of(texts, t).tolist())
    }

    def looked_up(images, tokens, power):
        of = [0 if torch.equal(image, TARGETS[0]) else 1 for image in images[::COPIES]]
        rows = [row[: row.index(FEW.stop) + 1] for row in tokens.tolist()]
        earned = [kept[(of[place // COPIES], *row)] for place, row in enumerate(rows)]
        return torch.tensor(earned), torch.tensor([each > 0 for each in earned])

    return partial(monkeypatch.setattr, reinforce, "rewards_of", looked_up)


def gradients(network: CSGNet, baseline: str, grammar: bool) -> torch.Tensor:
    """(calls, weights) gradients of the mean reward, as REINFORCE estimates it from a batch."""
    task = task_of(network, TARGETS, samples=COPIES, baseline=baseline, grammar=grammar)
    module, found = task.module.train(), []
    for call in range(CALLS + 1):
        network.zero_grad()
        task.loss(module, [0, 1] * REPEATS, noise(call), 0.0)[0].backward()
        found.append(-flat(network))
    return torch.stack(found[1:]).double()  # before the first there is no past


@pytest.mark.parametrize("grammar", [True, False], ids=["grammar", "free"])
def test_the_mean_of_many_gradients_is_the_exact_gradient(known_rewards, grammar):
    network = random_network(3, tokens=len(FEW), sharpness=8.0)
    expected_reward(network, grammar).backward()
    exact = flat(network).double()
    known_rewards()
    spread = {}
    for baseline in BASELINES:
        found = gradients(network, baseline, grammar)
        spread[baseline] = found.var(0).sum().item()
        error = math.sqrt(spread[baseline] / CALLS)  # how far a mean of so many calls lies from the truth
        assert (found.mean(0) - exact).norm() < 2 * error, baseline
        assert error < 0.15 * exact.norm()  # so that a third too much or too little would be seen
    # Without the grammar nearly all rewards are 0, and there is nothing to subtract.
    assert not grammar or max(spread["running"], spread["image"]) < 0.7 * spread["none"], spread


def test_it_climbs_the_expected_reward(countable, tmp_path):
    network = random_network(3, tokens=len(FEW), sharpness=8.0)
    before = expected_reward(network, True).item()
    best = sum(table_of(texts_of(True), target).max().item() for target in TARGETS) / 2
    task = task_of(network, TARGETS.repeat(8, 1, 1), samples=8, baseline="image")
    log = fit(task, Schedule(epochs=6, batch=2, rate=0.02), tmp_path)
    after = expected_reward(network, True).item()
    assert before < 0.6 and after > before + 0.6 * (best - before)
    assert log[-1]["reward"] > log[0]["reward"] and log[-1]["val_reward"] > 0.7 and log[0]["valid"] == 1


# ---- the module ----


def test_the_encoders_statistics_stay(tmp_path):
    network = tiny()
    network.encoder(torch.rand(20, 1, 64, 64))  # so that there are statistics
    before = {name: value.clone() for name, value in network.state_dict().items()}
    images = drawn("c(32,32,16)", "s(24,24,20)", "t(40,40,16)", "c(16,16,8)")
    task = task_of(network, images)
    fit(task, Schedule(epochs=2, batch=2, rate=0.01), tmp_path)
    after = network.state_dict()
    statistics = [name for name, _ in network.named_buffers()]
    assert statistics and all(torch.equal(before[name], after[name]) for name in statistics)
    learnt = [name for name, _ in network.named_parameters() if name.startswith("encoder")]
    assert learnt and not any(torch.equal(before[name], after[name]) for name in learnt)


def test_while_it_learns_a_picture_is_seen_alone():
    images = drawn("c(32,32,16)", "s(24,24,20)", "t(40,40,16)")
    actor = Actor(tiny()).train()
    assert actor.training and actor.network.training and not actor.network.encoder.training
    together, alone = actor.network.begin(images).feature[0], actor.network.begin(images[:1]).feature[0]
    torch.testing.assert_close(together, alone, rtol=0, atol=1e-5)  # sums in another order


class Stops(ReinforceTask):
    """Ctrl-C before one of the steps."""

    def loss(self, *arguments):
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt
        return super().loss(*arguments)


@pytest.mark.parametrize(
    "stop, dropout, momentum, grammar",
    [(1, 0.0, 0.0, True), (3, 0.0, 0.0, False), (4, 0.3, 0.0, True), (5, 0.0, 0.9, True)],
)
def test_stopped_anywhere_it_ends_with_the_same_bits(tmp_path, stop, dropout, momentum, grammar):
    """Of six steps; also the running average of past rewards goes on."""
    images = drawn("c(32,32,16)", "s(24,24,20)", "t(40,40,16)", "c(16,16,8)")
    schedule = Schedule(epochs=3, batch=2, rate=0.01, clip=1.0, seed=3, momentum=momentum)
    config = replace(TINY, dropout=dropout)
    whole, resumed = (task_of(tiny(config), images, grammar=grammar) for _ in range(2))
    torch.manual_seed(stop)
    fit(whole, schedule, tmp_path / "whole")
    stops = Stops(Actor(tiny(config)), images, images, 4, "running", 20, grammar, {})
    stops.left = stop
    with pytest.raises(KeyboardInterrupt):
        fit(stops, schedule, tmp_path / "run")
    torch.manual_seed(100 + stop)
    fit(resumed, schedule, tmp_path / "run")
    states = [task.module.state_dict() for task in (whole, resumed)]
    assert states[0]["averaged"] == 6
    assert all(torch.equal(one, states[1][name]) for name, one in states[0].items())


# ---- the command ----


@pytest.fixture
def small(monkeypatch, tmp_path) -> Path:
    """Networks of a moment; the one that comes with the project is such a one too."""
    for name in ("compact", "paper"):
        monkeypatch.setattr(CSGNetConfig, name, lambda dimensions: TINY if dimensions == 2 else TINY_3D)
    path = tmp_path / "pretrained.safetensors"
    save(tiny(seed=7), path)
    monkeypatch.setattr(reinforce_command, "pretrained", lambda name: path if name == "csgnet_2d" else None)
    return path


QUICK = ["--epochs", "2", "--batch", "46", "--samples", "2"]  # four steps an epoch


def train(*options: object) -> int:
    return commands.main(COMMANDS, ["csgnet_reinforce", *map(str, options)])


def test_the_command_leaves_weights_and_facts(small, tmp_path, capsys):
    out = tmp_path / "run"
    assert train(*QUICK, "--out", out) == 0
    said = capsys.readouterr().out
    assert "184 masks" in said and "source: embedded" in said
    assert "epoch 2/2: loss" in said and "reward" in said and "val_cd" in said
    network = load(CSGNet, out / "csgnet_reinforce.safetensors")
    start = load(CSGNet, small).state_dict()
    changed = {name for name, weight in network.state_dict().items() if not torch.equal(weight, start[name])}
    assert changed >= {name for name, _ in network.named_parameters() if "gru" in name or "scores" in name}
    assert not changed & {name for name, _ in network.named_buffers()}
    facts = json.loads((out / "csgnet_reinforce.json").read_text())
    assert facts["network"] == "CSGNet" and 0 < facts["losses"]["reward"] < 1
    expected = {"samples": 2, "baseline": "running", "power": 20, "grammar": 1, "momentum": 0}
    assert {name: facts["settings"][name] for name in expected} == expected
    assert len(facts["settings"]["start"]) == 16
    assert train(*QUICK, "--start", small, "--out", out) == 0  # the same weights by name: the same run


def test_the_papers_settings(small, tmp_path):
    assert train("--paper", "--epochs", 1, "--out", tmp_path) == 0
    settings = json.loads((tmp_path / "csgnet_reinforce.json").read_text())["settings"]
    expected = {
        "batch": 3000,
        "samples": 1,
        "rate": 0.01,
        "momentum": 0.9,
        "clip": 10,
        "grammar": 0,
        "last": 1,
    }
    assert {name: settings[name] for name in expected} == expected


def test_the_papers_settings_are_for_the_papers_network(small, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(CSGNetConfig, "paper", lambda dimensions: replace(TINY, hidden=TINY.hidden + 1))
    assert train("--paper", "--epochs", 1, "--out", tmp_path) == 1
    assert "found weights of other sizes than the paper's; expected, with --paper" in capsys.readouterr().err


def test_from_scratch(small, tmp_path):
    assert train(*QUICK, "--epochs", 1, "--start", "scratch", "--seed", 5, "--out", tmp_path) == 0
    facts = json.loads((tmp_path / "csgnet_reinforce.json").read_text())
    assert facts["settings"]["start"] == "scratch"
    found, start = load(CSGNet, tmp_path / "csgnet_reinforce.safetensors"), tiny(seed=5)
    # Four of Adam's steps, each about the rate at most, from what seed 5 makes.
    for name, weight in found.named_parameters():
        assert (weight - start.get_parameter(name)).abs().max() < 4 * 2e-4 * 1.5, name


@pytest.mark.parametrize("kind", ["missing", "text", "folder", "checkpoint", "space"])
def test_a_start_that_is_no_network_of_the_plane_is_told(small, tmp_path, capsys, kind):
    path, out = tmp_path / "start", tmp_path / "run"
    if kind == "text":
        path.write_text("mine")
    elif kind == "folder":
        path.mkdir()
    elif kind == "checkpoint":
        task = task_of(tiny(), drawn("c(32,32,16)"))
        fit(task, Schedule(epochs=1, batch=1, rate=0.1), tmp_path / "other")
        path = tmp_path / "other" / CHECKPOINT
    elif kind == "space":
        save(tiny(TINY_3D), path)
    assert train(*QUICK, "--start", path, "--out", out) == 1
    error = capsys.readouterr().err
    told = {
        "missing": "CheckpointError: {}: cannot be read",
        "text": "CheckpointError: {}: is damaged, or no safetensors file",
        "folder": "CheckpointError: {}: cannot be read (it is a folder; expected a file)",
        "checkpoint": "CheckpointError: {}: found weights of kind 'training run'; expected 'CSGNet'",
        "space": "TrainingError: {}: found a network of space with 6635 tokens; expected one of the plane with 400",
    }[kind].format(path)
    assert error.startswith(told) and error.count("\n") == 1 and not out.exists()


@pytest.mark.parametrize(
    "options, told",
    [
        (
            ["--samples", "1", "--baseline", "image"],
            "TrainingError: found the baseline 'image' with 1 programs",
        ),
        (["--samples", "0"], "TrainingError: found the baseline 'running' with 0 programs"),
        (["--power", "0"], "TrainingError: found the power 0"),
        (["--power", "nan"], "TrainingError: found the power nan"),
        (["--grammar", "2"], "TrainingError: grammar is 2; expected 0 or 1"),
        (["--momentum", "-0.1"], "TrainingError: momentum is -0.1"),
        (["--rate", "0"], "TrainingError: rate is 0"),
        (["--source", "clouds"], "DataError: unknown source 'clouds'"),
        (["--source", "sweethome3d"], "DataError: there is no "),
    ],
)
def test_bad_settings_are_told_in_one_line_and_leave_nothing(small, tmp_path, capsys, options, told):
    assert train(*QUICK, *options, "--out", tmp_path / "run") == 1
    error = capsys.readouterr().err
    assert error.startswith(told) and error.count("\n") == 1 and not (tmp_path / "run").exists()


@pytest.mark.parametrize("options", [[], ["--momentum", "0.9", "--baseline", "image", "--grammar", "0"]])
def test_interrupted_the_command_goes_on_to_the_same_bytes(small, tmp_path, capsys, monkeypatch, options):
    assert train(*QUICK, *options, "--out", tmp_path / "whole") == 0
    with monkeypatch.context() as patch:
        left, original = [6], ReinforceTask.loss  # in the second epoch

        def loss(*arguments):
            left[0] -= 1
            if left[0] < 0:
                raise KeyboardInterrupt
            return original(*arguments)

        patch.setattr(ReinforceTask, "loss", loss)
        assert train(*QUICK, *options, "--out", tmp_path / "run") == 130
    assert "goes on from there" in capsys.readouterr().err
    assert len(read(tmp_path / "run" / CHECKPOINT, KIND)[1]["log"]) == 1
    assert train(*QUICK, *options, "--out", tmp_path / "run") == 0
    one, other = ((tmp_path / run / "csgnet_reinforce.safetensors").read_bytes() for run in ("whole", "run"))
    assert one == other


@pytest.mark.parametrize(
    "options, told",
    [
        (["--samples", "3"], "samples: 2 then, 3 now"),
        (["--baseline", "image"], "baseline: 'running' then, 'image' now"),
        (["--grammar", "0"], "grammar: 1 then, 0 now"),
        (["--momentum", "0.9"], "momentum: 0.0 then, 0.9 now"),
        (["--precision", "bf16-mixed"], "precision: '32-true' then, 'bf16-mixed' now"),
        (["--start", "scratch"], "start: "),
    ],
)
def test_a_run_goes_on_with_its_own_settings_only(small, tmp_path, capsys, options, told):
    out = tmp_path / "run"
    assert train(*QUICK, "--epochs", 1, "--out", out) == 0
    before = (out / CHECKPOINT).read_bytes()
    assert train(*QUICK, "--epochs", 1, *options, "--out", out) == 1
    error = capsys.readouterr().err
    assert error.startswith("CheckpointError: ") and told in error and error.count("\n") == 1
    assert (out / CHECKPOINT).read_bytes() == before


def test_a_run_does_not_go_on_from_other_weights(small, tmp_path, capsys):
    assert train(*QUICK, "--epochs", 1, "--out", tmp_path / "run") == 0
    save(tiny(seed=8), small)  # better ones came with the project since
    assert train(*QUICK, "--epochs", 1, "--out", tmp_path / "run") == 1
    assert "start: " in capsys.readouterr().err


def test_half_precision(small, tmp_path):
    assert train(*QUICK, "--precision", "bf16-mixed", "--out", tmp_path / "half") == 0
    assert train(*QUICK, "--out", tmp_path / "full") == 0
    half, full = (load(CSGNet, tmp_path / out / "csgnet_reinforce.safetensors") for out in ("half", "full"))
    assert {weight.dtype for weight in half.parameters()} == {torch.float32}
    assert any(not torch.equal(a, b) for a, b in zip(half.parameters(), full.parameters()))


# ---- processes ----


def likeliest(odds: torch.Tensor, noise: torch.Generator) -> torch.Tensor:
    """In place of a drawn token: what a process writes does not depend on which pictures the others have."""
    return odds.argmax(1)


SHARDS = """
import sys
from lib.models import csgnet_decoding
from lib.training import commands
from lib.training.__main__ import COMMANDS
from tests.test_reinforce import likeliest
csgnet_decoding._drawn = likeliest
sys.exit(commands.main(COMMANDS))
"""


@pytest.mark.slow
def test_two_processes_learn_what_one_does(small, tmp_path, monkeypatch):
    options = [
        "--begin",
        str(small),
        "--batch",
        "37",
        "--epochs",
        "1",
        "--samples",
        "2",
        "--baseline",
        "none",
    ]
    with monkeypatch.context() as patch:
        patch.setattr(csgnet_decoding, "_drawn", likeliest)
        assert train(*options, "--out", tmp_path / "one") == 0
    (tmp_path / "shards.py").write_text(SHARDS)
    fabric = [Path(sys.executable).parent / "fabric", "run", "--accelerator=cpu", "--devices=2"]
    fabric += [
        f"--main-port={29500 + (os.getpid() + 666) % 1000}",
        tmp_path / "shards.py",
        "csgnet_reinforce",
    ]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [*fabric, *options, "--out", tmp_path / "two"], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    rows = [json.loads((tmp_path / out / LOG).read_text()) for out in ("one", "two")]
    for name in ("loss", "reward", "length", "val_reward", "val_cd"):
        assert rows[1][name] == pytest.approx(rows[0][name], rel=1e-3), name
    one, two = (
        load(CSGNet, tmp_path / out / "csgnet_reinforce.safetensors").state_dict() for out in ("one", "two")
    )
    for name, weight in one.items():
        # Five of Adam's steps of 2e-4 at most; where a gradient is near 0, rounding decides how long one is.
        assert (weight - two[name]).abs().double().mean() < 5e-6, name


def test_the_silhouettes_are_those_of_training(small, monkeypatch, tmp_path):
    """Nothing of the split that is measured later is looked at."""
    seen = []

    def recorded(source, split):
        seen.append(split)
        return silhouettes(source, split)

    monkeypatch.setattr(reinforce_command, "silhouettes", recorded)
    assert train(*QUICK, "--epochs", 1, "--out", tmp_path / "run") == 0
    assert sorted(seen) == ["train", "val"]


def test_pictures_of_random_programs(small, tmp_path, capsys):
    """--source synthetic: what the teacher's programs draw, without the programs."""
    options = ["--epochs", 1, "--batch", 600, "--samples", 1, "--source", "synthetic"]
    assert train(*options, "--out", tmp_path / "run") == 0
    assert "Pictures of 1200 random 2D train programs" in capsys.readouterr().out


def test_numbers_that_are_not_finite_are_told(tmp_path):
    network = tiny()
    torch.nn.init.constant_(network.scores.bias, float("nan"))
    with pytest.raises(TrainingError, match="epoch 1, batch 1: loss nan.*try a lower rate"):
        fit(task_of(network, drawn("c(32,32,16)")), Schedule(epochs=1, batch=1, rate=0.1), tmp_path)
