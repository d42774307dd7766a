"""What every data set is: items in a fixed order, and the folder that fetched and made ones live in."""

import os
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

REPOSITORY = Path(__file__).parents[2]
UNREADABLE = (  # what numpy and zipfile raise for one or another kind of damage
    *(
        OSError,
        EOFError,
        ValueError,
        TypeError,
        AttributeError,
        MemoryError,
        NotImplementedError,
        RuntimeError,
    ),
    *(zipfile.BadZipFile, zlib.error, tokenize.TokenError),
)
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
    named = os.environ.get("SHAPE_PROGRAMS_DATA")
    root = Path(named).expanduser() if named else REPOSITORY / "data"
    if root.is_file():
        raise DataError(f"SHAPE_PROGRAMS_DATA names {root}, which is a file; expected a folder")
    return root


def read_arrays(path: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Arrays of a .npz file by name. Raises KeyError for one that is not there, DataError for a damaged file."""
    try:
        with np.load(path) as file:  # never unpickles: that is numpy's default
            arrays = {name: file[name] for name in names}
    except UNREADABLE as error:
        raise DataError(f"{path}: cannot be read, or is damaged ({error})") from error
    if not all(isinstance(array, np.ndarray) for array in arrays.values()):
        raise DataError(f"{path}: cannot be read, or is damaged (a member is no array)")
    return arrays


def choose(what: str, value: str | None, choices: tuple[str, ...]) -> tuple[str, ...]:
    """The one that is asked for, or all for None. Raises DataError for another one."""
    if value is None:
        return choices
    if value not in choices:
        raise DataError(f"unknown {what} {value!r}: choose one of {', '.join(choices)}, or None for all")
    return (value,)


def made_sources(source: str | None, known: tuple[str, ...], folder: Path) -> Sequence[str]:
    """The source that is asked for; for None those whose .npz is in the folder, or "embedded" where none is. Raises
    DataError for one that is neither known nor "embedded"."""
    sources = choose("source", source, (*known, "embedded"))
    if source is not None:
        return sources
    return [name for name in known if (folder / f"{name}.npz").exists()] or ["embedded"]
