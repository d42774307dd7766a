"""The training loop and its command: killed anywhere, a run ends with the same bits; what cannot go on says why."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from lib.datasets import shapeassembly
from lib.models.code_distribution import CodeDistribution
from lib.models.program_vae import ProgramVAE
from lib.models.weights import CheckpointError, load, read, write
from lib.training import commands, loop
from lib.training.__main__ import COMMANDS
from lib.training.checkpoints import KIND
from lib.training.loop import CHECKPOINT, LOG, Schedule, TrainingError, batches, fit

ROOT = Path(__file__).parents[1]
SCHEDULE = Schedule(epochs=3, batch=4, rate=0.1, warmup=0.2, last=0.1, clip=1.0, seed=5)


class Line:
    """Learn y = 3 x from ten numbers with noise; a second layer is never used. stop: raised before that loss."""

    def __init__(self, stop: int | None = None, error: BaseException | None = None):
        torch.manual_seed(0)
        self.network = nn.ModuleDict({"line": nn.Linear(1, 1), "unused": nn.Linear(1, 1)})
        self.network.forward = self._forward
        self.about = {"data": "line"}
        self.stop, self.error, self.calls = stop, error, 0

    def _forward(self, x):
        return self.network["line"](x)

    def __len__(self):
        return 10

    def loss(self, network, picks, noise, progress):
        if self.calls == self.stop:
            raise self.error
        self.calls += 1
        x = torch.as_tensor(np.asarray(picks), dtype=torch.float32)[:, None] / 10
        off = (network(x) - 3 * x - 0.1 * torch.randn(len(picks), 1, generator=noise)).square().mean()
        return off, {"off": off}

    def report(self, network):
        assert not network.training
        return {"slope": network["line"].weight.item()}


def bits(task: Line) -> list[torch.Tensor]:
    return list(task.network.state_dict().values())


def same(one: list[torch.Tensor], other: list[torch.Tensor]) -> bool:
    return all(torch.equal(a, b) for a, b in zip(one, other, strict=True))


def without_time(log: list[dict]) -> list[dict]:
    return [{name: value for name, value in row.items() if name != "seconds"} for row in log]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Weights and log of a run that nothing stopped."""
    task = Line()
    return bits(task), without_time(fit(task, SCHEDULE, tmp_path_factory.mktemp("whole")))


# ---- schedule ----


def test_every_item_comes_once_an_epoch_in_another_order():
    first, second = (batches(10, SCHEDULE, epoch) for epoch in (0, 1))
    for picks in (first, second):
        assert [len(batch) for batch in picks] == [4, 3, 3] and sorted(np.concatenate(picks)) == [*range(10)]
    assert list(np.concatenate(first)) != list(np.concatenate(second))
    assert list(np.concatenate(batches(10, SCHEDULE, 0))) == list(np.concatenate(first))


def test_the_rate_grows_and_falls():
    schedule = Schedule(epochs=1, batch=1, rate=2.0, warmup=0.5, last=0.1)
    expected = {0.0: 0.0, 0.25: 1.0, 0.5: 2.0, 0.75: 1.1, 1.0: 0.2}  # 1.1: halfway between 2 and 0.2
    assert {at: schedule.rate_at(at) for at in expected} == pytest.approx(expected)
    assert Schedule(epochs=1, batch=1, rate=2.0).rate_at(0.7) == 2.0


@pytest.mark.parametrize(
    "wrong",
    [{"epochs": 0}, {"batch": 0}, {"rate": 0.0}, {"rate": math.nan}, {"rate": math.inf}, {"warmup": 2.0},
     {"clip": -1.0}, {"seed": -1}, {"seed": 2**63}, {"momentum": -0.1}, {"momentum": 1.5}, {"momentum": math.nan}],
)  # fmt: skip
def test_settings_without_sense_are_told(wrong):
    [name] = wrong
    with pytest.raises(TrainingError, match=f"{name} is .*expected"):
        Schedule(**{"epochs": 1, "batch": 1, "rate": 1.0} | wrong)


# ---- the loop ----


def test_it_learns_and_logs(whole, tmp_path):
    task, seen = Line(), []
    log = fit(task, Schedule(epochs=40, batch=4, rate=0.1), tmp_path, told=seen.append)
    assert log == seen and [row["epoch"] for row in log] == [*range(1, 41)]
    assert log[-1]["slope"] == pytest.approx(3, abs=0.3) and log[-1]["loss"] < 0.1 * log[0]["loss"]
    assert [json.loads(line) for line in (tmp_path / LOG).read_text().splitlines()] == log
    assert sorted(path.name for path in tmp_path.iterdir()) == [CHECKPOINT, LOG]


def test_the_logged_loss_is_the_mean_of_the_batches(tmp_path):
    task, seen = Line(), []
    original = task.loss

    def loss(*arguments):
        found = original(*arguments)
        seen.append(found[0].item())
        return found

    task.loss = loss
    [row] = fit(task, Schedule(epochs=1, batch=4, rate=0.1), tmp_path)
    assert row["loss"] == row["off"] == pytest.approx(sum(seen) / 3, rel=1e-5)


@pytest.mark.parametrize("stop", range(9))  # three epochs of three batches
def test_stopped_before_any_batch_it_ends_with_the_same_bits(whole, tmp_path, stop):
    with pytest.raises(KeyboardInterrupt):
        fit(Line(stop, KeyboardInterrupt()), SCHEDULE, tmp_path)
    task = Line()
    torch.manual_seed(stop)  # chance is drawn from the schedule's seed, not from what happened before
    log = fit(task, SCHEDULE, tmp_path)
    assert task.calls == 9 - stop // 3 * 3  # whole epochs are not done again
    assert same(bits(task), whole[0]) and without_time(log) == whole[1]


@pytest.mark.parametrize("write_of_epoch", [1, 2, 3])
@pytest.mark.parametrize("place", ["replace", "_write_log"])
def test_stopped_while_it_writes_it_ends_with_the_same_bits(
    whole, tmp_path, monkeypatch, write_of_epoch, place
):
    where, count = (Path, "replace") if place == "replace" else (loop, "_write_log"), []
    original = getattr(*where)

    def stops(*arguments):
        count.append(1)
        if len(count) == (2 * write_of_epoch - 1 if place == "replace" else write_of_epoch):
            raise KeyboardInterrupt
        return original(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(*where, stops)
        with pytest.raises(KeyboardInterrupt):
            fit(Line(), SCHEDULE, tmp_path)
    task = Line()
    log = fit(task, SCHEDULE, tmp_path)
    assert same(bits(task), whole[0]) and without_time(log) == whole[1]
    assert len((tmp_path / LOG).read_text().splitlines()) == 3


def test_a_finished_run_does_nothing_more(whole, tmp_path):
    fit(Line(), SCHEDULE, tmp_path)
    task = Line()
    assert without_time(fit(task, SCHEDULE, tmp_path)) == whole[1]
    assert task.calls == 0 and same(bits(task), whole[0])


def test_halves_that_a_killed_run_left_are_removed(tmp_path):
    (tmp_path / "half-123.part").write_text("half")
    fit(Line(), SCHEDULE, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [CHECKPOINT, LOG]


def test_a_loss_that_is_not_finite_stops_it_and_keeps_the_last_epoch(tmp_path):
    task = Line()
    original = task.loss

    def loss(*arguments):
        found, terms = original(*arguments)
        return (found * math.nan if task.calls == 5 else found), terms

    task.loss = loss
    with pytest.raises(TrainingError, match="epoch 2, batch 2: loss nan.*lower rate"):
        fit(task, SCHEDULE, tmp_path)
    assert [row["epoch"] for row in read(tmp_path / CHECKPOINT, KIND)[1]["log"]] == [1]


@pytest.mark.parametrize("spoilt", ["slope", "line.weight"])
def test_numbers_that_the_last_step_spoils_are_not_kept(tmp_path, spoilt):
    task = Line()

    def report(network):
        if spoilt == "line.weight":
            network["line"].weight.data.fill_(math.nan)
            return {}
        return {"slope": math.nan}

    task.report = report
    with pytest.raises(
        TrainingError, match=f"epoch 1: found .* not finite at its end, in {spoilt};.*lower rate"
    ):
        fit(task, SCHEDULE, tmp_path)
    assert not list(tmp_path.iterdir())


def test_nothing_to_learn_from_is_told(tmp_path):
    class Nothing(Line):
        def __len__(self):
            return 0

    with pytest.raises(TrainingError, match="nothing to learn from"):
        fit(Nothing(), SCHEDULE, tmp_path)


# ---- chance that has no generator of its own ----


class Forgetful(Line):
    """The line, with dropout."""

    def _forward(self, x):
        return nn.functional.dropout(self.network["line"](x), 0.5, self.network.training)


def test_dropout_too_is_the_same_after_a_stop(tmp_path):
    whole, killed, resumed = Forgetful(), Forgetful(4, KeyboardInterrupt()), Forgetful()
    torch.manual_seed(1)
    fit(whole, SCHEDULE, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        fit(killed, SCHEDULE, tmp_path / "killed")
    torch.manual_seed(2)
    fit(resumed, SCHEDULE, tmp_path / "killed")
    assert same(bits(whole), bits(resumed))
    plain = Line()
    fit(plain, SCHEDULE, tmp_path / "plain")
    assert not same(bits(whole), bits(plain))  # there was dropout


def test_a_training_draws_no_random_numbers_of_others(tmp_path):
    torch.manual_seed(1)
    expected = torch.rand(3)
    task = Forgetful()
    torch.manual_seed(1)
    fit(task, SCHEDULE, tmp_path)
    assert torch.equal(torch.rand(3), expected)


# ---- gradient descent with momentum, in place of Adam ----

HEADER = ("about", "log", "told")  # of a checkpoint
DESCENT = Schedule(epochs=3, batch=4, rate=0.05, momentum=0.5, seed=5)


def test_momentum_is_plain_gradient_descent_with_memory(tmp_path):
    """Against the recursion v <- m v + g, w <- w - rate v, with the gradient of (w x + b - y)^2 by hand."""
    task, seen = Line(), []
    weight, bias = (tensor.item() for tensor in bits(task)[:2])
    original = task.loss

    def loss(network, picks, noise, progress):
        x = torch.as_tensor(np.asarray(picks), dtype=torch.float64) / 10
        drawn = torch.Generator()
        drawn.set_state(noise.get_state())
        seen.append((x, 3 * x + 0.1 * torch.randn(len(picks), 1, generator=drawn).squeeze(1).double()))
        return original(network, picks, noise, progress)

    task.loss = loss
    fit(task, DESCENT, tmp_path)
    speed = [0.0, 0.0]
    for x, y in seen:
        off = 2 * (weight * x + bias - y)
        speed = [0.5 * v + g.item() for v, g in zip(speed, ((off * x).mean(), off.mean()))]
        weight, bias = weight - 0.05 * speed[0], bias - 0.05 * speed[1]
    assert [tensor.item() for tensor in bits(task)[:2]] == pytest.approx([weight, bias], rel=1e-5)


@pytest.mark.parametrize("stop", [0, 2, 3, 7])
def test_with_momentum_too_it_ends_with_the_same_bits(tmp_path, stop):
    whole, resumed = Line(), Line()
    fit(whole, DESCENT, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        fit(Line(stop, KeyboardInterrupt()), DESCENT, tmp_path / "killed")
    fit(resumed, DESCENT, tmp_path / "killed")
    assert same(bits(whole), bits(resumed))
    one, other = ((tmp_path / run / CHECKPOINT) for run in ("whole", "killed"))
    assert without_time(read(one, KIND)[1]["log"]) == without_time(read(other, KIND)[1]["log"])
    arrays = [read(path, KIND)[0] for path in (one, other)]
    assert arrays[0].keys() == arrays[1].keys() and same(*(list(each.values()) for each in arrays))
    assert {name for name in arrays[0] if not name.startswith("network.")} == {
        "sgd.momentum_buffer.line.weight",
        "sgd.momentum_buffer.line.bias",  # the layer that is never used has none
    }


@pytest.mark.parametrize("was, now", [(0.0, 0.5), (0.5, 0.0), (0.5, 0.9)])
def test_a_checkpoint_of_the_other_optimizer_is_refused(tmp_path, was, now):
    fit(Line(), Schedule(**vars(DESCENT) | {"momentum": was}), tmp_path)
    before = (tmp_path / CHECKPOINT).read_bytes()
    with pytest.raises(CheckpointError, match=f"another run .momentum: {was} then, {now} now"):
        fit(Line(), Schedule(**vars(DESCENT) | {"momentum": now}), tmp_path)
    assert (tmp_path / CHECKPOINT).read_bytes() == before


def test_arrays_of_the_other_optimizer_are_named(tmp_path):
    """A file that says it is of gradient descent and holds what Adam keeps."""
    fit(Line(), Schedule(**vars(DESCENT) | {"momentum": 0.0}), tmp_path)
    fit(Line(), DESCENT, tmp_path / "descent")
    tensors, _ = read(tmp_path / CHECKPOINT, KIND)
    _, facts = read(tmp_path / "descent" / CHECKPOINT, KIND)
    write(tmp_path / CHECKPOINT, tensors, KIND, {key: facts[key] for key in HEADER})
    task = Line()
    before = [tensor.clone() for tensor in bits(task)]
    with pytest.raises(CheckpointError, match="as 'adam.exp_avg.line.bias'; expected nothing"):
        fit(task, DESCENT, tmp_path)
    assert same(bits(task), before)


# ---- checkpoints ----


@pytest.fixture
def checkpoint(tmp_path) -> Path:
    fit(Line(), SCHEDULE, tmp_path)
    return tmp_path / CHECKPOINT


def refused(checkpoint: Path, told: str, **changes) -> None:
    """The checkpoint is refused with these words, and nothing of it is used."""
    task = Line()
    before = [tensor.clone() for tensor in bits(task)]
    with pytest.raises(CheckpointError, match=told) as error:
        fit(task, SCHEDULE, checkpoint.parent)
    assert str(checkpoint) in str(error.value) and "remove the file to begin anew" in str(error.value)
    assert same(bits(task), before)


@pytest.mark.parametrize("keep", [0, 50, -1])
def test_a_checkpoint_cut_short_is_refused(checkpoint, keep):
    checkpoint.write_bytes(checkpoint.read_bytes()[:keep])
    refused(checkpoint, "damaged, or no safetensors file")


def test_a_flipped_bit_is_noticed(checkpoint):
    content = bytearray(checkpoint.read_bytes())
    content[-2] ^= 4
    checkpoint.write_bytes(content)
    refused(checkpoint, "is damaged")


def test_weights_are_no_checkpoint(checkpoint):
    write(checkpoint, {"weight": torch.zeros(2)}, "Line", {})
    refused(checkpoint, "found weights of kind 'Line'; expected 'training run'")


@pytest.mark.parametrize("change", [{"rate": 0.2}, {"epochs": 4}, {"seed": 6}])
def test_another_runs_settings_are_named(checkpoint, change):
    [(name, now)] = change.items()
    was = getattr(SCHEDULE, name)
    with pytest.raises(CheckpointError, match=f"another run .{name}: {was} then, {now} now"):
        fit(Line(), Schedule(**vars(SCHEDULE) | change), checkpoint.parent)


def test_other_data_are_named(checkpoint):
    task = Line()
    task.about = {"data": "circle"}
    with pytest.raises(CheckpointError, match="data: 'line' then, 'circle' now"):
        fit(task, SCHEDULE, checkpoint.parent)


@pytest.mark.parametrize("name", ["network.line.weight", "network.unused.bias", "adam.exp_avg.line.bias"])
@pytest.mark.parametrize(
    "value, told",
    [
        (None, "found nothing as '{}'"),
        (torch.zeros(3), r"found float32 \(3,\) as '{}'; expected float32"),
        (torch.zeros(1).double(), "found float64"),
        (math.nan, "not finite in '{}'"),
    ],
)
def test_arrays_that_do_not_fit_are_named(checkpoint, name, value, told):
    tensors, facts = read(checkpoint, KIND)
    if value is None:
        del tensors[name]
    else:
        tensors[name] = value if isinstance(value, torch.Tensor) else torch.full_like(tensors[name], value)
    write(checkpoint, tensors, KIND, {key: facts[key] for key in HEADER})
    refused(checkpoint, told.format(name))


def test_surplus_arrays_are_named(checkpoint):
    tensors, facts = read(checkpoint, KIND)
    tensors["surplus"] = torch.zeros(1)
    write(checkpoint, tensors, KIND, {key: facts[key] for key in HEADER})
    refused(checkpoint, "'surplus'; expected nothing")


@pytest.mark.parametrize("log", [None, "none", [{}], [{"epoch": 2}], [3], {"epoch": 1}])
def test_a_log_without_sense_is_refused(checkpoint, log):
    tensors, facts = read(checkpoint, KIND)
    write(checkpoint, tensors, KIND, {"about": facts["about"], "log": log})
    refused(checkpoint, "no log of epochs 1, 2")


def test_settings_without_sense_are_refused(checkpoint):
    tensors, facts = read(checkpoint, KIND)
    write(checkpoint, tensors, KIND, {"about": 3, "log": facts["log"]})
    refused(checkpoint, "found no settings")


@pytest.mark.parametrize("old, new", [(b"seconds", b"secondz"), (b'loss\\": ', b'loss\\": 1')])
def test_a_header_with_other_words_is_refused(checkpoint, old, new):
    content = checkpoint.read_bytes()
    changed = content.replace(old, new)
    assert changed != content
    if grown := len(changed) - len(content):  # the first 8 bytes say how long the header is
        changed = (int.from_bytes(content[:8], "little") + grown).to_bytes(8, "little") + changed[8:]
    checkpoint.write_bytes(changed)
    refused(checkpoint, "is damaged: its settings and log are not those that were written")


# ---- the command ----


@pytest.fixture
def embedded(tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "none"))


def train(*options: object) -> int:
    return commands.main(COMMANDS, ["program_vae", *map(str, options)])


def started(*options: object) -> subprocess.Popen:
    """The same in a process of its own."""
    line = [sys.executable, "-m", "lib.training", "program_vae", *map(str, options)]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        line, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def wait_for(path: Path, process: subprocess.Popen, lines: int) -> None:
    """Until a log has so many lines."""
    for _ in range(6000):
        if path.exists() and len(path.read_text().splitlines()) >= lines:
            return
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    raise TimeoutError(path)


def test_the_command_leaves_weights_and_facts(embedded, tmp_path, capsys, unchecked_shapes):
    assert train("--limit", 4, "--epochs", 2, "--out", tmp_path / "run") == 0
    said = capsys.readouterr().out
    assert "4 embedded chair train programs" in said and "epoch 2/2: loss" in said
    path = tmp_path / "run" / "program_vae.safetensors"
    assert str(path) in said
    assert sum(weight.numel() for weight in load(ProgramVAE, path).parameters()) == 2146755
    codes = CodeDistribution.load(path.with_name("program_vae_codes.safetensors"))
    expected = CodeDistribution.of(load(ProgramVAE, path), list(shapeassembly("chair", "train")[:4]))
    torch.testing.assert_close(codes.factor, expected.factor, rtol=0, atol=1e-5)
    facts = json.loads(path.with_suffix(".json").read_text())
    assert facts["seed"] == 0 and facts["epochs"] == 2 and facts["losses"]["val_loss"] > 0
    assert facts["settings"]["batch"] == 32 and facts["settings"]["weights"]["kl"] == 0.2
    assert facts["command"].startswith("python -m lib.training program_vae --limit 4")
    assert set(facts["code"]) == {"version", "commit"} and facts["machine"]["processes"] == 1


def test_the_papers_settings(embedded, tmp_path, unchecked_shapes):
    assert train("--paper", "--limit", 2, "--epochs", 1, "--out", tmp_path / "run") == 0
    settings = json.loads((tmp_path / "run" / "program_vae.json").read_text())["settings"]
    expected = {"batch": 1, "rate": 1e-4, "warmup": 0, "last": 1, "clip": None, "annealing": 0, "epochs": 1}
    assert {name: settings[name] for name in expected} == expected


@pytest.mark.parametrize(
    "options, told",
    [
        (["--rate", "0"], "TrainingError: rate is 0"),
        (["--limit", "0"], "TrainingError: limit is 0; expected at least 1"),
        (["--threads", "0"], "TrainingError: threads is 0"),
        (["--kl", "-1"], "TrainingError: annealing is 0.0, kl -1.0"),
        (["--seed", str(10**30)], "TrainingError: seed is 1000"),
    ],
)
def test_bad_options_are_told_in_one_line(embedded, tmp_path, capsys, options, told):
    assert train(*options, "--out", tmp_path) == 1
    error = capsys.readouterr().err
    assert error.startswith(told) and error.count("\n") == 1


def test_a_file_in_the_place_of_the_folder_is_told_before_the_first_epoch(embedded, tmp_path, capsys):
    (tmp_path / "mine").write_text("mine")
    assert train("--limit", 2, "--epochs", 1, "--out", tmp_path / "mine") == 1
    told = capsys.readouterr()
    assert (
        told.err.startswith("TrainingError: ") and "mine is a file" in told.err and "epoch 1" not in told.out
    )


def test_a_foreign_checkpoint_is_told_in_one_line(embedded, tmp_path, capsys, unchecked_shapes):
    (tmp_path / CHECKPOINT).write_text("mine")
    assert train("--limit", 2, "--epochs", 1, "--out", tmp_path) == 1
    assert capsys.readouterr().err.startswith("CheckpointError: ")
    assert (tmp_path / CHECKPOINT).read_text() == "mine"


@pytest.mark.slow
def test_killed_twice_it_ends_with_the_same_bits(embedded, tmp_path, unchecked_shapes):
    options = ["--limit", 6, "--epochs", 12, "--batch", 3]
    assert train(*options, "--out", tmp_path / "whole") == 0
    for epochs in (1, 4):
        process = started(*options, "--out", tmp_path / "killed")
        wait_for(tmp_path / "killed" / LOG, process, epochs)
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
    assert not (tmp_path / "killed" / "program_vae.safetensors").exists()
    assert train(*options, "--out", tmp_path / "killed") == 0
    whole, killed = ((tmp_path / run / "program_vae.safetensors").read_bytes() for run in ("whole", "killed"))
    assert whole == killed


@pytest.mark.slow
def test_ctrl_c_ends_it_with_a_word(embedded, tmp_path):
    process = started("--limit", 6, "--epochs", 1000, "--out", tmp_path / "run")
    wait_for(tmp_path / "run" / LOG, process, 1)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert error.strip().splitlines()[-1].endswith("the same command goes on from there")
    assert "Traceback" not in error


def silent(*size: int, generator: torch.Generator | None = None) -> torch.Tensor:
    """In place of torch.randn: no noise where it is drawn for a batch, the usual start of the weights."""
    return torch.zeros(*size) if generator else torch.normal(0.0, 1.0, size)


# Without noise, the mean over the shards of a batch is the mean of the batch, also of shards of unequal size.
SHARDS = """
import sys, torch
from lib.training import commands
from lib.training.__main__ import COMMANDS
from tests.test_training import silent
torch.randn = silent
sys.exit(commands.main(COMMANDS))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "ablation", [None, "flat"]
)  # flat programs do not use the weights that make inner codes
def test_two_processes_learn_what_one_does(embedded, tmp_path, monkeypatch, unchecked_shapes, ablation):
    options = ["--limit", "8", "--batch", "5", "--epochs", "1", "--warmup", "0", "--rate", "1e-4"]
    options += ["--ablation", ablation] if ablation else []
    with monkeypatch.context() as patch:
        patch.setattr(torch, "randn", silent)
        assert train(*options, "--out", tmp_path / "one") == 0
    (tmp_path / "shards.py").write_text(SHARDS)
    fabric = [Path(sys.executable).parent / "fabric", "run", "--accelerator=cpu", "--devices=2"]
    fabric += [f"--main-port={29500 + os.getpid() % 1000}", tmp_path / "shards.py", "program_vae"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [*fabric, *options, "--out", tmp_path / "two"], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    weights = [load(ProgramVAE, tmp_path / out / "program_vae.safetensors") for out in ("one", "two")]
    for (name, one), two in zip(weights[0].state_dict().items(), weights[1].state_dict().values()):
        # Adam's steps are about the rate; where a gradient is near 0, rounding decides how long it is.
        assert (one - two).abs().mean() < 2e-7 and (one - two).abs().max() < 1e-4, name
    logs = [json.loads((tmp_path / out / LOG).read_text()) for out in ("one", "two")]
    for name in ("loss", "command", "point", "kl", "val_loss"):
        assert logs[1][name] == pytest.approx(logs[0][name], rel=1e-4)
    assert json.loads((tmp_path / "two" / "program_vae.json").read_text())["machine"]["processes"] == 2
