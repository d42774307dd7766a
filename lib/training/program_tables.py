"""Program tables kept on disk: reading thousands of programs takes seconds, and every run asks for the same ones.

A table lies below the data root as cache/program-table-KEY.npz. KEY is made of the programs' ids and texts, and of the
code that turns them into lines: a table is never stale, there is only another one. It may be removed at any time.
"""

import hashlib
import os
from contextlib import suppress
from pathlib import Path

import numpy as np

from ..datasets import DataError, ProgramSet, data_root
from ..datasets.base import read_arrays
from ..interpreters.shapeassembly import parsing, program
from ..models import program_lines, program_table
from ..models.program_table import ProgramTable

FIELDS = ("lines", "first", "parent", "program", "level")


def table_of(programs: ProgramSet) -> ProgramTable:
    """The table of a set of programs, from disk where it was kept; the embedded programs' is made anew.

    Raises DataError for programs that are damaged. A kept table that is damaged is made again.
    """
    if programs.source == "embedded" or not len(programs):
        return ProgramTable.of(programs)
    path = table_path(programs)
    if path.exists():
        try:
            return ProgramTable(**read_arrays(path, FIELDS))
        except (DataError, KeyError):
            pass  # cut short, or something else under this name: zip files carry checksums
    table = ProgramTable.of(programs)
    _keep(table, path)
    return table


def table_path(programs: ProgramSet) -> Path:
    """Where the table of these programs is kept."""
    key = hashlib.sha256(programs.digest().encode())
    for module in (parsing, program, program_lines, program_table):
        key.update(Path(module.__file__).read_bytes())
    return data_root() / "cache" / f"program-table-{key.hexdigest()[:20]}.npz"


def _keep(table: ProgramTable, path: Path) -> None:
    part = path.with_name(f"{path.name}.{os.getpid()}.part")  # one a process: several may begin together
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("wb") as file:
            np.savez_compressed(file, **{name: getattr(table, name) for name in FIELDS})
        part.replace(path)
    except OSError:
        pass  # a data root that cannot be written to, or a full disk: it works without
    finally:
        with suppress(OSError):
            part.unlink()
