"""Where part graphs lie: single files, folders and zip archives of them. Nothing is ever unpacked to disk.

    for name, graph in read_many("chair_hier.zip", "chair"):    graph: a PartGraph, or the error that tells why not
        …
    names = sources("chair_hier")                               or one by one, for workers that read their own
    graph = load("chair_hier", names[0], "chair")

A graph's name is its file's without ".json", with the folders between it and the source: "43875", "test/43875".
"""

import os
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path, PurePosixPath

from .errors import PartGraphError
from .parsing import known_category, parse, to_json
from .partgraph import PartGraph

LARGEST_FILE = 64 * 2**20  # bytes; a chair has 20 thousand, a zip bomb as many as it likes
SUFFIX = ".json"
_APPLE = "__MACOSX"  # the folder of file attributes in archives made on a Mac
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # the others cannot be read a piece at a time
_UNREADABLE = (OSError, EOFError, RuntimeError, ValueError, zipfile.BadZipFile, zlib.error)


def read(path: str | os.PathLike, category: str = "") -> PartGraph:
    """The part graph in a JSON file, as `parsing.parse`; its name is the file's stem."""
    return parse(_file(Path(path)), category, str(path))


def write(graph: PartGraph, path: str | os.PathLike) -> None:
    """Write a graph as one line of JSON. Raises PartGraphError; then the file is as it was before."""
    text, path = to_json(graph), Path(path)
    part = path.with_name(path.name + ".part")  # a killed run never leaves a half file under the real name
    try:
        part.write_text(text + "\n", encoding="utf-8")
        part.replace(path)
    except OSError as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise PartGraphError(f"cannot be written ({error.strerror})", file=str(path)) from error


def sources(path: str | os.PathLike) -> list[str]:
    """The names of the part graphs in a folder or zip archive, sorted. Raises PartGraphError where it is neither."""
    path = Path(path)
    if path.is_dir():
        files = [file.relative_to(path).as_posix() for file in path.rglob(f"*{SUFFIX}") if file.is_file()]
    else:
        files = _archive(path).namelist()
    wanted = (file for file in files if file.endswith(SUFFIX) and _APPLE not in PurePosixPath(file).parts)
    return sorted({file.removesuffix(SUFFIX) for file in wanted})


def load(path: str | os.PathLike, name: str, category: str = "") -> PartGraph:
    """One part graph of a folder or zip archive by its name, as `parsing.parse`. Raises PartGraphError."""
    path, file = Path(path), f"{path}/{name}{SUFFIX}"
    data = _file(Path(file)) if path.is_dir() else _member(path, name + SUFFIX, file)
    return replace(parse(data, category, file), name=name)


def read_many(
    path: str | os.PathLike, category: str = ""
) -> Iterator[tuple[str, PartGraph | PartGraphError]]:
    """All part graphs of a folder or zip archive by name; in place of one that cannot be read, its error.

    Raises PartGraphError at once where there is no such folder, archive or category.
    """
    known_category(category)
    return ((name, _load_or_error(path, name, category)) for name in sources(path))


def _load_or_error(path: str | os.PathLike, name: str, category: str) -> PartGraph | PartGraphError:
    try:
        return load(path, name, category)
    except PartGraphError as error:
        return error


def _file(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        raise PartGraphError(f"cannot be read ({_reason(error)})", file=str(path)) from error
    return _small_enough(data, str(path))


def _member(path: Path, member: str, file: str) -> bytes:
    """The content of one file in an archive. `file` is what errors call it."""
    archive = _archive(path)
    info = archive.NameToInfo.get(member)
    if info is None:
        raise PartGraphError("there is no such file in the archive", file=file)
    if info.flag_bits & 1:
        raise PartGraphError("the file is encrypted", "an archive without a password", file=file)
    if info.compress_type not in _METHODS:
        raise PartGraphError("compressed in an unusual way", "an ordinary zip archive (deflate)", file=file)
    try:
        with archive.open(info) as stream:
            data = stream.read(LARGEST_FILE + 1)  # what the archive says about its size may be a lie
    except _UNREADABLE as error:
        raise PartGraphError(f"the archive is damaged here ({_reason(error)})", file=file) from error
    return _small_enough(data, file)


def _small_enough(data: bytes, file: str) -> bytes:
    if len(data) > LARGEST_FILE:
        raise PartGraphError("the file is too large", f"at most {LARGEST_FILE / 2**20:g} MB", file=file)
    return data


def _archive(path: Path) -> zipfile.ZipFile:
    """An open archive, the same until it changes: the list of its files, perhaps thousands, is read once."""
    try:
        state = path.stat()
        return _opened(path, state.st_mtime_ns, state.st_size, os.getpid())
    except zipfile.BadZipFile:
        found, expected = "no zip archive, or a damaged one", f"a folder or a zip archive of {SUFFIX} files"
        raise PartGraphError(found, expected, file=str(path)) from None
    except _UNREADABLE as error:
        raise PartGraphError(f"cannot be read ({_reason(error)})", file=str(path)) from error


@lru_cache(maxsize=1)
def _opened(path: Path, changed: int, size: int, process: int) -> zipfile.ZipFile:
    return zipfile.ZipFile(path)  # one for each process: forked ones would share their place in the file


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__
