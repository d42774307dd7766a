"""The loss of a batch against a slow reading: one program, one line, one term at a time."""

from math import exp

import numpy as np
import pytest
import torch
from torch.nn.functional import binary_cross_entropy_with_logits, cross_entropy

from lib.interpreters.shapeassembly import sample
from lib.models.program_lines import COMMANDS, FIELD
from lib.models.program_table import ProgramTable, batch_of
from lib.models.program_vae import ProgramVAE, ProgramVAEConfig
from lib.training.program_loss import NUMBERS, TERMS, LossWeights, program_loss, total_loss
from lib.training.program_vae import ProgramTask, ReadAndWrite
from tests.conftest import unchecked

USES = {"Cuboid": 1, "attach": 2, "squeeze": 3, "reflect": 1, "translate": 1}  # cuboids a line names


@pytest.fixture(scope="module")
def table() -> ProgramTable:
    """Six programs, every other one with blocks that fill cuboids."""
    rng = np.random.default_rng(3)
    with unchecked():
        found = [sample(rng) for _ in range(60)]
        deep = [program for program in found if len(program.blocks) > 2]
        flat = [program for program in found if len(program.blocks) == 1]
        return ProgramTable.of([each for pair in zip(flat, deep) for each in pair][:6])


@pytest.fixture
def task(table) -> ProgramTask:
    torch.manual_seed(2)
    module = ReadAndWrite(ProgramVAE(ProgramVAEConfig(hidden=32, head=16)))
    return ProgramTask(module, table, table, LossWeights(), 0.0, {})


def by_line(network: ProgramVAE, levels, noise) -> dict[str, float]:
    """The terms of a batch of one program."""
    posterior, found = network(levels, noise)
    line, terms = network.line, dict.fromkeys(TERMS, 0.0)
    for state, code, size, target, leaf in zip(
        *(getattr(found, name)[:, None] for name in ("state", "code", "size", "targets", "leaf"))
    ):
        field = {name: target[0, where] for name, where in FIELD.items()}

        def picked(logits, name, field=field):
            return cross_entropy(logits, field[name].argmax()[None]).item()

        def off(values, name, field=field):
            return (values.flatten() - field[name]).abs().sum().item()

        terms["command"] += picked(line.command(state), "command")
        command = COMMANDS[int(field["command"].argmax())]
        named = torch.stack([field["first"], field["second"], field["third"]])[None]
        logits = line.cuboids(state, field["command"][None])
        for index, name in enumerate(("first", "second", "third")[: USES.get(command, 0)]):
            terms["cuboids"] += picked(logits[:, index], name)
        if command == "Cuboid":
            sides, aligned = line.size(state, size)
            terms["size"] += off(sides, "size")
            weight = torch.tensor(0.2)
            terms["aligned"] += binary_cross_entropy_with_logits(
                aligned, field["aligned"], pos_weight=weight
            ).item()
            terms["leaf"] += binary_cross_entropy_with_logits(line.leaf(state, code), leaf).item()
        elif command == "attach":
            points = line.attach(state, named)
            terms["point"] += off(points[:, :3], "point") + off(points[:, 3:], "place")
        elif command == "squeeze":
            face, uv = line.squeeze(state, named)
            terms["face"] += picked(face, "face")
            terms["uv"] += off(uv, "uv")
        elif command in ("reflect", "translate"):
            axis, count, distance = line.symmetry(state, named, size)
            terms["axis"] += picked(axis, "axis")
            if command == "translate":
                terms["count"] += off(count, "count")
                terms["distance"] += off(distance, "distance")
    terms["root"] = (found.root - levels[0].size).abs().sum().item()
    for mean, spread in zip(posterior.mean[0].tolist(), posterior.log_variance[0].tolist()):
        terms["kl"] += 0.5 * (mean**2 + exp(spread) - 1 - spread)
    return terms


def test_a_batch_counts_with_the_mean_of_its_programs(task, table):
    noise = torch.randn(6, 32, generator=torch.Generator().manual_seed(0))
    network = task.module.network
    with torch.no_grad():
        found = task.module(batch_of(table, range(6)), noise)
        alone = [by_line(network, batch_of(table, [pick]), noise[pick : pick + 1]) for pick in range(6)]
    assert list(found) == list(TERMS)
    for name in TERMS:
        expected = sum(terms[name] for terms in alone) / 6
        assert found[name].item() == pytest.approx(expected, rel=1e-4) and expected > 0, name


def test_the_weights_are_the_papers():
    ones = dict.fromkeys(TERMS, torch.tensor(1.0))
    assert total_loss(ones, LossWeights()) == pytest.approx(6 + 50 * 6 + 0.2)
    for name in TERMS:
        weight = 50 if name in NUMBERS else 0.2 if name == "kl" else 1
        more = total_loss(ones | {name: torch.tensor(3.0)}, LossWeights())
        assert more.item() == pytest.approx(306.2 + 2 * weight)


def test_the_kl_term_is_zero_for_the_standard_normal_distribution(task, table):
    for layer in (task.module.network.mean, task.module.network.log_variance):
        torch.nn.init.zeros_(layer.weight)
        torch.nn.init.zeros_(layer.bias)
    assert task.module(batch_of(table, range(6)), torch.zeros(6, 32))["kl"] == 0


def test_a_perfect_prediction_costs_no_number(task, table):
    """What the heads say of sizes, if they say the truth."""
    levels = batch_of(table, range(6))
    posterior, found = task.module.network(levels, torch.zeros(6, 32))
    cuboid = found.targets[:, FIELD["command"]].argmax(-1) == COMMANDS.index("Cuboid")
    truth = found.targets[cuboid][:, FIELD["size"]]
    task.module.network.line.size = lambda state, size: (truth, torch.zeros(len(truth)))
    root = torch.empty_like(found.root).index_copy(0, levels[0].program, levels[0].size)
    terms = program_loss(task.module.network.line, posterior, found, root)
    assert terms["size"] == 0 and terms["point"] > 0


def test_annealing_lets_the_kl_term_grow(task):
    task.annealing = 0.5

    def loss(progress):
        found, terms = task.loss(task.module, range(6), torch.Generator().manual_seed(0), progress)
        return found.item() - total_loss(terms, LossWeights(kl=0)).item(), terms["kl"].item()

    for progress, share in {0.0: 0.0, 0.25: 0.5, 0.5: 1.0, 1.0: 1.0}.items():
        weighed, kl = loss(progress)
        assert weighed == pytest.approx(0.2 * share * kl, abs=1e-3)


def test_the_report_is_the_loss_at_the_means(task, table, monkeypatch):
    monkeypatch.setattr("lib.training.program_vae.PER_REPORT", 4)  # two unequal batches
    with torch.no_grad():
        terms = task.module(batch_of(table, range(6)), torch.zeros(6, 32))
    report = task.report(task.module)
    assert report["val_loss"] == pytest.approx(total_loss(terms, LossWeights()).item(), rel=1e-4)
    assert {name: report[f"val_{name}"] for name in TERMS} == pytest.approx(
        {name: value.item() for name, value in terms.items()}, rel=1e-4
    )


def test_a_few_programs_are_learnt_by_heart(task, unchecked_shapes):
    adam = torch.optim.Adam(task.module.parameters(), lr=3e-3)
    losses = []
    for step in range(80):
        loss, _ = task.loss(task.module, range(6), torch.Generator().manual_seed(step), 0.0)
        adam.zero_grad()
        loss.backward()
        adam.step()
        losses.append(loss.item())
    assert losses[-1] < 0.5 * losses[0]
