"""What commands that make a data set of several sources have in common: their options, and how they end."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from data_scripts.ending import default_root, exit_code

INTERRUPTED = "interrupted; what was finished stays, the same command makes the rest"


def command(
    about: str,
    sources: Sequence[str],
    folder: str,
    counted: str,
    make_one: Callable[[str, argparse.Namespace], str],
    arguments: list[str] | None = None,
    sheets: bool = False,
) -> int:
    """Make the sources that are asked for. Returns the exit code: 0 made, 1 a problem, 130 interrupted. Problems are
    one line on stderr.

    about     the help
    folder    below the data root, where lib.datasets looks for them
    counted   what --count is a number of
    make_one  source, options -> a line for a person; raises DataError
    sheets    there is --sheet, too
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    only = "only this (may be repeated; default: all)"
    parser.add_argument("--source", action="append", choices=sources, help=only)
    parser.add_argument("--count", type=int, default=1000, help=f"{counted} (default: %(default)s)")
    package = "use this .deb of sweethome3d-furniture, download nothing"
    parser.add_argument("--package", type=Path, help=package)
    out = (
        f"default: %(default)s; lib.datasets looks for a folder {folder}/ in data/, or in the folder that the "
        "environment variable SHAPE_PROGRAMS_DATA names"
    )
    parser.add_argument("--out", type=Path, default=default_root() / folder, help=out)
    parser.add_argument("--force", action="store_true", help="replace what was made of something else")
    parser.add_argument("--workers", type=int, default=-1, help="processes (default: one for each core)")
    if sheets:
        parser.add_argument("--sheet", action="store_true", help="write contact sheets, too")
    options = parser.parse_args(arguments)
    if options.workers < 1 and options.workers != -1:
        parser.error("--workers must be 1 or more")
    if options.count < 1:
        parser.error("--count must be 1 or more")

    def work() -> None:
        for name in dict.fromkeys(options.source or sources):
            print(make_one(name, options))

    return exit_code(work, INTERRUPTED)
