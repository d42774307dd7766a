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

    Of equally near ones, one with about as many pixels ON as the target. Shows progress. Raises ValueError for no
    programs, and for targets of another size than the vocabulary's canvases.
    """
    width = vocabulary.canvases().shape[1]
    if not len(tokens) or targets.shape[1] != width:
        found = f"{len(tokens)} programs and targets of {targets.shape[1]} words"
        raise ValueError(f"found {found}; expected one program or more, and targets of {width}")
    known = _sorted(tokens, vocabulary)
    on = _bits(targets.numpy())
    index, pixels = torch.empty(len(targets), dtype=torch.long), torch.empty(len(targets), dtype=torch.long)
    blocks = torch.from_numpy(np.argsort(on, kind="stable")).split(BLOCK)
    for rows in tqdm(blocks, desc="nearest neighbours", leave=False, disable=None):
        index[rows], pixels[rows] = _nearest(targets[rows].numpy(), on[rows], known)
    return Nearest(known.order[index], pixels)


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
) -> tuple[Tensor, Tensor]:
    """Places among the known and differing pixels, for some targets with similar numbers of pixels."""
    index, pixels = np.zeros(len(targets), dtype=np.int64), np.full(len(targets), FAR)
    step = DRAWN_AT_ONCE[known.vocabulary.dimensions]
    low = high = int(np.searchsorted(known.on, on[len(on) // 2])) // step * step
    while True:
        # How much nearer than now the next programs below and above could be, for any target.
        gain_below = (pixels - (on - known.on[low - 1])).max() if low > 0 else 0
        gain_above = (pixels - (known.on[high] - on)).max() if high < len(known.on) else 0
        if max(gain_below, gain_above) <= 0:
            return torch.from_numpy(index), torch.from_numpy(pixels)
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
