"""Extract programs from part graphs:   python -m data_scripts.extract_programs INPUT --out FOLDER

INPUT is a folder or zip archive of StructureNet's JSON part graphs, thousands of them. In FOLDER, afterwards:

    programs/NAME.txt    the accepted programs; NAME is the file's, with the folders between INPUT and it
    rejected.json        name -> reason, detail and F-score (percent) of the others
    summary.json         how many, why not, and the mean F-score of the accepted ones
    journal.jsonl        what is finished: a killed run goes on from there with the same command

The files are the same, byte by byte, whatever the number of workers and however often the run was interrupted.
"""

import argparse
import json
import sys
import time
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath

from tqdm import tqdm

from data_scripts.ending import exit_code
from data_scripts.extraction_worker import UNREADABLE, extract_chunk
from data_scripts.journal import Journal, code_digest, write_whole
from data_scripts.parallel import in_parallel
from lib.datasets import CATEGORIES, DataError
from lib.extractor.files import sources

CHUNK = 32  # files a worker takes at once; fixed, because a batch of shapes is executed together
CODE = ("extractor", "interpreters", "metrics")  # parts of lib whose change makes other programs
FOLDERS = {f"{name}{end}": name for name in CATEGORIES for end in ("", "_hier")} | {
    "storagefurniture": "storage",
    "storagefurniture_hier": "storage",
}
OWN_DATA = """\
with PartNet's shapes:
  Part graphs of PartNet come with StructureNet (https://github.com/daerduoCarey/structurenet; Mo et al. 2019) to
  those who accept PartNet's and ShapeNet's licence terms, which stay between you and them; nothing is fetched here.
  Unpack the folders {chair,table,storagefurniture}_hier below data/partnet, so that there is
      data/partnet/chair_hier/43875.json          one line of JSON for each shape
  and run
      python -m data_scripts.extract_programs data/partnet/chair_hier --out data/extracted/chair
without them:
      python -m data_scripts.make_furniture --category chair --count 500
      python -m data_scripts.extract_programs data/furniture/chair --out data/extracted/chair
on a cluster:
  pip install -e '.[cluster]', then --scheduler tcp://HOST:8786 of a running Dask cluster whose workers
  have this repository installed and see INPUT under the same path.
"""


def fingerprints(source: Path, category: str | None) -> dict[str, str]:
    """For each part graph of a folder or archive, by name: its category, size in bytes and CRC-32, as one text.

    Raises PartGraphError for what is neither folder nor archive, and DataError where a category is neither given nor
    told by a folder's name.
    """
    names = sources(source)
    archive = None if source.is_dir() else zipfile.ZipFile(source)
    found = {}
    for name in names:
        told = category or category_of(source, name)
        if archive:
            info = archive.getinfo(f"{name}.json")
            found[name] = f"{told} {info.file_size} {info.CRC:08x}"
        else:
            found[name] = f"{told} {_size_and_checksum(source / f'{name}.json')}"
    return found


def _size_and_checksum(path: Path) -> str:
    try:
        content = path.read_bytes()
    except OSError as error:
        return f"unreadable {error.strerror}"
    return f"{len(content)} {zlib.crc32(content):08x}"


def category_of(source: Path, name: str) -> str:
    """The category that the innermost telling folder names: chair, chair_hier, storagefurniture_hier, …"""
    folders = [source.resolve().stem, *PurePosixPath(name).parts[:-1]]
    for folder in reversed(folders):
        if told := FOLDERS.get(folder.lower()):
            return told
    raise DataError(
        f"no folder's name tells the category of {name}; give --category, one of {', '.join(CATEGORIES)}"
    )


def extract_all(options: argparse.Namespace) -> tuple[list[dict], int]:
    """All rows, sorted by name, and how many of them were made now. Raises DataError and PartGraphError."""
    found = fingerprints(options.input, options.category)
    if not found:
        raise DataError(f"there are no .json files in {options.input}")
    journal = open_journal(options, found)
    chunks = journal.unfinished(found, CHUNK)
    count = sum(map(len, chunks))
    with tqdm(desc="extracting", unit=" shapes", total=len(found), initial=len(found) - count) as bar:
        for rows in extract_chunks(chunks, options):
            journal.add(rows)
            keep_programs(options.out, rows)
            bar.update(len(rows))
    journal.finish()
    return list(journal.rows.values()), count


def open_journal(options: argparse.Namespace, found: dict[str, str]) -> Journal:
    """What is finished, and nothing that was made otherwise or from other files. Raises DataError."""
    path = options.out / "journal.jsonl"
    if (options.out / "programs").exists() and not path.exists():
        raise DataError(f"{options.out} holds programs of something else; choose another --out")
    journal = Journal(path, settings(options))
    journal.check(found)
    keep_programs(options.out, journal.rows.values())  # the kill may have come between the journal and these
    return journal


def extract_chunks(chunks: list[dict[str, str]], options: argparse.Namespace) -> Iterator[list[dict]]:
    """The rows of each chunk, whichever is ready first. Raises DataError when the workers cannot go on."""
    source = options.input.resolve()  # a worker may have another working folder
    jobs = ((source, chunk, options.keep_rejected) for chunk in chunks)
    yield from in_parallel(extract_chunk, jobs, options.workers, options.scheduler)


def settings(options: argparse.Namespace) -> dict[str, str]:
    """What, beside the files, decides what comes out."""
    return {
        "category": options.category or "by folder",
        "keep_rejected": str(options.keep_rejected),
        "code": code_digest(*CODE),
    }


def keep_programs(out: Path, rows: Iterable[dict]) -> None:
    """Write the rows' programs, where they have one, to their places."""
    for row in rows:
        if row["program"] is not None:
            folder = "programs" if row["accepted"] else "rejected"
            write_whole(out / folder / f"{row['name']}.txt", row["program"].encode())


def report(out: Path, rows: list[dict]) -> dict:
    """Write rejected.json and summary.json; returns the latter's content."""
    rejected = [row for row in rows if not row["accepted"]]
    scores = [row["f_score"] for row in rows if row["accepted"] and row["f_score"] is not None]
    counts = Counter(row["reason"] for row in rejected)
    summary = {
        "shapes": len(rows),
        "accepted": len(rows) - len(rejected),
        "mean_f_score": round(sum(scores) / len(scores), 2) if scores else None,
        "rejected": dict(sorted(counts.items())),
    }
    table = {row["name"]: {key: row[key] for key in ("reason", "detail", "f_score")} for row in rejected}
    for name, content in (("rejected", table), ("summary", summary)):
        write_whole(out / f"{name}.json", (json.dumps(content, indent=2) + "\n").encode())
    return summary


def run(options: argparse.Namespace) -> None:
    """Extract, report, say so in one line. Raises DataError and PartGraphError."""
    started = time.monotonic()
    rows, count = extract_all(options)
    speed = count / (time.monotonic() - started)
    summary = report(options.out, rows)
    if all(row["reason"] == UNREADABLE for row in rows):
        raise DataError(
            f"none of {len(rows)} files gave a part graph; {rows[0]['name']}: {rows[0]['detail']}"
        )
    mean = f"mean F-score {summary['mean_f_score']}" if summary["mean_f_score"] is not None else "no F-score"
    reasons = ", ".join(f"{count} {reason}" for reason, count in summary["rejected"].items())
    print(
        f"{summary['accepted']} of {len(rows)} accepted ({summary['accepted'] / len(rows):.1%}), {mean}, "
        f"{f'rejected: {reasons}, ' if reasons else ''}"
        f"{count} extracted now at {speed:.1f} shapes/s; kept in {options.out}"
    )


def main(arguments: list[str] | None = None) -> int:
    """The command; returns the exit code: 0 finished, 1 bad input, 130 interrupted. Problems are one line on stderr."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=OWN_DATA, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("input", type=Path, metavar="INPUT", help="folder or .zip of JSON part graphs")
    parser.add_argument("--out", type=Path, required=True, help="where to keep the results")
    parser.add_argument("--category", choices=CATEGORIES, help="default: told by the folder, e.g. chair_hier")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=int, default=-1, help="processes (default: one for each core)")
    where.add_argument("--scheduler", metavar="ADDRESS", help="use this Dask cluster, e.g. tcp://HOST:8786")
    parser.add_argument(
        "--keep-rejected", action="store_true", help="write rejected programs, where there are, to rejected/"
    )
    options = parser.parse_args(arguments)
    if options.workers < 1 and options.workers != -1:
        parser.error("--workers must be 1 or more")
    return exit_code(lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
