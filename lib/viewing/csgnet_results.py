"""Reads what was measured of CSGNet: results/csgnet, and results/csgnet/seed_1 of networks that learned with it."""

import json
from collections.abc import Set
from pathlib import Path

RESULTS = Path(__file__).parents[2] / "results" / "csgnet"
SECOND = "seed_1"


def read_rows(path: Path, needed: Set[str] = frozenset()) -> dict:
    """The content of a table's file, whose "rows" are {name: {quantity: …}}; no rows where there is no file.

    Raises ValueError, which names the file, where it is damaged or one of its rows lacks a quantity of `needed`.
    """
    if not path.is_file():
        return {"rows": {}}
    command = "measure it again with data_scripts.measure_csgnet"
    found = _read(path, command)
    rows = found.get("rows")
    if not isinstance(rows, dict) or not all(isinstance(row, dict) for row in rows.values()):
        raise ValueError(f"{path}: found no rows of a table; {command}")
    for name, row in rows.items():
        if needed - row.keys():
            raise ValueError(
                f"{path}: found no {', '.join(sorted(needed - row.keys()))} of {name}; {command}"
            )
    return found


def read_runs(path: Path) -> list[dict] | None:
    """The runs [{"name": …, "log": one row an epoch}] of a file of curves; None where there is no file.

    Raises ValueError, which names the file, where it is damaged.
    """
    if not path.is_file():
        return None
    command = "make it again with data_scripts.keep_curves"
    runs = _read(path, command).get("runs")
    if not isinstance(runs, list) or not all(
        isinstance(run, dict) and {"name", "log"} <= run.keys() for run in runs
    ):
        raise ValueError(f"{path}: found no runs with a name and a log; {command}")
    return runs


def _read(path: Path, command: str) -> dict:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:  # no JSON, or no text at all
        raise ValueError(f"{path}: found no JSON ({error}); {command}") from error
    if not isinstance(found, dict):
        raise ValueError(f"{path}: found {type(found).__name__}; expected an object; {command}")
    return found
