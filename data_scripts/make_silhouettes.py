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
from collections.abc import Callable

from data_scripts import mask_files, sweethome
from data_scripts.made_files import is_made, replaces
from data_scripts.making import command
from data_scripts.mask_files import Drawn
from data_scripts.shape_sources import Item, Source, draw_all, furniture, models, programs
from lib.datasets import IMAGE_SOURCES, DataError
from lib.datasets.images import read, views_of
from lib.interpreters.rasterising import VIEWS, box_triangles, silhouettes
from lib.interpreters.shapeassembly import ProgramError, execute_many

CODE = (  # what, changed, draws other masks
    "lib/interpreters/cuboids.py",
    "lib/interpreters/rasterising.py",
    "lib/interpreters/shapeassembly/*.py",
    "lib/datasets/images.py",
    "lib/furniture/*.py",
    "data_scripts/sweethome.py",
)


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


DRAW = dict(zip(IMAGE_SOURCES, (draw_programs, draw_furniture, draw_models)))


def source_of(name: str, options: argparse.Namespace) -> Source:
    """One of IMAGE_SOURCES. Raises DataError for programs that were not fetched."""
    if name == "shapeassembly":
        return programs()
    return furniture(options.count) if name == "furniture" else models(options.package, options.out)


def make_one(name: str, options: argparse.Namespace) -> str:
    """Make one source's files, unless they are there; returns a line for a person. Raises DataError."""
    source = source_of(name, options)
    wanted = mask_files.settings(source.made_of, CODE)
    path = options.out / f"{name}.npz"
    if is_made(options.out, name, wanted):
        line = f"{path} is complete and up to date: nothing to do"
    elif replaces(options.out, name, wanted) and not options.force:
        raise DataError(f"{path} was made of something else; choose another --out, or --force to replace it")
    else:
        total, items, facts = source.load()
        drawn = draw_all(name, DRAW[name], total, items, options.workers)
        report = mask_files.write(options.out, name, drawn, {**facts, "settings": wanted})
        line = f"{path}: {mask_files.summary(report)}"
    if options.sheet:
        mask_files.write_sheets(options.out, read(path, name))
    return line


def main(arguments: list[str] | None = None) -> int:
    """The command; see data_scripts.making for options and exit code."""
    counted = "furniture of each category"
    return command(__doc__, IMAGE_SOURCES, "silhouettes", counted, make_one, arguments, sheets=True)


if __name__ == "__main__":
    sys.exit(main())
