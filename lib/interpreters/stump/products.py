"""The largest product of pairs: where nearly all the time of a stump goes.

    exact      R_cm = max_k P_kcm                    P_kcm = W_kc G_km
    smooth     R_cm = sum_k w_kcm P_kcm              w = softmax_k(temperature P), held constant in the gradient

In one piece P has K x C x points numbers, 537 MB for 256, 256 and 2,048. Here it exists for one k and a block of points
at a time, small enough for the processor's cache, once in the forward and again in the backward pass, which makes it
anew. What is kept in between is as large as the result.

With G = 1 - F, the paper's intersection layer min_k (W F + 1 - W) is 1 - R. The gradient of the exact product goes to
the largest P, to the first one where several are; that of the smooth one to each by its w, as in the paper's program.
"""

import math
from collections.abc import Iterator

import torch
from jaxtyping import Float
from torch import Tensor
from torch.autograd.function import once_differentiable

STEEPEST = 120.0  # highest temperature: far beyond it, sums of exp leave the range of float32
_CACHE = 1 << 17  # numbers of a block on a processor: half a megabyte
_CARD = 1 << 26  # and on a graphics card, which wants large ones


def max_product(
    w: Float[Tensor, "*#n k c"], g: Float[Tensor, "*#n k m"], temperature: float | None = None
) -> Float[Tensor, "*n c m"]:
    """max over k of w_kc g_km, exact or, with a temperature, smooth; differentiable once in w and in g.

    w and g lie in [0, 1]. K = 0 gives 0. The result has the wider one's dtype, at least float32.
    Raises ValueError for a temperature that is not in (0, STEEPEST], and for w and g of different K.
    """
    if temperature is not None and not 0 < temperature <= STEEPEST:
        raise ValueError(f"found a temperature of {temperature}; expected more than 0, at most {STEEPEST:g}")
    if w.shape[-2] != g.shape[-2]:
        raise ValueError(f"found w with K = {w.shape[-2]} and g with K = {g.shape[-2]}; expected the same")
    dtype = torch.promote_types(torch.promote_types(w.dtype, g.dtype), torch.float32)
    w, g = w.to(dtype), g.to(dtype)
    batch = torch.broadcast_shapes(w.shape[:-2], g.shape[:-2])
    if not w.shape[-2]:
        return g.new_zeros(*batch, w.shape[-1], g.shape[-1])
    flat = math.prod(batch)
    w, g = (each.expand(*batch, *each.shape[-2:]).reshape(flat, *each.shape[-2:]) for each in (w, g))
    return _MaxProduct.apply(w, g, temperature).view(*batch, w.shape[-1], g.shape[-1])


class _MaxProduct(torch.autograd.Function):
    @staticmethod
    def forward(ctx, w: Tensor, g: Tensor, temperature: float | None) -> Tensor:
        """R (n, c, m) of w (n, k, c) and g (n, k, m)."""
        result = g.new_zeros(len(g), w.shape[2], g.shape[2])
        scale = (
            torch.empty_like(result) if temperature else result
        )  # what the backward pass needs besides w and g
        for rows, points in _blocks(result):
            block = _exact if temperature is None else _smooth
            block(w[rows], g[rows, :, points], result[rows, :, points], scale[rows, :, points], temperature)
        ctx.save_for_backward(w, g, scale)
        ctx.temperature = temperature
        return result

    @staticmethod
    @once_differentiable
    def backward(ctx, gradient: Tensor):
        """The gradients of w and g; every P_k is made anew."""
        w, g, scale = ctx.saved_tensors
        to_w, to_g = torch.zeros_like(w), torch.empty_like(g)
        for rows, points in _blocks(gradient):
            shares = _exact_shares if ctx.temperature is None else _smooth_shares
            parts = w[rows], g[rows, :, points]
            waiting = shares(*parts, scale[rows, :, points], gradient[rows, :, points], ctx.temperature)
            for k, share in enumerate(waiting):  # share: of the gradient of R, what goes to P_k
                to_g[rows, k, points] = (parts[0][:, k].unsqueeze(1) @ share).squeeze(1)
                to_w[rows, k] += (share @ parts[1][:, k].unsqueeze(2)).squeeze(2)
        return to_w, to_g, None


def _blocks(result: Float[Tensor, "n c m"]) -> Iterator[tuple[slice, slice]]:
    """Slices of the batch and of the points that together cover the result."""
    count, width, length = result.shape
    most = _CARD if result.is_cuda else _CACHE
    points = max(1, min(length, most // max(1, width)))
    rows = max(1, most // max(1, width * length))
    for row in range(0, count, rows):
        for point in range(0, length, points):
            yield slice(row, row + rows), slice(point, point + points)


def _products(w: Tensor, g: Tensor, factor: float = 1.0) -> Iterator[Float[Tensor, "n c m"]]:
    """factor * P_k for each k; all in the same memory, so use it before the next."""
    room = g.new_empty(len(g), w.shape[2], g.shape[2])
    for k in range(w.shape[1]):
        yield torch.mul((w[:, k] * factor).unsqueeze(2), g[:, k].unsqueeze(1), out=room)


def _exact(w, g, result, _scale, _temperature) -> None:
    for product in _products(w, g):
        torch.maximum(result, product, out=result)


def _exact_shares(w, g, largest, gradient, _temperature) -> Iterator[Tensor]:
    waiting = gradient.clone()  # of points whose largest product has not come yet
    for product in _products(w, g):
        share = product.eq_(largest).mul_(waiting)  # 0 and 1 as floats: ten times as fast as bools
        waiting -= share
        yield share


def _smooth(w, g, result, scale, temperature) -> None:
    room = torch.empty_like(scale)
    scale.zero_()
    for product in _products(w, g, temperature):
        product -= temperature / 2  # cancels, and keeps exp in range
        torch.exp(product, out=room)
        scale += room
        result.addcmul_(room, product)
    result.div_(scale).add_(temperature / 2).div_(temperature)


def _smooth_shares(w, g, scale, gradient, temperature) -> Iterator[Tensor]:
    each = gradient / scale
    for product in _products(w, g, temperature):
        yield product.sub_(temperature / 2).exp_().mul_(each)
