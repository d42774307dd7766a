"""A worker of extract_programs: reads a chunk of part graphs, extracts programs, tells what became of each file."""

import math
import warnings
from pathlib import Path

import torch

from data_scripts.parallel import end_with
from lib.extractor import Extraction, Options, PartGraph, PartGraphError, extract_many
from lib.extractor.errors import PartGraphWarning
from lib.extractor.files import load

UNREADABLE = "unreadable"  # the reason given for a file without a part graph; the extractor has its own
LONGEST_NAME = 250  # bytes of a file or folder name


def extract_chunk(
    source: Path, chunk: dict[str, str], keep_rejected: bool, parent: int | None = None
) -> list[dict]:
    """One row for the journal for each file of the chunk, name -> fingerprint. Never raises for a bad file.

    A process other than `parent` (its id), which started it, ends with that one.
    """
    end_with(parent)
    torch.set_num_threads(1)  # the processes share the cores; and sums come in the same order everywhere
    graphs, outcomes = {}, {}
    for name, fingerprint in chunk.items():
        try:
            graphs[name] = _load(source, name, fingerprint.split()[0])
        except Exception as error:  # whatever one file does, the others go on
            outcomes[name] = _failure(UNREADABLE, error)
    outcomes |= zip(graphs, _extract(list(graphs.values()), keep_rejected))
    return [{"name": name, "source": chunk[name], **outcomes[name]} for name in chunk]


def _load(source: Path, name: str, category: str) -> PartGraph:
    if not _can_be_written(name):
        raise PartGraphError("its name cannot be the name of a program's file")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PartGraphWarning)  # thousands of files, each with odd labels
        try:
            return load(source, name, category)
        except PartGraphError as error:
            raise error.in_file(
                ""
            ) from None  # the row has the name already; the folder differs between machines


def _can_be_written(name: str) -> bool:
    """Is it a path that stays below the folder it is put in, of names that a file system takes?"""
    parts = name.split("/")
    short = all(len(part.encode(errors="replace")) <= LONGEST_NAME for part in parts)
    return short and all(parts) and ".." not in parts


def _extract(graphs: list[PartGraph], keep_rejected: bool) -> list[dict]:
    """Outcomes of several graphs together or, should that fail, of each alone."""
    try:
        return [
            _outcome(extraction) for extraction in extract_many(graphs, Options(keep_rejected=keep_rejected))
        ]
    except Exception as error:
        if len(graphs) == 1:
            return [_failure("error", error)]
        return [outcome for graph in graphs for outcome in _extract([graph], keep_rejected)]


def _outcome(extraction: Extraction) -> dict:
    score = extraction.f_score
    return {
        "accepted": extraction.accepted,
        "reason": extraction.reason,
        "detail": extraction.detail,
        "f_score": round(float(score), 2) if score is not None and math.isfinite(score) else None,
        "program": extraction.program.to_text() if extraction.program else None,
    }


def _failure(reason: str, error: Exception) -> dict:
    what = str(error) if isinstance(error, PartGraphError) else f"{type(error).__name__}: {error}"
    return {"accepted": False, "reason": reason, "detail": what, "f_score": None, "program": None}
