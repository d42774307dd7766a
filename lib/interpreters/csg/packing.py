"""Canvases as packed bits: 64 pixels in one 64-bit word.

A canvas is a row of words, one a line: 64 words for a 64 x 64 picture (a line is a row y), 64 * 64 words for a grid of
64^3 voxels (a line is a column x, y). Bit k of a word is the k-th pixel of its line: x in the plane, z in space. So one
`a | b` on int64 tensors unites 64 pixels at once.
"""

import numpy as np
import torch
from jaxtyping import Bool, Int
from torch import Tensor

SIDE = 64  # pixels along each side of a canvas: what fits a word

_BELOW = torch.tensor([(1 << k) - 1 for k in range(64)] + [-1])  # [k]: the k lowest bits are ON
_BITS = (torch.arange(256).unsqueeze(1) >> torch.arange(8) & 1).byte()  # (256, 8): the bits of each byte
# (256,): the same, each row as one number, which is faster to look up
_EIGHT = _BITS.view(torch.int64).squeeze(1)


def pack_runs(first: Int[Tensor, "*lines"], last: Int[Tensor, "*lines"]) -> Int[Tensor, "*lines"]:
    """The word of each line whose pixels first..last are ON; what lies outside 0..63 is cut off."""
    below = _BELOW.to(first.device)
    return below[(last + 1).clamp(0, SIDE)] & ~below[first.clamp(0, SIDE)]


def pack(pixels: Bool[Tensor, "*lines 64"]) -> Int[Tensor, "*lines"]:
    """One word for each line of 64 pixels."""
    return (pixels.long() << torch.arange(SIDE, device=pixels.device)).sum(-1)


def unpack(words: Int[Tensor, "*lines"]) -> Bool[Tensor, "*lines 64"]:
    """The 64 pixels of each word."""
    every_byte = words.flatten().contiguous().view(torch.uint8).int()
    eights = _EIGHT.to(words.device).index_select(0, every_byte)
    return eights.view(torch.bool).view(*words.shape, SIDE)


def count(words: Int[Tensor, "*batch lines"]) -> Int[Tensor, "*batch"]:
    """How many pixels of each canvas are ON. (NumPy counts bits in hardware, PyTorch has no such operation.)"""
    # Unsigned: of a negative number, whose pixel 63 is ON, NumPy counts the bits of the absolute value.
    ones = np.bitwise_count(words.numpy(force=True).view(np.uint64)).sum(-1, dtype=np.int64)
    return torch.as_tensor(ones, device=words.device)
