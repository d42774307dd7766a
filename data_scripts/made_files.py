"""The two files of a data set that was made: SOURCE.npz, and SOURCE.json, which tells how it was made.

The .json is written last. It has the .npz file's SHA-256 and the settings, so the two tell whether all is there and up
to date.
"""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path

from data_scripts.journal import write_whole
from lib.datasets import REPOSITORY


def code_of(patterns: Iterable[str]) -> str:
    """Twelve hexadecimal digits that change with the files of the repository that these patterns name."""
    total = hashlib.sha256()
    for path in sorted(path for pattern in patterns for path in REPOSITORY.glob(pattern)):
        total.update(path.read_bytes())
    return total.hexdigest()[:12]


def is_made(folder: Path, source: str, settings: dict) -> bool:
    """Are the files there, whole, and made with these settings?"""
    try:
        report = json.loads((folder / f"{source}.json").read_text(encoding="utf-8"))
        content = (folder / f"{source}.npz").read_bytes()
    except (OSError, ValueError):
        return False
    if not isinstance(report, dict):
        return False
    whole = report.get("sha256") == hashlib.sha256(content).hexdigest()
    return whole and report.get("settings") == settings


def replaces(folder: Path, source: str, settings: dict) -> bool:
    """Would making this replace what was made of something else, such as more furniture?"""
    try:
        report = json.loads((folder / f"{source}.json").read_text(encoding="utf-8"))
        return report["settings"]["made_of"] != settings["made_of"]
    except (OSError, ValueError, KeyError, TypeError):
        return False


def write_made(folder: Path, source: str, content: bytes, report: dict) -> None:
    """Write both. `report`, which has the settings, gets the digest."""
    report["sha256"] = hashlib.sha256(content).hexdigest()
    write_whole(folder / f"{source}.npz", content)
    write_whole(folder / f"{source}.json", (json.dumps(report, indent=1, ensure_ascii=False) + "\n").encode())
