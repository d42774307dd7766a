"""How fast is the ShapeAssembly interpreter? `make bench`; tests/bench_report.py turns the result into a table.

One thread, as the authors' figures were taken. The real programs are used where data_scripts/fetch_shapeassembly.py
put them, or where the archive lies in $SHAPE_PROGRAMS_SHARED or ../shared; else the project's examples.
"""

import os
from pathlib import Path

import pytest
import torch

from lib import datasets
from lib.interpreters.shapeassembly import Program, execute, execute_many, parse
from tests.conftest import read_programs

BATCH = 2000  # programs at a time: more are not faster, and memory stays below 2 GB
VARIANTS = 256


@pytest.fixture(scope="module")
def texts() -> tuple[str, dict[str, list[str]]]:
    """What the data is called, and the program texts of each category."""
    torch.set_num_threads(1)
    folder = Path(os.environ.get("SHAPE_PROGRAMS_SHARED") or datasets.REPOSITORY.parent / "shared")
    archive = folder / "data" / "shapeassembly-programs.tar.xz"
    if (datasets.data_root() / "shapeassembly").is_dir() or not archive.is_file():
        sets = {category: datasets.shapeassembly(category) for category in datasets.CATEGORIES}
        texts = {category: [program.to_text() for program in programs] for category, programs in sets.items()}
        source = sets["chair"].source
    else:
        texts = {category: list(programs.values()) for category, programs in read_programs(archive).items()}
        source = "real"
    return f"{sum(map(len, texts.values()))} {source} programs", texts


@pytest.fixture
def bench(benchmark, texts):
    """Times a function and notes what it stands for: bench(function, what, unit, per_second or ms a piece)."""

    def run(function, what: str, count: int = 1, rounds: int = 3, authors: float | None = None):
        result = benchmark.pedantic(function, rounds=rounds, warmup_rounds=1)
        benchmark.extra_info.update(what=what, count=count, authors_seconds_each=authors, data=texts[0])
        benchmark.extra_info.update(torch=torch.__version__, threads=torch.get_num_threads())
        return result

    return run


def median_length(texts: list[str]) -> str:
    """The program of median length: neither a toy nor a monster."""
    return sorted(texts, key=lambda text: (text.count("\n"), text))[len(texts) // 2]


def run_all(programs: list[Program]) -> int:
    """Execute in batches; the number of shapes with finite geometry."""
    batches = (programs[start : start + BATCH] for start in range(0, len(programs), BATCH))
    return sum(int(execute_many(batch).valid.sum()) for batch in batches)


def test_all_programs_in_batch(bench, texts):
    """Compile, run and place every program of the data set (parsed before)."""
    programs = [parse(text) for category in texts[1].values() for text in category]
    valid = bench(lambda: run_all(programs), "execute all programs in batch", len(programs), authors=1 / 20.5)
    assert valid == len(programs)


def test_parse(bench, texts):
    some = [text for category in texts[1].values() for text in category[:300]]
    programs = bench(lambda: [parse(text) for text in some], "parse one program", len(some))
    assert len(programs) == len(some)


@pytest.mark.parametrize("category, authors", [("chair", 0.025), ("table", 0.037), ("storage", 0.050)])
def test_one_program(bench, texts, category, authors):
    """What a widget feels when its text changes: parse, execute, list the parameters. The median program."""
    text = median_length(texts[1][category])

    def feel():
        program = parse(text)
        return execute(program), program.parameters()

    shape, _ = bench(feel, f"parse and execute one {category}", rounds=30, authors=authors)
    assert len(shape.cuboids)


def test_one_slider(bench, texts):
    """What a widget feels when a slider moves: the same structure with other numbers."""
    program = parse(median_length(texts[1]["chair"]))
    numbers = program.parameters()
    assert bench(lambda: execute(program, numbers), "execute one chair with other parameters", rounds=30)


@pytest.mark.parametrize("variants", [1, VARIANTS])
def test_gradients(bench, texts, variants):
    """Forward and backward of parameter vectors of one chair, as a fit would run them."""
    program = parse(median_length(texts[1]["chair"]))
    noise = torch.randn(
        variants, len(program.parameters()), generator=torch.Generator().manual_seed(0)
    ).double()
    numbers = (program.parameters() * (1 + 0.01 * noise)).requires_grad_()

    def both():
        return torch.autograd.grad(execute(program, numbers).cuboids.corners().square().sum(), numbers)[0]

    what = f"forward and backward of {variants} parameter vector{'s' * (variants > 1)} of one chair"
    gradient = bench(both, what, rounds=5 if variants > 1 else 30, authors=0.050 * variants)
    assert gradient.isfinite().all()
