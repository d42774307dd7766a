"""Rewrite the real programs for the paper's ablations:   python -m data_scripts.make_ablations [--workers N]

Without the part graphs that the authors extracted their ablations from, the programs themselves are rewritten:
flat, no_order, no_align, no_macros; `lib.extractor.rewriting` says how, and which are left out. They go to

    data/shapeassembly-ablations/ABLATION/{chair,table,storage}/ID.txt
    data/shapeassembly-ablations/ABLATION/splits/{chair,table,storage}/{train,val}.txt     without those left out
    data/shapeassembly-ablations/ABLATION/{chair,table,storage}.json                       counts and fidelity
    data/shapeassembly-ablations/ABLATION/{chair,table,storage}.jsonl                      journal: what is finished

or below --out or SHAPE_PROGRAMS_DATA instead of data/. A killed run goes on from where it was with the same command,
and the files are the same, byte by byte, whatever the number of workers. The chairs take about ten minutes of one core.
"""

import argparse
import json
import sys
import zlib
from collections import Counter
from pathlib import Path

import torch
from tqdm import tqdm

from data_scripts.ending import default_root, exit_code
from data_scripts.fetch_shapeassembly import write
from data_scripts.journal import Journal, code_digest, write_whole
from data_scripts.parallel import end_with, in_parallel
from lib.datasets import CATEGORIES, SPLITS, DataError, shapeassembly
from lib.datasets.programs import ABLATED
from lib.extractor.rewriting import ABLATIONS, Rewriting, rewrite_many
from lib.interpreters.shapeassembly import parse

CHUNK = 32  # programs a worker takes at once; fixed, because their shapes are executed together
CODE = ("extractor", "interpreters", "metrics")  # parts of lib whose change makes other programs
Texts = dict[str, str]  # id -> program


def rewrite_chunk(ablation: str, category: str, texts: Texts, parent: int | None = None) -> list[dict]:
    """One row for the journal for each program. A process other than `parent` (its id) ends with that one."""
    end_with(parent)
    torch.set_num_threads(1)  # the processes share the cores; and sums come in the same order everywhere
    found = rewrite_many([parse(text) for text in texts.values()], ablation, list(texts), category)
    return [_row(name, text, rewriting) for (name, text), rewriting in zip(texts.items(), found)]


def _row(name: str, text: str, rewriting: Rewriting) -> dict:
    return {
        "name": name,
        "source": fingerprint(text),
        "reason": rewriting.reason,
        "f_score": _number(rewriting.f_score, 2),
        "apart": _number(rewriting.apart, 9),
        "program": rewriting.program.to_text() if rewriting.program else None,
    }


def _number(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


def fingerprint(text: str) -> str:
    """Tells whether a program is still what it was."""
    return f"{len(text)} {zlib.crc32(text.encode()):08x}"


def originals(category: str, split: str | None = None) -> Texts:
    """The real programs. Raises DataError where they were not fetched."""
    programs = shapeassembly(category, split)
    if programs.source != "real":
        raise DataError(
            "the real programs are not here; first run: python -m data_scripts.fetch_shapeassembly"
        )
    return {name: program.to_text() for name, program in zip(programs.ids, programs)}


def make(folder: Path, ablation: str, category: str, texts: Texts, workers: int) -> dict:
    """Rewrite a category for an ablation; returns what its summary says. `folder` is the ablation's."""
    journal = Journal(folder / f"{category}.jsonl", {"code": code_digest(*CODE)})
    journal.check({name: fingerprint(text) for name, text in texts.items()})
    missing = journal.unfinished(texts, CHUNK)
    count = sum(map(len, missing))
    jobs = ((ablation, category, chunk) for chunk in missing)
    label = f"{ablation} {category}"
    with tqdm(desc=label, unit=" programs", total=len(texts), initial=len(texts) - count) as bar:
        for rows in in_parallel(rewrite_chunk, jobs, workers):
            journal.add(rows)
            bar.update(len(rows))
    journal.finish()
    keep(folder, category, journal.rows)
    return summary(journal.rows.values())


def keep(folder: Path, category: str, rows: dict[str, dict]) -> None:
    """Write programs and lists. The programs come into being in one step; the lists, without which nobody looks for
    them, come last."""
    made = {name: row["program"] for name, row in rows.items() if row["program"]}
    files = {f"{name}.txt": text.encode() for name, text in made.items()}
    place = folder / category
    present = {path.name: path.read_bytes() for path in place.iterdir()} if place.is_dir() else None
    if files != present:
        write(files, place)
    for split in SPLITS:
        listed = [name for name in shapeassembly(category, split).ids if name in made]
        text = "".join(f"{name}\n" for name in listed)
        write_whole(folder / "splits" / category / f"{split}.txt", text.encode())
    content = json.dumps(summary(rows.values()), indent=2) + "\n"
    write_whole(folder / f"{category}.json", content.encode())


def summary(rows) -> dict:
    """Counts; how far boxes moved, in shares of the diagonal; F-scores against the originals' shapes, percent."""
    made = [row for row in rows if row["program"]]
    scores = [row["f_score"] for row in made]
    moved = [row["apart"] for row in made if row["apart"] is not None]
    return {
        "programs": len(rows),
        "made": len(made),
        "extracted_anew": len(made) - len(moved),
        "mean_apart": round(sum(moved) / len(moved), 6) if moved else None,
        "most_apart": round(max(moved), 6) if moved else None,
        "mean_f_score": round(sum(scores) / len(scores), 2) if scores else None,
        "f_score_95_percent": round(100 * sum(s >= 95 for s in scores) / len(scores), 2) if scores else None,
        "left_out": dict(sorted(Counter(row["reason"] for row in rows if not row["program"]).items())),
    }


def run(options: argparse.Namespace) -> None:
    """Make what is asked for, a line each. Raises DataError."""
    for category in options.categories:
        texts = originals(category)
        for ablation in options.ablations:
            found = make(options.out / ABLATED / ablation, ablation, category, texts, options.workers)
            left_out = ", ".join(f"{count} {reason}" for reason, count in found["left_out"].items())
            print(
                f"{ablation} {category}: {found['made']} of {found['programs']} made, "
                f"{found['extracted_anew']} of them extracted anew, mean F-score {found['mean_f_score']}, "
                f"{found['f_score_95_percent']} % at 95 or more; left out: {left_out or 'none'}"
            )


def main(arguments: list[str] | None = None) -> int:
    """The command; returns the exit code: 0 finished, 1 bad input, 130 interrupted. Problems are one line on stderr."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--categories", nargs="+", choices=CATEGORIES, default=CATEGORIES, metavar="CATEGORY")
    parser.add_argument("--ablations", nargs="+", choices=ABLATIONS, default=ABLATIONS, metavar="ABLATION")
    parser.add_argument("--workers", type=int, default=-1, help="processes (default: one for each core)")
    parser.add_argument(
        "--out", type=Path, default=default_root(), help="the data root (default: %(default)s)"
    )
    options = parser.parse_args(arguments)
    if options.workers < 1 and options.workers != -1:
        parser.error("--workers must be 1 or more")
    return exit_code(lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
