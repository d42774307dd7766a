"""Reads what was measured of CSGNet: results/csgnet, and results/csgnet/seed_1 of networks that learned with it."""

import json
from collections.abc import Mapping, Set
from pathlib import Path

RESULTS = Path(__file__).parents[2] / "results" / "csgnet"
SECOND = "seed_1"


def read_rows(
    path: Path, needed: Mapping[str, Set[str]] = {}, header: Set[str] = frozenset({"samples"})
) -> dict:
    """The content of a table's file, whose "rows" are {name: {quantity: number, or {part: number}}}; no rows without
    a file.

    Raises ValueError, which names the file, where it is damaged, without `header`, or where a row lacks a quantity of
    `needed`, or one of its parts.
    """
    if not path.is_file():
        return {"rows": {}}
    command = "measure it again with data_scripts.measure_csgnet"
    found = _read(path, command)
    rows = found.get("rows")
    if not isinstance(rows, dict) or not all(isinstance(row, dict) for row in rows.values()):
        raise ValueError(f"{path}: found no rows of a table; {command}")
    if rows and header - found.keys():
        raise ValueError(f"{path}: found no {', '.join(sorted(header - found.keys()))}; {command}")
    for name, row in rows.items():
        values = {
            quantity: value if isinstance(value, dict) else {"": value} for quantity, value in row.items()
        }
        wrong = {q for q, parts in needed.items() if q not in row or parts - values[q].keys()}
        wrong |= {q for q, parts in values.items() if not all(map(_is_number, parts.values()))}
        if wrong:
            raise ValueError(f"{path}: found no {', '.join(sorted(wrong))} of {name}, as measured; {command}")
    return found


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def read_runs(path: Path, needed: Set[str] = frozenset()) -> list[dict] | None:
    """The runs [{"name": …, "log": one row an epoch}] of a file of curves; None where there is no file.

    Raises ValueError, which names the file, where it is damaged, or where a log has no epochs, or an epoch lacks a
    quantity of `needed`.
    """
    if not path.is_file():
        return None
    command = "make it again with data_scripts.keep_curves"
    runs = _read(path, command).get("runs")
    if not isinstance(runs, list) or not all(
        isinstance(run, dict) and {"name", "log"} <= run.keys() for run in runs
    ):
        raise ValueError(f"{path}: found no runs with a name and a log; {command}")
    for run in runs:
        rows = run["log"]
        whole = isinstance(rows, list) and rows and all(isinstance(row, dict) for row in rows)
        if not whole or not all(_is_number(row.get(key)) for row in rows for key in {"epoch", *needed}):
            raise ValueError(
                f"{path}: found no epochs with {', '.join(sorted(needed))} in {run['name']}; {command}"
            )
    return runs


def _read(path: Path, command: str) -> dict:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:  # no JSON, or no text at all
        raise ValueError(f"{path}: found no JSON ({error}); {command}") from error
    if not isinstance(found, dict):
        raise ValueError(f"{path}: found {type(found).__name__}; expected an object; {command}")
    return found
