"""How fast does CSGNet read pictures, learn, and have its programs refined? `make bench`. One thread.

The authors' figures are seconds of processor time, as their program was timed on a machine like this one while it had
other work. On the clock it took 2.9 s for a beam search of one picture, 0.25 s each for fifty, 0.30 s for greedy,
16.6 s for a training step of 96 programs, and 2.66 s for an iteration of Powell's method.

How far from the limit is a beam search with the paper's sizes? In a step a row of the batch takes 18.4 million multiply
and adds: 13.4 in the GRU, 5.0 in the two linear layers. A picture with ten beginnings and thirteen steps has 121 rows,
and its feature takes 15 million more: 2.24 billion together. With ten rows torch's matrix products of these sizes do 20
billion a second, as every weight comes from memory for little work; with 500 rows 50 billion. So products alone take
0.11 s for one picture and 0.045 s each for fifty, and the search takes 0.13 s and 0.049 s: 1.2 and 1.1 times as long.
"""

import numpy as np
import pytest
import torch

from lib.datasets import csg_programs
from lib.finding.picture_nearest import nearest
from lib.finding.picture_powell import refine_by_powell
from lib.finding.picture_refining import refine
from lib.interpreters.csg import execute_many, sample_many, vocabulary_of
from lib.models.csgnet import CSGNet, CSGNetConfig
from lib.models.csgnet_beams import beam_search
from lib.models.csgnet_decoding import write
from lib.models.pretrained import pretrained
from lib.models.weights import CheckpointError, load
from lib.training.csgnet import Teacher
from tests.timing import timed

DATA = "pictures of random programs, equal shares of lengths 3 to 13"
LENGTHS = (3, 5, 7, 9, 11, 13)
BATCH = 50
AUTHORS = {"greedy": 0.16, "beams of 1": 1.5, "beams of 50": 0.125, "96 programs": 7.7 / 96, "Powell": 1.35}


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    torch.set_num_threads(1)


def programs(each: int, seed: int = 0) -> torch.Tensor:
    """So many random programs of every length, in any order, padded with `$`."""
    rng = np.random.default_rng(seed)
    rows = [sample_many(rng, each, length) for length in LENGTHS]
    stop = vocabulary_of(2).stop
    padded = [torch.nn.functional.pad(row, (0, LENGTHS[-1] + 1 - row.shape[1]), value=stop) for row in rows]
    return torch.cat(padded)[torch.from_numpy(rng.permutation(each * len(LENGTHS)))]


@pytest.fixture(scope="module")
def images() -> torch.Tensor:
    return execute_many(programs(9)).images[:BATCH]


@pytest.fixture(scope="module", params=["paper", "compact"])
def network(request) -> tuple[str, CSGNet]:
    """The paper's sizes with random weights, whose programs are as long as may be; the network that was trained."""
    if request.param == "paper":
        torch.manual_seed(0)
        return "paper's sizes", CSGNet().eval()
    try:
        return "compact network", load(CSGNet, pretrained("csgnet_2d"))
    except CheckpointError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("count", [1, BATCH])
def test_beam_search(benchmark, network, images, count):
    name, network = network
    what = f"{name}: beam search with 10 beams, {count} at once, each"
    authors = AUTHORS[f"beams of {count}"] if name.startswith("paper") else None

    def search():
        return beam_search(network, images[-count:])

    rounds = 3 if authors and count > 1 else 7
    found = timed(benchmark, search, what, data=DATA, count=count, rounds=rounds, authors=authors)
    assert execute_many(found.tokens.flatten(0, 1)).valid.all()


def test_greedy(benchmark, network, images):
    name, network = network
    authors = AUTHORS["greedy"] if name.startswith("paper") else None

    def greedy():
        with torch.no_grad():
            return write(network, images[-1:])

    assert timed(benchmark, greedy, f"{name}: greedy, one picture", data=DATA, authors=authors)


@pytest.mark.parametrize("paper, count", [(True, 96), (False, 128)])
def test_a_training_step(benchmark, paper, count):
    """Drawing, forward, backward and Adam. What share of it is drawing stands in the log of every training."""
    torch.manual_seed(0)
    teacher = Teacher(CSGNet(CSGNetConfig.paper() if paper else CSGNetConfig.compact())).train()
    optimizer, tokens = torch.optim.Adam(teacher.parameters()), programs(-(-count // len(LENGTHS)))[:count]

    def step() -> float:
        optimizer.zero_grad()
        loss = teacher(execute_many(tokens).images, tokens)
        loss.backward()
        optimizer.step()
        return loss.item()

    name = "paper's sizes" if paper else "compact network"
    what = f"{name}: a training step of {count} programs, each"
    authors = AUTHORS["96 programs"] if paper else None
    assert timed(benchmark, step, what, data=DATA, count=count, rounds=3, authors=authors) > 0


@pytest.mark.parametrize("count, sweeps", [(1, None), (BATCH, None), (BATCH, 1)])
def test_refine(benchmark, count, sweeps):
    """Programs of 13 tokens towards the pictures of others; the authors' figure is one iteration of Powell's method."""
    found, targets = longest_programs(count)
    what = f"refine {'until the end' if sweeps is None else 'in one sweep'}, 13 tokens, {count} at once, each"
    refined = timed(
        benchmark, lambda: refine(found, targets, sweeps), what, data=DATA, count=count, rounds=3,
        authors=AUTHORS["Powell"],
    )  # fmt: skip
    assert (refined.distances[-1] <= refined.distances[0]).all()


def test_refine_by_powell(benchmark):
    [found], targets = longest_programs(1)
    what = "refine by Powell's method, one iteration, 13 tokens"
    _, distances = timed(
        benchmark, lambda: refine_by_powell(found, targets[0], 1), what, data=DATA, rounds=3,
        authors=AUTHORS["Powell"],
    )  # fmt: skip
    assert distances[-1] <= distances[0]


def longest_programs(count: int) -> tuple[list, torch.Tensor]:
    """Programs of 13 tokens, and the pictures of as many others."""
    tokens = sample_many(np.random.default_rng(1), 2 * count, LENGTHS[-1])
    return [vocabulary_of(2).program(row) for row in tokens[:count]], execute_many(tokens[count:]).images


def test_nearest_neighbours(benchmark):
    """Among the training programs that are at hand, all of which are drawn; for a hundred pictures together."""
    known, targets = csg_programs(2, "train").tokens, execute_many(programs(17, seed=2)[:100]).words
    what = f"nearest of {len(known)} programs for 100 pictures, each"
    found = timed(
        benchmark, lambda: nearest(targets, known, vocabulary_of(2)), what, data=DATA, count=100, rounds=1
    )
    assert (found.pixels >= 0).all()
