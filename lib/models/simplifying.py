"""What of a decided answer matters: few nodes that hold nearly all of its points.

Most nodes that a network unites are empty, or hidden in others. The node that holds most comes first, then the one that
adds most to it, and so on: a greedy cover.
"""

import math
from dataclasses import replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from ..interpreters.stump import layers
from .soft_stump import SoftStump

SHARE = 0.99  # of the points


def cover(inside: Bool[Tensor, "c m"], share: float = SHARE) -> Int[Tensor, " kept"]:
    """Which nodes, the most important first, hold that share of the points that all hold together; none for none.

    Raises ValueError for a share that is not from 0 to 1.
    """
    if not 0 <= share <= 1:
        raise ValueError(f"found a share of {share}; expected 0 to 1")
    by_any = inside.any(0)
    wanted, held, kept = math.ceil(share * int(by_any.sum())), torch.zeros_like(by_any), []
    while held.sum() < wanted:
        kept.append(int((inside & ~held).sum(1).argmax()))
        held |= inside[kept[-1]]
    return torch.tensor(kept, dtype=torch.long, device=inside.device)


@torch.no_grad()
def simplified(said: SoftStump, points: Float[Tensor, "b m 3"], share: float = SHARE) -> SoftStump:
    """The same answers with only those nodes united that `cover` keeps, told by these points.

    Raises ValueError for points of another number of answers, none, or some that are not finite; see also `cover`.
    """
    if points.ndim != 3 or points.shape[::2] != (len(said), 3) or not points.shape[1]:
        raise ValueError(
            f"found points {tuple(points.shape)}; expected ({len(said)}, m, 3), a row for each answer"
        )
    if not points.isfinite().all():
        raise ValueError("found points that are not finite; expected numbers")
    union = torch.full_like(said.union, -torch.inf)
    for row, (distances, w_c, w_i, w_u) in enumerate(zip(said.distances(points), *said.matrices)):
        held = (layers.signed_nodes(distances, w_c, w_i) <= 0) & w_u.unsqueeze(1)
        kept = cover(held, share)
        union[row, kept] = said.union[row, kept]
    return replace(said, union=union)
