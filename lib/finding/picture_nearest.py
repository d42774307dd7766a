"""Nearest neighbours: of many known programs, the one whose picture differs from a target in the fewest pixels.

CSGNet's paper compares with this baseline (Tables 2 to 4) and does not say how it measures nearness. Here it is the
number of pixels, or voxels, that differ: bits of one exclusive or over packed canvases.

The search is exact and does not look at everything: two canvases with a and b pixels ON differ in at least |a - b|.
Known programs are sorted by that number and looked at from the target's own number outwards, until no other can be
nearer. Canvases are drawn again when they are needed, so a million of them need no memory.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Int
from torch import Tensor
from tqdm import tqdm

from lib.interpreters.csg import Vocabulary, execute_many
from lib.interpreters.csg.packing import SIDE

BLOCK = 64  # targets with about as many pixels ON, searched together
WORDS_AT_ONCE = 1 << 18  # words compared in one go: what a core's cache holds
FAR = 1 << 40  # pixels: farther than any canvas
DRAWN_AT_ONCE = {2: 4096, 3: 128}  # programs, by dimension


@dataclass(frozen=True)
class Nearest:
    """For each target the number of the nearest program, and in how many pixels it differs."""

    index: Int[Tensor, " n"]
    pixels: Int[Tensor, " n"]


@dataclass(frozen=True)
class _Known:
    """Programs, sorted by the pixels that are ON in their canvases."""

    tokens: Int[Tensor, "m length"]
    vocabulary: Vocabulary
    on: Int[np.ndarray, " m"]
    order: Int[Tensor, " m"]  # which of the given programs each is


def nearest(
    targets: Int[Tensor, "n words"], tokens: Int[Tensor, "m length"], vocabulary: Vocabulary
) -> Nearest:
    """The nearest of m programs for each of n targets, which are packed as `Shapes.words` are.

    Of equally near ones, one with about as many pixels ON as the target. Works on the CPU and shows progress. Programs
    that are not valid are blank. Raises ValueError for no programs, and for targets that are no packed canvases of the
    vocabulary's dimension; ProgramError, which is one, for what are no tokens.
    """
    _check(targets, tokens, vocabulary)
    known = _sorted(tokens.cpu(), vocabulary)
    packed = targets.contiguous().numpy(force=True)
    on = _bits(packed)
    by_size = np.argsort(on, kind="stable")
    index, pixels = np.zeros(len(packed), dtype=np.int64), np.zeros(len(packed), dtype=np.int64)
    starts = range(0, len(packed), BLOCK)
    for start in tqdm(starts, desc="nearest neighbours", leave=False, disable=None):
        rows = by_size[start : start + BLOCK]
        index[rows], pixels[rows] = _nearest(packed[rows], on[rows], known)
    return Nearest(known.order[torch.from_numpy(index)], torch.from_numpy(pixels))


def _check(targets: Tensor, tokens: Tensor, vocabulary: Vocabulary) -> None:
    words = SIDE ** (vocabulary.dimensions - 1)
    if targets.ndim != 2 or targets.shape[1] != words or targets.dtype != torch.int64:
        found = f"targets {tuple(targets.shape)} of {targets.dtype}"
        raise ValueError(f"found {found}; expected packed canvases (n, {words}) of torch.int64: shapes.words")
    if not len(tokens):
        raise ValueError("found no programs; expected 1 or more")


def _bits(words: Int[np.ndarray, "*n words"]) -> Int[np.ndarray, "*n"]:
    return np.bitwise_count(words.view(np.uint64)).sum(-1, dtype=np.int64)


def _sorted(tokens: Tensor, vocabulary: Vocabulary) -> _Known:
    """The programs in order of their pixels: everything is drawn once."""
    parts = tokens.split(DRAWN_AT_ONCE[vocabulary.dimensions])
    bar = tqdm(parts, desc="known pictures", leave=False, disable=None)
    on = np.concatenate([_bits(execute_many(part, vocabulary).words.numpy()) for part in bar])
    order = torch.from_numpy(np.argsort(on, kind="stable"))
    return _Known(tokens[order], vocabulary, on[order.numpy()], order)


def _nearest(
    targets: Int[np.ndarray, "n words"], on: Int[np.ndarray, " n"], known: _Known
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """Places among the known and differing pixels, for some targets with similar numbers of pixels."""
    index, pixels = np.zeros(len(targets), dtype=np.int64), np.full(len(targets), FAR)
    step = DRAWN_AT_ONCE[known.vocabulary.dimensions]
    low = high = int(np.searchsorted(known.on, on[len(on) // 2])) // step * step
    while True:
        # How much nearer than now the next programs below and above could be, for any target.
        gain_below = (pixels - (on - known.on[low - 1]).clip(0)).max() if low > 0 else 0
        gain_above = (pixels - (known.on[high] - on).clip(0)).max() if high < len(known.on) else 0
        if max(gain_below, gain_above) <= 0:
            return index, pixels
        start = low - step if gain_below > gain_above else high
        low, high = min(low, start), max(high, start + step)
        words = execute_many(known.tokens[start : start + step], known.vocabulary).words.numpy()
        first, least = _compared(targets, words)
        nearer = least < pixels
        index[nearer], pixels[nearer] = first[nearer] + start, least[nearer]


def _compared(
    targets: Int[np.ndarray, "n words"], words: Int[np.ndarray, "m words"]
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """For each target the place of the nearest canvas, and its distance."""
    step = max(1, WORDS_AT_ONCE // targets.size)
    parts = [words[k : k + step] for k in range(0, len(words), step)]
    distance = np.concatenate([_bits(targets[:, None] ^ part) for part in parts], axis=1)
    place = distance.argmin(1)
    return place, distance[np.arange(len(targets)), place]
