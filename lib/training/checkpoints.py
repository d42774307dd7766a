"""A training that was stopped, on disk: weights, optimizer's moments, settings and log, by `lib.models.weights.write`.

The file is written whole under another name and then renamed: a run that is killed leaves the last checkpoint or the
one before, never half of one.
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from ..models.weights import CheckpointError, read, write

KIND = "training run"
NETWORK = "network"  # what the names of its arrays begin with; those of an optimizer begin with its name
# What an optimizer keeps for each weight, by torch's names: Adam the steps taken, running means of gradient and square.
MOMENTS = {"adam": ("step", "exp_avg", "exp_avg_sq"), "sgd": ("momentum_buffer",)}


@dataclass(frozen=True)
class Checkpoint:
    """about: data and settings of the run, JSON; log: one dict for each epoch that is done."""

    about: dict
    log: list[dict]


def write_checkpoint(
    path: Path, network: nn.Module, optimizer: torch.optim.Optimizer, checkpoint: Checkpoint
) -> None:
    """Put a run at the end of an epoch on disk."""
    tensors = {f"{NETWORK}.{name}": value for name, value in network.state_dict().items()}
    for name, weight in network.named_parameters():
        for moment, value in optimizer.state.get(weight, {}).items():
            tensors[f"{_kind(optimizer)}.{moment}.{name}"] = value
    facts = {"about": checkpoint.about, "log": checkpoint.log}
    write(path, tensors, KIND, facts | {"told": _digest(facts)})


def read_checkpoint(
    path: Path, network: nn.Module, optimizer: torch.optim.Optimizer, about: dict
) -> Checkpoint:
    """Put network and optimizer into the state of a checkpoint.

    Raises CheckpointError for a file that is damaged or foreign, and for one of a run with other data, settings or
    arrays; network and optimizer are then as they were.
    """
    try:
        tensors, facts = read(path, KIND)
        checkpoint = _told(path, facts)
        _same_run(path, checkpoint.about, about)
        _check(path, tensors, _expected(network, _kind(optimizer), tensors))
    except CheckpointError as error:
        raise CheckpointError(f"{error}. Choose another folder, or remove the file to begin anew") from error
    state = network.state_dict()
    network.load_state_dict({name: tensors[f"{NETWORK}.{name}"] for name in state})
    kind = _kind(optimizer)
    for name, weight in network.named_parameters():
        if f"{kind}.{MOMENTS[kind][0]}.{name}" in tensors:  # else it has not been used yet
            kept = {moment: tensors[f"{kind}.{moment}.{name}"] for moment in MOMENTS[kind]}
            # Adam keeps its step counts on the CPU, wherever the weights are.
            optimizer.state[weight] = {
                moment: value if moment == "step" else value.to(weight) for moment, value in kept.items()
            }
    return checkpoint


def _kind(optimizer: torch.optim.Optimizer) -> str:
    return type(optimizer).__name__.lower()


def _told(path: Path, facts: dict) -> Checkpoint:
    about, log = facts.get("about"), facts.get("log")
    rows = log if isinstance(log, list) else [None]
    numbered = [row.get("epoch") if isinstance(row, dict) else None for row in rows]
    if not isinstance(about, dict) or numbered != list(range(1, len(rows) + 1)):
        raise CheckpointError(
            f"{path}: is damaged: found no settings, or no log of epochs 1, 2, … in its header"
        )
    if facts.get("told") != _digest({"about": about, "log": log}):
        raise CheckpointError(f"{path}: is damaged: its settings and log are not those that were written")
    return Checkpoint(about, log)


def _digest(facts: dict) -> str:
    """Of settings and log: that of the arrays does not tell when these change."""
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def _same_run(path: Path, was: dict, now: dict) -> None:
    if other := _differing(was, now):
        (was, now) = (
            {name: value for key in other for name, value in _parts(key, each)} for each in (was, now)
        )
        changes = ", ".join(
            f"{key}: {was.get(key)!r} then, {now.get(key)!r} now" for key in _differing(was, now)
        )
        raise CheckpointError(f"{path}: belongs to another run ({changes})")


def _expected(network: nn.Module, kind: str, found: dict[str, Tensor]) -> dict[str, Tensor]:
    """What the arrays should be like: weights, and all moments of each weight that has one."""
    expected = {f"{NETWORK}.{name}": value for name, value in network.state_dict().items()}
    for name, weight in network.named_parameters():
        names = {moment: f"{kind}.{moment}.{name}" for moment in MOMENTS[kind]}
        if any(each in found for each in names.values()):
            expected |= {
                each: torch.zeros(()) if moment == "step" else weight for moment, each in names.items()
            }
    return expected


def _check(path: Path, found: dict[str, Tensor], expected: dict[str, Tensor]) -> None:
    """The same names, and under each the same shape and type, and finite numbers."""
    for name in sorted({*found, *expected}):
        have, want = (_described(tensors.get(name)) for tensors in (found, expected))
        if have != want:
            raise CheckpointError(f"{path}: found {have} as {name!r}; expected {want}")
        if not found[name].isfinite().all():
            raise CheckpointError(f"{path}: found numbers that are not finite in {name!r}")


def _described(tensor: Tensor | None) -> str:
    return "nothing" if tensor is None else f"{str(tensor.dtype)[6:]} {tuple(tensor.shape)}"


def _differing(was: dict, now: dict) -> list[str]:
    return sorted(key for key in {*was, *now} if was.get(key) != now.get(key))


def _parts(key: str, about: dict) -> list[tuple[str, object]]:
    """A setting, or those that it consists of."""
    value = about.get(key)
    return list(value.items()) if isinstance(value, dict) else [(key, value)]
