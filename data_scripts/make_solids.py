"""Make point clouds of solids:   python -m data_scripts.make_solids [--source furniture]

What CSG-Stump Net learns from, without ShapeNet: points on the surface with normals, and points of space, half of them
inside. Sources:

    shapeassembly   the real ShapeAssembly programs, executed (first: python -m data_scripts.fetch_shapeassembly)
    furniture       the furniture maker's shapes with their dense surfaces (turned legs, pillows), --count a category
    sweethome3d     some 200 real models out of Debian's package sweethome3d-furniture 1.8-1 (120 MB; kept in
                    data/downloads); inside is where their faces wind around a point
    csg             random solids of the CSG-Stump language, --count of them

They go to data/solids (or --out): SOURCE.npz, which lib.datasets.solid_clouds reads, and SOURCE.json with counts, what
was left out and why, licences and credits. Every solid is moved and scaled to diagonal 1 around the origin. How points
are chosen is told in lib/datasets/solid_sampling.py, how splits are made in lib/datasets/images.py; the ShapeAssembly
data set's own validation shapes are our test split.

The files are the same, byte by byte, whatever the number of workers. What is there and right is not made again; a
killed run leaves no half file behind.
"""

import argparse
import io
import sys
import zlib
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import trimesh

from data_scripts import sweethome
from data_scripts.journal import check_place
from data_scripts.made_files import code_of, is_made, replaces, write_made
from data_scripts.making import command
from data_scripts.shape_sources import MIT, Item, Source, draw_all, furniture, models, programs
from lib.datasets import DataError
from lib.datasets.images import SHARES, SPLITS, split_of
from lib.datasets.solid_clouds import ARRAYS, SOURCES, TEXTS, gathered, in_boxes
from lib.datasets.solid_sampling import SolidSample, by_winding, sample_solid
from lib.furniture import dense_mesh, make
from lib.interpreters.shapeassembly import ProgramError, execute_many
from lib.interpreters.stump import execute, sample

POINTS, QUERIES = 2048, 4096  # of each solid
CODE = (  # what, changed, makes other clouds
    "lib/datasets/solid_*.py",
    "lib/furniture/*.py",
    "lib/interpreters/cuboids.py",
    "lib/interpreters/shapeassembly/*.py",
    "lib/interpreters/stump/*.py",
    "data_scripts/sweethome.py",
)
Made = tuple[str, str, str, SolidSample | str]  # id, split, category, and the samples, or why there are none


def random_solids(count: int) -> Source:
    """Random stumps of the seeds 0, 1, …: Items end with the seed."""
    items = [(f"csg-{k:06d}", "csg", split_of(f"csg-{k:06d}"), k) for k in range(count)]
    return Source(f"{count} random stumps", lambda: (count, items, {"licence": MIT}))


def draw_programs(items: list[Item]) -> list[Made]:
    """Clouds of programs, executed as one batch."""
    shapes = execute_many([program for *_, program in items])

    def sampled(k: int, seed: int) -> SolidSample:
        return sample_solid(shapes[k].mesh(), in_boxes(shapes[k].cuboids), POINTS, QUERIES, seed)

    return [_made(item, lambda seed, k=k: sampled(k, seed)) for k, item in enumerate(items)]


def draw_furniture(items: list[Item]) -> list[Made]:
    """Clouds of the furniture maker's dense surfaces."""
    return [_of_mesh(item, lambda item=item: dense_mesh(make(item[1], item[3]))) for item in items]


def draw_models(items: list[Item]) -> list[Made]:
    """Clouds of Sweet Home 3D's models."""
    return [_of_mesh(item, lambda item=item: _mesh(sweethome.triangles(item[3]))) for item in items]


def draw_random(items: list[Item]) -> list[Made]:
    """Clouds of random stumps."""
    return [
        _of_mesh(item, lambda item=item: execute(sample(np.random.default_rng(item[3]))).mesh())
        for item in items
    ]


DRAW = dict(zip(SOURCES, (draw_programs, draw_furniture, draw_models, draw_random)))


def _mesh(triangles: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles))


def _of_mesh(item: Item, mesh: Callable[[], trimesh.Trimesh]) -> Made:
    def sampled(seed: int) -> SolidSample:
        found = mesh()
        return sample_solid(found, by_winding(found), POINTS, QUERIES, seed)

    return _made(item, sampled)


def _made(item: Item, sampled: Callable[[int], SolidSample]) -> Made:
    """`sampled` takes a seed, which is the solid's own."""
    name, category, split = item[:3]
    try:
        return name, split, category, sampled(zlib.crc32(name.encode()))
    # Of thousands of shapes, one may be no solid, or damaged.
    except (DataError, ValueError, IndexError, KeyError, ProgramError) as error:
        return name, split, category, f"no solid: {error}"


def write(folder: Path, source: str, solids: Iterable[Made], facts: dict) -> dict:
    """Write the .npz and .json of a source; returns what the latter says. Raises DataError where none is a solid."""
    solids = list(solids)
    kept = [solid for solid in solids if isinstance(solid[3], SolidSample)]
    left_out = {solid[0]: solid[3] for solid in solids if isinstance(solid[3], str)}
    if not kept:
        raise DataError(f"none of {len(solids)} shapes of {source} is a solid; expected some ({left_out})")
    clouds = gathered(kept, source)
    buffer = io.BytesIO()
    arrays = {name: getattr(clouds, name).numpy() for name in ARRAYS}
    np.savez_compressed(buffer, **arrays, **{name: np.array(getattr(clouds, name)) for name in TEXTS})
    report = {
        "source": source,
        "solids": len(clouds),
        "splits": {name: clouds.splits.count(name) for name in SPLITS},
        "categories": dict(sorted(Counter(clouds.categories).items())),
        **facts,
        "left_out": left_out,
    }
    write_made(folder, source, buffer.getvalue(), report)
    return report


def source_of(name: str, options: argparse.Namespace) -> Source:
    """One of SOURCES. Raises DataError for programs that were not fetched."""
    if name == "shapeassembly":
        return programs()
    if name == "sweethome3d":
        return models(options.package, options.out)
    return (furniture if name == "furniture" else random_solids)(options.count)


def make_one(name: str, options: argparse.Namespace) -> str:
    """Make one source's files, unless they are there; returns a line for a person. Raises DataError."""
    source = source_of(name, options)
    wanted = {"made_of": source.made_of, "points": POINTS, "queries": QUERIES, "code": code_of(CODE)}
    wanted |= {"split_shares": list(SHARES)}
    path = options.out / f"{name}.npz"
    if is_made(options.out, name, wanted):
        return f"{path} is complete and up to date: nothing to do"
    if replaces(options.out, name, wanted) and not options.force:
        raise DataError(f"{path} was made of something else; choose another --out, or --force to replace it")
    for ending in ("npz", "json"):
        check_place(options.out / f"{name}.{ending}")  # both, before minutes of work
    total, items, facts = source.load()
    drawn = draw_all(name, DRAW[name], total, items, options.workers)
    report = write(options.out, name, drawn, {**facts, "settings": wanted})
    splits = ", ".join(f"{count} {split}" for split, count in report["splits"].items())
    return f"{path}: {report['solids']} solids ({splits}); left out: {len(report['left_out'])}"


def main(arguments: list[str] | None = None) -> int:
    """The command; see data_scripts.making for options and exit code."""
    return command(
        __doc__, SOURCES, "solids", "furniture of each category, random solids", make_one, arguments
    )


if __name__ == "__main__":
    sys.exit(main())
