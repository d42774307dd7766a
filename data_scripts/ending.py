"""How a data script ends: an exit code, and for a problem one line on stderr that says what to do."""

import sys
from collections.abc import Callable
from pathlib import Path

from lib.datasets import DataError, data_root
from lib.extractor import PartGraphError

GOES_ON = "interrupted; the same command goes on from here"


def default_root() -> Path:
    """`data_root()`, as an option's default. Where that is no folder, the command ends with exit code 1."""
    try:
        return data_root()
    except DataError as error:
        sys.exit(_said(f"{type(error).__name__}: {error}", 1))


def exit_code(work: Callable[[], object], interrupted: str = GOES_ON) -> int:
    """Does the work; returns 0 when it is done, 1 for a problem, 130 when Ctrl-C ended it."""
    try:
        work()
    except (DataError, PartGraphError) as error:
        return _said(f"{type(error).__name__}: {error}", 1)
    except OSError as error:
        return _said(f"DataError: a file cannot be read or written: {error}", 1)
    except KeyboardInterrupt:
        return _said(interrupted, 130)
    return 0


def _said(line: str, code: int) -> int:
    print(line, file=sys.stderr)
    return code
