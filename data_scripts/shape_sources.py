"""Where the shapes come from of which data scripts make pictures and point clouds:

    programs     the real ShapeAssembly programs
    furniture    the furniture maker's shapes, of the seeds 0, 1, …
    models       Sweet Home 3D's models, out of Debian's package

Each is a Source, whose Items have a name, a category, a split, and what the shape is made from.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from tqdm import tqdm

from data_scripts import sweethome
from data_scripts.fetch_shapeassembly import digest, read_folder
from data_scripts.journal import write_whole
from data_scripts.packages import obtain
from data_scripts.parallel import end_with, in_parallel
from lib.datasets import CATEGORIES, SPLITS, DataError, ProgramSet, data_root, shapeassembly
from lib.datasets.images import SHARES, split_of
from lib.interpreters.threads import one_thread

CHUNK = 32  # shapes a worker takes at once; fixed, because a batch of programs is executed together
MIT = "this project's own, MIT"

Item = tuple  # an id, a category, a split, and what the shape is made from


@dataclass(frozen=True)
class Source:
    """Where shapes come from.

    made_of  what decides, beside the code, what comes out
    load     gives the number of shapes, an Item of each, and what the report says about them: licence, credits
    """

    made_of: str
    load: Callable[[], tuple[int, Iterable[Item], dict]]


def programs() -> Source:
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

    return Source(digest(read_folder(folder)), load)


def items_of(sets: dict[tuple[str, str], ProgramSet]) -> Iterator[Item]:
    """An Item for each program of each category and split of the data set; its own "val" is our "test"."""
    for (category, part), found in sets.items():
        for number, program in zip(found.ids, found):
            name = f"{category}/{number}"
            split = "test" if part == "val" else split_of(name, (*SHARES[:2], 0))
            yield name, category, split, program


def furniture(count: int) -> Source:
    """The furniture maker's first `count` shapes of each category: Items end with the seed."""
    names = {f"{category}-{k:06d}": (category, k) for category in CATEGORIES for k in range(count)}
    items = [(name, category, split_of(name), seed) for name, (category, seed) in names.items()]
    return Source(f"{count} of each category", lambda: (len(items), items, {"licence": MIT}))


def models(package: Path | None, folder: Path) -> Source:
    """Sweet Home 3D's furniture: Items end with a Model. The package's copyright file is written to `folder`.

    package  a .deb that is there; None: it is fetched
    Loading raises DataError for a package that cannot be had, or is damaged.
    """

    def load():
        found, copyright_text = sweethome.models(
            obtain(sweethome.PACKAGE, package, data_root() / "downloads")
        )
        write_whole(folder / "sweethome3d-copyright.txt", copyright_text.encode())
        credits = {m.id: {"name": m.title, "creator": m.creator, "licence": m.licence} for m in found}
        licence = "each model's own, in credits; the package's words: sweethome3d-copyright.txt"
        items = [(model.id, model.category, split_of(model.id), model) for model in found]
        return len(items), items, {"licence": licence, "package": sweethome.PACKAGE.name, "credits": credits}

    return Source(sweethome.PACKAGE.digest, load)


def draw_all(
    name: str, draw: Callable[[list[Item]], list], total: int, items: Iterable[Item], count: int
) -> Iterator[object]:
    """What `draw` makes of each shape, in the order of the items, whoever was ready first, with `count` workers."""
    items, waiting, number = iter(items), {}, 0
    chunks = iter(lambda: list(islice(items, CHUNK)), [])
    jobs = ((k, draw, chunk) for k, chunk in enumerate(chunks))
    with tqdm(desc=name, unit=" shapes", total=total) as bar:
        for k, drawn in in_parallel(_draw_chunk, jobs, count):
            bar.update(len(drawn))
            waiting[k] = drawn
            while number in waiting:
                yield from waiting.pop(number)
                number += 1


def _draw_chunk(number: int, draw: Callable, items: list[Item], parent: int | None) -> tuple:
    """A worker's task; its number comes back with its results. A process other than `parent` ends with that one."""
    end_with(parent)
    with one_thread():  # the processes share the cores; and sums come in the same order everywhere
        return number, draw(items)
