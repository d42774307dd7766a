"""ShapeAssembly programs: the authors' real ones where they were fetched, else the project's own and variations."""

import zlib
from functools import cache
from pathlib import Path

import numpy as np
import torch

from lib.interpreters.shapeassembly import Program, ProgramError, parse

from .base import CATEGORIES, DataError, DataSet, choose, data_root

SPLITS = ("train", "val")
EMBEDDED_SIZES = {"train": 40, "val": 8}  # programs a category
SCALE_RANGE = (0.8, 1.25)  # how far a variation stretches or shrinks an axis
EXAMPLES = Path(__file__).parents[1] / "examples" / "shapeassembly"


class ProgramSet(DataSet):
    """Programs; asking for one that is damaged raises DataError."""

    def describe(self) -> str:
        """One sentence: how many programs, of what, and where they come from."""
        if self.source == "real":
            return f"{len(self)} real {self.name} programs of the ShapeAssembly data set."
        return (
            f"{len(self)} embedded {self.name} programs: the project's own examples and seeded variations of them "
            "(fetch the real ones with: python -m data_scripts.fetch_shapeassembly)."
        )


def shapeassembly(category: str | None = None, split: str | None = None) -> ProgramSet:
    """ShapeAssembly programs: real ones when they were fetched, else embedded ones; `.source` says which.

    category  "chair", "table", "storage", or None for all three.
    split     "train", "val", or None for both.
    Raises DataError for another category or split, and for real data that is damaged.
    """
    categories = choose("category", category, CATEGORIES)
    splits = choose("split", split, SPLITS)
    name = " ".join(filter(None, [category, split])) or "furniture"
    folder = data_root() / "shapeassembly"
    if not folder.is_dir():
        programs = {}
        for each in categories:
            for part in splits:
                programs |= _embedded(each, part)
        return ProgramSet(programs, programs.__getitem__, "embedded", name)
    files = {}
    for each in categories:
        for part in splits:
            files |= _real(folder, each, part)

    @cache
    def load(program_id: str) -> Program:
        return _read(files[program_id])

    return ProgramSet(files, load, "real", name)


def examples() -> dict[str, Program]:
    """The hand-written example programs by name, in alphabetical order."""
    return {path.stem: _read(path) for path in _example_files()}


def example(name: str) -> Program:
    """One hand-written example program, such as example("chair"). Raises DataError naming the choices."""
    return _read(_example_file(name))


def example_text(name: str) -> str:
    """The same example as its file says it, comment line and all: for showing and editing."""
    return _example_file(name).read_text(encoding="utf-8")


def _example_files() -> list[Path]:
    return sorted(EXAMPLES.glob("*/*.txt"), key=lambda path: path.stem)


def _example_file(name: str) -> Path:
    for path in _example_files():
        if path.stem == name:
            return path
    raise DataError(f"unknown example {name!r}: choose one of {', '.join(p.stem for p in _example_files())}")


def _read(path: Path) -> Program:
    """Parse one file; any problem becomes a DataError that names the file and line."""
    try:
        return parse(path.read_text(encoding="utf-8"))
    except ProgramError as error:
        raise DataError(f"{path}: {error}") from error  # the error begins with the line and column
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise DataError(f"{path}: line {line}: not a text file") from error
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error


def _real(folder: Path, category: str, split: str) -> dict[str, Path]:
    """Program id -> file, in the order of the split's list; every file is known to exist."""
    listing = folder / "splits" / category / f"{split}.txt"
    fetch_again = "fetch the data again: python -m data_scripts.fetch_shapeassembly"
    try:
        ids = listing.read_text(encoding="utf-8").split()
        present = {path.stem for path in (folder / category).iterdir()}
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(
            f"{listing}: cannot be read, or its programs cannot ({error}); {fetch_again}"
        ) from error
    for line, program_id in enumerate(ids, start=1):
        if program_id not in present:
            raise DataError(
                f"{listing}, line {line}: there is no program {category}/{program_id}.txt; {fetch_again}"
            )
    return {program_id: folder / category / f"{program_id}.txt" for program_id in ids}


@cache
def _embedded(category: str, split: str) -> dict[str, Program]:
    """The category's examples (in "train" only), then variations of them in turn, up to EMBEDDED_SIZES[split]."""
    originals = {path.stem: _read(path) for path in _example_files() if path.parent.name == category}
    if not originals:
        raise DataError(f"lib/examples holds no {category} program: is the installation whole?")
    rng = np.random.default_rng(zlib.crc32(f"{category}/{split}".encode()))
    programs = dict(originals) if split == "train" else {}
    names = sorted(originals)
    while len(programs) < EMBEDDED_SIZES[split]:
        name = names[len(programs) % len(names)]
        programs[f"{name}-{split}-{len(programs):02d}"] = vary(originals[name], rng)
    return programs


def vary(program: Program, rng: np.random.Generator) -> Program:
    """The same structure in other proportions: every cuboid is scaled by one random factor an axis of the whole shape.

    One factor for all cuboids keeps what is as wide as the seat as wide as the seat.
    """
    factors = rng.uniform(*SCALE_RANGE, size=3)  # x, y, z
    scale = torch.ones_like(program.parameters(), dtype=torch.float64)
    for i, name in enumerate(program.parameter_names()):
        _block, _statement, command, index = name.split(":")
        if command == "Cuboid":  # its parameters 0, 1, 2 are the lengths along x, y, z
            scale[i] = factors[int(index)]
    return program.with_parameters((program.parameters().double() * scale).round(decimals=4))
