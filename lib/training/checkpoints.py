"""A run that was stopped, on disk: weights, Adam's moments, settings and log in one safetensors file, no pickles.

The file is written whole under another name and then renamed: a run that is killed leaves the last checkpoint or the
one before, never half of one.
"""

import json
import os
from dataclasses import dataclass
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from ..models.weights import CheckpointError

KIND = "shape-programs training run"


@dataclass(frozen=True)
class Checkpoint:
    """about: data and settings of the run, JSON; log: one dict for each epoch that is done."""

    about: dict
    log: list[dict]


def write_checkpoint(
    path: Path, network: nn.Module, optimizer: torch.optim.Optimizer, checkpoint: Checkpoint
) -> None:
    """Put a run at the end of an epoch on disk."""
    path.parent.mkdir(parents=True, exist_ok=True)
    tensors = {f"network.{name}": value for name, value in network.state_dict().items()}
    tensors |= _moments(network, optimizer)
    texts = {"kind": KIND, "about": json.dumps(checkpoint.about), "log": json.dumps(checkpoint.log)}
    part = path.with_name(f"half-{os.getpid()}.part")
    try:
        save_file({name: value.detach().cpu().contiguous() for name, value in tensors.items()}, part, texts)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def read_checkpoint(
    path: Path, network: nn.Module, optimizer: torch.optim.Optimizer, about: dict
) -> Checkpoint:
    """Put network and optimizer into the state of a checkpoint.

    Raises CheckpointError for a damaged file and for one of a run with other data or settings than `about`.
    """
    texts, tensors = _read(path)
    was, log = json.loads(texts["about"]), json.loads(texts["log"])
    if other := [key for key in {*was, *about} if was.get(key) != about.get(key)]:
        changes = ", ".join(f"{key}: {was.get(key)!r} then, {about.get(key)!r} now" for key in sorted(other))
        raise CheckpointError(f"{path} belongs to another run ({changes}); choose another --out, or remove it")
    weights = {
        name.removeprefix("network."): value for name, value in tensors.items() if name.startswith("network.")
    }
    try:
        network.load_state_dict(weights)
        _restore(network, optimizer, tensors)
    except (RuntimeError, KeyError) as error:
        raise CheckpointError(f"{path} does not fit the network ({error})") from error
    return Checkpoint(was, log)


def _read(path: Path) -> tuple[dict[str, str], dict[str, Tensor]]:
    try:
        with safe_open(path, "pt") as file:
            texts = file.metadata() or {}
            if texts.get("kind") != KIND:
                raise CheckpointError(f"{path} is no checkpoint of a training run")
            return texts, {name: file.get_tensor(name) for name in file.keys()}
    except (SafetensorError, OSError) as error:
        raise CheckpointError(f"{path} is damaged ({error}); remove it to begin anew") from error


def _moments(network: nn.Module, optimizer: torch.optim.Optimizer) -> dict[str, Tensor]:
    """Adam's step counts and running means, by the names of the weights they belong to."""
    found = {}
    for name, weight in network.named_parameters():
        for key, value in optimizer.state.get(weight, {}).items():
            found[f"adam.{key}.{name}"] = value
    return found


def _restore(network: nn.Module, optimizer: torch.optim.Optimizer, tensors: dict[str, Tensor]) -> None:
    for name, weight in network.named_parameters():
        kept = {key: tensors.get(f"adam.{key}.{name}") for key in ("step", "exp_avg", "exp_avg_sq")}
        if kept["step"] is not None:
            state = {key: value if key == "step" else value.to(weight) for key, value in kept.items()}
            optimizer.state[weight] = state
