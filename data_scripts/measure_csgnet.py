"""Measure CSGNet: Tables 2 to 5 of its paper, one at a time.

    python -m data_scripts.measure_csgnet synthetic                   Table 2: 5,000 random test programs of the plane
    python -m data_scripts.measure_csgnet synthetic --dimensions 3    Table 4: 500 of space
    python -m data_scripts.measure_csgnet silhouettes                 Table 3: 500 silhouettes, with refinement
    python -m data_scripts.measure_csgnet detection                   Table 5: primitives as objects
    python -m data_scripts.measure_csgnet logos                       what the paper shows of logos, in numbers

Make the data first: make_csg_programs (also with --dimensions 3), make_silhouettes, make_logos. Without it the few
programs and masks that are made on the spot are measured, and the result says so.

Each writes results/csgnet/NAME.json, with counts, the date and the version of code and weights. With --weights and
--out, other networks are measured: those of other seeds are in results/csgnet/other_seeds. The nearest neighbours are
searched in all training programs; this and Powell's method take most of the time: 10 to 40 minutes a table on one core.
--quick takes 16 of everything and a hundredth of the training programs.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import torch
from torch import Tensor
from tqdm import tqdm

from data_scripts.ending import exit_code
from data_scripts.journal import write_whole
from data_scripts.measuring import INTERRUPTED, check_writable, version
from lib.datasets import REPOSITORY, DataError, csg_programs, silhouettes
from lib.datasets.csg import TokenSet
from lib.datasets.images import logos
from lib.finding.picture_choice import Choice, best_of
from lib.finding.picture_nearest import nearest
from lib.finding.picture_powell import refine_by_powell
from lib.finding.picture_refining import refine
from lib.finding.primitive_detection import detection_precision
from lib.interpreters.csg import Program, execute_many, vocabulary_of
from lib.interpreters.csg.packing import pack
from lib.models.csgnet import CSGNet
from lib.models.csgnet_beams import beam_search
from lib.models.pretrained import pretrained
from lib.models.weights import CheckpointError, load

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
POWELL = 50  # silhouettes that are refined by Powell's method too, which is slow
QUICK = 16
AT_ONCE = 100  # shapes whose beams are searched together
DECIDING = ("interpreters", "models", "metrics", "finding")  # parts of lib that the numbers come from


def synthetic(dimensions: int, network: CSGNet, count: int, quick: bool) -> dict:
    """Tables 2 and 4: mean likeness of the answers to the shapes, all and by length of the program that drew them."""
    test = evenly(csg_programs(dimensions, "test"), count)
    lengths = (test.tokens != test.vocabulary.stop).sum(1)
    train = csg_programs(dimensions, "train")
    known = train.tokens[:: 100 if quick else 1]
    rows = {"nearest": compared(test, lengths, neighbours(test, known))}
    for k in BEAMS:
        rows[f"k={k}"] = compared(test, lengths, parsed(network, test, k))
    return {"data": test.source, "samples": len(test), "known": len(known), "rows": rows}


def neighbours(test: TokenSet, known: Tensor) -> tuple[Choice, float]:
    """The nearest known program of each test program, and seconds a shape."""
    start = time.perf_counter()
    parts = test.tokens.split(1000)  # so many shapes of space are 32 MB
    index = torch.cat(
        [nearest(execute_many(p, test.vocabulary).words, known, test.vocabulary).index for p in parts]
    )
    seconds = (time.perf_counter() - start) / len(test)
    return joined(
        [
            best_of(canvases(p, test), known[i].unsqueeze(1))
            for p, i in zip(test.tokens.split(AT_ONCE), index.split(AT_ONCE))
        ]
    ), seconds


def parsed(network: CSGNet, test: TokenSet, k: int) -> tuple[Choice, float]:
    """The best of k programs that the network writes for each test program, and seconds a shape for all k."""
    seconds, choices = 0.0, []
    for part in tqdm(test.tokens.split(AT_ONCE), desc=f"k={k}", leave=False, disable=None):
        shapes = canvases(part, test)
        start = time.perf_counter()
        beams = beam_search(network, shapes, k)
        choices.append(best_of(shapes, beams.tokens))
        seconds += time.perf_counter() - start
    return joined(choices), seconds / len(test)


def canvases(tokens: Tensor, programs: TokenSet) -> Tensor:
    shapes = execute_many(tokens, programs.vocabulary)
    return shapes.images if shapes.dimensions == 2 else shapes.grids


def joined(choices: Sequence[Choice]) -> Choice:
    """The choices for several batches as one; programs may be of different lengths."""
    longest = max(choice.tokens.shape[1] for choice in choices)
    stop = max(
        int(choice.tokens.max()) for choice in choices
    )  # every program is followed by `$`, the last token
    padded = [
        torch.nn.functional.pad(c.tokens, (0, longest - c.tokens.shape[1]), value=stop) for c in choices
    ]
    return Choice(
        torch.cat(padded), torch.cat([c.best for c in choices]), torch.cat([c.measure for c in choices])
    )


def compared(test: TokenSet, lengths: Tensor, answer: tuple[Choice, float]) -> dict:
    """A row: mean measure (Chamfer distance, px, or IoU, percent), of all and by length; percent that are exact."""
    choice, seconds = answer
    plane = test.vocabulary.dimensions == 2
    measure = choice.of_best if plane else 100 * choice.of_best
    drawn, written = (execute_many(t, test.vocabulary) for t in (test.tokens, choice.tokens))
    exact = (drawn.words == written.words).all(1).double()
    each = {int(n): float(measure[lengths == n].double().mean()) for n in lengths.unique()}
    exact_each = {n: 100 * float(exact[lengths == n].mean()) for n in each}
    return {
        "chamfer_px" if plane else "iou_percent": float(measure.double().mean()),
        "exact_percent": 100 * float(exact.mean()),
        "by_length": each,
        "exact_by_length": exact_each,
        "seconds_each": seconds,
    }


def silhouette_table(supervised: CSGNet, reinforced: CSGNet, count: int, quick: bool) -> dict:
    """Table 3: mean Chamfer distance to silhouettes after so many iterations of refinement, coordinate search on all
    and Powell's method on some."""
    masks = silhouettes(split="test")
    images = masks.images[:: max(1, len(masks) // count)][:count]
    train = csg_programs(2, "train")
    known = train.tokens[:: 100 if quick else 1]
    index = nearest(pack(images), known, train.vocabulary).index
    answers = {"nearest": best_of(images, known[index].unsqueeze(1))}
    for name, network in {"supervised": supervised, "reinforced": reinforced}.items():
        for k in (1, 10):
            answers[f"{name} k={k}"] = best_of(images, beam_search_all(network, images, k))
    powell = QUICK if quick else POWELL
    rows = {name: refined(choice, images, min(powell, len(images))) for name, choice in answers.items()}
    return {
        "data": masks.source,
        "samples": len(images),
        "powell_samples": min(powell, len(images)),
        "rows": rows,
    }


def beam_search_all(network: CSGNet, images: Tensor, k: int) -> Tensor:
    """Programs (n, k, length), searched for some images at a time."""
    found = [beam_search(network, part, k).tokens for part in images.split(AT_ONCE)]
    longest = max(tokens.shape[2] for tokens in found)
    return torch.cat(
        [torch.nn.functional.pad(t, (0, longest - t.shape[2]), value=network.stop) for t in found]
    )


def refined(choice: Choice, images: Tensor, powell: int) -> dict:
    """A row of Table 3: distances by iterations ("None" is until the end), and seconds a picture."""
    programs = [vocabulary_of(2).program(tokens) for tokens in choice.tokens]
    start = time.perf_counter()
    distances = refine(programs, images).distances.mean(1).tolist()
    seconds = (time.perf_counter() - start) / len(images)
    some = range(0, len(images), len(images) // powell)[:powell]
    start = time.perf_counter()
    slow = [by_powell(programs[i], images[i]) for i in tqdm(some, desc="Powell", leave=False, disable=None)]
    seconds_powell = (time.perf_counter() - start) / len(some)
    quick = refine([programs[i] for i in some], images[list(some)]).distances.mean(1).tolist()
    return {
        "chamfer_px": at_iterations(distances),
        "seconds_each": seconds,
        "same_as_powell_px": at_iterations(quick),
        "powell_px": {str(n): sum(row[str(n)] for row in slow) / len(slow) for n in SWEEPS},
        "powell_seconds_each": seconds_powell,
        "tokens": sum(map(len, programs)) / len(programs),
    }


def by_powell(program: Program, image: Tensor) -> dict[str, float]:
    return at_iterations(refine_by_powell(program, image)[1])


def at_iterations(distances: Sequence[float]) -> dict[str, float]:
    """After 0, 1, 2, 4, 10 and all iterations; where fewer were made, after the last."""
    return {str(n): distances[-1 if n is None else min(n, len(distances) - 1)] for n in SWEEPS}


def detection(network: CSGNet, count: int) -> dict:
    """Table 5: average precision of primitives, percent, and images a second."""
    test = evenly(csg_programs(2, "test"), count)
    images, rows = canvases(test.tokens, test), {}
    for k in (10, 40):
        start = time.perf_counter()
        beams = beam_search_all(network, images, k)
        seconds = time.perf_counter() - start
        found = detection_precision(beams, test.tokens, test.vocabulary)
        rows[f"k={k}"] = {n: 100 * v for n, v in found.items()} | {"images_a_second": len(images) / seconds}
    return {"data": test.source, "samples": len(test), "rows": rows}


def logo_table(supervised: CSGNet, reinforced: CSGNet, count: int) -> dict:
    """Mean Chamfer distance to logos, which no network has seen, before and after refinement."""
    masks = logos()
    images = masks.images[:: max(1, len(masks) // count)][:count]
    rows = {}
    for name, network in {"supervised": supervised, "reinforced": reinforced}.items():
        choice = best_of(images, beam_search_all(network, images, 10))
        programs = [vocabulary_of(2).program(tokens) for tokens in choice.tokens]
        rows[f"{name} k=10"] = {
            "chamfer_px": at_iterations(refine(programs, images).distances.mean(1).tolist())
        }
    return {"data": masks.source, "samples": len(images), "rows": rows}


def evenly(programs: TokenSet, count: int) -> TokenSet:
    """At most so many of the programs, at equal steps: lengths keep the shares of Table 1."""
    return programs[:: max(1, len(programs) // count)][:count]


def measure(options: argparse.Namespace) -> dict:
    """One table, with all that is needed to measure it again."""
    start = time.perf_counter()
    paths = {"weights": options.weights or pretrained(f"csgnet_{options.dimensions}d")}
    if options.table in ("silhouettes", "logos"):
        paths["reinforced"] = options.reinforced or pretrained("csgnet_2d_reinforced")
    networks = [load(CSGNet, path) for path in paths.values()]
    for path, network in zip(paths.values(), networks):
        if network.config.dimensions != options.dimensions:
            raise DataError(f"{path}: found a network of {network.config.dimensions} dimensions")
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


def rounded(found):
    """Numbers with four digits after the point, also inside of rows."""
    if isinstance(found, dict):
        return {name: rounded(value) for name, value in found.items()}
    return round(found, 4) if isinstance(found, float) else found


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
