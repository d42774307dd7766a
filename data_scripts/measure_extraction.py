"""Measure the extractor: python -m data_scripts.measure_extraction

    furniture   part graphs of the furniture maker                         results/extraction_furniture.json
    real        every real program executed, its boxes extracted again     results/extraction_round_trip.json
    shaken      the same, siblings shuffled and sizes off by up to 1 %
    flat        the same without shaking, leaf boxes only: no hierarchy

For each category: accepted share, F-scores, lines and macros beside those of the original programs, reasons of
rejection. Experiments without --only run one after the other; finished ones are kept and not run again unless --again.
All but furniture need the real programs (python -m data_scripts.fetch_shapeassembly); two cores take about 25 minutes.
"""

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from joblib import Parallel, delayed
from tqdm import tqdm

from lib.datasets import CATEGORIES, REPOSITORY, DataError, shapeassembly
from lib.extractor import Extraction, Part, PartGraph, extract_many
from lib.extractor.arranging import collapse, flat
from lib.extractor.bounding import centered
from lib.furniture import make
from lib.interpreters.cuboids import Cuboids
from lib.interpreters.shapeassembly import Program, execute_many, parse
from lib.metrics.fscore import cloud_f_score, spacing
from lib.metrics.programs import MACROS

RESULTS = REPOSITORY / "results"
FILES = {"furniture": RESULTS / "extraction_furniture.json"}
FILES |= dict.fromkeys(("real", "shaken", "flat"), RESULTS / "extraction_round_trip.json")
CHUNK = 32  # graphs a job
CLOUDS = 8  # every eighth shape is also measured cloud against cloud
SHAKEN = 0.01  # share by which sizes are off


def shake(graph: PartGraph, seed: int) -> PartGraph:
    """Siblings in another order, every side of every leaf longer or shorter by up to 1 %."""
    rng = np.random.default_rng(seed)

    def visit(part: Part) -> Part:
        if part.is_leaf:
            factors = torch.from_numpy(rng.uniform(1 - SHAKEN, 1 + SHAKEN, 3))
            return replace(part, box=Cuboids(part.box.size * factors, part.box.center, part.box.axes))
        children = [visit(child) for child in part.children]
        return replace(part, children=tuple(children[i] for i in rng.permutation(len(children))))

    return graph.with_root(visit(graph.root))


def furniture(category: str, chunk: Sequence[int]) -> tuple[list[PartGraph], list[Program]]:
    """Part graphs of some seeds; nobody wrote programs for them."""
    return [make(category, seed) for seed in chunk], []


def round_trip(
    change: Callable, category: str, chunk: Sequence[str]
) -> tuple[list[PartGraph], list[Program]]:
    """Part graphs of some executed real programs, given as texts, and the programs."""
    programs = [parse(text) for text in chunk]
    graphs = [PartGraph.from_shape(shape, category, str(i)) for i, shape in enumerate(execute_many(programs))]
    return [change(graph, text) for graph, text in zip(graphs, chunk)], programs


CHANGES = {
    "real": lambda graph, text: graph,
    "shaken": lambda graph, text: shake(graph, len(text)),
    "flat": lambda graph, text: flat(graph),
}


def measure_chunk(experiment: str, category: str, chunk: Sequence) -> list[dict]:
    """One row a graph."""
    torch.set_num_threads(1)
    if experiment == "furniture":
        graphs, programs = furniture(category, chunk)
    else:
        graphs, programs = round_trip(CHANGES[experiment], category, chunk)
    extractions = extract_many(graphs)
    originals = programs or [None] * len(graphs)
    rows = [row(*each) for each in zip(extractions, originals)]
    for graph, extraction, found in list(zip(graphs, extractions, rows))[::CLOUDS]:
        if extraction.accepted:
            found["cloud_f_score"] = cloud_score(graph, extraction.program)
    return rows


def row(extraction: Extraction, original: Program | None) -> dict:
    """What became of one graph."""
    found = {"reason": extraction.reason, "f_score": extraction.f_score}
    if extraction.accepted:
        found["program"] = counts(extraction.program)
    if original:
        found["original"] = counts(original)
    return found


def counts(program: Program) -> dict[str, int]:
    """Lines of one program, and how many of them are macros."""
    commands = [statement.command for _, _, statement in program.statements()]
    return {"lines": len(commands), "macros": sum(command in MACROS for command in commands)}


def cloud_score(graph: PartGraph, program: Program) -> float:
    """The F-score as the authors measure it: cloud against cloud, percent."""
    target = centered(collapse(graph)).leaves.surface_points(10_000, 1)
    result = execute_many([program])[0].surface_points(10_000, 2)
    return cloud_f_score(result, target, spacing(target))


def summary(rows: list[dict]) -> dict:
    """The figures of one category."""
    accepted = [each for each in rows if not each["reason"]]
    scores = np.array([each["f_score"] for each in accepted])
    clouds = [each for each in accepted if "cloud_f_score" in each]
    found = {
        "shapes": len(rows),
        "accepted_percent": round(100 * len(accepted) / len(rows), 2),
        "mean_f_score": round(float(scores.mean()), 2),
        "f_score_95_percent": round(100 * float((scores >= 95).mean()), 2),
        "mean_cloud_f_score": round(float(np.mean([each["cloud_f_score"] for each in clouds])), 2),
        **totals([each["program"] for each in accepted]),
        "reasons": dict(sorted(Counter(each["reason"] for each in rows if each["reason"]).items())),
    }
    if "original" in rows[0]:
        found["original"] = totals([each["original"] for each in rows])
        found["original_of_accepted"] = totals([each["original"] for each in accepted])
    return found


def totals(programs: list[dict]) -> dict:
    """Lines per program, and all macros divided by all lines."""
    lines, macros = (sum(each[key] for each in programs) for key in ("lines", "macros"))
    return {"lines": round(lines / len(programs), 2), "macros_per_line": round(macros / lines, 4)}


def inputs(experiment: str, category: str, count: int | None) -> Sequence:
    """Seeds, or program texts. Raises DataError without the real programs."""
    if experiment == "furniture":
        return range(count or 1000)
    programs = shapeassembly(category)
    if programs.source != "real":
        raise DataError(
            "the real programs are not here; first run: python -m data_scripts.fetch_shapeassembly"
        )
    return [program.to_text() for program in programs[:count]]


def run(experiment: str, count: int | None, workers: int) -> dict:
    """Figures of all categories."""
    found = {}
    for category in CATEGORIES:
        items = inputs(experiment, category, count)
        chunks = [items[start : start + CHUNK] for start in range(0, len(items), CHUNK)]
        jobs = (delayed(measure_chunk)(experiment, category, chunk) for chunk in chunks)
        done = Parallel(n_jobs=workers, return_as="generator")(jobs)
        rows = []
        with tqdm(total=len(items), desc=f"{experiment} {category}", unit=" shapes") as bar:
            for chunk in done:
                rows += chunk
                bar.update(len(chunk))
        found[category] = summary(rows)
    return found


def measure(experiment: str, options: argparse.Namespace) -> None:
    """Run one experiment, print and keep its figures; unless they are there already."""
    path = options.out / FILES[experiment].name
    kept = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    if experiment in kept and not options.again:
        counts = ", ".join(f"{found['shapes']} {category}" for category, found in kept[experiment].items())
        print(f"{experiment}: {counts} already in {path} (--again measures again)")
        return
    found = run(experiment, options.count, options.workers)
    keep(path, experiment, found)
    for category, figures in found.items():
        print(experiment, category, json.dumps(figures))


def keep(path: Path, experiment: str, found: dict) -> None:
    """Put the figures into the result file, beside those of other experiments."""
    kept = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    part.write_text(json.dumps(kept | {experiment: found}, indent=1) + "\n", encoding="utf-8")
    part.replace(path)


def main(arguments: list[str] | None = None) -> int:
    """Run from the command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=FILES, help="one experiment (default: all)")
    parser.add_argument(
        "--count", type=int, help="shapes a category (default: 1000 pieces of furniture; all programs)"
    )
    parser.add_argument(
        "--workers", type=int, default=os.cpu_count(), help="processes (default: %(default)s)"
    )
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder (default: results/)")
    parser.add_argument("--again", action="store_true", help="measure finished experiments again")
    options = parser.parse_args(arguments)
    wanted = [options.only] if options.only else list(FILES)
    try:
        for experiment in wanted:
            inputs(experiment, CATEGORIES[0], 1)  # missing data is told before hours of work, not after
        for experiment in wanted:
            measure(experiment, options)
    except DataError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
