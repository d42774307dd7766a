"""python -m lib.training program_vae --category chair --epochs 120 --out runs/chair

The paper trains on one program at a time, with a rate of 0.0001 (`--paper`). Without that: batches, at a higher
rate that falls along half a cosine, which is the same model in a fraction of the time. The authors stopped after
120 epochs (chair, storage) and 80 (table). Their weight of 0.1 for the KL term is 0.2 here: see `program_loss`.

OUT/program_vae_codes.safetensors   at the end: where the codes of the training programs lie, a `CodeDistribution`

One thread is the default: the matrices are small, and threads that share busy cores wait for one another at each of
them.
"""

import argparse
import math
from dataclasses import asdict
from pathlib import Path

import torch

from ..datasets import CATEGORIES, shapeassembly
from ..extractor.rewriting import ABLATIONS
from ..models.code_distribution import CodeDistribution
from ..models.program_vae import ProgramVAE
from .commands import Command, Job, Setting
from .loop import Schedule, TrainingError
from .program_loss import LossWeights
from .program_tables import table_of
from .program_vae import ProgramTask, ReadAndWrite

SETTINGS = (
    Setting("epochs", int, 120, 120, "passes over the programs"),
    Setting("batch", int, 32, 1, "programs a step"),
    Setting("rate", float, 1e-3, 1e-4, "Adam's learning rate at its highest"),
    Setting("warmup", float, 0.02, 0.0, "share of the steps in which the rate grows from 0"),
    Setting("last", float, 0.01, 1.0, "the rate at the end, as a share of the highest"),
    Setting("clip", float, 1000.0, math.inf, "largest norm of the gradient"),
    Setting("kl", float, 0.2, 0.2, "weight of the KL term"),
    Setting("annealing", float, 0.0, 0.0, "share of the steps in which that weight grows from 0"),
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Which programs."""
    parser.add_argument("--category", choices=CATEGORIES, default="chair", help="default: chair")
    parser.add_argument("--ablation", choices=ABLATIONS, help="programs rewritten without this (paper, 7.1)")
    parser.add_argument("--limit", type=int, metavar="N", help="only the first N training programs")


def folder(options: argparse.Namespace) -> Path:
    """runs/chair, runs/chair-flat, …"""
    return Path("runs") / "-".join(filter(None, [options.category, options.ablation]))


def job(options: argparse.Namespace) -> Job:
    """The program VAE on the training programs; those of validation are scored after every epoch."""
    if options.limit is not None and options.limit < 1:
        raise TrainingError(f"limit is {options.limit}; expected at least 1")
    if not 0 <= options.annealing <= 1 or not 0 <= options.kl < math.inf:
        raise TrainingError(
            f"annealing is {options.annealing}, kl {options.kl}; expected a share from 0 to 1, and 0 or more"
        )
    names = ("epochs", "batch", "rate", "warmup", "last", "clip", "seed")
    schedule = Schedule(**{name: getattr(options, name) for name in names})
    programs = shapeassembly(options.category, "train", options.ablation)[: options.limit]
    others = shapeassembly(options.category, "val", options.ablation)
    torch.manual_seed(options.seed)
    network = ProgramVAE()
    weights = LossWeights(kl=options.kl)
    about = {
        "category": options.category, "ablation": options.ablation, "programs": len(programs),
        "data": programs.digest()[:16], "network": asdict(network.config),
        "weights": asdict(weights), "annealing": options.annealing,
    }  # fmt: skip
    other = table_of(others) if len(others) else None
    task = ProgramTask(ReadAndWrite(network), table_of(programs), other, weights, options.annealing, about)

    def keep_codes(path: Path) -> None:
        if len(programs) > 1:  # one has no covariance
            CodeDistribution.of(network, list(programs)).save(
                path.with_name(f"{path.stem}_codes.safetensors")
            )

    return Job(task, schedule, network, programs.describe(), keep_codes)


COMMAND = Command(
    "the program VAE, which reads and writes ShapeAssembly programs", SETTINGS, add_options, job, folder
)
