"""How fast are CSG-Stumps? `make bench`; tests/bench_report.py turns the result into a table.

The authors' figures are of one thread: 41.7 s for the field of a stump of 64 boxes and 20 nodes at 128^3 points and
0.22 s for its marching cubes, once unused primitives and nodes are left out; about 2,800 s without that.
"""

import numpy as np
import pytest
import torch

from lib.interpreters.stump import execute, execute_many
from lib.interpreters.stump.surface import field
from tests.random_stumps import boxes, random_stump
from tests.timing import timed

FIELD, SURFACE = 41.7, 41.9  # seconds the authors' program takes
UNIT = [[-0.5] * 3, [0.5] * 3]
DATA = "64 random boxes, 20 nodes"


@pytest.fixture
def bench(benchmark):
    """bench(function, what, how many stumps, the authors' seconds)"""
    torch.set_num_threads(1)

    def run(function, what: str, count: int = 1, authors: float | None = None, data=DATA):
        return timed(benchmark, function, what, data=data, count=count, authors=authors)

    return run


def test_field(bench):
    shape = execute(boxes(), UNIT)
    values = bench(lambda: field(shape.program, shape.window, 128), "field at 128^3 points", authors=FIELD)
    assert values.shape == (130, 130, 130)


def test_marching_cubes(bench):
    shape = execute(boxes(), UNIT)
    mesh = bench(lambda: shape.marching_cubes(128), "field and marching cubes, 128^3", authors=SURFACE)
    assert mesh.is_watertight


def test_mesh(bench):
    shape = execute(boxes(), UNIT)
    assert bench(shape.mesh, "exact solid").is_volume


def test_many(bench):
    rng = np.random.default_rng(0)
    shapes = execute_many([random_stump(rng, 3) for _ in range(200)])
    points = torch.rand(2048, 3, generator=torch.Generator().manual_seed(0)).double() - 0.5
    data = "random stumps, up to 7 primitives"
    inside = bench(lambda: shapes.occupancy(points), "occupancy at 2,048 points", 200, data=data)
    assert inside.shape == (200, 2048)
