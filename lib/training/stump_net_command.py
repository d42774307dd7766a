"""python -m lib.training stump_net [options]: CSG-Stump Net, on point clouds of solids; see `stump_net`."""

import argparse
from functools import partial

import torch

from ..models.stump_net import HEADS, MADE_OF, StumpNet, StumpNetConfig
from . import solids_command
from .commands import Command, Job, Setting
from .loop import TrainingError
from .stump_net import CONNECTIONS, PULLS, StumpLesson, StumpStudent

SETTINGS = (
    *solids_command.LOOP,
    Setting("primitives", int, 64, 256, "K, as many of each kind"),
    Setting("nodes", int, 64, 256, "C"),
    Setting("weight", float, 1e-3, 1e-3, "of the term that pulls primitives to points"),
    Setting("dullest", float, 10.0, 150.0, "of the surfaces' sigmoid at the beginning"),
    Setting("power", float, 8.0, 0.0, "of the soft layers' means; 0: softmax of --temperature"),
    Setting("temperature", float, 20.0, 20.0, "of the soft layers, if the power is 0"),
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Which clouds, and which parts of the network differ from the default."""
    solids_command.add_options(parser)
    parser.add_argument(
        "--kinds",
        nargs="+",
        choices=MADE_OF,
        metavar="KIND",
        help="of primitives (default: box cylinder sphere cone)",
    )
    parser.add_argument(
        "--head", choices=HEADS, default=HEADS[0], help="of the intersections (default: %(default)s)"
    )
    parser.add_argument(
        "--pull", choices=PULLS, default=PULLS[0], help="the loss's second term (default: %(default)s)"
    )
    parser.add_argument(
        "--connections",
        choices=CONNECTIONS,
        default=CONNECTIONS[0],
        help="while it learns (default: %(default)s)",
    )
    parser.add_argument("--no_complement", action="store_true", help="no primitive is complemented")


def job(options: argparse.Namespace) -> Job:
    """CSG-Stump Net on the training clouds."""
    train = solids_command.clouds_of(options, "train")
    torch.manual_seed(options.seed)
    try:
        lesson = _lesson(options)
        student = StumpStudent(StumpNet(_config(options)), lesson)
    except (ValueError, TypeError, RuntimeError) as error:  # the others for more weights than memory
        raise TrainingError(str(error).splitlines()[0]) from error
    return solids_command.solid_job(options, train, student, lesson)


def _config(options: argparse.Namespace) -> StumpNetConfig:
    sizes = (options.primitives, options.nodes)
    given = {"head": options.head, "complement": not options.no_complement, "points": options.points}
    if options.kinds:
        given["kinds"] = tuple(options.kinds)
    base = StumpNetConfig if options.paper else StumpNetConfig.compact
    return base(*sizes, **given)


def _lesson(options: argparse.Namespace) -> StumpLesson:
    means = {"power": options.power} if options.power else {"power": None, "temperature": options.temperature}
    names = ("queries", "pull", "weight", "connections", "dullest")
    return StumpLesson(**{name: getattr(options, name) for name in names}, **means)


COMMAND = Command(
    "CSG-Stump Net, which reads point clouds and writes stumps",
    SETTINGS,
    add_options,
    job,
    partial(solids_command.folder, "stump-net"),
)
