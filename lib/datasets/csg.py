"""Random CSG programs: the paper's whole number where they were made, else a few, made on the spot.

programs = csg_programs(2, split="train")     a TokenSet: a sequence of Program
programs.tokens                               (n, longest) int64, padded with `$`: what networks and executors take
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Int
from torch import Tensor

from lib.interpreters.csg import Program, Vocabulary, sample_many, vocabulary_of

from .base import DataError, choose, data_root, read_arrays

SPLITS = ("train", "val", "test")
SIZES = {  # programs by dimension, tokens and split: CSGNet's Table 1
    dimensions: {length: dict(zip(SPLITS, (1000 * n for n in row))) for length, row in table.items()}
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
EMBEDDED = {"train": 200, "val": 20, "test": 40}  # programs of each length: a second's work in the plane


class TokenSet(Sequence):
    """CSG programs in a fixed order, kept as tokens: `set[i]` is a Program, a slice is a TokenSet.

    tokens      (n, longest) int64, indices into the vocabulary, padded with `$`
    vocabulary  what they mean
    source      "made", by data_scripts.make_csg_programs, or "embedded"
    """

    def __init__(self, tokens: Int[Tensor, "n longest"], vocabulary: Vocabulary, source: str, name: str):
        self.tokens, self.vocabulary, self.source, self.name = tokens, vocabulary, source, name

    def __len__(self) -> int:
        return len(self.tokens)

    def __getitem__(self, index) -> "Program | TokenSet":
        if isinstance(index, slice):
            return TokenSet(self.tokens[index], self.vocabulary, self.source, self.name)
        return self.vocabulary.program(self.tokens[index])

    def __repr__(self) -> str:
        return f"<TokenSet: {self.describe()}>"

    def describe(self) -> str:
        """One sentence: how many programs, of what, and where they come from."""
        if self.source == "made":
            return f"{len(self)} random {self.name} programs, made by data_scripts.make_csg_programs."
        return (
            f"{len(self)} random {self.name} programs, made on the spot (for as many as the paper has: "
            f"python -m data_scripts.make_csg_programs --dimensions {self.vocabulary.dimensions})."
        )


def csg_programs(dimensions: int = 2, split: str | None = None, length: int | None = None) -> TokenSet:
    """Random CSG programs by CSGNet's rules, shorter ones first: those that were made, else a few embedded ones.

    dimensions  2 for the plane, 3 for space.
    split       "train", "val", "test", or None for all; no program is in two of them.
    length      only programs of so many tokens: 3, 5, … 13 in the plane, 3, 5, 7 in space.
    Raises DataError for other ones, and for a file that is damaged.
    """
    if not isinstance(dimensions, int) or dimensions not in SIZES:
        hint = f"; did you mean split={dimensions!r}?" if dimensions in SPLITS else ""
        raise DataError(f"unknown number of dimensions {dimensions!r}: choose 2 or 3{hint}")
    lengths = tuple(SIZES[dimensions]) if length is None else (length,)
    if not all(isinstance(n, int) and n in SIZES[dimensions] for n in lengths):
        raise DataError(f"unknown length {length!r}: choose one of {', '.join(map(str, SIZES[dimensions]))}")
    splits = choose("split", split, SPLITS)
    path = data_root() / "csg" / f"programs_{dimensions}d.npz"
    made = path.exists()
    parts = [
        _read(path, f"{part}_{n}", n) if made else _embedded(dimensions, n)[part]
        for n in lengths
        for part in splits
    ]
    words = [f"{dimensions}D", f"{length}-token" if length else "", split or ""]
    vocabulary = vocabulary_of(dimensions)
    return TokenSet(
        _padded(parts, vocabulary), vocabulary, "made" if made else "embedded", " ".join(filter(None, words))
    )


def _padded(parts: list[Tensor], vocabulary: Vocabulary) -> Int[Tensor, "n longest"]:
    """All rows in one tensor; every program is followed by `$` once at least, as networks read and write them."""
    longest = max(part.shape[1] for part in parts) + 1
    tokens = torch.full((sum(map(len, parts)), longest), vocabulary.stop)
    start = 0
    for part in parts:
        tokens[start : start + len(part), : part.shape[1]] = part
        start += len(part)
    return tokens


@cache
def _embedded(dimensions: int, length: int) -> dict[str, Int[Tensor, "n length"]]:
    rng = np.random.default_rng([0, dimensions, length])
    tokens = sample_many(rng, sum(EMBEDDED.values()), length, dimensions)
    return dict(zip(EMBEDDED, tokens.split(list(EMBEDDED.values()))))


def _read(path: Path, name: str, length: int) -> Int[Tensor, "n length"]:
    again = f"make it again: python -m data_scripts.make_csg_programs --dimensions {path.stem[-2]}"
    try:
        tokens = read_arrays(path, [name])[name]
    except KeyError as error:
        raise DataError(f"{path}: there is no {name} in it; {again}") from error
    except DataError as error:
        raise DataError(f"{error}; {again}") from error
    if tokens.dtype != np.uint16 or tokens.ndim != 2 or tokens.shape[1] != length:
        found = f"{tokens.dtype} {tokens.shape}"
        raise DataError(f"{path}: found {name} {found}, expected uint16 (programs, {length}); {again}")
    tokens = torch.from_numpy(tokens.astype(np.int64))
    primitives = len(vocabulary_of(int(path.stem[-2])).primitives)
    depth = torch.where(tokens < primitives, 1, -1).cumsum(1)
    if tokens.numel() and (tokens.max() > primitives + 2 or depth.min() < 1 or depth[:, -1].max() > 1):
        raise DataError(f"{path}: {name} has rows that are no programs; {again}")
    return tokens
