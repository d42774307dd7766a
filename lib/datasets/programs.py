"""ShapeAssembly programs: the authors' real ones where they were fetched, else the project's own and variations.

Both also rewritten for the ablations of the paper's section 7.1: see `lib.extractor.rewriting`.
"""

import hashlib
import zlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
import torch

from lib.extractor.rewriting import ABLATIONS, rewrite_many
from lib.interpreters.shapeassembly import Program, ProgramError, parse

from .base import CATEGORIES, DataError, DataSet, choose, data_root

SPLITS = ("train", "val")
EMBEDDED_SIZES = {"train": 40, "val": 8}  # programs a category
SCALE_RANGE = (0.8, 1.25)  # how far a variation stretches or shrinks an axis
ABLATED = "shapeassembly-ablations"  # folder below the data root
EXAMPLES = Path(__file__).parents[1] / "examples" / "shapeassembly"


class ProgramSet(DataSet):
    """Programs; asking for one that is damaged raises DataError. `files` has the path of each that is read from one."""

    files: Mapping[str, Path] = MappingProxyType({})

    def __getitem__(self, index):
        found = super().__getitem__(index)
        if isinstance(index, slice):
            found.files = self.files
        return found

    def digest(self) -> str:
        """SHA-256 of ids and texts, which tells whether anything changed; files are not parsed for it."""
        digest = hashlib.sha256()
        for program_id in self.ids:
            text = _bytes(self.files[program_id]) if self.files else self._load(program_id).to_text().encode()
            digest.update(f"{program_id} {len(text)}\n".encode() + text)
        return digest.hexdigest()

    def describe(self) -> str:
        """One sentence: how many programs, of what, and where they come from."""
        if self.source == "real":
            return f"{len(self)} real {self.name} programs of the ShapeAssembly data set."
        if self.source == "made":
            return f"{len(self)} {self.name} programs, rewritten from the real ones of the ShapeAssembly data set."
        return (
            f"{len(self)} embedded {self.name} programs: the project's own examples and seeded variations of them "
            "(fetch the real ones with: python -m data_scripts.fetch_shapeassembly)."
        )


def shapeassembly(
    category: str | None = None, split: str | None = None, ablation: str | None = None
) -> ProgramSet:
    """ShapeAssembly programs: real ones when they were fetched, else embedded ones; `.source` says which.

    category  "chair", "table", "storage", or None for all three.
    split     "train", "val", or None for both.
    ablation  None, or "flat", "no_order", "no_align", "no_macros": the programs rewritten without that. Where the
              real ones are, rewriting them is a script's work and the source is then "made"; embedded ones are
              rewritten here.
    Raises DataError for another category, split or ablation, for real data that is damaged, and for an ablation of it
    that was not made.
    """
    categories = choose("category", category, CATEGORIES)
    splits = choose("split", split, SPLITS)
    if ablation is not None:
        choose("ablation", ablation, ABLATIONS)
    name = " ".join(filter(None, [ablation, category, split])) or "furniture"
    if not (data_root() / "shapeassembly").is_dir():
        programs = {}
        for each in categories:
            for part in splits:
                programs |= _embedded(each, part) if ablation is None else _rewritten(each, part, ablation)
        return ProgramSet(programs, programs.__getitem__, "embedded", name)
    folder, again = _real_folder(ablation)
    files = {}
    for each in categories:
        for part in splits:
            files |= _real(folder, each, part, again)

    @cache
    def load(program_id: str) -> Program:
        return _read(files[program_id])

    programs = ProgramSet(files, load, "real" if ablation is None else "made", name)
    programs.files = files
    return programs


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


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error


def _real_folder(ablation: str | None) -> tuple[Path, str]:
    """Where the real programs or those of an ablation lie, and what to do if they do not."""
    if ablation is None:
        fetch_again = "fetch the data again: python -m data_scripts.fetch_shapeassembly"
        return data_root() / "shapeassembly", fetch_again
    make_them = f"make them: python -m data_scripts.make_ablations --ablations {ablation}"
    return data_root() / ABLATED / ablation, make_them


def _real(folder: Path, category: str, split: str, again: str) -> dict[str, Path]:
    """Program id -> file, in the order of the split's list; every file is known to exist. `again` says how."""
    listing = folder / "splits" / category / f"{split}.txt"
    try:
        ids = listing.read_text(encoding="utf-8").split()
        present = {path.stem for path in (folder / category).iterdir()}
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{listing}: cannot be read, or its programs cannot ({error}); {again}") from error
    for line, program_id in enumerate(ids, start=1):
        if program_id not in present:
            raise DataError(
                f"{listing}, line {line}: there is no program {category}/{program_id}.txt; {again}"
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


@cache
def _rewritten(category: str, split: str, ablation: str) -> dict[str, Program]:
    """The embedded programs that can be rewritten for an ablation."""
    programs = _embedded(category, split)
    found = rewrite_many(list(programs.values()), ablation, list(programs), category)
    return {name: each.program for name, each in zip(programs, found) if each.program}


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
