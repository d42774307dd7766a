"""Make images without programs:   python -m data_scripts.make_silhouettes [--source furniture]

64x64 masks of furniture that nobody labelled, front and side views, to train an image parser on. Sources:

    shapeassembly   the real ShapeAssembly programs, executed (first: python -m data_scripts.fetch_shapeassembly)
    furniture       the furniture maker's shapes, --count of each category
    sweethome3d     some 200 real models, chairs, sofas, tables, desks, lamps and storage, of Sweet Home 3D's extra
                    libraries, out of Debian's package sweethome3d-furniture 1.8-1 (120 MB; kept in data/downloads)

They go to data/silhouettes (or --out): SOURCE.npz, which lib.datasets.silhouettes reads, SOURCE.json with counts, what
was left out and why, licences and credits, and with --sheet contact sheets to look at. How a mask is drawn is told in
lib/interpreters/rasterising.py, how splits are made in lib/datasets/images.py; the ShapeAssembly data set's own
validation shapes are our test split.

The files are the same, byte by byte, whatever the number of workers. What is there and right is not made again; a
killed run leaves no half file behind.
"""

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from tqdm import tqdm

from data_scripts import mask_files, sweethome
from data_scripts.ending import exit_code
from data_scripts.fetch_shapeassembly import digest, read_folder
from data_scripts.journal import write_whole
from data_scripts.mask_files import Drawn
from data_scripts.packages import obtain
from data_scripts.parallel import end_with, in_parallel
from lib.datasets import (
    CATEGORIES,
    IMAGE_SOURCES,
    SPLITS,
    DataError,
    ProgramSet,
    data_root,
    shapeassembly,
)
from lib.datasets.images import SHARES, read, split_of, views_of
from lib.interpreters.rasterising import VIEWS, box_triangles, silhouettes
from lib.interpreters.shapeassembly import ProgramError, execute_many
from lib.interpreters.threads import one_thread

CHUNK = 32  # shapes a worker takes at once; fixed, because a batch of programs is executed together
OUT = (
    "default: %(default)s; lib.datasets looks for a folder silhouettes/ in data/, or in the folder that the "
    "environment variable SHAPE_PROGRAMS_DATA names"
)
MIT = "this project's own, MIT"
CODE = (  # what, changed, draws other masks
    "lib/interpreters/cuboids.py",
    "lib/interpreters/rasterising.py",
    "lib/interpreters/shapeassembly/*.py",
    "lib/datasets/images.py",
    "lib/furniture/*.py",
    "data_scripts/sweethome.py",
)

Item = tuple  # an id, a category, a split, and what the shape is made from


@dataclass(frozen=True)
class Source:
    """Where shapes come from.

    made_of  what decides, beside the code, what comes out
    load     gives the number of shapes, an Item of each, and what the report says about them: licence, credits
    draw     makes masks of some items
    """

    made_of: str
    load: Callable[[], tuple[int, Iterable[Item], dict]]
    draw: Callable[[list[Item]], list[Drawn]]


def programs(options: argparse.Namespace) -> Source:
    """The real ShapeAssembly programs. Raises DataError where they were not fetched."""
    folder = data_root() / "shapeassembly"
    if not folder.is_dir():
        raise DataError(
            f"there are no ShapeAssembly programs in {folder}; fetch them: "
            "python -m data_scripts.fetch_shapeassembly, or leave them out: --source furniture --source sweethome3d"
        )

    def load():
        sets = {(category, part): shapeassembly(category, part) for category in CATEGORIES for part in SPLITS}
        licence = f"Copyright 2020, Brown University; the text is in {folder.name}/LICENSE"
        return sum(map(len, sets.values())), items_of(sets), {"licence": licence}

    return Source(digest(read_folder(folder)), load, draw_programs)


def items_of(sets: dict[tuple[str, str], ProgramSet]) -> Iterator[Item]:
    """An Item for each program of each category and split of the data set; its own "val" is our "test"."""
    for (category, part), found in sets.items():
        for number, program in zip(found.ids, found):
            name = f"{category}/{number}"
            split = "test" if part == "val" else split_of(name, (*SHARES[:2], 0))
            yield name, category, split, program


def furniture(options: argparse.Namespace) -> Source:
    """The furniture maker's shapes, of the seeds 0, 1, …"""
    names = {f"{category}-{k:06d}": (category, k) for category in CATEGORIES for k in range(options.count)}
    items = [(name, category, split_of(name), seed) for name, (category, seed) in names.items()]
    return Source(
        f"{options.count} of each category", lambda: (len(items), items, {"licence": MIT}), draw_furniture
    )


def models(options: argparse.Namespace) -> Source:
    """Sweet Home 3D's furniture. Loading raises DataError for a package that cannot be had, or is damaged."""

    def load():
        package = obtain(sweethome.PACKAGE, options.package, data_root() / "downloads")
        found, copyright_text = sweethome.models(package)
        write_whole(options.out / "sweethome3d-copyright.txt", copyright_text.encode())
        credits = {m.id: {"name": m.title, "creator": m.creator, "licence": m.licence} for m in found}
        licence = "each model's own, in credits; the package's words: sweethome3d-copyright.txt"
        items = [(model.id, model.category, split_of(model.id), model) for model in found]
        return len(items), items, {"licence": licence, "package": sweethome.PACKAGE.name, "credits": credits}

    return Source(sweethome.PACKAGE.digest, load, draw_models)


SOURCES = dict(zip(IMAGE_SOURCES, (programs, furniture, models)))


def draw_programs(items: list[Item]) -> list[Drawn]:
    """Masks of programs, executed as one batch."""
    shapes = execute_many([program for *_, program in items])
    return [_drawn(item, lambda k=k: box_triangles(shapes[k].cuboids)) for k, item in enumerate(items)]


def draw_furniture(items: list[Item]) -> list[Drawn]:
    """Masks of the furniture maker's shapes, by seed."""
    return [
        Drawn(name, category, split, dict(zip(VIEWS, views_of(category, seed))))
        for name, category, split, seed in items
    ]


def draw_models(items: list[Item]) -> list[Drawn]:
    """Masks of meshes."""
    return [_drawn(item, lambda item=item: sweethome.triangles(item[-1])) for item in items]


def _drawn(item: Item, triangles: Callable) -> Drawn:
    try:
        return Drawn(*item[:3], dict(zip(VIEWS, silhouettes(triangles()))))
    # Of thousands of shapes, one may be nothing to see, or damaged.
    except (ValueError, IndexError, KeyError, ProgramError) as error:
        return Drawn(*item[:3], problem=f"no shape: {error}")


def draw_all(name: str, source: Source, total: int, items: Iterable[Item], count: int) -> Iterator[Drawn]:
    """What became of each shape, in the order of the items, whoever was ready first."""
    items, waiting, number = iter(items), {}, 0
    chunks = iter(lambda: list(islice(items, CHUNK)), [])
    jobs = ((k, source.draw, chunk) for k, chunk in enumerate(chunks))
    with tqdm(desc=name, unit=" shapes", total=total) as bar:
        for k, drawn in in_parallel(draw_chunk, jobs, count):
            bar.update(len(drawn))
            waiting[k] = drawn
            while number in waiting:
                yield from waiting.pop(number)
                number += 1


def draw_chunk(number: int, draw: Callable, items: list[Item], parent: int | None) -> tuple:
    """A worker's task; its number comes back with its results. A process other than `parent` ends with that one."""
    end_with(parent)
    with one_thread():  # the processes share the cores; and sums come in the same order everywhere
        return number, draw(items)


def make_one(name: str, options: argparse.Namespace) -> str:
    """Make one source's files, unless they are there; returns a line for a person. Raises DataError."""
    source = SOURCES[name](options)
    wanted = mask_files.settings(source.made_of, CODE)
    path = options.out / f"{name}.npz"
    if mask_files.is_made(options.out, name, wanted):
        line = f"{path} is complete and up to date: nothing to do"
    elif mask_files.replaces(options.out, name, wanted) and not options.force:
        raise DataError(f"{path} was made of something else; choose another --out, or --force to replace it")
    else:
        total, items, facts = source.load()
        drawn = draw_all(name, source, total, items, options.workers)
        report = mask_files.write(options.out, name, drawn, {**facts, "settings": wanted})
        line = f"{path}: {mask_files.summary(report)}"
    if options.sheet:
        mask_files.write_sheets(options.out, read(path, name))
    return line


def make_all(options: argparse.Namespace) -> None:
    """Make the sources that the options name, a line for each. Raises DataError."""
    for name in dict.fromkeys(options.source or SOURCES):
        print(make_one(name, options))


def main(arguments: list[str] | None = None) -> int:
    """The command; returns the exit code: 0 made, 1 a problem, 130 interrupted. Problems are one line on stderr."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--source", action="append", choices=SOURCES, help="only this (may be repeated; default: all)"
    )
    parser.add_argument(
        "--count", type=int, default=1000, help="furniture of each category (default: %(default)s)"
    )
    parser.add_argument(
        "--package", type=Path, help="use this .deb of sweethome3d-furniture, download nothing"
    )
    parser.add_argument("--out", type=Path, default=data_root() / "silhouettes", help=OUT)
    parser.add_argument("--force", action="store_true", help="replace masks that were made of something else")
    parser.add_argument("--workers", type=int, default=-1, help="processes (default: one for each core)")
    parser.add_argument("--sheet", action="store_true", help="write contact sheets, too")
    options = parser.parse_args(arguments)
    if options.workers < 1 and options.workers != -1:
        parser.error("--workers must be 1 or more")
    if options.count < 1:
        parser.error("--count must be 1 or more")
    return exit_code(
        lambda: make_all(options), "interrupted; what was finished stays, the same command makes the rest"
    )


if __name__ == "__main__":
    sys.exit(main())
