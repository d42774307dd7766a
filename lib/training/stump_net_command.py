"""python -m lib.training stump_net [options]: CSG-Stump Net, on point clouds of solids; see `stump_net`."""

import argparse
import hashlib
from dataclasses import asdict, replace
from pathlib import Path

import torch

from ..datasets import DataError
from ..datasets.solid_clouds import SolidSet, solid_clouds
from ..models.stump_net import HEADS, StumpNet, StumpNetConfig
from .commands import Command, Job, Setting
from .loop import Schedule, TrainingError
from .stump_net import PULLS, Lesson, Student, StumpTask

SETTINGS = (
    Setting("epochs", int, 30, 10_001, "passes over the clouds"),
    Setting("batch", int, 8, 2, "clouds a step"),
    Setting("rate", float, 1e-3, 1e-4, "Adam's learning rate at its highest"),
    Setting("warmup", float, 0.02, 0.0, "share of the steps in which the rate grows from 0"),
    Setting("last", float, 0.02, 1.0, "the rate at the end, as a share of the highest"),
    Setting("clip", float, 1.0, 1e9, "largest norm of the gradient"),
    Setting("primitives", int, 64, 256, "K, a multiple of 4"),
    Setting("nodes", int, 64, 256, "C"),
    Setting("points", int, 512, 2048, "of a cloud that are looked at in a step"),
    Setting("queries", int, 1024, 2048, "points of space that are asked about in a step"),
    Setting("weight", float, 1e-3, 1e-3, "of the term that pulls primitives to points"),
    Setting("steepest", float, 8.0, 1.0, "of the connections' sigmoid at the end"),
    Setting("power", float, 8.0, 0.0, "of the soft layers' means; 0: softmax of --temperature"),
    Setting("temperature", float, 20.0, 20.0, "of the soft layers, if the power is 0"),
)
VALIDATED = 200  # clouds that are scored after every epoch


def add_options(parser: argparse.ArgumentParser) -> None:
    """Which clouds, and which parts of the network differ from the default."""
    parser.add_argument("--source", help="whose solids (default: all that were made)")
    parser.add_argument("--category", help="only solids of this category, such as chair (default: all)")
    parser.add_argument(
        "--head", choices=HEADS, default=HEADS[0], help="of the intersections (default: %(default)s)"
    )
    parser.add_argument(
        "--pull", choices=PULLS, default=PULLS[0], help="the loss's second term (default: %(default)s)"
    )
    parser.add_argument("--no_complement", action="store_true", help="no primitive is complemented")


def folder(options: argparse.Namespace) -> Path:
    """runs/stump-net or runs/stump-net-CATEGORY"""
    return Path("runs") / "-".join(filter(None, ["stump-net", options.category]))


def job(options: argparse.Namespace) -> Job:
    """CSG-Stump Net on the training clouds; some of validation are scored after every epoch."""
    names = ("epochs", "batch", "rate", "warmup", "last", "clip", "seed")
    schedule = Schedule(**{name: getattr(options, name) for name in names})
    train = solid_clouds(options.source, "train").select(category=options.category)
    others = solid_clouds(options.source, "val").select(category=options.category)
    if not len(train) or not len(others):
        found = f"there are {len(train)} clouds to learn from, {len(others)} to test"
        raise DataError(f"{found}, category {options.category}; expected some of both")
    others = others.rows(range(0, len(others), -(-len(others) // VALIDATED)))
    torch.manual_seed(options.seed)
    try:
        config, lesson = _config(options), _lesson(options)
        network = StumpNet(config)
    except ValueError as error:
        raise TrainingError(str(error)) from error
    about = {
        "data": digest(train), "network": asdict(config), "lesson": asdict(lesson), "precision": options.precision,
    }  # fmt: skip
    return Job(StumpTask(Student(network, lesson), train, others, about), schedule, network, train.describe())


def _config(options: argparse.Namespace) -> StumpNetConfig:
    sizes = (options.primitives, options.nodes)
    config = StumpNetConfig(*sizes) if options.paper else StumpNetConfig.compact(*sizes)
    return replace(config, head=options.head, complement=not options.no_complement)


def _lesson(options: argparse.Namespace) -> Lesson:
    means = (options.power, None) if options.power else (None, options.temperature)
    return Lesson(options.points, options.queries, options.pull, options.weight, options.steepest, *means)


def digest(clouds: SolidSet) -> str:
    """Names the clouds and their order."""
    total = hashlib.sha256("\n".join(clouds.ids).encode())
    total.update(clouds.points.numpy().tobytes())
    total.update(clouds.queries.numpy().tobytes())
    return total.hexdigest()[:16]


COMMAND = Command(
    "CSG-Stump Net, which reads point clouds and writes stumps", SETTINGS, add_options, job, folder
)
