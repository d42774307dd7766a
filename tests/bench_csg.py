"""How fast is the CSG interpreter? `make bench`; tests/bench_report.py turns the result into a table.

One thread, as the authors' figures were taken: 466 programs of the plane a second for equal shares of the lengths 3 to
13, and 5 of space with primitives drawn on the fly. The programs are random and valid; every primitive of the
networks' vocabularies has been drawn before. Programs are also sampled, for which there are no figures of the authors.
"""

import numpy as np
import pytest
import torch

from lib.interpreters.csg import execute, execute_many, parse, sample_many, vocabulary_of
from tests.csg_programs import random_mixture, random_program
from tests.timing import timed

AUTHORS = {2: 1 / 466, 3: 1 / 5}  # seconds a program
LENGTHS = {2: (3, 5, 7, 9, 11, 13), 3: (3, 5, 7)}
WHERE = {2: "the plane", 3: "space"}
DATA = "random programs, equal shares of lengths 3 to 13 (3 to 7 in space)"


@pytest.fixture(scope="module")
def tokens() -> dict[int, torch.Tensor]:
    """Random valid tokens of plane and space; 32 KB a program make batches of space small."""
    torch.set_num_threads(1)
    rng = np.random.default_rng(0)
    for dimensions in (2, 3):
        vocabulary_of(dimensions).canvases()
    return {d: random_mixture(rng, LENGTHS[d], {2: 4000, 3: 300}[d], vocabulary_of(d)) for d in (2, 3)}


@pytest.fixture
def bench(benchmark):
    """bench(function, what, how many programs, rounds, the authors' seconds)"""

    def run(function, what: str, count: int = 1, rounds: int = 7, authors: float | None = None):
        return timed(benchmark, function, what, data=DATA, count=count, rounds=rounds, authors=authors)

    return run


@pytest.mark.parametrize("dimensions", [2, 3])
def test_tokens(bench, tokens, dimensions):
    """What training does: from tokens to packed pixels, all in one batch."""
    some, what = tokens[dimensions], f"execute tokens of {WHERE[dimensions]}"
    authors = AUTHORS[dimensions]
    shapes = bench(lambda: execute_many(some, dimensions=dimensions), what, len(some), authors=authors)
    assert shapes.valid.all()


@pytest.mark.parametrize("dimensions, count", [(2, 3000), (3, 150)])
def test_programs(bench, tokens, dimensions, count):
    """A list of Programs, as an extractor or a refinement makes them: their primitives are drawn anew each time."""
    programs = [vocabulary_of(dimensions).program(row) for row in tokens[dimensions][:count]]
    what = f"execute Programs of {WHERE[dimensions]}"
    shapes = bench(lambda: execute_many(programs), what, count, authors=AUTHORS[dimensions])
    assert len(shapes) == count


def test_pixels(bench, tokens):
    """The packed pictures as a tensor of pixels, as a network reads them."""
    shapes = execute_many(tokens[2])
    assert bench(lambda: shapes.images, "unpack the pictures", len(shapes)).shape == (len(shapes), 64, 64)


def test_one_program(bench):
    """What a widget feels: parse and execute one program of seven tokens, not of the vocabulary."""
    text = random_program(np.random.default_rng(1), 2, 7).to_text()
    shape = bench(lambda: execute(parse(text)), "parse and execute one of the plane", rounds=50)
    assert shape.program.to_text() == text


def test_parse(bench, tokens):
    texts = [vocabulary_of(2).program(row).to_text() for row in tokens[2][:2000]]
    programs = bench(lambda: [parse(text) for text in texts], "parse one program of the plane", len(texts))
    assert [program.to_text() for program in programs] == texts


@pytest.mark.parametrize("dimensions, length, count", [(2, 13, 4000), (3, 7, 1000)])
def test_sample(bench, tokens, dimensions, length, count):
    """Random programs that follow the paper's rules, as data sets are made of: the longest, which take longest."""
    what = f"sample programs of {length} tokens in {WHERE[dimensions]}"
    made = bench(
        lambda: sample_many(np.random.default_rng(0), count, length, dimensions), what, count, rounds=3
    )
    assert made.shape == (count, length)
