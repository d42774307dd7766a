"""How fast is the program VAE trained? `make bench`.

One thread, as the authors' figures were taken: 0.07 to 0.13 s for a program (forward, backward and Adam's step), of
which the middle stands here. The training chairs are used where they were fetched or where the archive lies (see
bench_shapeassembly.py), else the project's examples.
"""

import pytest
import torch
from lightning_fabric import Fabric

from lib.datasets import shapeassembly
from lib.interpreters.shapeassembly import parse
from lib.models.program_table import ProgramTable, batch_of
from lib.models.program_vae import ProgramVAE
from lib.training.loop import Schedule, fit
from lib.training.program_loss import LossWeights
from lib.training.program_vae import ProgramTask, ReadAndWrite
from tests.bench_shapeassembly import texts  # noqa: F401, a fixture
from tests.timing import timed

AUTHORS = 0.10  # seconds a program
TRAINING_CHAIRS = 3339  # of 3,835; the archive's first ones where the split was not fetched
BATCH = 32


@pytest.fixture(scope="module")
def data(request) -> tuple[str, ProgramTable]:
    """What the programs are called, and their table."""
    programs, source = shapeassembly("chair", "train"), "real training"
    if programs.source != "real":
        name, found = request.getfixturevalue("texts")
        programs = [parse(text) for text in found["chair"][:TRAINING_CHAIRS]]
        source = name.split()[1]
    table = ProgramTable.of(list(programs))
    return f"{len(table)} {source} chairs", table


@pytest.fixture
def task(data) -> ProgramTask:
    torch.manual_seed(0)
    torch.set_num_threads(1)
    return ProgramTask(ReadAndWrite(ProgramVAE()), data[1], None, LossWeights(), 0.0, {})


def test_an_epoch(benchmark, task, data, tmp_path):
    """With the default batches; the checkpoint is written too."""
    folders = iter(tmp_path / str(number) for number in range(9))

    def epoch() -> list[dict]:
        schedule = Schedule(epochs=1, batch=BATCH, rate=1e-3, clip=1000.0)
        return fit(task, schedule, next(folders), Fabric(accelerator="cpu", devices=1))

    what = f"train on one chair, an epoch in batches of {BATCH}"
    result = benchmark.pedantic(epoch, rounds=1)
    benchmark.extra_info.update(
        what=what,
        count=len(task),
        authors_seconds_each=AUTHORS,
        data=data[0],
        torch=torch.__version__,
        threads=1,
    )
    assert result[0]["loss"] > 0


@pytest.mark.parametrize("size", [1, BATCH])
def test_a_step(benchmark, task, data, size):
    """Batch, forward and backward, without Adam."""
    picks = range(0, len(task), max(1, len(task) // size))[:size]

    def step() -> float:
        task.module.zero_grad()
        loss, _ = task.loss(task.module, picks, torch.Generator().manual_seed(0), 1.0)
        loss.backward()
        return loss.item()

    what = f"forward and backward of {'a batch of ' * (size > 1)}{size} chair{'s' * (size > 1)}, each"
    assert timed(benchmark, step, what, data=data[0], count=size, rounds=5) > 0


def test_making_batches(benchmark, task, data):
    """Rows of the table to the levels of a batch."""
    picks = range(0, len(task), len(task) // BATCH)[:BATCH]
    levels = timed(
        benchmark, lambda: batch_of(task.train, picks), "make a batch, each chair", data=data[0], count=BATCH
    )
    assert levels[0].depth == 0
