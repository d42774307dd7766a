"""The three layers on values, rows first: O and F are (K, points), S (C, points), T (points); any batches before.

    F = W_C (1 - O) + (1 - W_C) O      S = min_k (W_I F + 1 - W_I)      T = max_c W_U S        (paper, "Structure")

`binary` is the language itself: shapes are in or out, connections 0 or 1. `soft` is what a network learns with: all
values from 0 to 1. Its min and max are exact; or, with a temperature, averages that lean to the smallest and the
largest value, weights softmax(-temperature value) and softmax(temperature value), held constant in the gradient, as in
the paper's program (there 20); or, with a power, averages that lean so by powers, which is much faster: see `powers`.
`signed` is the language again, of distances: its result is negative inside, and 0 where the surface is.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from .powers import power_product
from .products import max_product


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


def signed(
    distances: Float[Tensor, "k m"],
    w_c: Bool[Tensor, " k"],
    w_i: Bool[Tensor, "k c"],
    w_u: Bool[Tensor, " c"],
) -> Float[Tensor, " m"]:
    """T: the smallest of the united nodes' `signed_nodes`; of none it is inf.

    Nowhere farther from 0 than the surface is away, if the distances are.
    """
    if not w_u.any():
        return torch.full_like(distances[0], torch.inf)
    return signed_nodes(distances, w_c, w_i[:, w_u]).amin(0)


def signed_nodes(
    distances: Float[Tensor, "k m"], w_c: Bool[Tensor, " k"], w_i: Bool[Tensor, "k c"]
) -> Float[Tensor, "c m"]:
    """S: the largest of a node's distances, where a complement's has the other sign; of nothing it is -inf."""
    turned = torch.where(w_c.unsqueeze(1), -distances, distances)
    nodes = distances.new_full((w_i.shape[1], distances.shape[1]), -torch.inf)
    for c, rows in enumerate(w_i.T):
        if rows.any():
            nodes[c] = turned[rows].amax(0)
    return nodes


def soft(
    occupancy: Float[Tensor, "*n k m"],
    w_c: Float[Tensor, "*#n k"],
    w_i: Float[Tensor, "*#n k c"],
    w_u: Float[Tensor, "*#n c"],
    temperature: float | None = None,
    power: float | None = None,
) -> tuple[Float[Tensor, "*n c m"], Float[Tensor, "*n m"]]:
    """S and T of values from 0 to 1; differentiable in all four. An intersection of nothing is 1, a union of nothing 0.

    Raises ValueError for a temperature or a power out of range, and for both.
    """
    nodes = intersection(complement(occupancy, w_c), w_i, temperature, power)
    return nodes, union(nodes, w_u, temperature, power)


def complement(occupancy: Float[Tensor, "*n k m"], w_c: Float[Tensor, "*#n k"]) -> Float[Tensor, "*n k m"]:
    """F."""
    w_c = w_c.unsqueeze(-1)
    return w_c * (1 - occupancy) + (1 - w_c) * occupancy


def intersection(
    selected_from: Float[Tensor, "*n k m"],
    w_i: Float[Tensor, "*#n k c"],
    temperature: float | None = None,
    power: float | None = None,
) -> Float[Tensor, "*n c m"]:
    """S = min_k (W F + 1 - W) = 1 - max_k W (1 - F)."""
    return 1 - _largest(w_i, 1 - selected_from, temperature, power)


def union(
    nodes: Float[Tensor, "*n c m"],
    w_u: Float[Tensor, "*#n c"],
    temperature: float | None = None,
    power: float | None = None,
) -> Float[Tensor, "*n m"]:
    """T = max_c W_U S."""
    return _largest(w_u.unsqueeze(-1), nodes, temperature, power).squeeze(-2)


def _largest(w: Tensor, g: Tensor, temperature: float | None, power: float | None) -> Tensor:
    """max_k w_kc g_km, exact or one of the two averages."""
    if power is None:
        return max_product(w, g, temperature)
    if temperature is not None:
        raise ValueError(f"found a temperature of {temperature} and a power of {power}; expected one of them")
    return power_product(w, g, power)
