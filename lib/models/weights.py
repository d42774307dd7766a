"""A trained network as one file: weights as plain arrays (safetensors), its config as JSON in the header.

    save(network, path)                 network.config is a frozen dataclass of numbers, texts and tuples of these
    save(network, path, half=True)      with 11 binary digits a weight instead of 24: a file half as large
    load(Network, path) -> network      Network(config) builds it

The header's only entry, "shape_programs", is the JSON {"kind": class name, "config": fields, "sha256": of the arrays}:
one entry, because the order of several differs from run to run, and the same weights should be the same bytes. Other
things that are made of arrays, such as the state of a training, use `write` and `read`.
"""

import dataclasses
import hashlib
import json
import os
from pathlib import Path
from typing import TypeVar, get_type_hints

import safetensors
import torch
from safetensors.torch import save as to_bytes
from torch import Tensor, nn

ENTRY = "shape_programs"
Network = TypeVar("Network", bound=nn.Module)


class CheckpointError(RuntimeError):
    """A file that does not hold what was asked for: missing, damaged, foreign, or of another network."""


def save(network: nn.Module, path: Path, half: bool = False) -> None:
    """Write the weights and `network.config`. A killed run never leaves half a file under the real name.

    half  write float32 weights as float16. Raises CheckpointError for weights beyond its largest number, 65504.
    """
    config, tensors = dataclasses.asdict(network.config), network.state_dict()
    if half:
        tensors = {name: _halved(name, tensor) for name, tensor in tensors.items()}
    write(path, tensors, type(network).__name__, {"config": config})


def _halved(name: str, tensor: Tensor) -> Tensor:
    if tensor.dtype != torch.float32:
        return tensor
    if not (halved := tensor.half()).isfinite().all():
        raise CheckpointError(
            f"found {tensor.abs().max():g} in {name!r}; expected at most 65504, to keep as float16"
        )
    return halved


def load(network: type[Network], path: Path, device: torch.device | str = "cpu") -> Network:
    """The network of a file, in evaluation mode. Random numbers drawn later are the same as without loading.

    Raises CheckpointError for a file that is missing, damaged, foreign, or of another network or other shapes, and for
    weights that are not finite, and variances below 0.
    """
    tensors, facts = read(path, network.__name__)
    tensors = {
        name: tensor.float() if tensor.dtype == torch.float16 else tensor for name, tensor in tensors.items()
    }
    if wrong := [name for name, tensor in tensors.items() if not tensor.isfinite().all()]:
        raise CheckpointError(
            f"{path}: found numbers that are not finite in {wrong[0]!r}; expected finite ones"
        )
    if wrong := [
        name for name, tensor in tensors.items() if name.endswith("running_var") and (tensor < 0).any()
    ]:
        raise CheckpointError(f"{path}: found variances below 0 in {wrong[0]!r}; expected some from 0")
    config = _config(network, facts.get("config"), path)
    with torch.device("meta"):  # shapes without memory: a wrong config cannot ask for more than there is
        _check(path, tensors, _build(network, config, path).state_dict())
    with torch.random.fork_rng(devices=[]):
        built = _build(network, config, path)
    built.load_state_dict(tensors)
    return built.to(device).eval()


def write(path: Path, tensors: dict[str, Tensor], kind: str, facts: dict) -> None:
    """Named arrays of one kind, with facts that JSON can hold, as a safetensors file; written in one step."""
    tensors = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in tensors.items()}
    header = {"kind": kind, **facts, "sha256": _digest(tensors)}
    content = to_bytes(tensors, {ENTRY: json.dumps(header, sort_keys=True)})
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"half-{os.getpid()}.part")  # one a process: two may write to one folder
    try:
        part.write_bytes(content)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def read(path: Path, kind: str) -> tuple[dict[str, Tensor], dict]:
    """What `write` wrote: arrays and facts. Raises CheckpointError for anything else, or another kind."""
    if Path(path).is_dir():
        raise CheckpointError(f"{path}: cannot be read (it is a folder; expected a file)")
    try:
        with safetensors.safe_open(path, framework="pt") as file:
            entry = (file.metadata() or {}).get(ENTRY)
            tensors = {name: file.get_tensor(name) for name in file.keys()}
    except OSError as error:
        raise CheckpointError(f"{path}: cannot be read ({error})") from error
    except safetensors.SafetensorError as error:
        found = f"{path}: is damaged, or no safetensors file ({error})"
        raise CheckpointError(found) from error
    facts = _facts(entry, path)
    if facts.get("kind") != kind:
        raise CheckpointError(f"{path}: found weights of kind {facts.get('kind')!r}; expected {kind!r}")
    if facts.get("sha256") != _digest(tensors):
        raise CheckpointError(f"{path}: is damaged: its arrays are not those that were written")
    return tensors, facts


def _facts(entry: str | None, path: Path) -> dict:
    if entry is None:
        raise CheckpointError(f"{path}: was not written by this project (no {ENTRY!r} in its header)")
    try:
        facts = json.loads(entry)
    except (ValueError, RecursionError) as error:
        raise CheckpointError(f"{path}: is damaged: its header is not JSON ({error})") from error
    if not isinstance(facts, dict):
        raise CheckpointError(f"{path}: is damaged: found {facts!r} in its header; expected a JSON object")
    return facts


def _digest(tensors: dict[str, Tensor]) -> str:
    """SHA-256 of names, types, shapes and bytes: a file can be damaged and still have the right lengths."""
    digest = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        digest.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}\n".encode())
        digest.update(tensor.reshape(-1).view(torch.uint8).numpy().data)
    return digest.hexdigest()


def _config(network: type, found: object, path: Path):
    """The config dataclass, which is the annotation of `config` in `Network.__init__`, from its JSON."""
    kind = get_type_hints(network.__init__)["config"]
    expected = sorted(field.name for field in dataclasses.fields(kind))
    if not isinstance(found, dict) or sorted(found) != expected:
        names = sorted(found) if isinstance(found, dict) else found
        raise CheckpointError(f"{path}: found the config {names}; expected {expected} of {kind.__name__}")
    fields = {name: tuple(value) if isinstance(value, list) else value for name, value in found.items()}
    try:
        return kind(**fields)
    except (TypeError, ValueError) as error:
        raise CheckpointError(f"{path}: no {kind.__name__} can be made of {fields} ({error})") from error


def _build(network: type[Network], config, path: Path) -> Network:
    try:
        return network(config)
    except (TypeError, ValueError, RuntimeError) as error:
        raise CheckpointError(f"{path}: no {network.__name__} can be built of {config} ({error})") from error


def _check(path: Path, found: dict[str, Tensor], expected: dict[str, Tensor]) -> None:
    """The same names, and under each the same shape and type."""
    for name in sorted({*found, *expected}):
        have, want = (_described(tensors.get(name)) for tensors in (found, expected))
        if have != want:
            raise CheckpointError(f"{path}: found {have} as {name!r}; expected {want}")


def _described(tensor: Tensor | None) -> str:
    return "nothing" if tensor is None else f"{str(tensor.dtype)[6:]} {tuple(tensor.shape)}"
