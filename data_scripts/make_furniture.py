"""Make part graphs out of nothing:   python -m data_scripts.make_furniture --category chair --count 5000

Writes the furniture maker's chairs, tables and storage furniture (`lib.furniture`) in StructureNet's JSON format, one
file each, named by category and seed:

    data/furniture/{chair,table,storage}/chair-000000.json …

Running it again rewrites nothing that is already there and right; a killed run leaves no half file behind.
"""

import argparse
import sys
from pathlib import Path

from tqdm import tqdm

from data_scripts.ending import default_root, exit_code
from lib.datasets import CATEGORIES, DataError
from lib.furniture import make


def write_one(category: str, seed: int, folder: Path) -> bool:
    """Make one piece of furniture and keep it; True when its file was missing or differed."""
    graph = make(category, seed)
    path = folder / f"{graph.name}.json"
    part = path.with_name(path.name + ".part")  # a killed run never leaves a half file under the real name
    graph.write(part)
    if path.is_file() and path.read_bytes() == part.read_bytes():
        part.unlink()
        return False
    part.replace(path)
    return True


def write_all(categories: list[str], count: int, seed: int, out: Path) -> int:
    """Furniture of the seeds seed, seed + 1, … of each category; returns how many files were written.

    Raises DataError for a folder that cannot be written to.
    """
    jobs = [(category, each) for category in categories for each in range(seed, seed + count)]
    try:
        for category in categories:
            (out / category).mkdir(parents=True, exist_ok=True)
        return sum(write_one(*job, out / job[0]) for job in tqdm(jobs, desc="making", unit=" shapes"))
    except OSError as error:
        raise DataError(f"could not write to {out}: {error}") from error


def run(options: argparse.Namespace) -> None:
    """Make what the options say, and tell how much it was. Raises DataError."""
    categories = [options.category] if options.category else list(CATEGORIES)
    written = write_all(categories, options.count, options.seed, options.out)
    total = options.count * len(categories)
    print(f"{total} part graphs ({', '.join(categories)}) in {options.out}; {written} of them written now")


def main(arguments: list[str] | None = None) -> int:
    """The command; returns the exit code. Problems are one line on stderr."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--category", choices=CATEGORIES, help="only this one (default: all three)")
    parser.add_argument("--count", type=int, default=5000, help="how many of each (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the first one (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=default_root() / "furniture", help="default: %(default)s")
    options = parser.parse_args(arguments)
    if options.count < 1 or options.seed < 0:
        parser.error("--count must be 1 or more, --seed 0 or more")
    return exit_code(lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
