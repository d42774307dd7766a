"""Weights on disk: what is saved comes back, and whatever else lies there is refused with its reason."""

import json
from dataclasses import dataclass

import pytest
import torch
from safetensors.torch import save_file
from torch import nn

from lib.models.weights import ENTRY, CheckpointError, load, read, save, write


@dataclass(frozen=True)
class TinyConfig:
    widths: tuple[int, ...] = (3, 5)
    name: str = "tiny"

    def __post_init__(self):
        if self.name == "bad":
            raise ValueError("no such name")


class Tiny(nn.Module):
    """A layer and a buffer; one weight is used twice."""

    def __init__(self, config: TinyConfig):
        super().__init__()
        self.config = config
        self.layer = nn.Linear(*config.widths)
        self.again = nn.Linear(*config.widths, bias=False)
        self.again.weight = self.layer.weight
        self.norm = nn.BatchNorm1d(config.widths[1])


class Other(Tiny):
    def __init__(self, config: TinyConfig):
        super().__init__(config)


@pytest.fixture
def network():
    torch.manual_seed(0)
    return Tiny(TinyConfig((4, 2), "zwölf"))


@pytest.fixture
def path(network, tmp_path):
    save(network, tmp_path / "tiny.safetensors")
    return tmp_path / "tiny.safetensors"


def rewrite(path, **changes):
    """The same arrays under a changed header."""
    tensors, facts = read(path, "Tiny")
    facts |= changes
    save_file(tensors, path, {ENTRY: json.dumps(facts)})


def test_what_is_saved_comes_back(network, path):
    loaded = load(Tiny, path)
    assert loaded.config == network.config and not loaded.training
    for name, tensor in network.state_dict().items():
        assert torch.equal(loaded.state_dict()[name], tensor), name


def test_the_same_weights_are_the_same_bytes(network, path, tmp_path):
    save(network, tmp_path / "new" / "again.safetensors")
    assert path.read_bytes() == (tmp_path / "new" / "again.safetensors").read_bytes()
    assert [file.name for file in tmp_path.glob("*.part")] == []


def test_loading_draws_no_random_numbers(path):
    torch.manual_seed(3)
    expected = torch.rand(4)
    torch.manual_seed(3)
    load(Tiny, path)
    assert torch.equal(torch.rand(4), expected)


def test_arrays_of_any_type_and_facts_come_back(tmp_path):
    tensors = {
        "step": torch.tensor(7),
        "none": torch.zeros(0, 3),
        "half": torch.ones(2).half(),
        "t": torch.eye(2).T,
    }
    write(tmp_path / "state", tensors, "state", {"epoch": 3})
    found, facts = read(tmp_path / "state", "state")
    assert facts["epoch"] == 3 and all(torch.equal(found[name], tensors[name]) for name in tensors)


def test_a_write_that_fails_leaves_the_old_file(path):
    before = path.read_bytes()
    with pytest.raises(TypeError):
        write(path, {}, "Tiny", {"config": object()})
    assert path.read_bytes() == before


@pytest.mark.parametrize("name", ["none.safetensors", "."])
def test_a_missing_file_and_a_folder_are_named(tmp_path, name):
    with pytest.raises(CheckpointError, match=str(tmp_path / name)):
        load(Tiny, tmp_path / name)


@pytest.mark.parametrize("keep", [0, 4, 100, -1])
def test_a_file_cut_short_is_refused(path, keep):
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(CheckpointError, match="damaged, or no safetensors file"):
        load(Tiny, path)


def test_a_flipped_bit_is_noticed(path):
    content = bytearray(path.read_bytes())
    content[-3] ^= 1
    path.write_bytes(content)
    with pytest.raises(CheckpointError, match="not those that were written"):
        load(Tiny, path)


@pytest.mark.parametrize("metadata", [None, {"format": "pt"}])
def test_a_foreign_file_is_refused(tmp_path, metadata):
    save_file({"weight": torch.zeros(2)}, tmp_path / "foreign", metadata)
    with pytest.raises(CheckpointError, match="not written by this project"):
        load(Tiny, tmp_path / "foreign")


@pytest.mark.parametrize("entry, told", [("{", "not JSON"), ("[1]", "expected a JSON object")])
def test_a_damaged_header_is_refused(tmp_path, entry, told):
    save_file({"weight": torch.zeros(2)}, tmp_path / "bad", {ENTRY: entry})
    with pytest.raises(CheckpointError, match=told):
        load(Tiny, tmp_path / "bad")


def test_another_network_is_refused(path):
    with pytest.raises(CheckpointError, match="kind 'Tiny'; expected 'Other'"):
        load(Other, path)


@pytest.mark.parametrize(
    "config, told",
    [
        (None, "found the config None"),
        ({"widths": [4, 2]}, "expected .'name', 'widths'."),
        (
            {"widths": [4, 3], "name": ""},
            r"found float32 \(2, 4\) as 'again.weight'; expected float32 \(3, 4\)",
        ),
        ({"widths": [4, -2], "name": ""}, "no Tiny can be built"),
        ({"widths": "many", "name": ""}, "no Tiny can be built"),
        ({"widths": [4, 2], "name": "bad"}, "no such name"),
        ({"widths": [4, 10**12], "name": ""}, "expected float32"),
    ],
)
def test_a_config_that_does_not_fit_is_refused(path, config, told):
    rewrite(path, config=config)
    with pytest.raises(CheckpointError, match=told):
        load(Tiny, path)


def test_missing_and_surplus_arrays_are_named(path, network):
    tensors = network.state_dict() | {"surplus": torch.zeros(1)}
    write(path, tensors, "Tiny", {"config": {"widths": [4, 2], "name": ""}})
    with pytest.raises(CheckpointError, match="'surplus'; expected nothing"):
        load(Tiny, path)
    del tensors["surplus"], tensors["norm.weight"]
    write(path, tensors, "Tiny", {"config": {"widths": [4, 2], "name": ""}})
    with pytest.raises(CheckpointError, match="found nothing as 'norm.weight'"):
        load(Tiny, path)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_weights_that_are_not_finite_are_refused(network, path, value):
    with torch.no_grad():
        network.layer.bias[1] = value
    save(network, path)
    with pytest.raises(CheckpointError, match="not finite in 'layer.bias'; expected finite ones"):
        load(Tiny, path)


def test_variances_below_0_are_refused(network, path):
    network.norm.running_var[0] = -1
    save(network, path)
    with pytest.raises(
        CheckpointError, match="variances below 0 in 'norm.running_var'; expected some from 0"
    ):
        load(Tiny, path)


def test_half_of_the_digits_and_half_of_the_bytes(network, path, tmp_path):
    """float16 has 11 binary digits: a weight comes back with a relative error below 2^-11, as float32."""
    with torch.no_grad():
        network.layer.weight.copy_(torch.rand_like(network.layer.weight) + 0.5)
    save(network, tmp_path / "half.safetensors", half=True)
    found = load(Tiny, tmp_path / "half.safetensors").layer.weight
    assert found.dtype == torch.float32
    error = (found / network.layer.weight - 1).abs()
    assert 0 < error.max() < 2**-11
    stored = read(tmp_path / "half.safetensors", "Tiny")[0]
    assert stored["layer.weight"].dtype == torch.float16
    assert stored["norm.num_batches_tracked"].dtype == torch.int64  # a count stays what it is


def test_weights_too_large_for_half_the_digits(network, tmp_path):
    network.layer.bias.data[0] = 70000.0
    with pytest.raises(CheckpointError, match="found 70000 in 'layer.bias'; expected at most 65504"):
        save(network, tmp_path / "half.safetensors", half=True)
    assert not list(tmp_path.glob("*half*"))
