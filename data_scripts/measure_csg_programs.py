"""Measure the made CSG programs: python -m data_scripts.measure_csg_programs

Writes results/csg_programs.json: for plane and space, how many programs there are of each split and length, how often
each operation and each kind of primitive occurs, and what the programs draw. Different programs may draw the same
picture, and a test picture that is also in train can be learnt by heart, so these are counted:

    pictures            distinct ones among all, and the share of test programs whose picture train has too
    swapped_in_train    the share of test programs that train has too but for the order of operands of + and *

All programs of the plane are executed; of space, whose grids are 64 times as large, `--sample` of each split: what is
said of pictures then holds for the sample alone, and train has more of the test pictures than it says.
The programs are made by: python -m data_scripts.make_csg_programs --dimensions 2 (and 3)
"""

import argparse
import json
import sys
from hashlib import blake2b
from pathlib import Path

import numpy as np
import torch
from tqdm import tqdm

from data_scripts.ending import exit_code
from data_scripts.journal import write_whole
from lib.datasets import CSG_SIZES, CSG_SPLITS, REPOSITORY, DataError, csg_programs, data_root
from lib.interpreters.csg import execute_many, vocabulary_of

RESULT = REPOSITORY / "results" / "csg_programs.json"
NAMES = {2: "plane", 3: "space"}
CHUNK = {2: 4096, 3: 256}  # programs executed at once, by dimension
INTERRUPTED = "interrupted; nothing was written"


def load(dimensions: int, split: str) -> dict[int, np.ndarray]:
    """The made tokens of a split by length. Raises DataError where they were not made."""
    found = {}
    for length in CSG_SIZES[dimensions]:
        programs = csg_programs(dimensions, split, length)
        if programs.source != "made":
            raise DataError(
                f"there is no {path_of(dimensions)}; first run: "
                f"python -m data_scripts.make_csg_programs --dimensions {dimensions}"
            )
        found[length] = programs.tokens[:, :length].numpy()
    return found


def path_of(dimensions: int) -> Path:
    return data_root() / "csg" / f"programs_{dimensions}d.npz"


def measure(dimensions: int, sample: int | None) -> dict:
    """The figures of plane or space; `sample` programs of each split are executed, None: all. Raises DataError."""
    programs = {split: load(dimensions, split) for split in CSG_SPLITS}
    rng = np.random.default_rng(0)
    chosen = {split: choose(rng, found, sample) for split, found in programs.items()}
    total = sum(len(tokens) for found in chosen.values() for tokens in found.values())
    with tqdm(total=total, desc=NAMES[dimensions], unit=" programs") as bar:
        drawn = {split: draw(found, dimensions, bar) for split, found in chosen.items()}
    pictures = {split: hashes for split, (hashes, _) in drawn.items()}
    first = len(vocabulary_of(dimensions).primitives)
    trees = {
        split: np.concatenate([tree_hashes(tokens, first) for tokens in found.values()])
        for split, found in programs.items()
    }
    return {
        "megabytes": round(path_of(dimensions).stat().st_size / 1e6, 2),
        "programs": {
            split: {n: len(tokens) for n, tokens in found.items()} for split, found in programs.items()
        },
        **frequencies([tokens for found in programs.values() for tokens in found.values()], dimensions),
        "swapped_in_train_percent": seen_percent(trees["test"], trees["train"]),
        "pictures": {
            "programs": {split: len(hashes) for split, hashes in pictures.items()},
            "are": "all programs" if sample is None else f"at most {sample} random programs of each split",
            "distinct": len(np.unique(np.concatenate([*pictures.values()]))),
            "test_in_train_percent": seen_percent(pictures["test"], pictures["train"]),
            "mean_on": round(float(np.concatenate([on for _, on in drawn.values()]).mean()), 1),
        },
    }


def choose(
    rng: np.random.Generator, found: dict[int, np.ndarray], sample: int | None
) -> dict[int, np.ndarray]:
    """At most `sample` programs of a split, of each length its share; None: all."""
    ends = np.cumsum([len(tokens) for tokens in found.values()])
    if sample is None or sample >= ends[-1]:
        return found
    rows = np.sort(rng.choice(ends[-1], sample, replace=False))
    parts = np.split(rows, np.searchsorted(rows, ends[:-1]))
    return {n: found[n][part - end + len(found[n])] for n, part, end in zip(found, parts, ends)}


def draw(found: dict[int, np.ndarray], dimensions: int, bar: tqdm) -> tuple[np.ndarray, np.ndarray]:
    """(a hash of each program's picture, how many of its pixels are ON).

    Hashes have 64 bits: that any two of n different pictures have the same has odds of n^2 / 2^65, for the plane's
    1,675,000 one in 13 million.
    """
    hashes, on = [], []
    for tokens in found.values():
        for some in np.split(tokens, range(CHUNK[dimensions], len(tokens), CHUNK[dimensions])):
            shapes = execute_many(torch.from_numpy(some), dimensions=dimensions)
            hashes += [blake2b(words, digest_size=8).digest() for words in shapes.words.numpy()]
            on.append(shapes.on.numpy())
            bar.update(len(some))
    return np.frombuffer(b"".join(hashes), np.uint64), np.concatenate(on)


def frequencies(arrays: list[np.ndarray], dimensions: int) -> dict[str, dict[str, float]]:
    """Percent of each operation everywhere and as the last token, and of each kind of primitive."""
    vocabulary = vocabulary_of(dimensions)
    words = np.array([text.partition("(")[0] for text in vocabulary.texts])

    def percent(tokens: list[np.ndarray], operations: bool) -> dict[str, float]:
        counts = sum(np.bincount(each.ravel(), minlength=len(vocabulary)) for each in tokens)
        group = list("+*-") if operations else sorted({*words} - {*"+*-$"})
        numbers = {word: int(counts[words == word].sum()) for word in group}
        return {word: round(100 * many / max(1, sum(numbers.values())), 2) for word, many in numbers.items()}

    return {
        "operations_percent": percent(arrays, True),
        "last_operations_percent": percent([tokens[:, -1] for tokens in arrays], True),
        "primitives_percent": percent(arrays, False),
    }


def tree_hashes(tokens: np.ndarray, first: int) -> np.ndarray:
    """A 64-bit hash of each valid program, the same for those that differ only in the order of operands of + and *.

    tokens (programs, length); first: the token of +, which * and - follow.
    """
    leaf = np.random.default_rng(0).integers(1 << 64, size=first, dtype=np.uint64)
    rows, depth = np.arange(len(tokens)), np.zeros(len(tokens), int)
    stack = np.zeros((len(tokens), tokens.shape[1] // 2 + 2), np.uint64)
    for token in tokens.T:
        a, b = stack[rows, depth - 2], stack[rows, depth - 1]  # of a primitive they are not used
        both = a + np.where(token == first + 2, np.uint64(3), np.uint64(1)) * b
        joins = token >= first
        depth = depth + np.where(joins, -1, 1)
        stack[rows, depth - 1] = np.where(
            joins, _mixed(both + token.astype(np.uint64)), leaf[np.minimum(token, first - 1)]
        )
    return stack[:, 0]


def _mixed(x: np.ndarray) -> np.ndarray:
    """Every bit of the result depends on every bit of x (the last steps of SplitMix64)."""
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        x = (x ^ (x >> np.uint64(shift))) * np.uint64(factor)
    return x ^ (x >> np.uint64(31))


def seen_percent(some: np.ndarray, among: np.ndarray) -> float:
    return round(100 * float(np.isin(some, among).mean()), 3)


def told(name: str, found: dict) -> str:
    """A few lines for the terminal."""
    lengths = [*found["programs"]["train"]]
    rows = [["tokens", *lengths, "all"]]
    rows += [
        [split, *(f"{n:,}" for n in [*row.values(), sum(row.values())])]
        for split, row in found["programs"].items()
    ]
    shares = {
        heading: ", ".join(f"{word} {share}%" for word, share in found[key].items())
        for heading, key in (
            ("operations", "operations_percent"),
            ("the last", "last_operations_percent"),
            ("primitives", "primitives_percent"),
        )
    }
    pictures = found["pictures"]
    shares["pictures"] = (
        f"{pictures['distinct']:,} distinct of {sum(pictures['programs'].values()):,} ({pictures['are']}), "
        f"{pictures['mean_on']:,} ON on average"
    )
    shares["test in train"] = (
        f"pictures {pictures['test_in_train_percent']}%, programs but for order {found['swapped_in_train_percent']}%"
    )
    lines = [f"{name}, {found['megabytes']} MB"]
    lines += [f"{row[0]:14s}" + "".join(f"{cell:>10}" for cell in row[1:]) for row in rows]
    return "\n".join(lines + [f"{heading:14s}{text}" for heading, text in shares.items()])


def run(options: argparse.Namespace) -> None:
    """Measure, print, and write. Raises DataError."""
    wanted = options.dimensions or list(NAMES)
    for dimensions in wanted:
        load(dimensions, "val")  # missing data is told before minutes of work, not after
    kept = json.loads(options.out.read_text(encoding="utf-8")) if options.out.is_file() else {}
    for dimensions in wanted:
        found = measure(dimensions, options.sample if dimensions == 3 else None)
        kept[NAMES[dimensions]] = found
        print(told(NAMES[dimensions], found))
    write_whole(options.out, (json.dumps(kept, indent=1) + "\n").encode())
    print(f"kept in {options.out}")


def main(arguments: list[str] | None = None) -> int:
    """The command; returns the exit code: 0 finished, 1 bad input, 130 interrupted. Problems are one line on stderr."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--dimensions", type=int, choices=(2, 3), nargs="*", help="2: the plane, 3: space (default: both)"
    )
    parser.add_argument(
        "--sample",
        type=int,
        default=20_000,
        metavar="N",
        help="programs of space executed of each split (default: %(default)s)",
    )
    parser.add_argument(
        "--out", type=Path, default=RESULT, help="the JSON (default: results/csg_programs.json)"
    )
    options = parser.parse_args(arguments)
    if options.sample < 1:
        parser.error("--sample must be 1 or more")
    return exit_code(lambda: run(options), INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
