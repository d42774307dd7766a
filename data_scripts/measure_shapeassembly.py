"""Execute every real program, count, and compare with the paper: python -m data_scripts.measure_shapeassembly

Writes results/shapeassembly_statistics.json: programs, lines, macros per line and leaf parts of each category,
beside the "Ground Truth" rows of the paper's Tables 3 and 5.
"""

import argparse
import json
import sys
from pathlib import Path

from tqdm import tqdm

from lib.datasets import CATEGORIES, REPOSITORY, DataError, shapeassembly
from lib.interpreters.shapeassembly import execute_many
from lib.metrics.programs import PAPER_GROUND_TRUTH, program_statistics

RESULT = REPOSITORY / "results" / "shapeassembly_statistics.json"


def measure() -> dict[str, dict]:
    """Statistics by category, over the train and val programs together. Raises DataError without the real data."""
    rows = {}
    for category in tqdm(CATEGORIES, desc="categories"):
        programs = shapeassembly(category)
        if programs.source != "real":
            raise DataError(
                "the real programs are not here; first run: python -m data_scripts.fetch_shapeassembly"
            )
        programs = list(programs)
        rows[category] = {
            "measured": program_statistics(programs, execute_many(programs)).as_row(),
            "paper": PAPER_GROUND_TRUTH[category].as_row(),
        }
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Run from the command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out", type=Path, default=RESULT, help="where to write the JSON (default: results/)"
    )
    out = parser.parse_args(arguments).out
    try:
        rows = measure()
    except DataError as error:
        print(error, file=sys.stderr)
        return 1
    for category, row in rows.items():
        print(
            category,
            *(f"{key} {row['measured'][key]:g} ({row['paper'][key]:g})" for key in row["paper"]),
            sep="  ",
        )
    print(f"measured (paper); kept in {out}")
    out.parent.mkdir(parents=True, exist_ok=True)
    part = out.with_name(out.name + ".part")
    part.write_text(json.dumps(rows, indent=1) + "\n")
    part.replace(out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
