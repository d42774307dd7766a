"""What the commands of networks that read point clouds share: which clouds, and the settings of the loop."""

import argparse
import hashlib
from dataclasses import asdict
from pathlib import Path

from torch import nn

from ..datasets import DataError
from ..datasets.solid_clouds import SolidSet, solid_clouds
from .commands import PRECISIONS, Job, Setting
from .loop import Schedule, TrainingError
from .solids import SolidTask, Student

LOOP = (
    Setting("epochs", int, 30, 10_001, "passes over the clouds"),
    Setting("batch", int, 8, 2, "clouds a step"),
    Setting("rate", float, 1e-3, 1e-4, "Adam's learning rate at its highest"),
    Setting("warmup", float, 0.02, 0.0, "share of the steps in which the rate grows from 0"),
    Setting("last", float, 0.02, 1.0, "the rate at the end, as a share of the highest"),
    Setting("clip", float, 1.0, 1e9, "largest norm of the gradient"),
    Setting("points", int, 256, 2048, "of a cloud that are looked at in a step"),
    Setting("queries", int, 512, 2048, "points of space that are asked about in a step"),
)
VALIDATED = 200  # clouds that are scored after every epoch


def add_options(parser: argparse.ArgumentParser) -> None:
    """Which clouds."""
    parser.add_argument("--source", help="whose solids (default: all that were made)")
    parser.add_argument("--category", help="only solids of this category, such as chair (default: all)")


def folder(name: str, options: argparse.Namespace) -> Path:
    """runs/NAME or runs/NAME-CATEGORY"""
    return Path("runs") / "-".join(filter(None, [name, options.category]))


def clouds_of(options: argparse.Namespace, split: str) -> SolidSet:
    """The clouds to learn from, or some of those to score. Raises DataError where there are none."""
    clouds = solid_clouds(options.source, split).select(category=options.category)
    if not len(clouds):
        found = f"there are no {split} clouds of the category {options.category}, source {options.source}"
        raise DataError(f"{found}; expected some")
    return clouds if split == "train" else clouds.rows(range(0, len(clouds), -(-len(clouds) // VALIDATED)))


def solid_job(options: argparse.Namespace, train: SolidSet, student: Student, lesson: object) -> Job:
    """The student on the training clouds; some of validation are scored after every epoch.

    Raises DataError, and TrainingError for a precision that surfaces cannot be placed with, and for more points than
    the clouds have.
    """
    _check_counts(options, train)
    if options.precision != PRECISIONS[0]:
        raise TrainingError(
            f"found the precision {options.precision}; expected {PRECISIONS[0]}: bfloat16 keeps three digits of a "
            "distance, and surfaces are decided by less"
        )
    names = ("epochs", "batch", "rate", "warmup", "last", "clip", "seed")
    schedule = Schedule(**{name: getattr(options, name) for name in names})
    network: nn.Module = student.network
    about = {
        "data": digest(train), "network": asdict(network.config), "lesson": asdict(lesson),
        "precision": options.precision,
    }  # fmt: skip
    task = SolidTask(student, train, clouds_of(options, "val"), about)
    return Job(task, schedule, network, train.describe())


def _check_counts(options: argparse.Namespace, train: SolidSet) -> None:
    for name, there in (("points", train.points.shape[1]), ("queries", train.queries.shape[1])):
        if (asked := getattr(options, name)) > there:
            raise TrainingError(
                f"found --{name} {asked}, and clouds of {there} {name}; expected at most as many"
            )


def digest(clouds: SolidSet) -> str:
    """Names the clouds and their order."""
    total = hashlib.sha256("\n".join(clouds.ids).encode())
    total.update(clouds.points.numpy().tobytes())
    total.update(clouds.queries.numpy().tobytes())
    return total.hexdigest()[:16]
