"""A stump as pieces that are cut: what solids and outlines share.

The shape is the sum of its united nodes. A node starts as everything in sight, a large box, is cut down to each of its
primitives in turn, and loses the complemented ones. Primitives that go on for ever are pieces that reach out of sight.
"""

from collections.abc import Callable
from functools import reduce
from operator import add
from typing import TypeVar

import torch
from jaxtyping import Float
from torch import Tensor

from .bounds import bounds
from .errors import ProgramError
from .primitives import Primitive
from .program import Stump

SIZES = (
    1e-60,
    1e60,
)  # of windows: the fifth powers, which moments of inertia are, still lie in float64's range

Piece = TypeVar("Piece")  # manifold3d's Manifold or CrossSection


def sight(stump: Stump, window: Float[Tensor, "2 d"]) -> Float[Tensor, "2 d"]:
    """What to cut the shape with: the window, moved far outwards where the shape ends by itself.

    (Round primitives are blown up a little, and must not lose that where they touch the window.)
    """
    (low, high), (shape_low, shape_high) = window, bounds(stump)
    size = (high - low).max()
    ends = shape_low >= low - 1e-9 * size, shape_high <= high + 1e-9 * size
    return torch.stack([torch.where(ends[0], low - size, low), torch.where(ends[1], high + size, high)])


def side(window: Float[Tensor, "2 d"]) -> float:
    """The window's longest side, perhaps 0. Raises ProgramError for one that is too small or large to compute with."""
    longest = float((window[1] - window[0]).max())
    if longest and not SIZES[0] <= longest <= SIZES[1]:
        expected = f"sizes from {SIZES[0]:g} to {SIZES[1]:g}"
        raise ProgramError(f"the shape's window has sides of {longest:g}", expected=expected)
    return longest


def reach(primitive: Primitive, box: Float[Tensor, "2 d"]) -> float:
    """A length at which a piece that starts at the primitive's translation has left the box in every direction."""
    middle = primitive.translation.detach().cpu().double()
    return 1.01 * float((box - middle).abs().amax(0).norm())


def assemble(stump: Stump, piece: Callable[[Primitive], Piece], everything: Piece, nothing: Piece) -> Piece:
    """The shape, of one piece for each primitive that counts."""
    stump = stump.pruned()
    pieces = [piece(primitive) for primitive in stump.primitives]
    complement, nodes = stump.complement.tolist(), []
    for column in stump.intersection[:, stump.union].T:
        selected = column.nonzero()[:, 0].tolist()
        node = everything
        for k in sorted(selected, key=complement.__getitem__):  # differences last: less is left to cut
            node = node - pieces[k] if complement[k] else node ^ pieces[k]
        nodes.append(node)
    return reduce(add, nodes, nothing)
