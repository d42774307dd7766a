"""The program VAE: a batch says of each program what the program alone would say, and training moves all of it."""

import numpy as np
import pytest
import torch

from lib.interpreters.shapeassembly import sample
from lib.models.program_lines import COMMAND, FIELD
from lib.models.program_table import ProgramTable, batch_of
from lib.models.program_vae import DEPTHS, ProgramVAE, ProgramVAEConfig, one_hot_fields
from lib.models.weights import load, save
from tests.conftest import unchecked

SMALL = ProgramVAEConfig(hidden=24, head=12)
CLOSE = 1e-5  # sums in another order, in float32


@pytest.fixture(scope="module")
def table() -> ProgramTable:
    """Eight programs, every other one with blocks that fill cuboids."""
    rng = np.random.default_rng(11)
    with unchecked():
        found = [sample(rng) for _ in range(60)]
        deep = [program for program in found if len(program.blocks) > 2]
        flat = [program for program in found if len(program.blocks) == 1]
        return ProgramTable.of([each for pair in zip(flat, deep) for each in pair][:8])


@pytest.fixture(scope="module")
def network() -> ProgramVAE:
    torch.manual_seed(5)
    return ProgramVAE(SMALL).eval()


@pytest.fixture(scope="module")
def noise() -> torch.Tensor:
    return torch.randn(8, SMALL.hidden, generator=torch.Generator().manual_seed(1))


def of_program(levels, found, program: int) -> dict[str, torch.Tensor]:
    """What a batch predicts for one of its programs."""
    rows = torch.cat([level.program[level.node[level.inputs]] for level in levels]) == program
    by_line = {name: getattr(found, name)[rows] for name in ("state", "code", "size", "targets", "leaf")}
    return by_line | {"root": found.root[program : program + 1]}


def test_the_sizes_are_the_papers():
    network = ProgramVAE()
    encoder = ("read_line", "reader", "first_state", "summary", "mean", "log_variance")
    count = {name: weight.numel() for name, weight in network.named_parameters()}
    inside = sum(size for name, size in count.items() if name.split(".")[0] in encoder)
    assert round(inside / 1e6, 2) == 0.74 and round(sum(count.values()) / 1e6 - inside / 1e6, 2) == 1.41


def test_programs_are_read_together_as_alone(network, table):
    together = network.encode(batch_of(table, range(8)))
    for pick in range(8):
        alone = network.encode(batch_of(table, [pick]))
        assert torch.allclose(together.mean[pick], alone.mean[0], atol=CLOSE)
        assert torch.allclose(together.log_variance[pick], alone.log_variance[0], atol=CLOSE)
    assert (together.mean[1:] - together.mean[:1]).abs().amax(1).min() > 10 * CLOSE  # and they do differ


def test_the_order_of_a_batch_does_not_matter(network, table):
    order = [5, 0, 7, 3]
    assert torch.allclose(
        network.encode(batch_of(table, order)).mean,
        network.encode(batch_of(table, range(8))).mean[order],
        atol=CLOSE,
    )


def test_programs_are_written_together_as_alone(network, table, noise):
    levels = batch_of(table, range(8))
    together = network.decode(noise, levels)
    for pick in range(8):
        levels_alone = batch_of(table, [pick])
        alone = of_program(levels_alone, network.decode(noise[pick : pick + 1], levels_alone), 0)
        for name, value in of_program(levels, together, pick).items():
            assert torch.allclose(value, alone[name], atol=CLOSE), name


def test_a_line_is_predicted_from_those_before_it_only(network, table, noise):
    """Other numbers in a line change what is predicted after it, not before."""
    [level] = batch_of(table, [int(np.flatnonzero(np.bincount(table.program) == 1)[0])])
    before = network.decode(noise[:1], [level]).state
    middle = len(level.lines) // 2
    changed = level.lines.clone()
    changed[middle, FIELD["size"]] += 1
    after = network.decode(noise[:1], [type(level)(**vars(level) | {"lines": changed})]).state
    assert torch.equal(before[:middle], after[:middle])
    assert not torch.allclose(before[middle], after[middle])


def test_leaf_flags_mark_the_cuboids_that_are_filled(network, table, noise):
    levels = batch_of(table, range(8))
    found = network.decode(noise, levels)
    assert int((found.leaf == 0).sum()) == sum(len(level.size) for level in levels[1:]) > 0
    assert (found.targets[found.leaf == 0][:, FIELD["command"]].argmax(-1) == COMMAND["Cuboid"]).all()


def test_what_fills_a_cuboid_changes_the_code(network, table):
    """The encoder reads inner blocks: with another inner block the latent code is another."""
    pick = int(table.program[table.level > 0][0])
    levels = batch_of(table, [pick])
    before = network.encode(levels).mean
    inner = levels[1].lines.clone()
    inner[-2, FIELD["point"]] += 5
    changed = type(levels[1])(**vars(levels[1]) | {"lines": inner})
    assert not torch.equal(network.encode([levels[0], changed, *levels[2:]]).mean, before)


def test_all_weights_are_moved(network, table, noise):
    posterior, found = network(batch_of(table, range(8)), noise)
    line, cuboids = network.line, one_hot_fields(found.targets)
    command = line.command(found.state)
    heads = [
        command, line.cuboids(found.state, command), *line.size(found.state, found.size), found.root,
        line.attach(found.state, cuboids), *line.squeeze(found.state, cuboids), posterior.log_variance,
        *line.symmetry(found.state, cuboids, found.size), line.leaf(found.state, found.code),
    ]  # fmt: skip
    gradients = torch.autograd.grad(sum(head.square().sum() for head in heads), list(network.parameters()))
    assert all(gradient.abs().sum() > 0 for gradient in gradients)


def test_levels_from_the_third_on_look_alike(network):
    lines, size = torch.zeros(1, 63), torch.ones(1, 3)
    at = [network.read_previous(lines, size, depth) for depth in range(DEPTHS + 2)]
    assert not torch.equal(at[0], at[1]) and not torch.equal(at[1], at[2])
    assert torch.equal(at[2], at[3]) and torch.equal(at[2], at[4])


def test_no_noise_means_the_mean(network, table, noise):
    posterior = network.encode(batch_of(table, range(8)))
    assert torch.equal(posterior.at(torch.zeros(8, SMALL.hidden)), posterior.mean)
    deviation = (posterior.at(noise) - posterior.mean) / noise
    assert torch.allclose(deviation, (posterior.log_variance / 2).exp(), atol=1e-4)


def test_it_is_saved_and_loaded(network, table, tmp_path):
    save(network, tmp_path / "vae.safetensors")
    loaded = load(ProgramVAE, tmp_path / "vae.safetensors")
    assert loaded.config == SMALL
    levels = batch_of(table, range(8))
    assert torch.equal(loaded.encode(levels).mean, network.encode(levels).mean)
