"""python -m lib.training ucsg [options]: CSG-Stump Net's rival in the manner of UCSG-Net; see `ucsg`."""

import argparse
from functools import partial

import torch

from ..models.ucsg import UCSG, UCSGConfig
from . import solids_command
from .commands import Command, Job, Setting
from .loop import TrainingError
from .ucsg import UCSGLesson, UCSGStudent

SETTINGS = (
    *solids_command.LOOP,
    Setting("each", int, 32, 32, "primitives of each kind, boxes and balls"),
    Setting("layers", int, 5, 5, "of choices"),
    Setting("nodes", int, 12, 12, "of each layer but the last"),
)


def job(options: argparse.Namespace) -> Job:
    """The network on the training clouds."""
    train = solids_command.clouds_of(options, "train")
    torch.manual_seed(options.seed)
    try:
        lesson = UCSGLesson(options.points, options.queries)
        student = UCSGStudent(UCSG(UCSGConfig(options.each, options.layers, options.nodes)), lesson)
    except (ValueError, TypeError, RuntimeError) as error:  # the others for more weights than memory
        raise TrainingError(str(error).splitlines()[0]) from error
    return solids_command.solid_job(options, train, student, lesson)


COMMAND = Command(
    "a rival of CSG-Stump Net in the manner of UCSG-Net",
    SETTINGS,
    solids_command.add_options,
    job,
    partial(solids_command.folder, "ucsg"),
)
