"""Keep the curves of trainings: logs of runs, epoch by epoch, as one file that the notebooks draw.

    python -m data_scripts.keep_curves "supervised start=runs/csgnet-reinforce" "from scratch=runs/scratch"

Writes results/csgnet/reinforce_curves.json: {"runs": [{"name", "command", "log": [{"epoch", …}, …]}, …]}. The names are
those that the curves get in the drawing. A run that has not ended is kept as far as it is, without a command.
"""

import argparse
import json
import sys
from pathlib import Path

from data_scripts.ending import exit_code
from data_scripts.journal import write_whole
from data_scripts.measuring import INTERRUPTED, check_writable
from lib.datasets import REPOSITORY, DataError
from lib.training.loop import LOG

CURVES = REPOSITORY / "results" / "csgnet" / "reinforce_curves.json"


def curve(named: str) -> dict:
    """One run, given as NAME=FOLDER. Raises DataError for anything else, and for a folder without a log."""
    name, equals, folder = named.partition("=")
    path = Path(folder) / LOG
    if not (name and equals and path.is_file()):
        raise DataError(f"found {named!r}; expected NAME=FOLDER, and a {LOG} in the folder")
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        log = [json.loads(line, parse_constant=_no_number) for line in lines]
        if [row["epoch"] for row in log] != list(range(1, len(log) + 1)) or not log:
            raise ValueError("its log has no rows of epochs 1, 2, …")
        return {"name": name, **_command(Path(folder), len(log)), "log": log}
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise DataError(f"{folder}: a file in it is damaged, or of no run ({error})") from error


def _no_number(found: str) -> None:
    raise ValueError(f"{found} is no number")


def _command(folder: Path, epochs: int) -> dict[str, str]:
    """The command, from the facts beside the run's weights; nothing where it has not ended, or where they are those of
    an earlier run, with another number of epochs."""
    paths = [path for path in folder.glob("*.json") if path.with_suffix(".safetensors").is_file()]
    facts = json.loads(paths[0].read_text(encoding="utf-8")) if paths else {"epochs": None}
    return {"command": str(facts["command"])} if facts["epochs"] == epochs else {}


def main(arguments: list[str] | None = None) -> int:
    """The command. Returns the exit code: 0 finished, 1 nothing could be kept, 130 interrupted."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs="+", metavar="NAME=FOLDER")
    parser.add_argument("--out", type=Path, default=CURVES, help=f"default: {CURVES.relative_to(REPOSITORY)}")
    options = parser.parse_args(arguments)

    def work() -> None:
        check_writable(options.out)
        found = {"runs": [curve(named) for named in options.runs]}
        if len({run["name"] for run in found["runs"]}) < len(options.runs):
            raise DataError("found two runs of one name; expected names that differ")
        write_whole(options.out, (json.dumps(found, indent=1) + "\n").encode())
        print(f"{len(found['runs'])} curves kept in {options.out}")

    return exit_code(work, INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
