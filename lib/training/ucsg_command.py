"""python -m lib.training ucsg [options]: CSG-Stump Net's rival in the manner of UCSG-Net; see `ucsg`.

--paper takes the numbers of the authors' program, with points where it has voxels (2,048, as CSG-Stump Net), and as
many points of space as the clouds have, up to its 16,384. Adam's betas stay as they are here; the authors' are 0.5 and
0.99.
"""

import argparse
from dataclasses import replace
from functools import partial

import torch

from ..models.ucsg import UCSG, UCSGConfig
from . import solids_command
from .commands import Command, Job, Setting
from .loop import TrainingError
from .ucsg import UCSGLesson, UCSGStudent

PAPERS = {"epochs": 501, "batch": 16, "queries": 16_384}  # where they are not CSG-Stump Net's
PAPER_SIZES = {"widths": (512, 1024, 2048), "neighbours": 20}
SETTINGS = (
    *(replace(each, papers=PAPERS.get(each.name, each.papers)) for each in solids_command.LOOP),
    Setting("each", int, 32, 32, "primitives of each kind, boxes and balls"),
    Setting("layers", int, 5, 5, "of choices"),
    Setting("nodes", int, 12, 12, "of each layer but the last"),
)


def job(options: argparse.Namespace) -> Job:
    """The network on the training clouds."""
    train = solids_command.clouds_of(options, "train")
    torch.manual_seed(options.seed)
    try:
        lesson, sizes = UCSGLesson(options.queries), PAPER_SIZES if options.paper else {}
        config = UCSGConfig(options.each, options.layers, options.nodes, points=options.points, **sizes)
        student = UCSGStudent(UCSG(config), lesson)
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
