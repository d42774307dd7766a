"""The largest product of pairs as a mean weighted by powers: matrix products instead of K x C x points numbers.

    R_cm = sum_k P_kcm^p P_kcm / sum_k P_kcm^p        P_kcm = W_kc G_km

What softmax weights do by exp, P^p does here: large products count, small ones do not, and the weights are held
constant in the gradient. But (W G)^p = W^p G^p, so both sums are products of two matrices, and so are their gradients.
It is never above the maximum, and equal to it where all other products are 0. Where all are so small that their powers
leave the range of float32 (below 2e-4 for p = 8), it falls to 0.
"""

import torch
from jaxtyping import Float
from torch import Tensor
from torch.autograd.function import once_differentiable

LEAST = 1e-30  # a sum of powers that counts as this much at least: it is divided by
HIGHEST = 64.0


def power_product(
    w: Float[Tensor, "*#n k c"], g: Float[Tensor, "*#n k m"], power: float
) -> Float[Tensor, "*n c m"]:
    """About the maximum over k of w_kc g_km, see above; differentiable once in w and in g, which lie in [0, 1].

    The result has the wider one's dtype, at least float32. Raises ValueError for a power that is not in (0, HIGHEST],
    and for w and g of different K.
    """
    if not 0 < power <= HIGHEST:
        raise ValueError(f"found a power of {power}; expected more than 0, at most {HIGHEST:g}")
    if w.shape[-2] != g.shape[-2]:
        raise ValueError(f"found w with K = {w.shape[-2]} and g with K = {g.shape[-2]}; expected the same")
    dtype = torch.promote_types(torch.promote_types(w.dtype, g.dtype), torch.float32)
    batch = torch.broadcast_shapes(w.shape[:-2], g.shape[:-2])
    w, g = (each.to(dtype).expand(*batch, *each.shape[-2:]) for each in (w, g))
    return _PowerProduct.apply(w, g, power)


class _PowerProduct(torch.autograd.Function):
    @staticmethod
    def forward(ctx, w: Tensor, g: Tensor, power: float) -> Tensor:
        """R (*n, c, m) of w (*n, k, c) and g (*n, k, m)."""
        w_weight, g_weight = w**power, g**power
        weights = (w_weight.mT @ g_weight).clamp_(min=LEAST)
        ctx.save_for_backward(w, g, weights)
        ctx.power = power
        return ((w_weight * w).mT @ (g_weight * g)).div_(weights)

    @staticmethod
    @once_differentiable
    def backward(ctx, gradient: Tensor):
        """To each product goes its weight's share."""
        w, g, weights = ctx.saved_tensors
        w_weight, g_weight = w**ctx.power, g**ctx.power
        each = gradient / weights
        to_w = w_weight * ((g_weight * g) @ each.mT)
        to_g = g_weight * ((w_weight * w) @ each)
        return to_w, to_g, None
