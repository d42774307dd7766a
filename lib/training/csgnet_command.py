"""python -m lib.training csgnet [--dimensions 2|3] [options]: CSGNet, on random programs; see `csgnet`."""

import argparse
import hashlib
from dataclasses import asdict
from pathlib import Path

import torch

from ..datasets.csg import TokenSet, csg_programs
from ..models.csgnet import CSGNet, CSGNetConfig
from .commands import Command, Job, Setting
from .csgnet import ParseTask, Teacher
from .loop import Schedule, TrainingError

SETTINGS = (
    Setting("epochs", int, 60, 250, "passes over so many programs as --programs says"),
    Setting("programs", int, 40_000, 40_000, "programs an epoch"),
    Setting("batch", int, 128, 100, "programs a step"),
    Setting("rate", float, 1e-3, 1e-3, "Adam's learning rate at its highest"),
    Setting("warmup", float, 0.02, 0.0, "share of the steps in which the rate grows from 0"),
    Setting("last", float, 0.01, 0.01, "the rate at the end, as a share of the highest"),
    Setting("clip", float, 1.0, 10.0, "largest norm of the gradient"),
    Setting(
        "curriculum", float, 0.0, 0.0, "share of the steps in which the longest programs grow to all lengths"
    ),
    Setting(
        "in_order", int, 1, 0, "1: operands of unions and intersections in a fixed order; 0: as they are"
    ),
)
VALIDATED = 1000  # programs that are scored after every epoch


def add_options(parser: argparse.ArgumentParser) -> None:
    """Plane or space."""
    parser.add_argument("--dimensions", type=int, choices=(2, 3), default=2, help="default: 2, the plane")


def folder(options: argparse.Namespace) -> Path:
    """runs/csgnet-2d or runs/csgnet-3d"""
    return Path("runs") / f"csgnet-{options.dimensions}d"


def job(options: argparse.Namespace) -> Job:
    """CSGNet on the training programs; some of validation are scored after every epoch."""
    if not 0 <= options.curriculum <= 1 or options.programs < 1:
        raise TrainingError(
            f"curriculum is {options.curriculum}, programs {options.programs}; "
            "expected a share from 0 to 1, and 1 or more"
        )
    names = ("epochs", "batch", "rate", "warmup", "last", "clip", "seed")
    schedule = Schedule(**{name: getattr(options, name) for name in names})
    programs = csg_programs(options.dimensions, "train")
    others = evenly(csg_programs(options.dimensions, "val"), VALIDATED)
    torch.manual_seed(options.seed)
    config = (CSGNetConfig.paper if options.paper else CSGNetConfig.compact)(options.dimensions)
    network = CSGNet(config)
    about = {
        "dimensions": options.dimensions, "data": digest(programs), "network": asdict(config),
        "programs": options.programs, "curriculum": options.curriculum, "in_order": options.in_order,
        "precision": options.precision,
    }  # fmt: skip
    task = ParseTask(
        Teacher(network),
        programs,
        others,
        options.programs,
        options.curriculum,
        bool(options.in_order),
        about,
    )
    return Job(task, schedule, network, programs.describe())


def evenly(programs: TokenSet, count: int) -> TokenSet:
    """At most so many of the programs, taken at equal steps, so that lengths keep their shares."""
    return programs[:: max(1, len(programs) // count)][:count]


def digest(programs: TokenSet) -> str:
    """Names the programs and their order."""
    return hashlib.sha256(programs.tokens.numpy().data).hexdigest()[:16]


COMMAND = Command("CSGNet, which reads shapes and writes CSG programs", SETTINGS, add_options, job, folder)
