"""What a long run has finished, kept so that a killed run goes on where it was.

A journal is a file of JSON lines: the run's settings, then one row for each finished thing, a dict with a "name".
Rows are appended a batch at a time, in one write; a last line that a kill cut short is dropped when it is read again.
"""

import hashlib
import json
import os
from pathlib import Path

from lib.datasets import REPOSITORY, DataError


class Journal:
    """The rows of a run, by name: those in the file at `path`, and those added since.

    Raises DataError where the file was made with other settings.
    """

    def __init__(self, path: Path, settings: dict[str, str]):
        self.path, self.settings = path, settings
        lines = _whole_lines(path)
        if lines and lines[0] != settings:
            raise DataError(
                f"{path} was made with other settings ({difference(lines[0], settings)}); {_ADVICE}"
            )
        self.rows = {row["name"]: row for row in lines[1:]}
        self._rewrite()

    def add(self, rows: list[dict]) -> None:
        """Keep finished rows."""
        with self.path.open(
            "ab", buffering=0
        ) as file:  # one write: all of it or, if killed, a beginning of it
            file.write(_text(rows))
        self.rows |= {row["name"]: row for row in rows}

    def check(self, sources: dict[str, str]) -> None:
        """Raises DataError unless every row was made from what its source is now: name -> fingerprint."""
        for name, row in self.rows.items():
            if name not in sources:
                raise DataError(f"{name} is in {self.path} but no longer in the input; {_ADVICE}")
            if row["source"] != sources[name]:
                was = f"was {row['source']}, is {sources[name]}"
                raise DataError(f"{name} has changed since {self.path} was begun ({was}); {_ADVICE}")

    def unfinished(self, sources: dict[str, str], size: int) -> list[dict[str, str]]:
        """Chunks of `size` sources of which one has no row yet; they are cut as in the first run."""
        names = list(sources)
        chunks = [{name: sources[name] for name in names[k : k + size]} for k in range(0, len(names), size)]
        return [chunk for chunk in chunks if not self.rows.keys() >= chunk.keys()]

    def finish(self) -> None:
        """Bring the rows into the order of their names, so that the file is the same whoever finished first."""
        self.rows = dict(sorted(self.rows.items()))
        self._rewrite()

    def _rewrite(self) -> None:
        write_whole(self.path, _text([self.settings, *self.rows.values()]))


_ADVICE = "choose another --out, or remove that folder to begin anew"


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that a killed run never leaves half under its real name; one that is the same is left alone. Behind
    a link, the file that it leads to is written. Raises DataError where a folder or a device is in the way."""
    path = path.resolve()
    check_place(path)
    if path.is_file() and path.read_bytes() == content:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    # Not a longer name: the file's own may be as long as names can be. One a process: two may write to one folder.
    part = path.with_name(f"half-{os.getpid()}.part")
    try:
        part.write_bytes(content)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def check_place(path: Path) -> None:
    """Raises DataError where a folder or a device has the name of a file that is to be written."""
    if path.exists() and not path.is_file():
        raise DataError(f"{path} is a folder, a device, or the like; expected the name of a file to write")


def code_digest(*parts: str) -> str:
    """Twelve hexadecimal digits that change when the code below lib/PART does, for any of the parts."""
    code = hashlib.sha256()
    for path in sorted(path for part in parts for path in (REPOSITORY / "lib" / part).rglob("*.py")):
        code.update(path.read_bytes())
    return code.hexdigest()[:12]


def _text(rows: list[dict]) -> bytes:
    return "".join(json.dumps(row) + "\n" for row in rows).encode()


def _whole_lines(path: Path) -> list[dict]:
    text = path.read_bytes() if path.exists() else b""
    whole, _cut_short = text[: text.rfind(b"\n") + 1], text[text.rfind(b"\n") + 1 :]
    try:
        return [json.loads(line) for line in whole.splitlines()]
    except ValueError as error:
        raise DataError(f"{path} is damaged ({error}); {_ADVICE}") from error


def difference(old: dict, new: dict) -> str:
    """The settings that are not what they were, for a message."""
    keys = [key for key in new if old.get(key) != new[key]]
    return (
        ", ".join(f"{key}: {old.get(key)!r} then, {new[key]!r} now" for key in keys)
        or "it is no such journal"
    )
