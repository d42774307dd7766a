"""python -m lib.training csgnet_reinforce [options]: a trained CSGNet goes on without a teacher; see `reinforce`."""

import argparse
from pathlib import Path

import torch
from jaxtyping import Bool
from torch import Tensor

from ..datasets import DataError, silhouettes
from ..datasets.csg import csg_programs
from ..interpreters.csg import execute_many
from ..models.csgnet import CSGNetConfig
from ..models.pretrained import pretrained
from .commands import Command, Job, Setting
from .csgnet_command import SCRATCH, begin, digest, evenly, spread
from .loop import Schedule, TrainingError
from .reinforce import BASELINES, Actor, ReinforceTask

SYNTHETIC = "synthetic"
PICTURES = 20_000  # of random programs, to learn from
SETTINGS = (
    Setting("epochs", int, 8, 100, "passes over the pictures"),
    Setting("batch", int, 64, 3000, "pictures a step"),
    Setting("samples", int, 16, 1, "programs drawn for each picture"),
    Setting("rate", float, 2e-4, 0.01, "the learning rate at its highest"),
    Setting("momentum", float, 0.0, 0.9, "of gradient descent; 0: Adam"),
    Setting("warmup", float, 0.02, 0.0, "share of the steps in which the rate grows from 0"),
    Setting("last", float, 0.05, 1.0, "the rate at the end, as a share of the highest"),
    Setting("clip", float, 1.0, 10.0, "largest norm of the gradient"),
    Setting("power", float, 20, 20, "of the reward"),
    Setting("grammar", int, 1, 0, "1: draw only programs that can be executed"),
)
VALIDATED = 500  # pictures that are scored after every epoch


def add_options(parser: argparse.ArgumentParser) -> None:
    """Where to begin, and from which pictures to learn."""
    start = f"weights to begin with (default: those that come with the project), or {SCRATCH!r}"
    # Two names: `fabric run` takes --start for an abbreviation of one of its own options.
    parser.add_argument("--start", "--begin", metavar="PATH", help=start)
    sources = (
        f"whose silhouettes (default: all that were made), or {SYNTHETIC!r}: pictures of random programs"
    )
    parser.add_argument("--source", help=sources)
    told = "what is subtracted from rewards (default: the paper's running average)"
    parser.add_argument("--baseline", choices=BASELINES, default=BASELINES[0], help=told)


def folder(options: argparse.Namespace) -> Path:
    """runs/csgnet-reinforce or runs/csgnet-reinforce-scratch"""
    return Path("runs") / ("csgnet-reinforce" + (f"-{SCRATCH}" if options.start == SCRATCH else ""))


def job(options: argparse.Namespace) -> Job:
    """REINFORCE on the training silhouettes; some of validation are scored after every epoch."""
    if options.grammar not in (0, 1):
        raise TrainingError(f"grammar is {options.grammar}; expected 0 or 1")
    names = ("epochs", "batch", "rate", "warmup", "last", "clip", "seed", "momentum")
    schedule = Schedule(**{name: getattr(options, name) for name in names})
    images, told = _pictures(options.source, "train", None)
    others, _ = _pictures(options.source, "val", VALIDATED)
    if not len(images) or not len(others):
        raise DataError(
            f"there are {len(images)} pictures to learn from, {len(others)} to test; expected some of both"
        )
    torch.manual_seed(options.seed)
    if options.start is None:
        options.start = str(pretrained("csgnet_2d"))
    network, begun = begin(options, dimensions=2)
    if options.paper and network.config != CSGNetConfig.paper(2):
        raise TrainingError(
            f"{options.start}: found weights of other sizes than the paper's; expected, with --paper, --start with "
            "those of `python -m lib.training csgnet --paper`"
        )
    about = {
        "data": digest(images), "start": begun, "samples": options.samples, "baseline": options.baseline,
        "power": options.power, "grammar": options.grammar, "precision": options.precision,
    }  # fmt: skip
    try:
        task = ReinforceTask(
            Actor(network), images, others, options.samples, options.baseline,
            options.power, bool(options.grammar), about,
        )  # fmt: skip
    except ValueError as error:
        raise TrainingError(str(error)) from error
    return Job(task, schedule, network, told)


def _pictures(source: str | None, split: str, most: int | None) -> tuple[Bool[Tensor, "n 64 64"], str]:
    """At most so many silhouettes, spread over all, or pictures of random programs; and a sentence about them."""
    if source == SYNTHETIC:
        programs = evenly(csg_programs(2, split), most or PICTURES)
        return execute_many(programs.tokens).images, f"Pictures of {programs.describe()}"
    masks = silhouettes(source, split)
    return masks.images[spread(len(masks), most or len(masks))], masks.describe()


COMMAND = Command(
    "CSGNet on pictures without programs: it tries, and is rewarded for likeness",
    SETTINGS,
    add_options,
    job,
    folder,
)
