"""Images without programs: 64x64 masks of furniture that nobody labelled, for training an image parser on.

    masks = silhouettes("sweethome3d", split="train")     an ImageSet, as data_scripts.make_silhouettes wrote it
    masks = silhouettes("embedded")                       the furniture maker's first 50 of each category

A shape's two masks, front and side, are in one split, which a hash of its name decides: 10 in 16 of the shapes are for
training, 3 for validation, 3 for testing (5K, 1.5K and 1.5K of 8K in CSGNet, section 4.1). No mask is in two splits.
"""

import hashlib
from collections.abc import Sequence
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, UInt8
from torch import Tensor

from lib.furniture import make
from lib.interpreters import rasterising
from lib.interpreters.rasterising import FILL, SIZE, VIEWS, box_triangles

from .base import CATEGORIES, DataError, choose, data_root, made_sources, read_arrays

SPLITS = ("train", "val", "test")
SOURCES = ("shapeassembly", "furniture", "sweethome3d")  # what data_scripts.make_silhouettes knows
EMBEDDED = 50  # shapes a category, of which there are masks with no download: a second's work
SHARES = (10, 3, 3)  # sixteenths of the shapes
BLANK = 2 * FILL  # no more pixels are a line: something without thickness is up to two pixels wide
FULL = FILL**2 * 98 // 100  # more are a square that leaves nothing to parse
COLUMNS = ("ids", "views", "splits", "categories")  # texts, one a mask; `masks` has the bits, 8 a byte
BYTES = SIZE * SIZE // 8


class ImageError(ValueError):
    """A file that holds no masks as the data scripts write them."""


class ImageSet(Sequence):
    """Masks in a fixed order: `set[i]` is a (64, 64) bool tensor, a slice is an ImageSet.

    images      (n, 64, 64) bool, image[row, column], rows go down
    ids         the shape that each shows, such as "chair/43875"; its two views have the same
    views       "front" or "side" of each ("logo" of a logo)
    splits      "train", "val" or "test" of each
    categories  "chair", "table", "lamp", … of each
    source      where they come from: "shapeassembly", "furniture", "sweethome3d", "logos", several joined by " + ",
                or "embedded"
    """

    def __init__(self, packed: UInt8[np.ndarray, "n b"], columns: dict[str, Sequence[str]], source: str):
        """packed: the bits of each mask, row by row, as np.packbits has them; columns: COLUMNS -> n texts."""
        self.packed, self.source = packed, source
        self.ids, self.views, self.splits, self.categories = (tuple(columns[name]) for name in COLUMNS)

    @cached_property
    def images(self) -> Bool[Tensor, "n 64 64"]:
        bits = np.unpackbits(self.packed, axis=1).reshape(len(self), SIZE, SIZE)
        return torch.from_numpy(bits.astype(bool))

    def __len__(self) -> int:
        return len(self.packed)

    def __getitem__(self, index):
        return self.rows(range(len(self))[index]) if isinstance(index, slice) else self.images[index]

    def rows(self, numbers: Sequence[int]) -> "ImageSet":
        """The masks of these numbers, in this order."""
        columns = {name: [getattr(self, name)[k] for k in numbers] for name in COLUMNS}
        return ImageSet(self.packed[list(numbers)], columns, self.source)

    def select(self, split: str | None = None, view: str | None = None, category: str | None = None):
        """The masks of one split, view or category, or of several of these at once: an ImageSet, perhaps empty."""
        wanted = (split, view, category)
        rows = enumerate(zip(self.splits, self.views, self.categories))
        return self.rows([k for k, row in rows if all(w in (None, is_) for w, is_ in zip(wanted, row))])

    def __repr__(self) -> str:
        return f"<ImageSet: {self.describe()}>"

    def describe(self) -> str:
        """One sentence: how many masks, of how many shapes, in which splits, and where they come from."""
        splits = ", ".join(f"{self.splits.count(name)} {name}" for name in SPLITS if name in self.splits)
        made_here = " (made on the spot by the furniture maker)" if self.source == "embedded" else ""
        return (
            f"{len(self)} masks of {len(set(self.ids))} shapes ({splits or 'none'}), "
            f"source: {self.source}{made_here}."
        )


def silhouettes(source: str | None = None, split: str | None = None) -> ImageSet:
    """64x64 masks of furniture from the front and the side, without programs; `.source` says whose furniture it is.

    source  "shapeassembly", "furniture" or "sweethome3d", as made by data_scripts.make_silhouettes; "embedded" for
            a few that are made on the spot; None for all that were made, and where there are none, the embedded ones.
    split   "train", "val", "test", or None for all: no shape and no mask is in two of them.
    Raises DataError for another source or split, one that was not made, and files that are damaged.
    """
    choose("split", split, SPLITS)
    folder = data_root() / "silhouettes"
    images = joined([_images(folder, name) for name in made_sources(source, SOURCES, folder)])
    return images if split is None else images.select(split)


def logos(split: str | None = None) -> ImageSet:
    """64x64 masks of logos, for testing alone as in CSGNet's paper, so that all of them are in the split "test".

    Raises DataError for another split, and where they were not made with data_scripts.make_logos.
    """
    choose("split", split, SPLITS)
    images = _images(data_root() / "silhouettes", "logos")
    return images if split is None else images.select(split)


def _images(folder: Path, source: str) -> ImageSet:
    """One source's masks. Raises DataError, with the command that makes them."""
    if source == "embedded":
        kept = made(EMBEDDED)
        return kept.rows(range(len(kept)))  # a copy: what is changed in it stays there
    script = "make_logos" if source == "logos" else f"make_silhouettes --source {source}"
    path = folder / f"{source}.npz"
    if not path.exists():
        raise DataError(f"there is no {path}; make it: python -m data_scripts.{script}")
    try:
        return read(path, source)
    except ImageError as error:
        raise DataError(f"{error}; make it again: python -m data_scripts.{script}") from error


def read(path: Path, source: str) -> ImageSet:
    """The masks in a .npz file. Raises ImageError for a file that is missing, damaged or of another kind."""
    try:
        arrays = read_arrays(path, ("masks", *COLUMNS))
    except KeyError as error:
        raise ImageError(
            f"{path}: it has no masks as the data scripts write them ({error.args[0]})"
        ) from error
    except DataError as error:
        raise ImageError(str(error)) from error
    masks = arrays.pop("masks")
    if masks.dtype != np.uint8 or masks.shape[1:] != (BYTES,):
        raise ImageError(f"{path}: found masks {masks.dtype} {masks.shape}, expected uint8 (n, {BYTES})")
    for name, column in arrays.items():
        if column.dtype.kind != "U" or column.shape != masks.shape[:1]:
            found = f"{column.dtype} {column.shape}"
            raise ImageError(f"{path}: found {name} {found}, expected {len(masks)} texts, one a mask")
    if unknown := set(arrays["splits"].tolist()) - set(SPLITS):
        raise ImageError(f"{path}: found the split {min(unknown)!r}, expected {', '.join(SPLITS)}")
    return ImageSet(masks, {name: column.tolist() for name, column in arrays.items()}, source)


def joined(sets: Sequence[ImageSet]) -> ImageSet:
    """Several sets as one, without the masks that would then be in two splits."""
    if len(sets) == 1:
        return sets[0]
    columns = {name: [text for each in sets for text in getattr(each, name)] for name in COLUMNS}
    whole = ImageSet(np.concatenate([s.packed for s in sets]), columns, " + ".join(s.source for s in sets))
    return whole.rows(np.flatnonzero(in_one_split(whole.packed, whole.splits)).tolist())


@cache
def made(count: int) -> ImageSet:
    """The furniture maker's first `count` pieces of each category, as the data script would write them."""
    masks, rows = [], []
    for category in CATEGORIES:
        for seed in range(count):
            for view, mask in zip(VIEWS, views_of(category, seed)):
                if not fault(mask):
                    name = f"{category}-{seed:06d}"
                    masks.append(np.packbits(mask))
                    rows.append((name, view, split_of(name), category))
    columns = dict(zip(COLUMNS, zip(*rows)))
    keep = in_one_split(packed := np.stack(masks), columns["splits"])
    return ImageSet(packed, columns, "embedded").rows(np.flatnonzero(keep).tolist())


def views_of(category: str, seed: int) -> Bool[np.ndarray, "2 64 64"]:
    """The masks of one piece of furniture, front and side."""
    return rasterising.silhouettes(box_triangles(make(category, seed).leaves))


def fault(mask: Bool[np.ndarray, "64 64"]) -> str:
    """Why a mask is of no use to a parser, "blank" or "full"; else nothing."""
    on = int(mask.sum())
    return "blank" if on <= BLANK else "full" if on > FULL else ""


def split_of(name: str, shares: Sequence[int] = SHARES) -> str:
    """The split of a shape, by its name alone, so that new shapes never move old ones. `shares` are those of SPLITS."""
    number = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big") * sum(shares) >> 64
    bounds = np.cumsum(shares)
    return SPLITS[int(np.searchsorted(bounds, number, side="right"))]


def in_one_split(packed: UInt8[np.ndarray, "n b"], splits: Sequence[str]) -> Bool[np.ndarray, " n"]:
    """Which masks may stay so that none is in two splits: a mask stays in the last of train, val and test that has it,
    so that what a parser is tested on is whole, and new to it."""
    rank = np.array([SPLITS.index(name) for name in splits])
    last: dict[bytes, int] = {}
    for mask, number in zip(map(bytes, packed), rank.tolist()):
        last[mask] = max(number, last.get(mask, 0))
    return rank == np.array([last[bytes(mask)] for mask in packed], dtype=int)
