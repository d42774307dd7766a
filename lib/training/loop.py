"""One training loop for every network here: on a CPU, a GPU, or several processes, resumable to the last bit.

A `Task` says what is learnt: a network, the batches of an epoch, the loss of a batch. `fit` does the rest: Adam, a
schedule of its rate, a progress bar, a log line an epoch, a checkpoint an epoch. All randomness is drawn from (seed,
epoch, batch, process), never from what happened before, so a run that was killed and started again ends with the same
weights, bit for bit, as one that never stopped (on the same CPU, with the same number of threads and processes).

Several processes share each batch: process r of n takes items r, r + n, … of it. Gradients are averaged over processes,
each loss weighted by its share of the batch, so that the step is that of the whole batch, also where shares differ.
"""

import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from lightning_fabric import Fabric
from torch import Tensor, nn
from tqdm import tqdm

from .checkpoints import Checkpoint, read_checkpoint, write_checkpoint

EPSILON = 1e-6  # of Adam, as in the ShapeAssembly authors' program
CHECKPOINT, LOG = "checkpoint.safetensors", "log.jsonl"  # what a run keeps in its folder
SHOW_EVERY = 10  # batches
LARGEST_SEED = 2**63 - 1  # that torch takes
LARGEST_RATE = 1e6  # Adam moves a weight about so far in a step: more is a slip of the keyboard


class TrainingError(RuntimeError):
    """A training that cannot begin or go on; the message says why, and what to try."""


@dataclass(frozen=True)
class Schedule:
    """How long and how fast a network learns.

    epochs   passes over the data
    batch    items a step, over all processes
    rate     Adam's learning rate at its highest
    warmup   share of the steps in which the rate grows from 0 to that
    last     the rate at the end, as a share of the highest, reached along half a cosine; 1 keeps it constant
    clip     largest norm of the gradient; a longer one is shortened to it
    momentum 0: Adam; else plain gradient descent, with this momentum
    seed     of everything random

    Raises TrainingError for numbers that make no sense.
    """

    epochs: int
    batch: int
    rate: float
    warmup: float = 0.0
    last: float = 1.0
    clip: float = math.inf
    seed: int = 0
    momentum: float = 0.0

    def __post_init__(self) -> None:
        for name, least in {"epochs": 1, "batch": 1, "seed": 0}.items():
            if (value := getattr(self, name)) < least:
                raise TrainingError(f"{name} is {value}; expected at least {least}")
        if self.seed > LARGEST_SEED:
            raise TrainingError(f"seed is {self.seed}; expected at most {LARGEST_SEED}")
        if not 0 < self.rate <= LARGEST_RATE:
            raise TrainingError(f"rate is {self.rate}; expected a number above 0, at most {LARGEST_RATE:g}")
        if not self.clip > 0:
            raise TrainingError(f"clip is {self.clip}; expected a number above 0")
        for name in ("warmup", "last", "momentum"):
            if not 0 <= (value := getattr(self, name)) <= 1:
                raise TrainingError(f"{name} is {value}; expected a share from 0 to 1")

    def rate_at(self, progress: float) -> float:
        """The learning rate when a share `progress` of all steps is done."""
        if progress < self.warmup:
            return self.rate * progress / self.warmup
        done = (progress - self.warmup) / (1 - self.warmup) if self.warmup < 1 else 1.0
        return self.rate * (self.last + (1 - self.last) * (1 + math.cos(math.pi * done)) / 2)


@runtime_checkable
class Task(Protocol):
    """What is learnt."""

    network: nn.Module
    about: dict  # JSON: data and settings that must be the same when a run goes on

    def __len__(self) -> int:
        """Number of training items."""

    def loss(
        self, network: nn.Module, picks: Sequence[int], noise: torch.Generator, progress: float
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of some items, and its terms by name for the log; `noise` is what all chance comes from."""

    def report(self, network: nn.Module) -> dict[str, float]:
        """Figures for the log at the end of an epoch, such as the loss on other data."""


def fit(
    task: Task,
    schedule: Schedule,
    folder: Path,
    fabric: Fabric | None = None,
    told: Callable[[dict], None] | None = None,
) -> list[dict]:
    """Train `task.network`; returns the log, one dict an epoch. Goes on from the checkpoint in `folder`, if any.

    fabric  where it runs, launched; if not given, one device: the GPU where there is one
    told    called with the log's line after each epoch, in the first process
    Raises CheckpointError for a checkpoint that is damaged or of another run; TrainingError where there is nothing to
    learn from, or the loss stops being finite (the checkpoint is then that of the epoch before).
    """
    if not len(task):
        raise TrainingError("there is nothing to learn from: no training items")
    fabric = fabric or Fabric(devices=1)
    descent = _optimizer(task.network, schedule)
    network, optimizer = fabric.setup(task.network, descent)
    about = json.loads(json.dumps(task.about | asdict(schedule), default=str))
    log: list[dict] = []
    if (folder / CHECKPOINT).exists():
        log = read_checkpoint(folder / CHECKPOINT, task.network, descent, about).log
    fabric.barrier()  # nobody writes before all have read
    if fabric.is_global_zero:
        for part in folder.glob("half-*.part"):  # a run was killed while it wrote; the folder is one run's
            part.unlink(missing_ok=True)
    run = _Run(task, schedule, fabric, network, optimizer)
    for epoch in range(len(log), schedule.epochs):
        log = [*log, run.epoch(epoch, log[-1] if log else {})]
        if fabric.is_global_zero:
            write_checkpoint(folder / CHECKPOINT, task.network, descent, Checkpoint(about, log))
            _write_log(folder / LOG, log)
            if told:
                told(log[-1])
        fabric.barrier()
    if fabric.is_global_zero:
        _write_log(folder / LOG, log)  # again: a run may have been killed between checkpoint and log
    return log


def _optimizer(network: nn.Module, schedule: Schedule) -> torch.optim.Optimizer:
    weights = list(network.parameters())
    if schedule.momentum:
        return torch.optim.SGD(weights, lr=schedule.rate, momentum=schedule.momentum)
    # Plain Adam: the fused one gives other last bits on other processors.
    return torch.optim.Adam(weights, lr=schedule.rate, eps=EPSILON)


def batches(count: int, schedule: Schedule, epoch: int) -> list[np.ndarray]:
    """Item numbers of an epoch's batches, in a random order that (seed, epoch) decides."""
    order = np.random.default_rng([schedule.seed, epoch]).permutation(count)
    return np.array_split(order, math.ceil(count / schedule.batch))


@dataclass
class _Run:
    task: Task
    schedule: Schedule
    fabric: Fabric
    network: nn.Module
    optimizer: torch.optim.Optimizer

    def epoch(self, epoch: int, before: dict) -> dict:
        """One pass over the data: mean terms of the loss, figures of the task, seconds."""
        start = time.perf_counter()
        self.network.train()
        picks = batches(len(self.task), self.schedule, epoch)
        shown = f"epoch {epoch + 1}/{self.schedule.epochs}"
        hidden = None if self.fabric.is_global_zero else True  # None: where no terminal shows it
        bar = tqdm(picks, desc=shown, disable=hidden, leave=False, dynamic_ncols=True)
        sums: dict[str, Tensor] = {}
        for number, batch in enumerate(bar):
            progress = (epoch + number / len(picks)) / self.schedule.epochs
            terms = self.step(batch, [self.schedule.seed, epoch, number], progress)
            for name, value in terms.items():
                sums[name] = sums.get(name, 0) + value.detach()
            if not bar.disable and number % SHOW_EVERY == 0:
                bar.set_postfix({name: f"{value.item() / (number + 1):.3g}" for name, value in sums.items()})
        means = {name: self.fabric.all_reduce(value).item() / len(picks) for name, value in sums.items()}
        self.network.eval()
        seconds = before.get("seconds", 0.0) + time.perf_counter() - start
        found = means | self.task.report(self.task.network)
        self._check(epoch, found)
        return {"epoch": epoch + 1, **_rounded(found), "seconds": round(seconds, 1)}

    def _check(self, epoch: int, found: dict[str, float]) -> None:
        """The last step of an epoch can spoil weights, and no later loss would tell."""
        wrong = [name for name, value in found.items() if not math.isfinite(value)]
        weights = self.task.network.named_parameters()
        wrong += [name for name, weight in weights if not weight.isfinite().all()]
        if wrong:
            raise TrainingError(
                f"epoch {epoch + 1}: found numbers that are not finite at its end, in {wrong[0]}; expected finite "
                "ones: try a lower rate, or a smaller clip"
            )

    def step(self, batch: np.ndarray, seed: list[int], progress: float) -> dict[str, Tensor]:
        """One update of the weights; each process takes its share of the batch. The terms are weighted by the share."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.schedule.rate_at(progress)
        rank, world = self.fabric.global_rank, self.fabric.world_size
        entropy = int(np.random.SeedSequence([*seed, rank]).generate_state(1)[0])
        own = batch[rank::world]
        weight = len(own) * world / len(batch)  # 0 for a process that is left without an item; 1 if alone
        loss, terms = self._loss(own if len(own) else batch[:1], entropy, progress)
        self.optimizer.zero_grad()
        self.fabric.backward(loss * weight)
        norm = self.fabric.clip_gradients(
            self.network, self.optimizer, max_norm=self.schedule.clip, error_if_nonfinite=False
        )
        if not math.isfinite(loss.item() + norm.item()):
            _seed, epoch, number = seed
            raise TrainingError(
                f"epoch {epoch + 1}, batch {number + 1}: loss {loss.item():.4g}, norm of its gradient "
                f"{norm.item():.4g}; expected finite numbers: try a lower rate, or a smaller clip"
            )
        self.optimizer.step()
        return {name: value * weight for name, value in {"loss": loss, **terms}.items()}

    def _loss(self, picks: np.ndarray, entropy: int, progress: float) -> tuple[Tensor, dict[str, Tensor]]:
        """The task's loss, with all chance from `entropy`: also that of dropout, which has no generator of its own."""
        noise = torch.Generator().manual_seed(entropy)
        device = self.fabric.device
        with torch.random.fork_rng([device] if device.type == "cuda" else []):
            torch.manual_seed(entropy)
            return self.task.loss(self.network, picks, noise, progress)


def _rounded(figures: dict[str, float]) -> dict[str, float]:
    return {name: float(f"{value:.6g}") for name, value in figures.items()}


def _write_log(path: Path, log: list[dict]) -> None:
    write_whole(path, "".join(json.dumps(row) + "\n" for row in log))


def write_whole(path: Path, text: str) -> None:
    """Write a text file in one step: a killed run, or a full disk, never leaves half of it under its name."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
