"""The fitted distribution of codes has the mean and covariance of what it was fitted to, and samples come from it."""

import pytest
import torch

from lib.datasets import CATEGORIES, shapeassembly
from lib.models.code_distribution import CodeDistribution
from lib.models.exploring import codes
from lib.models.pretrained import pretrained
from lib.models.program_vae import ProgramVAE, ProgramVAEConfig
from lib.models.weights import CheckpointError, load, write
from lib.models.writing import sample

pytestmark = pytest.mark.usefixtures("unchecked_shapes")


@pytest.fixture(scope="module")
def network():
    return load(ProgramVAE, pretrained("program_vae_chair"))


@pytest.fixture(scope="module")
def fitted(network):
    return CodeDistribution.of(network, list(shapeassembly("chair", "train")[:40]))


def test_mean_and_covariance(network, fitted):
    found = codes(network, list(shapeassembly("chair", "train")[:40])).double()
    torch.testing.assert_close(fitted.mean.double(), found.mean(0), rtol=0, atol=1e-5)
    covariance = fitted.factor.double() @ fitted.factor.double().T
    blur = covariance - torch.cov(found.T)
    assert (blur.diagonal() > 0).all()  # each code's own variance …
    assert (blur - torch.diag(blur.diagonal())).abs().max() < 1e-4  # … and nothing across
    drawn = fitted.at(torch.randn(20_000, 256, generator=torch.Generator().manual_seed(0)))
    torch.testing.assert_close(drawn.mean(0), fitted.mean, rtol=0, atol=0.1)
    assert (torch.cov(drawn.T) - covariance.float()).abs().max() < 0.25


def test_sampling_draws_from_it(network, fitted):
    usual, ours = (sample(network, 10, codes=each).programs for each in (None, fitted))
    assert ours == sample(network, 10, codes=fitted).programs and ours != usual
    far = CodeDistribution(fitted.mean, torch.zeros(256, 256))  # one point: one program
    assert len(set(sample(network, 5, codes=far, mode="skip").programs)) == 1


def test_it_comes_back_from_its_file(fitted, tmp_path):
    fitted.save(tmp_path / "codes.safetensors")
    again = CodeDistribution.load(tmp_path / "codes.safetensors")
    assert torch.equal(again.mean, fitted.mean) and torch.equal(again.factor, fitted.factor)
    with pytest.raises(CheckpointError, match="kind"):
        CodeDistribution.load(pretrained("program_vae_chair"))
    write(
        tmp_path / "flat.safetensors",
        {"mean": torch.zeros(4), "factor": torch.zeros(4)},
        "CodeDistribution",
        {},
    )
    with pytest.raises(CheckpointError, match=r"found arrays .*; expected mean \(n,\) and factor \(n, n\)"):
        CodeDistribution.load(tmp_path / "flat.safetensors")


def test_codes_of_another_length_are_refused(fitted):
    small = ProgramVAE(ProgramVAEConfig(hidden=8, head=8))
    with pytest.raises(ValueError, match="codes of 256 numbers; expected 8"):
        sample(small, 1, codes=fitted)


@pytest.mark.parametrize("category", CATEGORIES)
def test_those_that_come_with_the_project(category):
    programs = shapeassembly(category, "train")
    if programs.source != "real":
        pytest.skip("the real programs are not fetched")
    own = load(ProgramVAE, pretrained(f"program_vae_{category}"))
    kept = CodeDistribution.load(pretrained(f"program_vae_{category}_codes"))
    found = CodeDistribution.of(own, list(programs))
    torch.testing.assert_close(kept.mean, found.mean, rtol=0, atol=1e-4)
    torch.testing.assert_close(kept.factor, found.factor, rtol=0, atol=1e-3)


def test_one_program_has_no_covariance(network):
    with pytest.raises(ValueError, match="found 1 programs"):
        CodeDistribution.of(network, list(shapeassembly("chair", "train")[:1]))
