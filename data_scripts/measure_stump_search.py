"""Measure the search for a stump's matrices: python -m data_scripts.measure_stump_search

Writes results/stump_search.json. Random stumps of K balls in a cube, K / 2 nodes of two or three balls each, are to be
found again from 4096 points of which 2 % are told wrong, by three searches with a limit of SECONDS each:

    layers   the paper's binary program: a variable for each cell of the matrices (only up to MOST_LAYERS balls)
    solve    lib.finding's search: cells merged, nodes chosen out of a list of terms, bounds of the complement layer
    greedy   one node after the other

For each K and search, over the seeds: the objective (percent of the points that are wrong), how much of it no matrices
could do without, as far as is proven, the seconds, and how many answers were proven to be the best. Times are those of
one thread. About three minutes on one core; --quick takes seconds and is for a first look.
"""

import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import torch
from tqdm import tqdm

from data_scripts.journal import code_digest
from data_scripts.measuring import command
from lib.datasets import REPOSITORY
from lib.finding.arrangement import Arrangement
from lib.finding.matrices import EXACT, Matrices, arrange, greedy, solve
from lib.finding.programming import layers

RESULT = REPOSITORY / "results" / "stump_search.json"
PRIMITIVES = (2, 4, 6, 8, 10, 12, 16, 24, 32, 48, 64)
MOST_LAYERS = 16  # with more balls the paper's program finds nothing within the limit
SEEDS, SECONDS, POINTS, NOISE = 3, 10.0, 4096, 0.02
QUICK = {"primitives": (2, 4), "seeds": 2, "seconds": 2.0}
ATTEMPTS = 200


def planted(count: int, seed: int) -> tuple[torch.Tensor, torch.Tensor, int]:
    """(which points are in which balls (K, N), which should be in (N), nodes) of a random stump.

    Each node holds 3 to 30 % of the points, and 2 % that no node before it holds.
    """
    rng = np.random.default_rng([count, seed])
    points = rng.uniform(-1, 1, (POINTS, 3))
    centers, radii = rng.uniform(-0.8, 0.8, (count, 1, 3)), rng.uniform(0.4, 0.9, (count, 1))
    inside = np.linalg.norm(points - centers, axis=-1) <= radii
    held = inside ^ (rng.random((count, 1)) < 0.4)
    target, nodes = np.zeros(POINTS, bool), max(1, count // 2)
    for _ in range(nodes):
        target |= _node(rng, held, target)
    target ^= rng.random(POINTS) < NOISE
    return torch.from_numpy(inside), torch.from_numpy(target), nodes


def _node(rng: np.random.Generator, held: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The points (N) of a random node that adds something to the target; none where chance finds no such node."""
    for _ in range(ATTEMPTS):
        chosen = rng.choice(len(held), size=min(len(held), rng.integers(2, 4)), replace=False)
        node = held[chosen].all(0)
        if 0.03 < node.mean() < 0.3 and (node & ~target).mean() > 0.02:
            return node
    return np.zeros(len(target), bool)


def by_layers(inside: torch.Tensor, target: torch.Tensor, nodes: int, seconds: float) -> dict:
    """What the paper's program comes to: an answer without terms counts as an empty shape."""
    start = time.perf_counter()
    arrangement: Arrangement = arrange(inside, target)
    answer = layers(arrangement, nodes, seconds)
    objective = arrangement.error(answer.terms or []) / arrangement.total
    return _row(objective, answer.bound / arrangement.total, time.perf_counter() - start)


def by(
    search: Callable[..., Matrices], inside: torch.Tensor, target: torch.Tensor, nodes: int, seconds: float
) -> dict:
    """What a search of lib.finding comes to."""
    found = search(inside, target, nodes=nodes, seconds=seconds)
    return _row(found.objective, found.bound, found.seconds)


def _row(objective: float, bound: float, seconds: float) -> dict:
    return {"objective": objective, "bound": bound, "seconds": seconds, "proven": objective - bound <= EXACT}


SEARCHES: dict[str, Callable] = {
    "layers": by_layers,
    "solve": partial(by, solve),
    "greedy": partial(by, greedy),
}


def measure(primitives: tuple[int, ...], seeds: int, seconds: float) -> dict:
    """The figures of all searches."""
    wanted = {k: [name for name in SEARCHES if name != "layers" or k <= MOST_LAYERS] for k in primitives}
    rows = []
    with tqdm(total=seeds * sum(map(len, wanted.values())), unit=" searches") as bar:
        for count, names in wanted.items():
            questions = [planted(count, seed) for seed in range(seeds)]
            for name in names:
                bar.set_description(f"{count} balls, {name}")
                found = []
                for question in questions:
                    found.append(SEARCHES[name](*question, seconds))
                    bar.update()
                rows.append(summary(count, name, questions, found))
    return {
        "command": "python -m data_scripts.measure_stump_search",
        "code": code_digest("finding"),
        "points": POINTS,
        "noise_percent": 100 * NOISE,
        "limit_seconds": seconds,
        "seeds": seeds,
        "rows": rows,
    }


def summary(count: int, name: str, questions: list[tuple], found: list[dict]) -> dict:
    """One row: means over the seeds, and the longest time."""
    mean = {key: float(np.mean([each[key] for each in found])) for key in ("objective", "bound", "seconds")}
    return {
        "primitives": count,
        "nodes": questions[0][2],
        "cells": round(float(np.mean([len(arrange(*question[:2]).value) for question in questions])), 1),
        "search": name,
        "wrong_percent": round(100 * mean["objective"], 3),
        "bound_percent": round(100 * mean["bound"], 3),
        "seconds": round(mean["seconds"], 3),
        "longest_seconds": round(max(each["seconds"] for each in found), 3),
        "proven": sum(each["proven"] for each in found),
    }


def told(found: dict) -> str:
    """The rows as a table for the terminal."""
    headings = {
        "primitives": "K", "nodes": "nodes", "cells": "cells", "search": "search", "wrong_percent": "wrong %",
        "bound_percent": "bound %", "seconds": "seconds", "longest_seconds": "longest", "proven": "proven",
    }  # fmt: skip
    lines = [[*headings.values()]] + [[str(row[key]) for key in headings] for row in found["rows"]]
    return "\n".join("".join(f"{cell:>9}" for cell in line) for line in lines)


def main(arguments: list[str] | None = None) -> int:
    """The command; returns the exit code, as `command` says."""
    return command(__doc__, RESULT, "few and small ones, to see that it works", run, told, arguments)


def run(quick: bool) -> dict:
    """The figures, of few and small stumps or of all."""
    return measure(**(QUICK if quick else {"primitives": PRIMITIVES, "seeds": SEEDS, "seconds": SECONDS}))


if __name__ == "__main__":
    sys.exit(main())
