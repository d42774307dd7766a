"""Measure CSGNet: Tables 2 to 5 of its paper, one at a time.

    python -m data_scripts.measure_csgnet synthetic                   Table 2: 5,000 random test programs of the plane
    python -m data_scripts.measure_csgnet synthetic --dimensions 3    Table 4: 500 of space
    python -m data_scripts.measure_csgnet silhouettes                 Table 3: 500 silhouettes, with refinement
    python -m data_scripts.measure_csgnet detection                   Table 5: primitives as objects
    python -m data_scripts.measure_csgnet logos                       what the paper shows of logos, in numbers

Make the data first: make_csg_programs (also with --dimensions 3), make_silhouettes, make_logos. Without it the few
programs and silhouettes that are made on the spot are measured, and the result says so; there are no such logos.

Each writes results/csgnet/NAME.json, with counts, the date and the version of code and weights. With --weights and
--out, other networks are measured, such as those of other seeds. The nearest neighbours are
searched in all training programs; this and Powell's method take most of the time: 10 to 40 minutes a table on one core.
--quick takes 16 of everything and a hundredth of the training programs.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from functools import partial
from hashlib import sha256
from pathlib import Path

import torch
from torch import Tensor
from tqdm import tqdm

from data_scripts.ending import exit_code
from data_scripts.journal import write_whole
from data_scripts.measuring import INTERRUPTED, check_writable, rounded, version
from lib.datasets import REPOSITORY, DataError, csg_programs, silhouettes
from lib.datasets.csg import TokenSet
from lib.datasets.images import logos
from lib.finding.picture_choice import Choice, best_of
from lib.finding.picture_nearest import nearest
from lib.finding.picture_powell import refine_by_powell
from lib.finding.picture_refining import refine
from lib.finding.primitive_detection import detection_precision
from lib.interpreters.csg import Program, Shapes, execute_many, vocabulary_of
from lib.interpreters.csg.packing import pack
from lib.models.csgnet import CSGNet, check_reader
from lib.models.csgnet_beams import beam_search
from lib.models.pretrained import pretrained
from lib.models.weights import CheckpointError, load
from lib.training.csgnet_command import evenly, spread

FOLDER = REPOSITORY / "results" / "csgnet"
TABLES = ("synthetic", "silhouettes", "detection", "logos")
COUNTS = {
    ("synthetic", 2): 5_000,
    ("synthetic", 3): 500,
    ("silhouettes", 2): 500,
    ("detection", 2): 2_000,
    ("logos", 2): 500,
}
BEAMS = (1, 5, 10)
SWEEPS = (0, 1, 2, 4, 10, None)  # iterations of refinement; None: until nothing gets better
POWELL = 25  # silhouettes that are refined by Powell's method too, which is slow
QUICK = 16
AT_ONCE = 100  # shapes whose beams are searched together
DECIDING = ("interpreters", "models", "metrics", "finding")  # parts of lib that the numbers come from


def synthetic(dimensions: int, network: CSGNet, count: int, quick: bool) -> dict:
    """Tables 2 and 4: mean likeness of the answers to the shapes, all and by length of the program that drew them."""
    test, known = some(evenly(csg_programs(dimensions, "test"), count)), known_programs(dimensions, quick)
    shapes = execute_many(test.tokens, test.vocabulary)
    canvases = shapes.images if dimensions == 2 else shapes.grids
    methods = {"nearest": partial(neighbours, canvases, shapes.words, known)}
    methods |= {f"k={k}": partial(parsed, network, canvases, k) for k in BEAMS}
    rows = {}
    for name, method in methods.items():
        start = time.perf_counter()
        choice = method()
        seconds = (time.perf_counter() - start) / len(test)
        rows[name] = compared(shapes, choice) | {"seconds_each": seconds}
    return {"data": test.source, "samples": len(test), "known": len(known), "rows": rows}


def known_programs(dimensions: int, quick: bool) -> TokenSet:
    """What the nearest neighbours are searched in."""
    return some(csg_programs(dimensions, "train")[:: 100 if quick else 1])


def some(found):
    """The same. Raises DataError for no programs, or no masks."""
    if not len(found):
        raise DataError(f"{found.describe()} There is nothing to measure; expected 1 or more")
    return found


def neighbours(canvases: Tensor, words: Tensor, known: TokenSet) -> Choice:
    """The nearest known program of each shape, which is given as a canvas and as packed words."""
    index = nearest(words, known.tokens, known.vocabulary).index
    return best_of(canvases, known.tokens[index].unsqueeze(1))


def parsed(network: CSGNet, canvases: Tensor, k: int) -> Choice:
    """The best of k programs that the network writes for each shape."""
    return best_of(canvases, beams_of(network, canvases, k))


def beams_of(network: CSGNet, canvases: Tensor, k: int) -> Tensor:
    """The network's k likeliest programs for each shape, (n, k, length), searched for some shapes at a time."""
    parts = tqdm(canvases.split(AT_ONCE), desc=f"k={k}", leave=False, disable=None)
    found = [beam_search(network, part, k).tokens for part in parts]
    longest = max(tokens.shape[2] for tokens in found)
    return torch.cat(
        [torch.nn.functional.pad(t, (0, longest - t.shape[2]), value=network.stop) for t in found]
    )


def compared(shapes: Shapes, choice: Choice) -> dict:
    """A row: mean measure (Chamfer distance, px, or IoU, percent), of all and by length; percent that are exact."""
    plane = shapes.dimensions == 2
    measure = (choice.of_best if plane else 100 * choice.of_best).double()
    exact = 100 * (shapes.words == execute_many(choice.tokens, shapes.vocabulary).words).all(1).double()
    lengths = (shapes.tokens != shapes.vocabulary.stop).sum(1)
    of = {int(n): lengths == n for n in lengths.unique()}
    return {
        "chamfer_px" if plane else "iou_percent": float(measure.mean()),
        "exact_percent": float(exact.mean()),
        "by_length": {n: float(measure[rows].mean()) for n, rows in of.items()},
        "exact_by_length": {n: float(exact[rows].mean()) for n, rows in of.items()},
    }


def silhouette_table(supervised: CSGNet, reinforced: CSGNet, count: int, quick: bool) -> dict:
    """Table 3: mean Chamfer distance to silhouettes after so many iterations of refinement, coordinate search on all
    and Powell's method on some."""
    masks = some(silhouettes(split="test"))
    images, known = masks.images[spread(len(masks), count)], known_programs(2, quick)
    choices = {"nearest": neighbours(images, pack(images), known)}
    for name, network in {"supervised": supervised, "reinforced": reinforced}.items():
        choices |= {f"{name} k={k}": parsed(network, images, k) for k in (1, 10)}
    few = spread(len(images), QUICK if quick else POWELL)
    rows = {name: refined(choice, images, few) for name, choice in choices.items()}
    return {"data": masks.source, "samples": len(images), "powell_samples": len(few), "rows": rows}


def refined(choice: Choice, images: Tensor, some: Tensor) -> dict:
    """A row of Table 3: distances by iterations ("None" is until the end), and seconds a picture; Powell's method
    refines some of the pictures."""
    programs = programs_of(choice)
    start = time.perf_counter()
    distances = refine(programs, images).distances
    seconds = (time.perf_counter() - start) / len(images)
    bar = tqdm(some.tolist(), desc="Powell", leave=False, disable=None)
    start = time.perf_counter()
    slow = [at_iterations(refine_by_powell(programs[i], images[i])[1]) for i in bar]
    seconds_powell = (time.perf_counter() - start) / len(some)
    return {
        "chamfer_px": at_iterations(distances.mean(1).tolist()),
        "seconds_each": seconds,
        "same_as_powell_px": at_iterations(distances[:, some].mean(1).tolist()),
        "powell_px": {n: sum(row[n] for row in slow) / len(slow) for n in slow[0]},
        "powell_seconds_each": seconds_powell,
        "tokens": sum(map(len, programs)) / len(programs),
    }


def programs_of(choice: Choice) -> list[Program]:
    return [vocabulary_of(2).program(tokens) for tokens in choice.tokens]


def at_iterations(distances: Sequence[float]) -> dict[str, float]:
    """After 0, 1, 2, 4, 10 and all iterations; where fewer were made, after the last."""
    return {str(n): distances[-1 if n is None else min(n, len(distances) - 1)] for n in SWEEPS}


def detection(network: CSGNet, count: int) -> dict:
    """Table 5: average precision of primitives, percent, and images a second."""
    test = some(evenly(csg_programs(2, "test"), count))
    images, rows = execute_many(test.tokens, test.vocabulary).images, {}
    for k in (10, 40):
        start = time.perf_counter()
        beams = beams_of(network, images, k)
        seconds = time.perf_counter() - start
        found = detection_precision(beams, test.tokens, test.vocabulary)
        rows[f"k={k}"] = {n: 100 * v for n, v in found.items()} | {"images_a_second": len(images) / seconds}
    return {"data": test.source, "samples": len(test), "rows": rows}


def logo_table(supervised: CSGNet, reinforced: CSGNet, count: int) -> dict:
    """Mean Chamfer distance to logos, which no network has seen, before and after refinement."""
    masks = some(logos())
    images, rows = masks.images[spread(len(masks), count)], {}
    for name, network in {"supervised": supervised, "reinforced": reinforced}.items():
        found = refine(programs_of(parsed(network, images, 10)), images).distances
        rows[f"{name} k=10"] = {"chamfer_px": at_iterations(found.mean(1).tolist())}
    return {"data": masks.source, "samples": len(images), "rows": rows}


def measure(options: argparse.Namespace) -> dict:
    """One table, with all that is needed to measure it again."""
    start = time.perf_counter()
    paths = {"weights": options.weights or pretrained(f"csgnet_{options.dimensions}d")}
    if options.table in ("silhouettes", "logos"):
        paths["reinforced"] = options.reinforced or pretrained("csgnet_2d_reinforced")
    elif options.reinforced:
        raise DataError(f"found --reinforced for the table {options.table}; expected --weights")
    networks = [network_of(path, options.dimensions) for path in paths.values()]
    count = QUICK if options.quick else options.count or COUNTS[options.table, options.dimensions]
    if options.table == "synthetic":
        found = synthetic(options.dimensions, *networks, count, options.quick)
    elif options.table == "silhouettes":
        found = silhouette_table(*networks, count, options.quick)
    else:
        found = (detection if options.table == "detection" else logo_table)(*networks, count)
    named = {name: sha256(path.read_bytes()).hexdigest()[:12] for name, path in paths.items()}
    seconds = {"seconds": round(time.perf_counter() - start, 1), "threads": torch.get_num_threads()}
    header = {"table": options.table, "dimensions": options.dimensions, **named, **version(*DECIDING)}
    return header | rounded(found) | seconds


def network_of(path: Path, dimensions: int) -> CSGNet:
    """A trained network. Raises CheckpointError, and DataError for one of other dimensions."""
    network = load(CSGNet, path)
    try:
        check_reader(network, dimensions)
    except ValueError as error:
        raise DataError(f"{path}: {error}") from error
    return network


def main(arguments: list[str] | None = None) -> int:
    """The command. Returns the exit code: 0 finished, 1 nothing could be measured, 130 interrupted."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("--dimensions", type=int, choices=(2, 3), default=2, help="of synthetic programs")
    parser.add_argument("--weights", type=Path, help="default: those that come with the project")
    parser.add_argument("--reinforced", type=Path, help="those of the reinforced network")
    parser.add_argument("--count", type=int, help="shapes (default: see above)")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} shapes")
    parser.add_argument("--out", type=Path, help="default: results/csgnet/NAME.json")
    options = parser.parse_args(arguments)
    name = f"synthetic_{options.dimensions}d" if options.table == "synthetic" else options.table
    out = options.out or FOLDER / f"{name}.json"

    def work() -> None:
        check_writable(out)
        if (options.table, options.dimensions) not in COUNTS:
            raise DataError(f"{options.table} is of the plane; expected --dimensions 2")
        if options.count is not None and options.count < 1:
            raise DataError(f"--count is {options.count}; expected at least 1")
        torch.set_num_threads(1)
        try:
            found = measure(options)
        except (CheckpointError, ValueError) as error:
            raise DataError(str(error)) from error
        print(json.dumps(found["rows"], indent=1))
        write_whole(out, (json.dumps(found, indent=1) + "\n").encode())
        print(f"kept in {out}")

    return exit_code(work, INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
