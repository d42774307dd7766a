"""Solids as point clouds, without any program: what CSG-Stump Net learns from, and what it is measured on.

    clouds = solid_clouds("shapeassembly", split="train")     a SolidSet, as data_scripts.make_solids wrote it
    clouds = solid_clouds("embedded")                         the furniture maker's first pieces, and everyday solids

How they are sampled is told in `solid_sampling`, how split in `images`. Coordinates are kept as float16: of a shape of
diagonal 1 they are right to 0.0001, a hundredth of the distance between 2,048 points on its surface.
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from lib.furniture import make
from lib.interpreters.cuboids import Cuboids
from lib.interpreters.stump import Stump, execute

from .base import CATEGORIES, DataError, choose, data_root, made_sources, read_arrays
from .images import SPLITS, split_of
from .solid_sampling import Contains, SolidSample, by_winding, sample_solid
from .solids import SOLIDS, solid

SOURCES = ("shapeassembly", "furniture", "sweethome3d", "csg")  # what data_scripts.make_solids knows
ARRAYS = ("points", "normals", "queries")
TEXTS = ("ids", "splits", "categories")
EMBEDDED = 40  # pieces of each category with no download
LARGEST = 1.0  # coordinate of a cloud of diagonal 1 around the origin, with room to spare
SIZES = {"points": 1024, "queries": 2048}  # of each embedded solid: two seconds' work for all


class SolidSet(Sequence):
    """Clouds in a fixed order: `set[i]` is a SolidSample, a slice is a SolidSet.

    points, normals  (n, p, 3) float16 tensors; queries (n, q, 3): the first half of each row inside, the rest outside
    ids, splits, categories  a text for each; source: where they come from, several joined by " + "
    """

    def __init__(self, arrays: dict[str, np.ndarray], texts: dict[str, Sequence[str]], source: str):
        self.points, self.normals, self.queries = (torch.from_numpy(arrays[name]) for name in ARRAYS)
        self.ids, self.splits, self.categories = (tuple(texts[name]) for name in TEXTS)
        self.source = source

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, index):
        if isinstance(index, slice):
            return self.rows(range(len(self))[index])
        return SolidSample(*(getattr(self, name)[index].double().numpy() for name in ARRAYS))

    def rows(self, numbers: Sequence[int]) -> "SolidSet":
        """The clouds of these numbers, in this order."""
        numbers = list(numbers)
        arrays = {name: getattr(self, name)[numbers].numpy() for name in ARRAYS}
        return SolidSet(
            arrays, {name: [getattr(self, name)[k] for k in numbers] for name in TEXTS}, self.source
        )

    def select(self, split: str | None = None, category: str | None = None) -> "SolidSet":
        """The clouds of one split, or category, or both; perhaps none."""
        rows = enumerate(zip(self.splits, self.categories))
        return self.rows([k for k, (s, c) in rows if split in (None, s) and category in (None, c)])

    @property
    def inside(self) -> Float[Tensor, " q"]:
        """The occupancy of the queries of any row: 1 of the first half, 0 of the rest."""
        count = self.queries.shape[1]
        return (torch.arange(count) < count // 2).float()

    def __repr__(self) -> str:
        return f"<SolidSet: {self.describe()}>"

    def describe(self) -> str:
        """One sentence: how many solids, in which splits, and where they come from."""
        splits = ", ".join(f"{self.splits.count(name)} {name}" for name in SPLITS if name in self.splits)
        made_here = " (made on the spot)" if self.source == "embedded" else ""
        return f"{len(self)} solids as point clouds ({splits or 'none'}), source: {self.source}{made_here}."


def solid_clouds(source: str | None = None, split: str | None = None) -> SolidSet:
    """Point clouds of solids; `.source` says whose they are.

    source  one of SOURCES, as made by data_scripts.make_solids; "embedded" for some that are made on the spot; None for
            all that were made, and where there are none, the embedded ones
    split   "train", "val", "test", or None for all
    Raises DataError for another source or split, one that was not made, and files that are damaged.
    """
    choose("split", split, SPLITS)
    folder = data_root() / "solids"
    clouds = joined([_clouds(folder, name) for name in made_sources(source, SOURCES, folder)])
    return clouds if split is None else clouds.select(split)


def _clouds(folder: Path, source: str) -> SolidSet:
    if source == "embedded":
        return embedded()[:]  # a copy: what is changed in it stays there
    path, again = folder / f"{source}.npz", f"python -m data_scripts.make_solids --source {source}"
    if not path.exists():
        raise DataError(f"there is no {path}; make it: {again}")
    try:
        return read(path, source)
    except DataError as error:
        raise DataError(f"{error}; make it again: {again}") from error


def read(path: Path, source: str) -> SolidSet:
    """The clouds in a .npz file. Raises DataError for a file that is missing, damaged or of another kind."""
    try:
        arrays = read_arrays(path, (*ARRAYS, *TEXTS))
    except KeyError as error:
        raise DataError(
            f"{path}: it has no clouds as the data script writes them ({error.args[0]})"
        ) from error
    texts = {name: arrays.pop(name) for name in TEXTS}
    count = texts["ids"].size
    for name, column in texts.items():
        if column.dtype.kind != "U" or column.shape != (count,):
            raise DataError(f"{path}: found {name} {column.dtype} {column.shape}; expected {count} texts")
    for name, array in arrays.items():
        if array.dtype != np.float16 or array.ndim != 3 or array.shape[::2] != (count, 3):
            raise DataError(
                f"{path}: found {name} {array.dtype} {array.shape}; expected float16 ({count}, n, 3)"
            )
        if not np.isfinite(array).all():
            raise DataError(f"{path}: found {name} that are not finite; expected numbers")
    if (size := np.abs(arrays["points"]).max(initial=0)) > LARGEST or size == 0 < count:
        raise DataError(
            f"{path}: found points up to {size:g} from the origin; expected shapes of diagonal 1 around it"
        )
    points, normals, queries = (arrays[name].shape[1] for name in ARRAYS)
    if not points or normals != points or queries < 2 or queries % 2:
        raise DataError(
            f"{path}: found {points} points, {normals} normals and {queries} queries of each; expected as many normals "
            "as points, 1 or more, and an even number of queries, 2 or more"
        )
    if unknown := set(texts["splits"].tolist()) - set(SPLITS):
        raise DataError(f"{path}: found the split {min(unknown)!r}; expected {', '.join(SPLITS)}")
    return SolidSet(arrays, {name: column.tolist() for name, column in texts.items()}, source)


def joined(sets: Sequence[SolidSet]) -> SolidSet:
    """Several sets as one; each cloud with as many points as the smallest has."""
    if len(sets) == 1:
        return sets[0]
    source = " + ".join(each.source for each in sets)
    arrays = {name: _side_by_side([getattr(each, name) for each in sets], name) for name in ARRAYS}
    return SolidSet(arrays, {name: [t for s in sets for t in getattr(s, name)] for name in TEXTS}, source)


def _side_by_side(tensors: list[Tensor], name: str) -> np.ndarray:
    """Rows of all; queries keep their halves."""
    count = min(tensor.shape[1] for tensor in tensors)
    if name != "queries":
        return torch.cat([tensor[:, :count] for tensor in tensors]).numpy()
    halves = [[half[:, : count // 2] for half in tensor.chunk(2, 1)] for tensor in tensors]
    return torch.cat([torch.cat(pair, 1) for pair in halves]).numpy()


def gathered(samples: Sequence[tuple[str, str, str, SolidSample]], source: str) -> SolidSet:
    """A set of samples, each with its id, split and category."""
    texts = {name: [row[k] for row in samples] for k, name in enumerate(TEXTS)}
    arrays = {
        name: np.stack([getattr(row[3], name) for row in samples]).astype(np.float16) for name in ARRAYS
    }
    return SolidSet(arrays, texts, source)


@cache
def embedded() -> SolidSet:
    """The furniture maker's boxes, for all splits, and the everyday solids, to test on."""
    rows = []
    for category in CATEGORIES:
        for seed in range(EMBEDDED):
            name = f"{category}-{seed:06d}"
            graph = make(category, seed)
            sample = sample_solid(graph.mesh(), in_boxes(graph.leaves), **SIZES)
            rows.append((name, split_of(name), category, sample))
    for name in SOLIDS:
        mesh = execute(Stump.from_tree(solid(name))).mesh()
        rows.append((name, "test", "everyday", sample_solid(mesh, by_winding(mesh), **SIZES)))
    return gathered(rows, "embedded")


def in_boxes(boxes: Cuboids) -> Contains:
    """Which points are in one of the boxes, or on it: exact, and faster than `by_winding`."""
    return lambda places: boxes.contains(torch.from_numpy(places)).numpy()
