"""How fast are the layers of a stump, at the paper's size? `make bench`; tests/bench_report.py makes a table of it.

One thread, 256 primitives, 256 nodes, 2,048 points, one shape, forward and backward, all values random. The authors'
program takes about 5 s and 1.5 GB for this. Memory is what the process needed at its peak beyond its inputs, which
includes their gradients; Linux tells it.
"""

from multiprocessing import get_context
from pathlib import Path

import pytest
import torch

from lib.interpreters.stump import layers
from tests.timing import timed

AUTHORS = 5.0  # seconds
STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")
DATA = "256 primitives, 256 nodes, 2,048 points, batch 1, random"


def drawn(points: int = 2048) -> list[torch.Tensor]:
    """Occupancies and the three matrices."""
    torch.manual_seed(0)
    shapes = [(256, points), (256,), (256, 256), (256,)]
    return [torch.rand(1, *shape).requires_grad_() for shape in shapes]


def step(inputs: list[torch.Tensor], temperature: float | None) -> tuple[torch.Tensor, ...]:
    """Forward and backward."""
    _, values = layers.soft(*inputs, temperature=temperature)
    return torch.autograd.grad((values**2).mean(), inputs)


def peak_megabytes(temperature: float | None) -> float | None:
    """What a step needs at its peak beyond its inputs, in a process of its own; None where the system does not say."""
    if not RESET.exists():
        return None
    with get_context("spawn").Pool(1) as pool:
        return pool.apply(_peak, [temperature])


def _peak(temperature: float | None) -> float:
    torch.set_num_threads(1)
    step(drawn(2), temperature)  # what PyTorch loads on first use
    inputs = drawn()
    RESET.write_text("5")  # the peak starts anew
    before = kilobytes("VmRSS")
    step(inputs, temperature)
    return (kilobytes("VmHWM") - before) / 1000


def kilobytes(key: str) -> int:
    return next(int(line.split()[1]) for line in STATUS.read_text().splitlines() if line.startswith(key))


@pytest.mark.parametrize("temperature", [None, 20.0])
def test_forward_and_backward(benchmark, temperature):
    torch.set_num_threads(1)
    inputs = drawn()
    what = f"forward and backward, {'exact' if temperature is None else 'smooth'}"
    gradients = timed(benchmark, lambda: step(inputs, temperature), what, data=DATA, authors=AUTHORS)
    benchmark.extra_info.update(peak_megabytes=peak_megabytes(temperature), authors_megabytes=1500)
    assert all(gradient.isfinite().all() for gradient in gradients)
