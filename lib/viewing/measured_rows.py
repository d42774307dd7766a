"""Reads the rows of a table in results/, as a data script measured them, for the figures that show them."""

import json
from collections.abc import Set
from math import isfinite
from pathlib import Path


def measured_rows(path: Path, rows: str, needed: Set[str], command: str) -> dict[str, dict]:
    """The rows by name. Raises FileNotFoundError where there is no such file, and ValueError for one that is damaged or
    whose rows lack a figure of `needed`; both name the command that measures them."""
    if not path.is_file():
        raise FileNotFoundError(
            f"results/{path.parent.name}/{path.name} is not there; this measures it: {command}"
        )
    try:
        found = json.loads(path.read_text(encoding="utf-8"))[rows]
        whole = bool(found) and all(_measured(row[name]) for row in found.values() for name in needed)
    except (ValueError, LookupError, TypeError, AttributeError):
        whole = False
    if not whole:
        raise ValueError(f"{path}: found no {rows} as they are measured; make them again: {command}")
    return found


def _measured(value: object) -> bool:
    return isinstance(value, list) or isfinite(value)
