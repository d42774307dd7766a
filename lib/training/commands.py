"""What the training commands share: settings, devices, how they end, and the facts kept beside the weights.

OUT/checkpoint.safetensors   the run after its last whole epoch: the same command goes on from it
OUT/log.jsonl                one line an epoch
OUT/NAME.safetensors         at the end: the weights, for lib.models.weights.load
OUT/NAME.json                and how they came to be; what else a network needs lies beside them
"""

import argparse
import datetime
import importlib.metadata
import json
import math
import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from lightning_fabric import Fabric
from torch import nn

from ..datasets import REPOSITORY, DataError
from ..interpreters.shapeassembly import ProgramError
from ..models.weights import CheckpointError, save
from .loop import CHECKPOINT, LARGEST_SEED, Schedule, Task, TrainingError, fit, write_whole

PROGRAM = "python -m lib.training"
TOLD = ("loss", "reward", "val_loss", "val_cd", "val_iou")  # of the figures of an epoch, if it has them
MOST_THREADS = 1024  # PyTorch crashes where it cannot make so many
PRECISIONS = ("32-true", "bf16-mixed")  # as Lightning Fabric names them


@dataclass(frozen=True)
class Setting:
    """A number of a training: its value here, and the paper's (`--paper`); or, where the paper has none, that of the
    authors' program, or one that changes nothing."""

    name: str
    kind: type
    ours: int | float
    papers: int | float
    about: str


@dataclass(frozen=True)
class Job:
    """What a command line asks for.

    network  what is saved in the end
    data     one sentence about what it learned from
    ready    makes the trained network what is to be saved, before it is
    finish   what else belongs to the trained network: told where its weights were saved, writes files beside them
    """

    task: Task
    schedule: Schedule
    network: nn.Module
    data: str
    finish: Callable[[Path], None] = lambda weights: None
    ready: Callable[[], None] = lambda: None


@dataclass(frozen=True)
class Command:
    """A network that can be trained: its own options, its settings, and how options become a job and a folder."""

    about: str
    settings: Sequence[Setting]
    add_options: Callable[[argparse.ArgumentParser], None]
    job: Callable[[argparse.Namespace], Job]
    folder: Callable[[argparse.Namespace], Path]


def main(commands: Mapping[str, Command], arguments: Sequence[str] | None = None) -> int:
    """Train what the command line says; returns 0, 1 for a problem that is told on stderr, 130 after Ctrl-C."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    options = _parser(commands).parse_args(arguments)
    command = commands[options.name]
    for setting in command.settings:
        if getattr(options, setting.name) is None:
            setattr(options, setting.name, setting.papers if options.paper else setting.ours)
    folder = options.out or command.folder(options)
    try:
        _train(command, options, folder, f"{PROGRAM} {shlex.join(arguments)}")
    except (DataError, CheckpointError, TrainingError, ProgramError) as error:
        return _said(f"{type(error).__name__}: {error}", 1)
    except OSError as error:
        return _said(f"TrainingError: a file cannot be read or written: {error}", 1)
    except KeyboardInterrupt:
        kept = (folder / CHECKPOINT).exists()
        goes_on = f"{folder} holds what is finished, and the same command goes on from there"
        return _said(f"stopped; {goes_on if kept else 'no epoch was finished'}", 130)
    return 0


def fabric_of_this_run(precision: str = PRECISIONS[0]) -> Fabric:
    """One device, the GPU where there is one; or what `fabric run` was told, which it passes on in the environment."""
    if "LT_CLI_USED" not in os.environ:
        return Fabric(devices=1, precision=precision)
    if int(os.environ.get("WORLD_SIZE", "1")) > 1 and "LT_STRATEGY" not in os.environ:
        # Not every batch uses all weights (flat programs fill no cuboid), and DDP would wait for their gradients.
        return Fabric(strategy="ddp_find_unused_parameters_true", precision=precision)
    return Fabric(precision=precision)


def _parser(commands: Mapping[str, Command]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=PROGRAM, description="Train a network.")
    names = parser.add_subparsers(dest="name", required=True, metavar="NAME")
    for name, command in commands.items():
        one = names.add_parser(name, help=command.about, description=command.about)
        command.add_options(one)
        for each in command.settings:
            told = f"{each.about} (default {each.ours:g}; with --paper {each.papers:g})"
            one.add_argument(f"--{each.name}", type=each.kind, metavar="N", help=told)
        one.add_argument(
            "--paper", action="store_true", help="the paper's sizes and settings, where none is given"
        )
        one.add_argument("--seed", type=int, default=0, help="of everything random (default 0)")
        one.add_argument("--out", type=Path, help="folder of the run (default: below runs/)")
        one.add_argument("--threads", type=int, default=1, help="CPU threads a process (default 1)")
        one.add_argument(
            "--half", action="store_true", help="keep the trained weights as float16: a file half as large"
        )
        one.add_argument(
            "--precision", choices=PRECISIONS, default=PRECISIONS[0],
            help="of numbers: bf16-mixed is twice as fast where the processor has it (default 32-true)",
        )  # fmt: skip
    return parser


def _train(command: Command, options: argparse.Namespace, folder: Path, line: str) -> None:
    if not 1 <= options.threads <= MOST_THREADS:
        raise TrainingError(f"threads is {options.threads}; expected 1 to {MOST_THREADS}")
    if not 0 <= options.seed <= LARGEST_SEED:  # before networks are made with it
        raise TrainingError(f"seed is {options.seed}; expected 0 to {LARGEST_SEED}")
    torch.set_num_threads(options.threads)
    fabric = fabric_of_this_run(options.precision)
    job = command.job(options)

    def told(row: dict) -> None:
        figures = ", ".join(f"{name} {row[name]:.4g}" for name in TOLD if name in row)
        print(f"epoch {row['epoch']}/{job.schedule.epochs}: {figures}, {row['seconds']:.0f} s", flush=True)

    _check_folder(folder)
    if fabric.is_global_zero:
        print(job.data, flush=True)
    log = fit(job.task, job.schedule, folder, fabric, told)
    if fabric.is_global_zero:
        path = folder / f"{options.name}.safetensors"
        job.ready()
        save(job.network, path, options.half)
        job.finish(path)
        facts = _facts(job, log, fabric, line, options.precision)
        write_whole(path.with_suffix(".json"), json.dumps(facts, indent=2) + "\n")
        print(f"weights: {path}; how they came to be: {path.with_suffix('.json')}")


def _check_folder(folder: Path) -> None:
    """Makes the folder of the run: told before the first epoch, not after. Raises TrainingError for a file there."""
    if folder.exists() and not folder.is_dir():
        raise TrainingError(f"{folder} is a file; expected a folder for the run, or none yet")
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK):
        raise TrainingError(f"{folder} cannot be written to; expected a folder of yours")


def _facts(job: Job, log: list[dict], fabric: Fabric, line: str, precision: str) -> dict:
    """What somebody needs to judge the weights, or to make them again."""
    settings = job.task.about | vars(job.schedule)
    return {
        "network": type(job.network).__name__,
        "weights": sum(weight.numel() for weight in job.network.parameters()),
        "data": job.data,
        "command": line,
        # JSON has no infinity: null is no limit.
        "settings": {name: None if value == math.inf else value for name, value in settings.items()},
        "seed": job.schedule.seed,
        "epochs": len(log),
        "seconds": log[-1]["seconds"],
        "losses": {name: value for name, value in log[-1].items() if name not in ("epoch", "seconds")},
        "machine": {
            "device": torch.cuda.get_device_name() if fabric.device.type == "cuda" else fabric.device.type,
            "processes": fabric.world_size,
            "precision": precision,
            "threads": torch.get_num_threads(),
            "torch": torch.__version__,
        },
        "code": {"version": importlib.metadata.version("shape-programs"), "commit": _commit()},
        "date": datetime.date.today().isoformat(),
    }


def _commit() -> str:
    """The commit of the code, marked if files differ from it."""
    git = ["git", "-C", str(REPOSITORY), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        found = subprocess.run(git, capture_output=True, text=True).stdout.strip()
    except OSError:  # no git here
        found = ""
    return found or "unknown"


def _said(line: str, code: int) -> int:
    print(line, file=sys.stderr)
    return code
