"""CSGNet learns with a teacher: the loss by hand, what is shown when, the same bits after a stop, the command."""

import hashlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from lib.datasets import csg_programs
from lib.datasets.csg import TokenSet
from lib.interpreters.csg import execute_many, parse, vocabulary_of
from lib.metrics.images import image_chamfer, iou
from lib.models.csgnet import CSGNet, CSGNetConfig
from lib.models.csgnet_decoding import write
from lib.models.weights import load, read, save
from lib.training import commands
from lib.training.__main__ import COMMANDS
from lib.training.checkpoints import KIND
from lib.training.csgnet import Lessons, ParseTask, Teacher
from lib.training.csgnet_command import evenly, spread
from lib.training.loop import CHECKPOINT, LOG, Schedule, fit
from tests.conftest import unchecked

ROOT = Path(__file__).parents[1]
PLANE = vocabulary_of(2)
TINY = CSGNetConfig(2, 400, (4,), (8,), (8,), (1,), "batch", embedding=8, hidden=16, dropout=0.0)
TINY_3D = CSGNetConfig(3, 6635, (2,), (16,), (16,), (1,), "none", embedding=4, hidden=8, dropout=0.0)
TEXTS = {  # by length
    1: ["c(32,32,16)", "s(24,24,20)"],
    3: ["c(32,32,28)s(32,32,20)-", "c(16,16,8)t(40,40,12)+", "s(48,48,12)c(40,40,12)+"],
    5: ["c(24,24,16)s(40,40,16)t(32,32,8)++", "s(40,24,20)c(16,48,8)t(32,16,8)++"],
}


@pytest.fixture(autouse=True)
def embedded(tmp_path, monkeypatch):
    """The few programs that are made on the spot, and no shape checks: other tests have them."""
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "none"))
    with unchecked():
        yield


def programs(*lengths: int) -> TokenSet:
    tokens = [parse(text).tokens(PLANE, 6) for length in lengths for text in TEXTS[length]]
    return TokenSet(torch.stack(tokens), PLANE, "made", "hand-written")


def tiny(config: CSGNetConfig = TINY, seed: int = 0) -> CSGNet:
    torch.manual_seed(seed)
    return CSGNet(config)


def task_of(train: TokenSet, other: TokenSet | None = None, network: CSGNet | None = None, **changes):
    lessons = Lessons(**{"programs": 40, "pruned": False, "in_order": False} | changes)
    return ParseTask(Teacher(network or tiny()), train, other or train, lessons, {})


def noise(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


# ---- the loss ----


def test_the_teachers_loss_is_the_mean_over_all_tokens_up_to_each_stop():
    """A loop over programs and tokens, each asked for with those before it; what follows the first `$` is nothing."""
    train, network = programs(1, 3, 5), tiny().eval()
    images = execute_many(train.tokens).images
    total, count = 0.0, 0
    for image, row in zip(images, train.tokens.tolist()):
        length = row.index(PLANE.stop) + 1
        for place in range(length):
            state = network.begin(image[None])
            before = torch.tensor([[network.start, *row[:place]]])
            odds = network.advance(state, before)[0][0, -1].double().log_softmax(0)
            total, count = total - odds[row[place]].item(), count + 1
    assert count == 2 * 2 + 3 * 4 + 2 * 6
    assert Teacher(network)(images, train.tokens).item() == pytest.approx(total / count, rel=1e-5)


def test_padding_changes_nothing_of_the_loss():
    train, teacher = programs(1, 3), Teacher(tiny().eval())
    images = execute_many(train.tokens).images
    longer = torch.nn.functional.pad(train.tokens, (0, 5), value=PLANE.stop)
    after_stop = longer.clone()
    after_stop[:, 4:] = 7  # tokens behind the `$` are not read
    expected = teacher(images, train.tokens).item()
    assert teacher(images, longer).item() == pytest.approx(expected, rel=1e-6)
    assert teacher(images, after_stop).item() == pytest.approx(expected, rel=1e-6)


def test_the_loss_of_a_batch_is_that_of_random_programs_and_their_pictures():
    train = programs(1, 3, 5)
    task = task_of(train)
    with torch.no_grad():
        loss, terms = task.loss(task.module.eval(), range(50), noise(3), 0.5)
        drawn = train.tokens[torch.randint(len(train), (50,), generator=noise(3))]
        expected = task.module(execute_many(drawn).images, drawn)
    assert terms == {} and loss.item() == pytest.approx(expected.item(), rel=1e-6)
    assert len(drawn.unique(dim=0)) == len(train)  # all were drawn


# ---- what is shown ----


def test_a_curriculum_shows_short_programs_first_and_all_at_the_end():
    train = programs(1, 3, 5)
    task = task_of(train, curriculum=0.6)
    shown = {0.0: 2, 0.19: 2, 0.2: 5, 0.39: 5, 0.41: 7, 0.6: 7, 0.99: 7}  # thirds of 0.6: lengths 1, 3, 5
    assert {progress: task.shown(progress) for progress in shown} == shown
    assert {task_of(train).shown(progress) for progress in (0.0, 0.5, 1.0)} == {len(train)}


def test_batches_follow_the_curriculum(monkeypatch):
    task = task_of(programs(1, 3, 5), curriculum=0.9)
    seen = {}
    for progress in (0.0, 0.4, 0.95):

        def network(canvases, tokens, progress=progress):
            seen[progress] = {int(length) for length in (tokens != PLANE.stop).sum(1)}
            return torch.zeros(())

        network.parameters = task.module.parameters
        task.loss(network, range(200), noise(), progress)
    assert seen == {0.0: {1}, 0.4: {1, 3}, 0.95: {1, 3, 5}}


def test_programs_in_order_draw_the_same():
    train = csg_programs(2, "val")
    plain, ordered = (task_of(train, in_order=each) for each in (False, True))
    assert torch.equal(plain.taught(train.tokens), train.tokens)  # the longest are there, so no column is cut
    taught = ordered.taught(train.tokens)
    assert (taught != train.tokens).any(1).float().mean() > 0.2  # something was to be done
    assert torch.equal(execute_many(taught).words, execute_many(train.tokens).words)
    first = len(PLANE.primitives)  # of the operations only their number stays: A - (B + C) becomes A - B - C
    assert torch.equal(*(tokens.clamp(max=first).sort(1).values for tokens in (taught, train.tokens)))
    assert torch.equal(ordered.taught(taught), taught)


def test_what_no_picture_needs_is_not_taught():
    train = csg_programs(2, "train")
    taught = task_of(train, pruned=True).taught(train.tokens)
    both = task_of(train, pruned=True, in_order=True).taught(train.tokens)
    was, now, also = ((each != PLANE.stop).sum(1) for each in (train.tokens, taught, both))
    assert (now < was).float().mean() > 0.4 and (also <= now).all()
    assert (also < now).any()  # what the order made needless is gone, too
    for tokens in (taught, both):
        assert torch.equal(execute_many(tokens).words, execute_many(train.tokens).words)
    for one in ("pruned", "in_order"):
        assert torch.equal(both, task_of(train, **{one: True}).taught(both))


def test_jitter_changes_pictures_that_are_learned_from_only():
    train, seen = programs(3), []
    network = lambda canvases, tokens: seen.append(canvases) or torch.zeros(())  # noqa: E731
    for jitter in (0.0, 1.0):
        task = task_of(train, jitter=jitter)
        network.parameters = task.module.parameters
        task.loss(network, range(40), noise(), 1.0)
        seen.append(task.report(task.module.eval()))
    plain, reported, moved, also_reported = seen
    assert plain.shape == moved.shape and (plain != moved).any((1, 2)).float().mean() > 0.9
    assert reported["val_loss"] == also_reported["val_loss"] and reported["val_cd"] == also_reported["val_cd"]


def test_taught_programs_are_as_wide_as_the_longest():
    hidden = parse("c(16,16,8)c(16,16,12)+").tokens(PLANE, 6)[None]
    for pruned, width in ((False, 4), (True, 2)):
        train = TokenSet(hidden, PLANE, "made", "")
        assert task_of(train, pruned=pruned).taught(hidden).shape == (1, width)


def test_loss_and_report_use_the_order():
    swapped = TokenSet(parse("c(16,16,8)s(48,48,12)+").tokens(PLANE, 4)[None], PLANE, "made", "")
    [straight] = {
        row for row in map(tuple, task_of(swapped, in_order=True).taught(swapped.tokens).tolist())
    }  # whichever of the two it is
    other = torch.tensor(sorted({straight, (straight[1], straight[0], *straight[2:])} - {straight}))
    found = [
        task.report(task.module.eval())["val_loss"]
        for in_order, tokens in ((True, torch.tensor([straight])), (True, other), (False, other))
        for task in [task_of(TokenSet(tokens, PLANE, "made", ""), in_order=in_order)]
    ]
    assert found[0] == found[1] != found[2]


def test_spread_keeps_the_shares():
    assert spread(10, 5).tolist() == [0, 2, 4, 6, 8] and spread(3, 9).tolist() == [0, 1, 2]
    assert spread(7, 5).tolist() == [0, 1, 2, 4, 5] and not len(spread(0, 4))
    val = csg_programs(2, "val")  # 20 programs of each of 6 lengths
    lengths = (evenly(val, 90).tokens != PLANE.stop).sum(1)
    assert lengths.bincount()[3::2].tolist() == [15] * 6


# ---- the report ----


def test_the_report_scores_other_programs():
    train, other = programs(1), csg_programs(2, "val")
    task = task_of(train, other)
    task.module.eval()
    found = task.report(task.module)
    images = execute_many(other.tokens).images
    answers = execute_many(write(task.module.network, images).tokens)
    assert answers.valid.all()
    assert found["val_cd"] == pytest.approx(image_chamfer(images, answers.images).mean().item(), rel=1e-5)
    assert found["val_loss"] == pytest.approx(
        task.module(images, other.tokens).item(), rel=1e-5
    )  # all at once
    assert set(found) == {"preparing_share", "drawing_share", "val_loss", "val_cd"}


def test_the_report_in_space_tells_overlap():
    other = csg_programs(3, "val", 3)[:6]
    task = task_of(other, network=tiny(TINY_3D).eval())
    found = task.report(task.module)
    grids = execute_many(other.tokens, other.vocabulary).grids
    answers = execute_many(write(task.module.network, grids).tokens, other.vocabulary).grids
    assert found["val_iou"] == pytest.approx(iou(grids, answers, dims=3).mean().item(), rel=1e-5)
    assert set(found) == {"preparing_share", "drawing_share", "val_loss", "val_iou"}


def test_the_share_of_drawing_is_a_share_and_begins_anew(monkeypatch):
    task = task_of(programs(1))
    assert task.report(task.module.eval())["drawing_share"] == 0
    clock = [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: clock[0])
    task.started = 0.0

    def network(canvases, tokens):
        clock[0] += 3.0  # seconds of learning
        return torch.zeros(())

    network.parameters = task.module.parameters
    original = execute_many

    def slowly(*arguments, **named):
        clock[0] += 1.0  # second of drawing
        return original(*arguments, **named)

    def ponder(tokens):
        clock[0] += 4.0  # seconds of finding out what is to be taught
        return tokens

    monkeypatch.setattr("lib.training.csgnet.execute_many", slowly)
    task.taught = ponder
    for _ in range(2):
        task.loss(network, range(4), noise(), 0.0)
    found = task.report(task.module)
    assert (found["drawing_share"], found["preparing_share"]) == pytest.approx((2 / 16, 8 / 16))
    task.started = clock[0] = 100.0
    task.loss(network, range(4), noise(), 0.0)
    found = task.report(task.module)
    assert (found["drawing_share"], found["preparing_share"]) == pytest.approx((1 / 8, 4 / 8))


# ---- learning ----


def test_a_few_programs_are_learnt(tmp_path):
    train = programs(1, 3)
    network = tiny(replace(TINY, channels=(16,), embedding=16, hidden=128))
    task = task_of(train, network=network, programs=320)
    log = fit(task, Schedule(epochs=3, batch=16, rate=0.005, last=0.1, clip=1.0), tmp_path)
    # Nothing learnt is ln 400 = 6.0 a token, and each epoch halves what is left.
    losses = [row["val_loss"] for row in log]
    assert losses[0] < 2 and losses[1] < losses[0] / 1.5 and losses[2] < losses[1] / 1.5
    assert log[-1]["val_cd"] == 0  # five pictures are told apart and drawn again
    assert all(0 < row["drawing_share"] < 1 for row in log)


class Stops(ParseTask):
    """Ctrl-C before one of the steps."""

    def loss(self, *arguments):
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt
        return super().loss(*arguments)


@pytest.mark.parametrize("dropout", [0.0, 0.3])
@pytest.mark.parametrize("stop", [1, 5, 8])  # of nine steps
def test_stopped_anywhere_it_ends_with_the_same_bits(tmp_path, stop, dropout):
    """Also the running statistics of the encoder's norm, and also where dropout draws random numbers."""
    config, train = replace(TINY, dropout=dropout), programs(1, 3, 5)
    schedule = Schedule(epochs=3, batch=8, rate=0.01, warmup=0.2, clip=1.0, seed=3)
    lessons = Lessons(24, curriculum=0.5, jitter=0.5)
    assert lessons.pruned and lessons.in_order
    whole, resumed = (ParseTask(Teacher(tiny(config)), train, train, lessons, {}) for _ in range(2))
    torch.manual_seed(stop)
    fit(whole, schedule, tmp_path / "whole")
    stops = Stops(Teacher(tiny(config)), train, train, lessons, {})
    stops.left = stop
    with pytest.raises(KeyboardInterrupt):
        fit(stops, schedule, tmp_path / "run")
    torch.manual_seed(100 + stop)
    fit(resumed, schedule, tmp_path / "run")
    states = [task.module.state_dict() for task in (whole, resumed)]
    assert "network.encoder.2.running_var" in states[0] or dropout
    assert all(torch.equal(one, states[1][name]) for name, one in states[0].items())


# ---- the command ----


@pytest.fixture
def small(monkeypatch):
    """Networks of a moment, whatever sizes are asked for."""
    for name in ("compact", "paper"):
        monkeypatch.setattr(CSGNetConfig, name, lambda dimensions: TINY if dimensions == 2 else TINY_3D)


FEW = ["--epochs", "2", "--programs", "12", "--batch", "5"]


def train(*options: object) -> int:
    return commands.main(COMMANDS, ["csgnet", *map(str, options)])


def test_the_command_leaves_weights_and_facts(small, tmp_path, capsys):
    out = tmp_path / "run"
    assert train(*FEW, "--out", out) == 0
    said = capsys.readouterr().out
    assert "1200 random 2D train programs" in said and "epoch 2/2: loss" in said and "val_cd" in said
    assert sorted(path.name for path in out.iterdir()) == [
        CHECKPOINT, "csgnet.json", "csgnet.safetensors", LOG,
    ]  # fmt: skip
    network = load(CSGNet, out / "csgnet.safetensors")
    facts = json.loads((out / "csgnet.json").read_text())
    assert network.config == TINY and facts["network"] == "CSGNet"
    assert facts["weights"] == sum(weight.numel() for weight in network.parameters())
    settings = facts["settings"]
    assert settings["network"]["hidden"] == 16 and settings["momentum"] == 0
    assert {name: settings[name] for name in ("dimensions", "programs", "pruned", "in_order", "precision")} == {
        "dimensions": 2, "programs": 12, "pruned": 1, "in_order": 1, "precision": "32-true",
    }  # fmt: skip
    assert facts["epochs"] == 2 and 0 < facts["losses"]["val_loss"] < 20
    assert facts["command"].startswith("python -m lib.training csgnet --epochs 2")


def test_the_command_in_space(small, tmp_path):
    assert train("--dimensions", 3, *FEW, "--epochs", 1, "--out", tmp_path) == 0
    assert load(CSGNet, tmp_path / "csgnet.safetensors").config == TINY_3D
    assert 0 <= json.loads((tmp_path / "csgnet.json").read_text())["losses"]["val_iou"] <= 1


@pytest.mark.parametrize("sharing", [0, 1])
def test_what_is_saved_has_the_networks_own_weights(small, tmp_path, sharing):
    """Whether tokens shared weights or not while it learned."""
    assert train(*FEW, "--sharing", sharing, "--out", tmp_path) == 0
    network = load(CSGNet, tmp_path / "csgnet.safetensors")
    assert set(network.state_dict()) == set(tiny().state_dict())
    found = json.loads((tmp_path / "csgnet.json").read_text())["losses"]["val_loss"]
    loss = task_of(programs(1), csg_programs(2, "val"), network, pruned=True, in_order=True).report(
        Teacher(network)
    )
    assert loss["val_loss"] == pytest.approx(found, rel=1e-5)  # what is loaded is what was measured


@pytest.mark.parametrize("sharing", [0, 1])
def test_the_command_goes_on_from_weights(small, tmp_path, sharing):
    start = tmp_path / "start.safetensors"
    save(before := tiny(seed=5), start)
    options = (*FEW, "--start", start, "--sharing", sharing, "--out", tmp_path / "run")
    assert train(*options, "--rate", 1e-4) == 0
    network = load(CSGNet, tmp_path / "run" / "csgnet.safetensors")
    steps = 2 * math.ceil(12 / 5)
    # A step of Adam's is about the rate at most; a shared weight is a sum of the token's own and up to four others.
    most = steps * 1e-4 * 1.5 * (5 if sharing else 1)
    moved = [(w - before.get_parameter(name)).abs().max() for name, w in network.named_parameters()]
    assert 0 < max(moved) < most
    facts = json.loads((tmp_path / "run" / "csgnet.json").read_text())
    assert facts["settings"]["start"] == hashlib.sha256(start.read_bytes()).hexdigest()[:16]


def test_a_start_of_the_other_dimension_is_told(small, tmp_path, capsys):
    start = tmp_path / "start.safetensors"
    save(tiny(), start)
    assert train("--dimensions", 3, *FEW, "--start", start, "--out", tmp_path / "run") == 1
    told = f"TrainingError: {start}: found a network of the plane with 400 tokens; expected one of space with 6635\n"
    assert capsys.readouterr().err == told and not (tmp_path / "run").exists()


def test_the_papers_settings(small, tmp_path):
    assert train("--paper", *FEW, "--epochs", 1, "--out", tmp_path) == 0
    settings = json.loads((tmp_path / "csgnet.json").read_text())["settings"]
    expected = {"rate": 1e-3, "warmup": 0, "clip": 10, "pruned": 0, "in_order": 0, "curriculum": 0}
    assert {name: settings[name] for name in expected} == expected


def test_the_seed_decides_and_nothing_else(small, tmp_path):
    found = []
    for number, seed in enumerate((0, 0, 1)):
        torch.manual_seed(number)
        assert train(*FEW, "--seed", seed, "--out", tmp_path / str(number)) == 0
        found.append((tmp_path / str(number) / "csgnet.safetensors").read_bytes())
    assert found[0] == found[1] != found[2]


@pytest.mark.parametrize(
    "options, told",
    [
        (["--programs", "0"], "TrainingError: found 0 programs, curriculum 0.0, jitter 0.0; expected"),
        (["--curriculum", "1.5"], "TrainingError: found 12 programs, curriculum 1.5"),
        (["--curriculum", "nan"], "TrainingError: found 12 programs, curriculum nan"),
        (
            ["--jitter", "1.5"],
            "TrainingError: found 12 programs, curriculum 0.0, jitter 1.5; expected at least 1, and shares from 0 to 1",
        ),
        (
            ["--jitter", "nan"],
            "TrainingError: found 12 programs, curriculum 0.0, jitter nan; expected at least 1",
        ),
        (["--dimensions", "3", "--jitter", "0.5"], "TrainingError: found jitter 0.5 in space; expected 0"),
        (["--pruned", "-1"], "TrainingError: pruned is -1; expected 0 or 1"),
        (["--in_order", "2"], "TrainingError: in_order is 2; expected 0 or 1"),
        (["--sharing", "-1"], "TrainingError: sharing is -1; expected 0 or 1"),
        (["--batch", "0"], "TrainingError: batch is 0"),
        (["--epochs", "0"], "TrainingError: epochs is 0"),
        (["--rate", "-1"], "TrainingError: rate is -1"),
        (["--warmup", "2"], "TrainingError: warmup is 2"),
        (["--seed", "-3"], "TrainingError: seed is -3"),
        (["--threads", "0"], "TrainingError: threads is 0"),
    ],
)
def test_bad_settings_are_told_in_one_line_and_leave_nothing(small, tmp_path, capsys, options, told):
    out = tmp_path / "run"
    assert train(*FEW, *options, "--out", out) == 1
    error = capsys.readouterr().err
    assert error.startswith(told) and error.count("\n") == 1 and "expected" in error
    assert not out.exists()


def test_half_precision_is_another_run(small, tmp_path, capsys):
    options = [*FEW, "--out", tmp_path]
    assert train(*options, "--precision", "bf16-mixed") == 0
    facts = json.loads((tmp_path / "csgnet.json").read_text())
    assert facts["machine"]["precision"] == facts["settings"]["precision"] == "bf16-mixed"
    weights = (tmp_path / "csgnet.safetensors").read_bytes()
    network = load(CSGNet, tmp_path / "csgnet.safetensors")
    assert {weight.dtype for weight in network.parameters()} == {torch.float32}  # only products are rounded
    checkpoint = (tmp_path / CHECKPOINT).read_bytes()
    assert train(*options, "--precision", "32-true") == 1
    assert "precision: 'bf16-mixed' then, '32-true' now" in capsys.readouterr().err
    assert (tmp_path / CHECKPOINT).read_bytes() == checkpoint
    assert train(*options, "--precision", "bf16-mixed") == 0  # and goes on as it was
    assert (tmp_path / "csgnet.safetensors").read_bytes() == weights
    assert train(*FEW, "--out", tmp_path / "whole") == 0
    assert (tmp_path / "whole" / "csgnet.safetensors").read_bytes() != weights


@pytest.mark.parametrize(
    "option, told",
    [
        (["--jitter", "0.5"], "jitter: 0.0 then, 0.5 now"),
        (["--pruned", "0"], "pruned: 1 then, 0 now"),
        (["--in_order", "0"], "in_order: 1 then, 0 now"),
        (["--sharing", "0"], "sharing: 1 then, 0 now"),
        (["--curriculum", "0.5"], "curriculum: 0.0 then, 0.5 now"),
        (["--programs", "13"], "programs: 12 then, 13 now"),
        (["--dimensions", "3"], "dimensions: 2 then, 3 now"),
        (["--epochs", "3"], "epochs: 2 then, 3 now"),
    ],
)
def test_a_run_goes_on_with_its_own_settings_only(small, tmp_path, capsys, option, told):
    assert train(*FEW, "--out", tmp_path) == 0
    assert train(*FEW, *option, "--out", tmp_path) == 1
    error = capsys.readouterr().err
    assert error.startswith("CheckpointError: ") and told in error and error.count("\n") == 1


def test_half_of_the_digits_are_kept_of_the_same_weights(small, tmp_path):
    """--half says how weights are kept, not how they are learned: a finished run only writes them anew."""
    assert train(*FEW, "--out", tmp_path) == 0
    path = tmp_path / "csgnet.safetensors"
    whole, size = load(CSGNet, path).state_dict(), path.stat().st_size
    assert train(*FEW, "--half", "--out", tmp_path) == 0
    halved = load(CSGNet, path).state_dict()
    assert path.stat().st_size < 0.6 * size and "--half" in (tmp_path / "csgnet.json").read_text()
    for name, tensor in halved.items():
        assert tensor.dtype == whole[name].dtype
        assert torch.allclose(tensor, whole[name], rtol=2**-11, atol=1e-6), name
    assert any(not torch.equal(tensor, whole[name]) for name, tensor in halved.items())


# ---- processes ----


@pytest.mark.slow
def test_killed_it_ends_with_the_same_bits(tmp_path):
    """The compact network, by the command, killed in the middle of an epoch."""
    options = ["--epochs", "4", "--programs", "8", "--batch", "4", "--dimensions", "2"]
    assert train(*options, "--out", tmp_path / "whole") == 0
    line = [sys.executable, "-m", "lib.training", "csgnet", *options, "--out", str(tmp_path / "killed")]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(line, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
    while not process.stdout.readline().startswith("epoch 1/4"):
        assert process.poll() is None
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    assert not (tmp_path / "killed" / "csgnet.safetensors").exists()
    assert 1 <= len(read(tmp_path / "killed" / CHECKPOINT, KIND)[1]["log"]) < 4
    assert train(*options, "--out", tmp_path / "killed") == 0
    whole, killed = ((tmp_path / run / "csgnet.safetensors").read_bytes() for run in ("whole", "killed"))
    assert whole == killed


def in_turn(rank: int = 0, world: int = 1):
    """In place of torch.randint: the first programs in turn, of which each process takes its share."""

    def first(most: int, size: tuple[int], generator: torch.Generator) -> torch.Tensor:
        return torch.arange(rank, rank + world * size[0], world) % most

    return first


# A norm over the batch is another one over its shards: none here. Programs of one length: the mean over the tokens of
# the shards is then that of the batch.
SHARDS = """
import os, sys, torch
from dataclasses import replace
from lib.models.csgnet import CSGNetConfig
from lib.training import commands
from lib.training.__main__ import COMMANDS
from tests.test_csgnet_training import TINY, in_turn
torch.randint = in_turn(int(os.environ["LOCAL_RANK"]), 2)
CSGNetConfig.compact = lambda dimensions: replace(TINY, norm="none")
sys.exit(commands.main(COMMANDS))
"""


@pytest.mark.slow
def test_two_processes_learn_what_one_does(tmp_path, monkeypatch):
    options = ["--programs", "12", "--batch", "6", "--epochs", "2", "--warmup", "0", "--rate", "1e-3"]
    with monkeypatch.context() as patch:
        patch.setattr(torch, "randint", in_turn())
        patch.setattr(CSGNetConfig, "compact", lambda dimensions: replace(TINY, norm="none"))
        assert train(*options, "--out", tmp_path / "one") == 0
    (tmp_path / "shards.py").write_text(SHARDS)
    fabric = [Path(sys.executable).parent / "fabric", "run", "--accelerator=cpu", "--devices=2"]
    fabric += [f"--main-port={29500 + (os.getpid() + 333) % 1000}", tmp_path / "shards.py", "csgnet"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [*fabric, *options, "--out", tmp_path / "two"], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    one, two = (load(CSGNet, tmp_path / out / "csgnet.safetensors").state_dict() for out in ("one", "two"))
    for name, weight in one.items():
        # Adam's steps are about the rate; where a gradient is near 0, rounding decides how long it is.
        assert (weight - two[name]).abs().mean() < 2e-6 and (weight - two[name]).abs().max() < 1e-3, name
    logs = [(tmp_path / out / LOG).read_text().splitlines() for out in ("one", "two")]
    for row, other in zip(*(map(json.loads, lines) for lines in logs)):
        assert [other[name] for name in ("loss", "val_loss")] == pytest.approx(
            [row[name] for name in ("loss", "val_loss")], rel=1e-4
        )
    assert json.loads((tmp_path / "two" / "csgnet.json").read_text())["machine"]["processes"] == 2


@pytest.mark.parametrize("empty", ["train", "val"])
def test_no_programs_are_told_before_the_first_epoch(small, tmp_path, capsys, monkeypatch, empty):
    def some(dimensions, split):
        return csg_programs(dimensions, split)[: 0 if split == empty else None]

    monkeypatch.setattr("lib.training.csgnet_command.csg_programs", some)
    assert train(*FEW, "--out", tmp_path / "run") == 1
    error = capsys.readouterr().err
    assert error.startswith("DataError: there are ") and "expected some of both" in error


def test_a_full_disk_leaves_no_half_facts(small, tmp_path, capsys, monkeypatch):
    write = Path.write_text

    def full(path, text, **options):
        if path.name.startswith("csgnet.json"):
            write(path, text[:10], **options)
            raise OSError("No space left on device")
        return write(path, text, **options)

    monkeypatch.setattr(Path, "write_text", full)
    assert train(*FEW, "--out", tmp_path / "run") == 1
    assert "No space left" in capsys.readouterr().err
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == [
        CHECKPOINT, "csgnet.safetensors", LOG,
    ]  # fmt: skip
