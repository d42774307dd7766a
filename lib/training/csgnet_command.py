"""python -m lib.training csgnet [--dimensions 2|3] [options]: CSGNet, on random programs; see `csgnet`."""

import argparse
import hashlib
from dataclasses import asdict
from functools import partial
from pathlib import Path

import torch
from jaxtyping import Int
from torch import Tensor

from ..datasets import DataError
from ..datasets.csg import TokenSet, csg_programs
from ..models.csgnet import CSGNet, CSGNetConfig, check_reader
from ..models.weights import load
from .commands import Command, Job, Setting
from .csgnet import Lessons, ParseTask, Teacher
from .csgnet_sharing import share, unshare
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
        "jitter",
        float,
        0.0,
        0.0,
        "share of the pictures of the plane that are moved and stretched a little (authors' program: 1)",
    ),
    Setting(
        "pruned",
        int,
        1,
        0,
        "1: parts of a program that do not change its picture are not taught; 0: they are",
    ),
    Setting(
        "in_order",
        int,
        1,
        0,
        "1: of the ways to say a program one, see interpreters.csg.ordering; 0: as they are",
    ),
    Setting(
        "sharing", int, 1, 0, "1: while it learns, tokens with a number in common share weights; 0: none do"
    ),
)
LESSONS = ("programs", "curriculum", "pruned", "in_order", "jitter")  # settings: what is taught
SCRATCH = "scratch"  # where a network begins that has learned nothing
MOST = 10**8  # programs an epoch
VALIDATED = 1000  # programs that are scored after every epoch


def add_options(parser: argparse.ArgumentParser) -> None:
    """Plane or space, and where to begin."""
    parser.add_argument("--dimensions", type=int, choices=(2, 3), default=2, help="default: 2, the plane")
    # Two names: `fabric run` takes --start for an abbreviation of one of its own options.
    start = f"weights to go on from (default: {SCRATCH!r}, random ones)"
    parser.add_argument("--start", "--begin", metavar="PATH", help=start)


def folder(options: argparse.Namespace) -> Path:
    """runs/csgnet-2d or runs/csgnet-3d"""
    return Path("runs") / f"csgnet-{options.dimensions}d"


def job(options: argparse.Namespace) -> Job:
    """CSGNet on the training programs; some of validation are scored after every epoch."""
    if options.programs > MOST:
        raise TrainingError(f"programs is {options.programs}; expected 1 to {MOST}")
    for name in ("pruned", "in_order", "sharing"):
        if (value := getattr(options, name)) not in (0, 1):
            raise TrainingError(f"{name} is {value}; expected 0 or 1")
    names = ("epochs", "batch", "rate", "warmup", "last", "clip", "seed")
    schedule = Schedule(**{name: getattr(options, name) for name in names})
    programs = csg_programs(options.dimensions, "train")
    others = evenly(csg_programs(options.dimensions, "val"), VALIDATED)
    if not len(programs) or not len(others):
        raise DataError(
            f"there are {len(programs)} programs to learn from, {len(others)} to test; expected some of both"
        )
    torch.manual_seed(options.seed)
    lessons = {name: getattr(options, name) for name in LESSONS}
    network, begun = begin(options, options.dimensions)
    if options.sharing:
        share(network)
    about = lessons | {
        "dimensions": options.dimensions, "data": digest(programs.tokens), "network": asdict(network.config),
        "start": begun, "sharing": options.sharing, "precision": options.precision,
    }  # fmt: skip
    try:
        task = ParseTask(Teacher(network), programs, others, Lessons(**lessons), about)
    except ValueError as error:
        raise TrainingError(str(error)) from error
    ready = partial(unshare, network) if options.sharing else Job.ready
    return Job(task, schedule, network, programs.describe(), ready=ready)


def begin(options: argparse.Namespace, dimensions: int) -> tuple[CSGNet, str]:
    """The network of `--start`, or a new one; and what names its weights. Raises TrainingError, CheckpointError."""
    if options.start in (None, SCRATCH):
        return CSGNet((CSGNetConfig.paper if options.paper else CSGNetConfig.compact)(dimensions)), SCRATCH
    path = Path(options.start)
    network = load(CSGNet, path)
    try:
        check_reader(network, dimensions)
    except ValueError as error:
        raise TrainingError(f"{path}: {error}") from error
    return network, hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def evenly(programs: TokenSet, count: int) -> TokenSet:
    """At most so many of the programs, spread over all, so that lengths keep their shares."""
    some = spread(len(programs), count)
    return TokenSet(programs.tokens[some], programs.vocabulary, programs.source, programs.name)


def spread(total: int, count: int) -> Int[Tensor, " some"]:
    """Places of at most `count` of `total` things, spread evenly from the first on."""
    count = min(count, total)
    return torch.arange(count) * total // max(1, count)


def digest(data: Tensor) -> str:
    """Names what is learned from, programs or pictures, and its order."""
    return hashlib.sha256(data.numpy().data).hexdigest()[:16]


COMMAND = Command("CSGNet, which reads shapes and writes CSG programs", SETTINGS, add_options, job, folder)
