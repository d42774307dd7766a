"""The three layers on values, rows first: O is (K, points), S (C, points), T (points); any number of batches before.

`binary` is the language itself: shapes are in or out and connections 0 or 1.
"""

from jaxtyping import Bool, Float
from torch import Tensor


def complement(occupancy: Float[Tensor, "*n k m"], w_c: Float[Tensor, "*#n k"]) -> Float[Tensor, "*n k m"]:
    """F = W_C (1 - O) + (1 - W_C) O, the paper's equation (2)."""
    w_c = w_c.unsqueeze(-1)
    return w_c * (1 - occupancy) + (1 - w_c) * occupancy


def binary(
    inside: Bool[Tensor, "*n k m"],
    w_c: Bool[Tensor, "*#n k"],
    w_i: Bool[Tensor, "*#n k c"],
    w_u: Bool[Tensor, "*#n c"],
) -> tuple[Bool[Tensor, "*n c m"], Bool[Tensor, "*n m"]]:
    """S and T of yes and no. A point is in node c if none of the node's F_k lacks it: they are counted by a matrix
    product, exact up to 2^24 primitives."""
    lacking = (inside == w_c.unsqueeze(-1)).float()  # 1 - F
    nodes = w_i.mT.float() @ lacking == 0
    return nodes, (nodes & w_u.unsqueeze(-1)).any(-2)
