"""How fast does CSG-Stump Net learn, at the paper's size? `make bench`; tests/bench_report.py makes a table of it.

One thread, 256 primitives, 256 nodes, batch 1, 2,048 points looked at and 2,048 asked about: a whole step, forward,
backward and Adam. The authors' program takes 6.2 to 7.7 s and 4 GB for this. Memory is what the process needed at its
peak beyond what it had before the network was made, which includes weights, gradients and Adam's moments.
"""

from collections.abc import Callable
from multiprocessing import get_context

import pytest
import torch

from lib.models.dgcnn import nearest
from lib.models.stump_net import HEADS, StumpNet, StumpNetConfig
from lib.training.stump_net import StumpLesson, StumpStudent
from tests.bench_stump_layers import RESET, kilobytes
from tests.timing import timed

AUTHORS = 6.2  # seconds
DATA = "256 primitives, 256 nodes, 2,048 + 2,048 points, batch 1, random"
MEANS = {"power": {"power": 8.0}, "softmax": {"power": None, "temperature": 20.0}}


def stepper(head: str, mean: str) -> Callable[[], float]:
    """What makes one step, and returns the loss."""
    torch.manual_seed(0)
    lesson = StumpLesson(2048, **MEANS[mean])
    student = StumpStudent(StumpNet(StumpNetConfig(head=head)), lesson).train()
    descent = torch.optim.Adam(student.parameters(), 1e-4)
    clouds, queries = torch.rand(2, 1, 2048, 3) - 0.5
    inside = (torch.arange(2048) < 1024).float()

    def step() -> float:
        loss, _ = student(clouds, queries, inside, 0.0, torch.Generator())
        descent.zero_grad()
        loss.backward()
        descent.step()
        return loss.item()

    return step


def peak_megabytes(head: str, mean: str) -> float | None:
    """What three steps need at their peak, in a process of their own; None where the system does not say."""
    if not RESET.exists():
        return None
    with get_context("spawn").Pool(1) as pool:
        return pool.apply(_peak, [head, mean])


def _peak(head: str, mean: str) -> float:
    torch.set_num_threads(1)
    torch.nn.Linear(4, 4)(torch.rand(2, 4)).sum().backward()  # what PyTorch loads on first use
    before = kilobytes("VmRSS")
    step = stepper(head, mean)
    RESET.write_text("5")  # the peak starts anew
    for _ in range(3):
        step()
    return (kilobytes("VmHWM") - before) / 1000


@pytest.mark.parametrize("head, mean", [(HEADS[0], "power"), (HEADS[0], "softmax"), (HEADS[1], "power")])
def test_a_step(benchmark, head, mean):
    torch.set_num_threads(1)
    step = stepper(head, mean)
    what = f"a training step, head {head}, mean by {mean}"
    loss = timed(benchmark, step, what, data=DATA, authors=AUTHORS)
    benchmark.extra_info.update(peak_megabytes=peak_megabytes(head, mean), authors_megabytes=4000)
    assert 0 < loss < 1


@pytest.mark.parametrize("width", [3, 64])
def test_nearest_neighbours(benchmark, width):
    torch.set_num_threads(1)
    points = torch.rand(1, 2048, width, generator=torch.Generator().manual_seed(0))
    found = timed(
        benchmark, lambda: nearest(points, 20), f"20 nearest of 2,048, {width} numbers each", data=DATA
    )
    assert found.shape == (1, 2048, 20)
