"""Measure the search for stumps in point clouds: python -m data_scripts.measure_stump_solids

Writes results/stump_solids.json. Each of the ten solids of lib.datasets is found again from a cloud of 10,000 points
with normals: a clean one, and one with noise of 0.5 % of the diagonal and 5 % outliers. With each of SEEDS seeds, which
draw the cloud and the search's trials, the matrices are searched for twice, by `solve` and by `greedy`.

IoU is that of the found and the true solid at 100,000 random points of the true one's bounding box; `box_iou` is what
the bounding box itself would have. Times are those of one thread. About five minutes on one core; --quick takes one
seed and three solids, which is half a minute.
"""

import sys

import numpy as np
import torch
from tqdm import tqdm

from data_scripts.journal import code_digest
from data_scripts.measuring import command
from lib.datasets import REPOSITORY
from lib.datasets.solids import SOLIDS, solid
from lib.finding import find_stump, greedy, sample_cloud, solve
from lib.interpreters.stump import Shape, Stump, execute

RESULT = REPOSITORY / "results" / "stump_solids.json"
CLOUDS = {"clean": {"noise": 0.0, "outliers": 0.0}, "noisy": {"noise": 0.005, "outliers": 0.05}}
SEARCHES = {"solve": solve, "greedy": greedy}
POINTS, PROBES, SEEDS, GOOD = 10_000, 100_000, 3, 0.95
QUICK = {"solids": ("bolt", "mug", "table"), "seeds": 1}


def iou(found: Shape, true: Shape) -> float:
    """Share of points in both among those in either, told from random points of the true shape's bounds."""
    low, high = true.window
    points = low + (high - low) * torch.rand(PROBES, 3, generator=torch.Generator().manual_seed(0)).double()
    a, b = found.occupancy(points), true.occupancy(points)
    return float((a & b).sum() / (a | b).sum())


def row(name: str, cloud: str, search: str, seeds: int) -> dict:
    """One solid, one kind of cloud, one search: means over the seeds, and the worst IoU."""
    true, found, scores = execute(Stump.from_tree(solid(name))), [], []
    for seed in range(seeds):
        points = sample_cloud(true.mesh(), POINTS, seed, **CLOUDS[cloud])
        found.append(find_stump(points, seed, search=SEARCHES[search]))
        scores.append(iou(execute(found[-1].stump), true))
    return {
        "solid": name,
        "cloud": cloud,
        "search": search,
        "iou": round(float(np.mean(scores)), 3),
        "worst_iou": round(min(scores), 3),
        "candidates": round(float(np.mean([len(each.candidates) for each in found])), 1),
        "primitives": round(float(np.mean([len(each.stump.primitives) for each in found])), 1),
        "nodes": round(float(np.mean([len(each.stump.union) for each in found])), 1),
        "wrong_percent": round(100 * float(np.mean([each.objective for each in found])), 3),
        "proven": sum(each.matrices.proven for each in found),
        "seconds": round(float(np.mean([sum(each.seconds.values()) for each in found])), 1),
    }


def measure(solids: tuple[str, ...], seeds: int) -> dict:
    """The figures of all solids."""
    wanted = [(name, cloud, search) for name in solids for cloud in CLOUDS for search in SEARCHES]
    with tqdm(wanted, unit=" rows") as bar:
        rows = [row(*each, seeds) for each in bar]
    return {
        "command": "python -m data_scripts.measure_stump_solids",
        "code": code_digest("finding"),
        "points": POINTS,
        "seeds": seeds,
        "clouds": CLOUDS,
        "box_iou": {name: round(box_iou(execute(Stump.from_tree(solid(name)))), 3) for name in solids},
        "rows": rows,
    }


def box_iou(true: Shape) -> float:
    """How much of its bounding box the solid fills."""
    low, high = true.window
    return float(true.mesh().volume / (high - low).prod())


def told(found: dict) -> str:
    """The rows as a table for the terminal, and how many solids are good."""
    keys = [key for key in found["rows"][0] if key != "solid"]
    lines = ["".join([f"{'solid':12}", *(f"{key:>14}" for key in keys)])]
    lines += ["".join([f"{r['solid']:12}", *(f"{r[key]!s:>14}" for key in keys)]) for r in found["rows"]]
    for cloud in CLOUDS:
        for search in SEARCHES:
            some = [r for r in found["rows"] if (r["cloud"], r["search"]) == (cloud, search)]
            good = sum(r["worst_iou"] >= GOOD for r in some)
            lines.append(
                f"{cloud}, {search}: IoU at least {GOOD} with every seed for {good} of {len(some)} solids"
            )
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """The command; returns the exit code, as `command` says."""
    return command(__doc__, RESULT, "three solids and one seed", run, told, arguments)


def run(quick: bool) -> dict:
    """The figures, of few solids or of all."""
    return measure(**(QUICK if quick else {"solids": SOLIDS, "seeds": SEEDS}))


if __name__ == "__main__":
    sys.exit(main())
