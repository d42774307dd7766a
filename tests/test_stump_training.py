"""CSG-Stump Net learns: both terms of the loss by hand, the same bits after a stop, the command."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from lib.datasets.solid_clouds import gathered
from lib.datasets.solid_sampling import SolidSample
from lib.interpreters.stump import Box, Sphere
from lib.models.soft_stump import SoftStump
from lib.models.stump_net import StumpNet, StumpNetConfig
from lib.models.ucsg import UCSG, UCSGConfig
from lib.models.weights import CheckpointError, load
from lib.training import commands
from lib.training.__main__ import COMMANDS
from lib.training.loop import CHECKPOINT, LOG, Schedule, fit
from lib.training.solids import SolidTask, iou
from lib.training.stump_net import StumpLesson, StumpStudent, pulled, use
from lib.training.ucsg import UCSGLesson, UCSGStudent
from tests.conftest import unchecked

TINY = StumpNetConfig(8, 4, rank=3, feature=8, widths=(8, 8), neighbours=3, points=20)
LESSON = StumpLesson(queries=40)


@pytest.fixture(autouse=True)
def embedded(tmp_path, monkeypatch):
    """No data but what is made on the spot, and no shape checks: other tests have them."""
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "none"))
    with unchecked():
        yield


def balls(count: int, seed: int = 0):
    """Balls of different sizes about the origin."""
    rng, rows = np.random.default_rng(seed), []
    for k in range(count):
        radius = rng.uniform(0.1, 0.25)
        normals = rng.normal(size=(20, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        queries = np.concatenate([normals * radius * 0.5, normals * radius * 1.8])
        rows.append((f"b{k}", "train", "ball", SolidSample(normals * radius, normals, queries)))
    return gathered(rows, "balls")


def task_of(seed: int = 0, lesson: StumpLesson = LESSON, config: StumpNetConfig = TINY) -> SolidTask:
    torch.manual_seed(seed)
    return SolidTask(StumpStudent(StumpNet(config), lesson), balls(6), balls(3, seed=1), {})


def rival_of(seed: int = 0) -> SolidTask:
    torch.manual_seed(seed)
    student = UCSGStudent(UCSG(UCSGConfig(3, 2, 2, 8, (8,), 3, 20)), UCSGLesson(40))
    return SolidTask(student, balls(6), balls(3, seed=1), {})


def test_the_second_term_by_hand():
    """Two primitives, three points: one contains a point, one does not."""
    distances = torch.tensor([[[-0.3, 0.1, 0.4], [0.5, 0.2, 0.6]]])
    assert pulled(distances, "paper").item() == pytest.approx((0.1**2 + 0.2**2) / 2)
    assert pulled(distances, "authors").item() == pytest.approx((0.3**2 + 0.2**2) / 2)


def test_the_loss_is_both_terms():
    task = task_of(lesson=StumpLesson(queries=40, weight=0.5, dullest=150))
    loss, terms = task.loss(task.network, [2, 0], torch.Generator().manual_seed(0), 0.0)
    clouds = task.train.points[[2, 0]].float()
    said = task.student.network(clouds)
    distances = said.distances(task.train.queries[[2, 0]].float())
    found = said.occupancy(distances, 1.0)
    expected = (found - task.train.inside).square().mean()
    assert terms["reconstruction"].item() == pytest.approx(expected.item(), abs=1e-6)
    pull = distances.square().amin(2).mean()
    assert terms["pull"].item() == pytest.approx(pull.item(), abs=1e-6)
    assert loss.item() == pytest.approx((expected + 0.5 * pull).item(), abs=1e-6)


def test_few_points_are_the_noises_choice():
    task = task_of(lesson=StumpLesson(queries=16), config=replace(TINY, points=12))
    losses = [
        task.loss(task.network, [0, 1], torch.Generator().manual_seed(seed), 0.0)[0].item()
        for seed in (0, 0, 1)
    ]
    assert losses[0] == losses[1] != losses[2]


def test_steeper_connections_are_so_in_the_second_half():
    lesson = StumpLesson(connections="steeper")
    assert [lesson.steepness(p) for p in (0, 0.5, 0.75, 1)] == [1, 1, 4.5, 8]
    assert {StumpLesson(connections=other).steepness(1.0) for other in ("soft", "straight_through")} == {1}


@pytest.mark.parametrize("name", ["pull", "connections"])
def test_other_names_are_refused(name):
    with pytest.raises(ValueError, match=f"found .*{name} 'both'; expected one of"):
        StumpLesson(**{name: "both"})


def test_power_and_temperature_exclude_each_other():
    with pytest.raises(ValueError, match="found a power of 8 and a temperature of 20; expected one of them"):
        StumpLesson(temperature=20.0)


def test_straight_through_connections_are_decided_and_have_a_slope():
    said = task_of().student.network(balls(3).points.float())
    distances = said.distances(balls(3).queries.float())
    soft, straight = (said.occupancy(distances, straight_through=each) for each in (False, True))
    hard = [(logits > 0).float() * 80 - 40 for logits in said.logits]
    expected = SoftStump(said.primitives, *hard).occupancy(distances)
    assert torch.allclose(straight, expected, atol=1e-5) and not torch.allclose(straight, soft, atol=1e-2)
    slopes = [
        torch.autograd.grad(each.sum(), said.intersection, retain_graph=True)[0] for each in (soft, straight)
    ]
    assert torch.equal(*slopes) and (slopes[0] != 0).any()


def test_straight_through_is_for_learning_only():
    """Its soft answers are those of soft connections: else nothing would be lost by deciding, whatever it learned."""
    data, losses, soft = balls(3), {}, {}
    asked = data.points.float(), data.queries.float(), data.inside.float()
    for name in ("soft", "straight_through"):
        student = task_of(lesson=StumpLesson(queries=40, weight=0, connections=name)).student.eval()
        losses[name] = student(*asked, 1.0, torch.Generator())[0].item()
        said = student.network(asked[0])
        soft[name] = student.soft(said, said.distances(asked[1]))
    assert torch.equal(*soft.values()) and losses["soft"] != pytest.approx(
        losses["straight_through"], abs=1e-3
    )
    assert losses["soft"] == pytest.approx((soft["soft"] - asked[2]).square().mean().item(), abs=1e-6)


def test_surfaces_get_sharper_in_the_first_half():
    lesson = StumpLesson(dullest=1.5)
    assert [lesson.sharpness(p) for p in (0, 0.25, 0.5, 1)] == pytest.approx([1.5, 15, 150, 150])


def test_overlap_and_use_by_hand():
    inside = torch.tensor([True, True, False, False])
    found = torch.tensor([[True, False, True, False], [True, True, False, False]])
    assert iou(found, inside).tolist() == pytest.approx([1 / 3, 1])
    shape = torch.zeros(1, 2, 3)
    said = SoftStump(
        (Box(shape + 0.1, shape), Sphere(shape[..., 0] + 0.4, shape)),
        complement=torch.zeros(1, 4),
        intersection=torch.tensor([[[9.0, -9], [9, -9], [-9, 9], [-9, -9]]]),
        union=torch.tensor([[9.0, -9]]),
    )
    found = use(said)
    assert (found["primitives"].item(), found["nodes"].item()) == (2, 1)
    assert found["size"].item() == pytest.approx((6 * 0.1 + 2 * 0.4) / 8)
    p = 1 / (1 + math.exp(-9))
    sure = -p * math.log2(p) - (1 - p) * math.log2(
        1 - p
    )  # 8 cells and 2 nodes; of 4 complements one bit each
    assert found["entropy"].item() == pytest.approx((4 + 10 * sure) / 14, rel=1e-3)
    never = torch.full((1, 4), -torch.inf)
    assert use(replace(said, complement=never))["entropy"].item() == pytest.approx(10 * sure / 14, rel=1e-3)


def test_sizes_are_lengths():
    """A cone's slope is none, nor are a superquadric's exponents."""
    config = replace(TINY, kinds=("cone",))
    network = StumpNet(config).eval()
    points = balls(2).points.float()
    assert use(network(points))["size"].tolist() == [0, 0]
    network = StumpNet(replace(config, kinds=("superquadric",))).eval()
    found = network(points)
    assert torch.allclose(use(found)["size"], found.primitives[0].half.flatten(1).mean(1))
    with pytest.raises(ValueError, match="found primitives of the kind 'superquadric'; expected"):
        found.stumps()


def test_it_learns_balls(tmp_path):
    """A network of a moment on six balls: decided answers overlap most of other balls."""
    task = task_of()
    log = fit(task, Schedule(epochs=60, batch=6, rate=0.01, warmup=0.1, last=0.05), tmp_path)
    assert log[-1]["reconstruction"] < 0.5 * log[0]["reconstruction"]
    assert log[-1]["val_iou"] > 0.8 and abs(log[-1]["val_iou"] - log[-1]["val_soft_iou"]) < 0.1


def test_the_rivals_loss_by_hand():
    task = rival_of()
    noise = torch.Generator().manual_seed(0)
    loss, terms = task.loss(task.network, [0, 1], noise, 0.0)
    assert terms["margin"].item() == 1 and terms["temperature"].item() == 0  # the margin is not narrow yet
    reach, expected = terms["reach"].item(), terms["reconstruction"].item()
    assert loss.item() == pytest.approx(expected + 0.1 * (1 + reach), abs=1e-6)
    with torch.no_grad():
        task.student.network.margin.fill_(-0.04)
    _, terms = task.loss(task.network, [0, 1], noise, 0.0)
    assert terms["margin"].item() == pytest.approx(0.04) and terms["temperature"].item() == 4


def test_the_rival_learns_balls(tmp_path):
    """Decided answers are good once the margin is narrow."""
    log = fit(rival_of(), Schedule(epochs=400, batch=6, rate=0.01, warmup=0.05, last=0.05), tmp_path)
    assert abs(log[-1]["margin_now"]) < 0.01 < log[0]["margin_now"]
    assert log[-1]["reconstruction"] < 0.01 and log[-1]["val_iou"] > 0.75
    assert 1 <= log[-1]["primitives"] <= 6


@pytest.mark.parametrize("task_of", [task_of, rival_of])
def test_a_stopped_run_goes_on_to_the_same_bits(tmp_path, task_of):
    schedule = Schedule(epochs=3, batch=4, rate=0.01, warmup=0.1)
    whole = task_of()
    fit(whole, schedule, tmp_path / "whole")

    def stop(row):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit(task_of(), schedule, tmp_path / "stopped", told=stop)
    again = task_of(seed=7)  # its weights are those of the checkpoint
    fit(again, schedule, tmp_path / "stopped")
    for (name, one), other in zip(whole.network.state_dict().items(), again.network.state_dict().values()):
        assert torch.equal(one, other), name


def train(*options: object, name: str = "stump_net") -> int:
    return commands.main(COMMANDS, [name, *map(str, options)])


LITTLE = ["--epochs", 1, "--points", 16, "--queries", 32, "--batch", 40]
FEW = [*LITTLE, "--primitives", 8, "--nodes", 4]


def test_the_command_leaves_weights_and_facts(tmp_path, capsys):
    assert train(*FEW, "--category", "chair", "--head", "linear", "--no_complement", "--out", tmp_path) == 0
    assert "val_iou" in capsys.readouterr().out
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        CHECKPOINT, LOG, "stump_net.json", "stump_net.safetensors",
    ]  # fmt: skip
    network = load(StumpNet, tmp_path / "stump_net.safetensors")
    assert (network.config.primitives, network.config.nodes, network.config.head) == (8, 4, "linear")
    assert not network.config.complement
    facts = json.loads((tmp_path / "stump_net.json").read_text())
    assert facts["settings"]["lesson"]["pull"] == "paper" and facts["settings"]["lesson"]["power"] == 8
    assert set(facts["losses"]) == {
        *("loss", "reconstruction", "pull", "val_soft_iou", "val_iou"),
        *("primitives", "nodes", "size", "entropy"),
    }


def test_rivals_are_commands_too(tmp_path):
    options = [*FEW, "--nodes", 8, "--category", "chair"]
    boxes, ovals = tmp_path / "boxes", tmp_path / "ovals"
    assert train(*options, "--kinds", "box", "--head", "own", "--no_complement", "--out", boxes) == 0
    assert train(*options, "--kinds", "superquadric", "--head", "own", "--out", ovals) == 0
    assert load(StumpNet, boxes / "stump_net.safetensors").config.kinds == ("box",)
    small = ["--each", 3, "--layers", 2, "--nodes", 2, "--category", "chair"]
    assert train(*LITTLE, *small, "--out", tmp_path / "ucsg", name="ucsg") == 0
    assert load(UCSG, tmp_path / "ucsg" / "ucsg.safetensors").config.each == 3
    assert train(*LITTLE, "--layers", 0, "--out", tmp_path / "none", name="ucsg") == 1


def test_the_papers_settings(tmp_path):
    assert train("--paper", *FEW, "--category", "table", "--out", tmp_path) == 0
    settings = json.loads((tmp_path / "stump_net.json").read_text())["settings"]
    assert settings["rate"] == 1e-4 and settings["last"] == 1 and settings["network"]["neighbours"] == 20
    assert (
        settings["lesson"] | {"temperature": 20, "power": None, "connections": "soft"} == settings["lesson"]
    )


@pytest.mark.parametrize(
    "options, told",
    [
        (["--primitives", "6"], "TrainingError: found 6 primitives of 4 kinds"),
        (["--nodes", "0"], "TrainingError: found StumpNetConfig(primitives=8, nodes=0"),
        (["--dullest", "151"], "TrainingError: found dullest 151; expected more than 0, at most 150"),
        (["--weight", "-1"], "TrainingError: found 32 queries, weight -1.0"),
        (["--weight", "nan"], "TrainingError: found 32 queries, weight nan"),
        (["--weight", "inf"], "TrainingError: found 32 queries, weight inf"),
        (["--queries", "1"], "TrainingError: found 1 queries"),
        (
            ["--points", "1025"],
            "TrainingError: found --points 1025, and clouds of 1024 points; expected at most",
        ),
        (["--queries", "2050"], "TrainingError: found --queries 2050, and clouds of 2048 queries"),
        (["--precision", "bf16-mixed"], "TrainingError: found the precision bf16-mixed; expected 32-true"),
        (["--power", "-1"], "TrainingError: found a power of -1"),
        (["--power", "0", "--temperature", "999"], "TrainingError: found a temperature of 999"),
        (["--seed", str(10**30)], "TrainingError: seed is 1000"),
        (["--nodes", str(10**18)], "TrainingError: "),
        (["--nodes", str(10**30)], "TrainingError: "),
        (["--category", "spoon"], "DataError: there are no train clouds of the category spoon"),
        (["--source", "shapenet"], "DataError: unknown source 'shapenet'"),
    ],
)
def test_bad_options_are_told_in_one_line(tmp_path, capsys, options, told):
    assert train(*FEW, *options, "--out", tmp_path / "run") == 1
    error = capsys.readouterr().err
    assert error.startswith(told) and error.count("\n") == 1 and not (tmp_path / "run").exists()


def test_a_run_goes_on_with_the_same_lesson_only(tmp_path):
    schedule = Schedule(epochs=1, batch=6, rate=0.01)
    for name in ("soft", "steeper"):
        task = task_of()
        task.about = {"lesson": {"points": 20, "connections": name}}
        if name == "soft":
            fit(task, schedule, tmp_path)
    with pytest.raises(CheckpointError, match=r"another run \(connections: 'soft' then, 'steeper' now\)"):
        fit(task, schedule, tmp_path)
