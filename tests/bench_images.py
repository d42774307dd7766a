"""How fast are the metrics on images? `make bench`; tests/bench_report.py turns the result into a table.

One thread and processor time, as the authors' figures were taken. Pairs of $SHAPE_PROGRAMS_SHARED or ../shared where
they are, on which the authors' program was timed; else unions of random discs and rectangles, with outlines as long.
"""

import os
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from lib import datasets
from lib.metrics.distances import distance_transform
from lib.metrics.edges import edge_map
from lib.metrics.images import image_chamfer, iou

PAIRS = 4000
AUTHORS = 1 / 4769  # s of processor time for the distance of a pair: their program calls OpenCV and numpy
AUTHORS_WHOLE_REWARD = "317 to 377 a second, execution of the program included"

pytestmark = pytest.mark.benchmark(timer=time.process_time)


@pytest.fixture(scope="module")
def pairs() -> tuple[str, torch.Tensor, torch.Tensor]:
    """What the data is called, and two batches of images."""
    torch.set_num_threads(1)
    folder = Path(os.environ.get("SHAPE_PROGRAMS_SHARED") or datasets.REPOSITORY.parent / "shared")
    path = folder / "goldens" / "csg_chamfer.npz"
    if not path.is_file():
        a, b = random_shapes(2 * PAIRS).chunk(2)
        return f"{PAIRS} pairs of random shapes", a, b
    with np.load(path) as golden:
        bits = [np.unpackbits(golden[name], axis=-1).reshape(-1, 64, 64) for name in "ab"]
    a, b = (torch.from_numpy(each.astype(bool)).repeat(PAIRS // len(each), 1, 1) for each in bits)
    return f"{len(a)} pairs of programs' images", a, b


def random_shapes(count: int, size: int = 64) -> torch.Tensor:
    """Unions of two discs and two rectangles."""
    rng = np.random.default_rng(0)
    y, x = torch.meshgrid(torch.arange(size), torch.arange(size), indexing="ij")
    images = torch.zeros(count, size, size, dtype=torch.bool)
    for image in images:
        for cy, cx, radius, ry, rx, rh, rw in rng.uniform([8] * 7, [56, 56, 16, 56, 56, 16, 16], (2, 7)):
            image |= (y - cy) ** 2 + (x - cx) ** 2 < radius**2
            image |= ((y - ry).abs() < rh / 2) & ((x - rx).abs() < rw)
    return images


@pytest.fixture
def bench(benchmark, pairs):
    """Times function(a, b) and notes what it stands for."""

    def run(function, what: str, authors: float | None = None, share: int = 1):
        name, a, b = pairs
        a, b = a[::share].contiguous(), b[::share].contiguous()
        result = benchmark.pedantic(function, (a, b), rounds=7, warmup_rounds=1)
        benchmark.extra_info.update(what=what, count=len(a), authors_seconds_each=authors, data=name)
        benchmark.extra_info.update(torch=torch.__version__, threads=torch.get_num_threads())
        benchmark.extra_info.update(per_second=round(len(a) / benchmark.stats.stats.median))
        return result

    return run


@pytest.mark.parametrize("distance", ["octagonal", "euclidean"])
def test_image_chamfer(bench, benchmark, distance):
    """Everything from two images to a number: edge maps, distances both ways, means."""
    found = bench(
        lambda a, b: image_chamfer(a, b, distance), f"Chamfer distance of a pair, {distance}", AUTHORS
    )
    benchmark.extra_info.update(authors_whole_reward=AUTHORS_WHOLE_REWARD)
    assert found.isfinite().all()


def test_iou(bench):
    found = bench(iou, "intersection over union of a pair")
    assert (found <= 1).all()


def test_edge_map(bench):
    edges = bench(lambda a, b: edge_map(a), "edge map of an image")
    assert edges.any()


def test_distance_transform(bench, pairs):
    edges = edge_map(pairs[1])
    found = bench(
        lambda a, b: distance_transform(edges[: len(a)]), "distances of all pixels of an image", share=8
    )
    assert (found >= 0).all()
