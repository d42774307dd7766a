"""What every data set is: items in a fixed order, and the folder that fetched and made ones live in."""

import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
CATEGORIES = ("chair", "table", "storage")


class DataError(RuntimeError):
    """Data that is missing, damaged or unknown. The message is one line that says what to do."""


class DataSet(Sequence):
    """Items in a fixed order, read or made when asked for. `ids[i]` names item i; a slice is a set of its kind."""

    def __init__(self, ids: Iterable[str], load: Callable[[str], object], source: str, name: str):
        self.ids, self.source, self.name = tuple(ids), source, name
        self._load = load  # id -> item

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, index):
        if isinstance(index, slice):
            return type(self)(self.ids[index], self._load, self.source, self.name)
        return self._load(self.ids[index])

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.describe()}>"


def data_root() -> Path:
    """The folder of fetched data sets: SHAPE_PROGRAMS_DATA, or data/ in the repository."""
    return Path(os.environ.get("SHAPE_PROGRAMS_DATA") or REPOSITORY / "data")


def choose(what: str, value: str | None, choices: tuple[str, ...]) -> tuple[str, ...]:
    """The one that is asked for, or all for None. Raises DataError for another one."""
    if value is None:
        return choices
    if value not in choices:
        raise DataError(f"unknown {what} {value!r}: choose one of {', '.join(choices)}, or None for all")
    return (value,)
