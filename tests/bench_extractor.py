"""How fast is the extractor, and the furniture maker? `make bench`.

One thread, except where all cores are named. The real shapes are those of executed real programs (where they are at
hand, see bench_shapeassembly.py). The authors' extractor took 12.8 to 33.5 s for seven shapes of 3 to 6 leaves
(20.3 s the median); a larger chair did not finish in 140 s.
"""

import os

import pytest
from joblib import Parallel, delayed

from lib.datasets import CATEGORIES
from lib.extractor import PartGraph, extract_many
from lib.furniture import make
from lib.interpreters.shapeassembly import execute_many, parse
from lib.metrics.fscore import f_score
from tests.bench_shapeassembly import bench, texts  # noqa: F401, fixtures

AUTHORS = 20.3  # seconds a shape
SHAPES = 60  # of each category
CHUNK = 30


@pytest.fixture(scope="module")
def graphs(texts) -> list[PartGraph]:  # noqa: F811
    """Part graphs of executed programs, evenly spread over each category."""
    found = []
    for category, programs in texts[1].items():
        some = [parse(text) for text in programs[:: max(1, len(programs) // SHAPES)][:SHAPES]]
        found += [PartGraph.from_shape(shape, category) for shape in execute_many(some)]
    return found


def accepted(graphs: list[PartGraph]) -> int:
    return sum(extraction.accepted for extraction in extract_many(graphs))


def in_chunks(graphs: list[PartGraph]) -> list[list[PartGraph]]:
    return [graphs[start : start + CHUNK] for start in range(0, len(graphs), CHUNK)]


def test_extraction(bench, graphs):  # noqa: F811
    """Part graph to validated program, F-score included."""

    def run() -> int:
        return sum(map(accepted, in_chunks(graphs)))

    assert bench(run, "extract a program", len(graphs), rounds=1, authors=AUTHORS) > 0.9 * len(graphs)


def test_extraction_on_all_cores(bench, graphs):  # noqa: F811
    cores = os.cpu_count()

    def run() -> int:
        return sum(Parallel(n_jobs=cores)(delayed(accepted)(chunk) for chunk in in_chunks(graphs)))

    what = f"extract a program, {cores} processes"
    assert bench(run, what, len(graphs), rounds=1, authors=AUTHORS) > 0.9 * len(graphs)


def test_extraction_of_furniture(bench):  # noqa: F811
    graphs = [make(category, seed) for category in CATEGORIES for seed in range(30)]
    found = bench(lambda: accepted(graphs), "extract a program of made furniture", len(graphs), rounds=1)
    assert found > 0.8 * len(graphs)


def test_making_furniture(bench):  # noqa: F811
    def run() -> list[PartGraph]:
        return [make(category, seed) for category in CATEGORIES for seed in range(100)]

    assert len(bench(run, "make a part graph", 300)) == 300


def test_f_score(bench, graphs):  # noqa: F811
    """10,000 points on each of two shapes, distances to the other's surface."""
    boxes = graphs[0].leaves
    assert bench(lambda: f_score(boxes, boxes), "measure an F-score", rounds=10) == 100
