"""Walking about in a latent space: ways have their ends, directions are those a hand-made cloud has, sums are sums."""

import math

import pytest
import torch

from lib import datasets
from lib.models import code_distribution, weights
from lib.models.exploring import Directions, analogy, arc, codes, interpolate, mean_code, straight
from lib.models.pretrained import pretrained
from lib.models.program_vae import ProgramVAE, ProgramVAEConfig
from lib.models.weights import CheckpointError, load
from lib.models.writing import write

pytestmark = pytest.mark.usefixtures("unchecked_shapes")


@pytest.fixture(scope="module")
def network():
    """Untrained and small: what it writes is nonsense, where it puts programs is as good a code as any."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return ProgramVAE(ProgramVAEConfig(hidden=24, head=16)).eval()


@pytest.fixture(scope="module")
def chairs():
    return list(datasets.shapeassembly("chair", "train"))[:12]


@pytest.fixture(scope="module")
def writer():
    try:
        return load(ProgramVAE, pretrained("program_vae_chair"))
    except CheckpointError as error:
        pytest.skip(str(error))


def test_codes_do_not_depend_on_the_batch(network, chairs, monkeypatch):
    together = codes(network, chairs)
    assert together.shape == (12, 24) and not together.requires_grad
    monkeypatch.setattr(code_distribution, "AT_ONCE", 5)
    assert torch.allclose(codes(network, chairs), together, atol=1e-6)
    assert codes(network, []).shape == (0, 24)


@pytest.mark.parametrize("way", [straight, arc])
def test_a_way_has_its_ends_and_comes_back_the_same(way):
    start, end = torch.randn(2, 16, generator=torch.Generator().manual_seed(1))
    there, back = way(start, end, 7), way(end, start, 7)
    assert torch.equal(there[0], start) and torch.equal(there[-1], end)
    assert torch.allclose(there, back.flip(0), atol=1e-6)
    with pytest.raises(ValueError, match="found 1 steps; expected at least 2"):
        way(start, end, 1)


def test_the_middle_by_hand():
    x, y = torch.tensor([2.0, 0.0]), torch.tensor([0.0, 4.0])
    assert torch.allclose(straight(x, y, 3)[1], torch.tensor([1.0, 2.0]))
    assert torch.allclose(
        arc(x, y, 3)[1], 3 * torch.tensor([1.0, 1.0]) / math.sqrt(2)
    )  # length between 2 and 4


def test_an_arc_goes_by_even_angles_and_lengths():
    start, end = torch.randn(2, 64, generator=torch.Generator().manual_seed(2)).double()
    way = arc(start, end, 9)
    share = torch.linspace(0, 1, 9, dtype=torch.float64)
    assert torch.allclose(way.norm(dim=1), (1 - share) * start.norm() + share * end.norm())
    unit = way / way.norm(dim=1, keepdim=True)
    cosines = (unit[1:] * unit[:-1]).sum(1)
    assert torch.allclose(cosines, cosines[:1])


@pytest.mark.parametrize("factor", [0.0, 1.0, 2.0, -1.0])
def test_where_there_is_no_arc_there_is_the_line(factor):
    start = torch.tensor([1.0, 2.0, 3.0])
    assert torch.equal(arc(start, factor * start, 5), straight(start, factor * start, 5))


def test_directions_of_a_cloud_made_by_hand():
    generator = torch.Generator().manual_seed(0)
    turn, _ = torch.linalg.qr(torch.randn(6, 6, generator=generator))
    spread = torch.tensor([5.0, 3.0, 2.0, 0.0, 0.0, 0.0])
    middle = torch.arange(6.0)
    noise = torch.randn(4000, 6, generator=generator)
    found = Directions.of(middle + noise * spread @ turn.T, count=4)
    assert len(found) == 4
    assert torch.allclose(found.mean, middle, atol=0.4)  # 5 / sqrt(4000) is 0.08
    assert torch.allclose(found.spread, spread[:4], atol=0.15)
    assert torch.allclose((found.axes[:3] @ turn[:, :3]).abs(), torch.eye(3), atol=0.05)
    assert torch.allclose(found.share, torch.tensor([25, 9, 4, 0]) / 38, atol=0.03)


def test_weights_and_codes_are_each_others_inverse(network, chairs):
    directions = Directions.of(codes(network, chairs), count=5)
    assert torch.allclose(directions.axes @ directions.axes.T, torch.eye(5), atol=1e-5)
    weights = torch.randn(3, 5, generator=torch.Generator().manual_seed(0))
    assert torch.allclose(directions.weights(directions.code(weights)), weights, atol=1e-4)
    assert torch.equal(directions.code(torch.zeros(5)), directions.mean)
    base = torch.ones(24)
    assert torch.allclose(
        directions.code(weights, base) - base, directions.code(weights) - directions.mean, atol=1e-6
    )
    flat = Directions.of(torch.ones(4, 3), count=2)
    assert torch.equal(flat.weights(torch.ones(3)), torch.zeros(2)) and torch.equal(
        flat.share, torch.zeros(2)
    )


@pytest.mark.parametrize("count", [0, 12, 25])
def test_there_are_only_so_many_directions(network, chairs, count):
    with pytest.raises(ValueError, match=f"found {count} directions; expected 1 to 11 for 12 codes"):
        Directions.of(codes(network, chairs), count)


def test_directions_are_saved(network, chairs, tmp_path):
    directions = Directions.of(codes(network, chairs), count=3)
    directions.save(tmp_path / "directions.safetensors")
    again = Directions.load(tmp_path / "directions.safetensors")
    assert all(torch.equal(value, vars(again)[name]) for name, value in vars(directions).items())
    (tmp_path / "foreign.safetensors").write_bytes(b"no such thing")
    with pytest.raises(CheckpointError):
        Directions.load(tmp_path / "foreign.safetensors")


def test_sums_of_codes(network, chairs):
    own = codes(network, chairs)
    assert torch.allclose(mean_code(network, chairs[:3]), own[:3].mean(0), atol=1e-6)
    with pytest.raises(ValueError, match="found no programs"):
        mean_code(network, [])


def test_an_interpolation_begins_and_ends_as_reconstructions(writer, chairs):
    found = interpolate(writer, chairs[0], chairs[5], steps=4)
    ends = write(writer, codes(writer, [chairs[0], chairs[5]]), "skip").programs
    assert len(found) == 4
    assert [found[0].structure, found[-1].structure] == [program.structure for program in ends]
    assert found == interpolate(writer, chairs[0], chairs[5], steps=4)


def test_what_is_added_and_taken_away_leaves_the_same(writer, chairs):
    a, b = chairs[:2]
    assert (
        analogy(writer, a, a, b).structure == write(writer, codes(writer, [b]), "skip").programs[0].structure
    )


def test_weights_that_are_not_there(tmp_path):
    (tmp_path / "tables.safetensors").touch()
    with pytest.raises(CheckpointError, match="no weights called 'chairs'; found tables"):
        pretrained("chairs", tmp_path)
    with pytest.raises(CheckpointError, match="found none at all"):
        pretrained("chairs", tmp_path / "nowhere")
    assert pretrained("tables", tmp_path) == tmp_path / "tables.safetensors"


def test_codes_that_are_not_finite_have_no_directions():
    with pytest.raises(ValueError, match="not finite"):
        Directions.of(torch.full((3, 4), math.nan), 1)


def test_other_arrays_are_no_directions(tmp_path):
    weights.write(tmp_path / "x.safetensors", {"x": torch.zeros(2)}, "Directions", {})
    with pytest.raises(CheckpointError, match=r"found the arrays \['x'\]; expected \['axes'"):
        Directions.load(tmp_path / "x.safetensors")
