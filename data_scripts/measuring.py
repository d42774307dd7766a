"""What commands that measure have in common: their options, a file that is known to be writable, a table, the end."""

import argparse
import json
import os
import subprocess
from collections.abc import Callable
from datetime import date
from pathlib import Path

import torch

from data_scripts.ending import exit_code
from data_scripts.journal import code_digest, write_whole
from lib.datasets import REPOSITORY, DataError

INTERRUPTED = "interrupted; nothing was written"
LARGEST_SEED = 2**32 - 1  # multiples of it, one for each set of points, are still seeds that torch takes


def command(
    about: str,
    result: Path,
    quick: str,
    measure: Callable[[bool], dict],
    told: Callable[[dict], str],
    arguments: list[str] | None = None,
) -> int:
    """Measure, print and write, as a command with --quick and --out. Returns the exit code: 0 finished, 1 nothing
    could be written, 130 interrupted.

    about    the help; quick  that of --quick
    result   where the figures go without --out
    measure  whether it is to be quick -> the figures; told  the figures as a text
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help=quick)
    default = f"the JSON (default: {result.relative_to(REPOSITORY)})"
    parser.add_argument("--out", type=Path, default=result, help=default)
    options = parser.parse_args(arguments)

    def work() -> None:
        check_writable(options.out)  # told before minutes of work, not after
        torch.set_num_threads(1)
        found = measure(options.quick)
        print(told(found))
        write_whole(options.out, (json.dumps(found, indent=1) + "\n").encode())
        print(f"kept in {options.out}")

    return exit_code(work, INTERRUPTED)


def check_writable(path: Path) -> None:
    """Makes the folder that the file will be in. Raises DataError or OSError for a file that cannot be written."""
    if path.is_dir():
        raise DataError(f"{path} is a folder; expected the name of a file to write")
    if path.exists() and not path.is_file():
        raise DataError(f"{path} is a device, or the like; expected the name of a file to write")
    path.parent.mkdir(parents=True, exist_ok=True)
    if not os.access(path.parent, os.W_OK) or path.exists() and not os.access(path, os.W_OK):
        raise DataError(f"{path} cannot be written; expected a file in a folder of yours")


def check_seed(seed: int) -> None:
    """Raises DataError for a seed that a generator would refuse, minutes later perhaps."""
    if not 0 <= seed <= LARGEST_SEED:
        raise DataError(f"--seed is {seed}; expected 0 to {LARGEST_SEED}")


def version(*parts: str) -> dict[str, str]:
    """Date, commit, and a digest of the code that decides the numbers: `parts` of lib."""
    asked = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, cwd=REPOSITORY
    )
    return {"date": date.today().isoformat(), "commit": asked.stdout.strip(), "code": code_digest(*parts)}


def rounded(found):
    """Numbers with four digits after the point, also inside of rows and lists."""
    if isinstance(found, list):
        return [rounded(value) for value in found]
    if isinstance(found, dict):
        return {name: rounded(value) for name, value in found.items()}
    return round(found, 4) if isinstance(found, float) else found
