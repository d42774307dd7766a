"""Make the random CSG programs that CSGNet learns from:   python -m data_scripts.make_csg_programs --dimensions 2

The programs follow the paper's rules (`lib.interpreters.csg.sampling`), as many as its Table 1 has of each length:
1,675,000 of the plane, 910,000 of space. What is kept are tokens, not pictures, which a batch of programs makes faster
than a disk could deliver them:

    data/csg/programs_2d.npz     train_3, val_3, test_3, train_5, … test_13: (programs, tokens) uint16
    data/csg/programs_2d.json    how they were made, and how often each operation and primitive occurs

No two programs of a file are the same, whatever their splits. The files are the same, byte by byte, whatever the number
of workers, and however often the run was interrupted: a killed run goes on from its last chunk with the same command.
"""

import argparse
import hashlib
import io
import json
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from tqdm import tqdm

from data_scripts.csg_worker import Chunk, make_chunk
from data_scripts.ending import default_root, exit_code
from data_scripts.journal import code_digest, difference, write_whole
from data_scripts.parallel import in_parallel
from lib.datasets import CSG_SIZES, CSG_SPLITS, DataError
from lib.interpreters.csg import vocabulary_of

# Programs a worker makes at once, by dimension; fixed, because it decides what comes out.
CHUNK = {2: 8192, 3: 4096}
_SPARE = 1.02  # as many more are made at first than are needed, for what turns out to be there already
_OUT = (
    "default: %(default)s; lib.datasets looks for a folder csg/ in data/, or in the folder that the environment "
    "variable SHAPE_PROGRAMS_DATA names"
)
_EPILOG = """\
on a cluster:
  pip install -e '.[cluster]', then --scheduler tcp://HOST:8786 of a running Dask cluster whose workers
  have this repository installed.
"""


def sizes(dimensions: int, share: float) -> dict[int, dict[str, int]]:
    """Programs wanted, by length and split: a share of the paper's Table 1, at least one of each."""
    table = CSG_SIZES[dimensions]
    return {
        length: {split: max(1, round(n * share)) for split, n in row.items()} for length, row in table.items()
    }


class Parts:
    """Finished chunks, each in a file of its own, until all are there. Raises DataError for those made otherwise."""

    def __init__(self, folder: Path, settings: dict):
        self.folder = folder
        self._locked = _lock(folder)
        text = json.dumps(settings)
        made = folder / "settings.json"
        if made.exists() and (begun := made.read_text(errors="replace")) != text:
            raise DataError(
                f"{folder} holds the beginning of something else ({begun}, wanted {text}); "
                "remove it, or choose another --out"
            )
        write_whole(made, text.encode())

    def path(self, chunk: Chunk) -> Path:
        """Where a chunk is, or will be."""
        return self.folder / f"{chunk[1]:02d}-{chunk[2]:05d}.npy"

    def keep(self, chunk: Chunk, tokens: np.ndarray) -> None:
        """Write a finished chunk's tokens (programs, length)."""
        file = io.BytesIO()
        np.save(file, tokens)
        write_whole(self.path(chunk), file.getvalue())

    def read(self, chunk: Chunk) -> np.ndarray:
        """The tokens of a finished chunk. Raises DataError for a file that is damaged."""
        path = self.path(chunk)
        try:
            tokens = np.lib.format.read_array(io.BytesIO(path.read_bytes()))  # unpickles nothing
            if tokens.dtype != np.uint16 or tokens.ndim != 2 or tokens.shape[1] != chunk[1]:
                raise ValueError(
                    f"found {tokens.dtype} {tokens.shape}, expected uint16 (programs, {chunk[1]})"
                )
            return tokens
        except (ValueError, EOFError) as error:
            raise DataError(
                f"{path} is damaged ({error}); remove it, and the same command makes it again"
            ) from error


def _lock(folder: Path) -> io.IOBase | None:
    """An open file that no other run has open, until this process ends. Raises DataError where one has."""
    try:
        import fcntl
    except ImportError:  # not on Windows
        return None
    folder.mkdir(parents=True, exist_ok=True)
    file = (folder / "lock").open("w")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise DataError(f"another run is filling {folder}; wait for it, or choose another --out") from None
    return file


def make_all(options: argparse.Namespace, parts: Parts, wanted: dict[int, int]) -> dict[int, np.ndarray]:
    """As many different programs of each length as are wanted."""
    dimensions = options.dimensions
    first = {length: int(number * _SPARE) + 1 for length, number in wanted.items()}
    size = {length: min(CHUNK[dimensions], number) for length, number in first.items()}
    chunks = {length: _chunks(number, size[length]) for length, number in first.items()}
    programs: dict[int, np.ndarray] = {}
    with tqdm(desc="making", unit=" programs") as bar:
        while len(programs) < len(wanted):
            needed = [(dimensions, length, k) for length, many in chunks.items() for k in range(many)]
            missing = [chunk for chunk in needed if not parts.path(chunk).exists()]
            bar.total = sum(size[length] for _, length, _ in needed)
            bar.update(bar.total - sum(size[length] for _, length, _ in missing) - bar.n)
            missing.sort(key=lambda chunk: -chunk[1])  # the slow ones first
            for chunk, tokens in _made(options, missing, size):
                parts.keep(chunk, tokens)
                bar.update(len(tokens))
            for length in wanted.keys() - programs.keys():
                found = distinct(
                    np.concatenate([parts.read((dimensions, length, k)) for k in range(chunks[length])])
                )
                if len(found) >= wanted[length]:
                    programs[length] = found[: wanted[length]]
                else:
                    chunks[length] += _chunks(wanted[length] - len(found), size[length])
    return {length: programs[length] for length in wanted}


def _chunks(programs: int, size: int) -> int:
    return -(-programs // size)


def _made(
    options: argparse.Namespace, missing: list[Chunk], size: dict[int, int]
) -> Iterator[tuple[Chunk, np.ndarray]]:
    jobs = ((options.seed, chunk, size[chunk[1]]) for chunk in missing)
    yield from in_parallel(make_chunk, jobs, options.workers, options.scheduler)


def distinct(tokens: np.ndarray) -> np.ndarray:
    """The rows without repetitions, each where it came first."""
    rows = np.ascontiguousarray(tokens).view([("", tokens.dtype)] * tokens.shape[1]).ravel()
    _, first = np.unique(rows, return_index=True)
    return tokens[np.sort(first)]


def split_up(
    programs: dict[int, np.ndarray], wanted: dict, options: argparse.Namespace
) -> dict[str, np.ndarray]:
    """The arrays of the npz file: each length shuffled, then cut into splits."""
    arrays = {}
    for length, tokens in programs.items():
        order = np.random.default_rng([options.seed, options.dimensions, length]).permutation(len(tokens))
        ends = np.cumsum(list(wanted[length].values()))[:-1]
        for split, part in zip(wanted[length], np.split(tokens[order], ends)):
            arrays[f"{split}_{length}"] = part
    return arrays


def summary(arrays: dict[str, np.ndarray], settings: dict) -> dict:
    """The JSON file: settings, programs by split and length, and shares of operations and primitives in percent."""
    vocabulary = vocabulary_of(settings["dimensions"])
    counts = sum(np.bincount(tokens.ravel(), minlength=len(vocabulary)) for tokens in arrays.values())
    kinds: dict[str, int] = {}
    for primitive, number in zip(vocabulary.primitives, counts.tolist()):
        kinds[primitive.kind] = kinds.get(primitive.kind, 0) + number
    operations = dict(zip("+*-", counts[len(vocabulary.primitives) :].tolist()))
    return settings | {
        "programs": {
            split: sum(len(a) for n, a in arrays.items() if n.startswith(split)) for split in CSG_SPLITS
        },
        "by_length": {name: len(tokens) for name, tokens in arrays.items()},
        "operations_percent": _percent(operations),
        "primitives_percent": _percent(kinds),
    }


def _percent(counts: dict[str, int]) -> dict[str, float]:
    return {name: round(100 * n / max(1, sum(counts.values())), 2) for name, n in counts.items()}


def write(path: Path, arrays: dict[str, np.ndarray]) -> None:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    write_whole(path, file.getvalue())


def run(options: argparse.Namespace) -> None:
    """Make the file, say what is in it. Raises DataError."""
    started = time.monotonic()
    name = f"programs_{options.dimensions}d"
    path, told = options.out / f"{name}.npz", options.out / f"{name}.json"
    settings = {"dimensions": options.dimensions, "seed": options.seed, "share": options.share}
    settings["code"] = code_digest("interpreters/csg")
    before = _read(told) if path.exists() else {}
    if settings.items() <= before.items() and before.get("sha256") == _digest(path):
        print(f"{path} is there already, made with the same settings: nothing to do")
        # A run that was killed at its very end may have left them.
        shutil.rmtree(options.out / f"{name}.parts", ignore_errors=True)
        return
    if before and not settings.items() <= before.items() and not options.force:
        changes = difference(before, settings)
        raise DataError(f"{path} was made with other settings ({changes}); choose another --out, or --force")
    wanted = sizes(options.dimensions, options.share)
    parts = Parts(options.out / f"{name}.parts", settings)
    programs = make_all(options, parts, {length: sum(row.values()) for length, row in wanted.items()})
    arrays = split_up(programs, wanted, options)
    told.unlink(missing_ok=True)  # until it is written again, the two files might not belong together
    write(path, arrays)
    content = summary(arrays, settings) | {"sha256": _digest(path)}
    write_whole(told, (json.dumps(content, indent=2) + "\n").encode())
    shutil.rmtree(parts.folder)
    took = f"{path.stat().st_size / 1e6:.3g} MB, {time.monotonic() - started:.0f} s"
    print(
        f"{_told(content)}; {took}, in {path}, where lib.datasets.csg_programs({options.dimensions}) reads it"
    )


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _read(told: Path) -> dict:
    """The JSON file; nothing where there is none, or a damaged one, beside which the programs are made again."""
    try:
        content = json.loads(told.read_text())
    except (FileNotFoundError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _told(content: dict) -> str:
    programs = ", ".join(f"{number:,} {split}" for split, number in content["programs"].items())
    shares = (
        f"{n} {share}%"
        for key in ("operations_percent", "primitives_percent")
        for n, share in content[key].items()
    )
    return f"{programs}; {', '.join(shares)}"


def main(arguments: list[str] | None = None) -> int:
    """The command; returns the exit code: 0 finished, 1 bad input, 130 interrupted. Problems are one line on stderr."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=_EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--dimensions", type=int, choices=(2, 3), default=2, help="2: the plane (default), 3: space"
    )
    parser.add_argument("--out", type=Path, default=default_root() / "csg", help=_OUT)
    parser.add_argument("--force", action="store_true", help="replace programs made with other settings")
    parser.add_argument(
        "--seed", type=int, default=0, help="other seeds, other programs (default: %(default)s)"
    )
    parser.add_argument(
        "--share", type=float, default=1.0, help="of the paper's numbers, such as 0.01 (default: all)"
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=int, default=-1, help="processes (default: one for each core)")
    where.add_argument("--scheduler", metavar="ADDRESS", help="use this Dask cluster, e.g. tcp://HOST:8786")
    options = parser.parse_args(arguments)
    if options.workers < 1 and options.workers != -1:
        parser.error("--workers must be 1 or more")
    if not 0 < options.share <= 1:
        parser.error("--share must be more than 0 and at most 1")
    if options.seed < 0:
        parser.error("--seed must be 0 or more")
    return exit_code(lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
