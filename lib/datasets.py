"""Where programs and part graphs come from: real data sets where they were put, else what travels with lib/.

    chairs = shapeassembly("chair", split="train")     a sequence of Program
    graphs = part_graphs("chair")                      a sequence of PartGraph
    chairs.source                                      "real" or "embedded"
    print(chairs.describe())                           one sentence for the reader

The data root is ./data in the repository, or the folder that the environment variable SHAPE_PROGRAMS_DATA names.
Real data is read when it is first asked for, so a big set opens at once. The embedded programs are the hand-written
examples of lib/examples and seeded variations of their sizes, the embedded part graphs come from the furniture maker
(lib.furniture): the same on every machine.
"""

import os
import zlib
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import torch

from lib.extractor import PartGraphError
from lib.extractor.files import load as load_graph
from lib.extractor.files import sources
from lib.furniture import make
from lib.furniture.silhouettes import SPLITS as IMAGE_SPLITS
from lib.furniture.silhouettes import ImageError, ImageSet, joined, made
from lib.furniture.silhouettes import read as read_images
from lib.interpreters.shapeassembly import Program, ProgramError, parse

CATEGORIES = ("chair", "table", "storage")
SPLITS = ("train", "val")
EMBEDDED_SIZES = {"train": 40, "val": 8}  # programs a category
IMAGE_SOURCES = ("shapeassembly", "furniture", "sweethome3d")  # what data_scripts.make_silhouettes knows
EMBEDDED_IMAGES = 50  # shapes a category, of which there are masks with no download: a second's work
FURNITURE = 1000  # part graphs a category; the maker has no end of them
CSG_SPLITS = ("train", "val", "test")
CSG_SIZES = {  # programs by dimension, tokens and split: CSGNet's Table 1
    dimensions: {length: dict(zip(CSG_SPLITS, (1000 * n for n in row))) for length, row in table.items()}
    for dimensions, table in {
        2: {
            3: (25, 5, 5),
            5: (100, 10, 50),
            7: (150, 20, 50),
            9: (250, 20, 50),
            11: (350, 20, 100),
            13: (350, 20, 100),
        },
        3: {3: (100, 10, 20), 5: (200, 20, 40), 7: (400, 40, 80)},
    }.items()
}
PARTNET = {
    "chair": "chair_hier",
    "table": "table_hier",
    "storage": "storagefurniture_hier",
}  # StructureNet's folders
SCALE_RANGE = (0.8, 1.25)  # how far a variation stretches or shrinks an axis
REPOSITORY = Path(__file__).parents[1]
EXAMPLES = Path(__file__).parent / "examples" / "shapeassembly"


class DataError(RuntimeError):
    """Data that is missing, damaged or unknown. The message is one line that says what to do."""


class DataSet(Sequence):
    """Items in a fixed order, read or made when asked for. `ids[i]` names item i; a slice is a set of its kind."""

    def __init__(self, ids: Iterable[str], load: Callable[[str], object], source: str, name: str):
        self.ids, self.source, self.name = tuple(ids), source, name
        self._load = load  # id -> item

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, index):
        if isinstance(index, slice):
            return type(self)(self.ids[index], self._load, self.source, self.name)
        return self._load(self.ids[index])

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.describe()}>"


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


class GraphSet(DataSet):
    """Part graphs; asking for one that is damaged raises PartGraphError."""

    def describe(self) -> str:
        """One sentence: how many part graphs, of what, and where they come from."""
        if self.source == "real":
            return f"{len(self)} {self.name} part graphs of PartNet."
        return f"{len(self)} {self.name} part graphs of the furniture maker (see lib.furniture)."


def data_root() -> Path:
    """The folder of fetched data sets: SHAPE_PROGRAMS_DATA, or data/ in the repository."""
    return Path(os.environ.get("SHAPE_PROGRAMS_DATA") or REPOSITORY / "data")


def shapeassembly(category: str | None = None, split: str | None = None) -> ProgramSet:
    """ShapeAssembly programs: real ones when they were fetched, else embedded ones; `.source` says which.

    category  "chair", "table", "storage", or None for all three.
    split     "train", "val", or None for both.
    Raises DataError for another category or split, and for real data that is damaged.
    """
    categories = _choose("category", category, CATEGORIES)
    splits = _choose("split", split, SPLITS)
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


def part_graphs(category: str) -> GraphSet:
    """Part graphs of a category: PartNet's where its owner put them (data/partnet/chair_hier, …), else made ones.

    Raises DataError for another category, or for a PartNet folder without files.
    """
    if category not in CATEGORIES:
        raise DataError(f"unknown category {category!r}: choose one of {', '.join(CATEGORIES)}")
    folder = data_root() / "partnet" / PARTNET[category]
    if not folder.is_dir():
        names = [f"{category}-{seed:06d}" for seed in range(FURNITURE)]
        return GraphSet(
            names, lambda name: make(category, int(name.rpartition("-")[2])), "embedded", category
        )
    try:
        names = sources(folder)
    except PartGraphError as error:
        raise DataError(str(error)) from error
    if not names:
        raise DataError(f"{folder} holds no .json file; see python -m data_scripts.extract_programs --help")
    return GraphSet(names, lambda name: load_graph(folder, name, category), "real", category)


def silhouettes(source: str | None = None, split: str | None = None) -> ImageSet:
    """64x64 masks of furniture from the front and the side, without programs; `.source` says whose furniture it is.

    source  "shapeassembly", "furniture" or "sweethome3d", as made by data_scripts.make_silhouettes; "embedded" for
            a few that are made on the spot; None for all that were made, and where there are none, the embedded ones.
    split   "train", "val", "test", or None for all: no shape and no mask is in two of them.
    Raises DataError for another source or split, one that was not made, and files that are damaged.
    """
    sources = _choose("source", source, (*IMAGE_SOURCES, "embedded"))
    _choose("split", split, IMAGE_SPLITS)
    folder = data_root() / "silhouettes"
    if source is None:
        sources = [name for name in IMAGE_SOURCES if (folder / f"{name}.npz").exists()] or ["embedded"]
    images = joined([_images(folder, name) for name in sources])
    return images if split is None else images.select(split)


def logos(split: str | None = None) -> ImageSet:
    """64x64 masks of logos, for testing alone as in CSGNet's paper, so that all of them are in the split "test".

    Raises DataError for another split, and where they were not made with data_scripts.make_logos.
    """
    _choose("split", split, IMAGE_SPLITS)
    images = _images(data_root() / "silhouettes", "logos")
    return images if split is None else images.select(split)


def examples() -> dict[str, Program]:
    """The hand-written example programs by name, in alphabetical order."""
    return {path.stem: _read(path) for path in _example_files()}


def example(name: str) -> Program:
    """One hand-written example program, such as example("chair"). Raises DataError naming the choices."""
    return _read(_example_file(name))


def example_text(name: str) -> str:
    """The same example as its file says it, comment line and all: for showing and editing."""
    return _example_file(name).read_text(encoding="utf-8")


def _choose(what: str, value: str | None, choices: tuple[str, ...]) -> tuple[str, ...]:
    if value is None:
        return choices
    if value not in choices:
        raise DataError(f"unknown {what} {value!r}: choose one of {', '.join(choices)}, or None for all")
    return (value,)


def _images(folder: Path, source: str) -> ImageSet:
    """One source's masks. Raises DataError, with the command that makes them."""
    if source == "embedded":
        return made(EMBEDDED_IMAGES)
    script = "make_logos" if source == "logos" else f"make_silhouettes --source {source}"
    path = folder / f"{source}.npz"
    if not path.exists():
        raise DataError(f"there is no {path}; make it: python -m data_scripts.{script}")
    try:
        return read_images(path, source)
    except ImageError as error:
        raise DataError(f"{error}; make it again: python -m data_scripts.{script}") from error


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
