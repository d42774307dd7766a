"""How fast does a network write programs? `make bench`. One thread; the chair network that comes with the project.

A batch shares every step of the network and of the interpreter: the ratio of the two skip rows is what that saves.
"""

import pytest
import torch

from lib import datasets
from lib.models.program_vae import ProgramVAE
from lib.models.weights import load
from lib.models.writing import write
from tests.timing import timed

BATCH = 256
DATA = "random latent codes, chairs"


@pytest.fixture(scope="module")
def network() -> ProgramVAE:
    torch.set_num_threads(1)
    path = datasets.REPOSITORY / "pretrained" / "program_vae_chair.safetensors"
    if not path.is_file():
        pytest.skip(f"no {path}")
    return load(ProgramVAE, path)


@pytest.mark.parametrize("mode", ["reject", "skip", "none"])
def test_write_a_batch(benchmark, network, mode):
    """Codes a second: what is rejected counts, as its time was spent."""
    latent = torch.randn(BATCH, network.config.hidden, generator=torch.Generator().manual_seed(0))
    what = f"write {BATCH} programs at once, mode {mode}"
    written = timed(benchmark, lambda: write(network, latent, mode), what, data=DATA, count=BATCH, rounds=3)
    assert len(written.accepted) > BATCH / 2


def test_write_one(benchmark, network):
    latent = torch.randn(1, network.config.hidden, generator=torch.Generator().manual_seed(0))
    assert timed(benchmark, lambda: write(network, latent, "skip"), "write one program, mode skip", data=DATA)
