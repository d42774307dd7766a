"""Checkers for 12_csg_stump_net: functions are tried on random inputs, numbers compared with formulas."""

import math

import torch
from torch import Tensor

from ..models.simplifying import SHARE, cover
from . import OK, UNANSWERED, hint

TENTH = math.log(
    (1 + math.sqrt(0.9)) / (1 - math.sqrt(0.9))
)  # where a sigmoid's slope is a tenth of its largest
CLOSE = 0.03  # share that numbers may be off: read off a curve
ROUNDED = 1e-2  # that logits may be off, as in half precision; wrong ones are off by 1


def check_reach(answer: object) -> str:
    """Exercise 12.1: two distances, for sharpness 150 and 10, at which the slope is a tenth of the largest."""
    if answer is None:
        return UNANSWERED
    try:
        found = [float(value) for value in answer]
    except Exception:  # whatever it is, it becomes a hint
        return hint("the answer is two distances, such as (0.1, 0.2): for sharpness 150, then for 10")
    if len(found) != 2 or not all(math.isfinite(value) and value > 0 for value in found):
        return hint("two distances, both above 0: for sharpness 150, then for 10")
    for value, sharpness in zip(found, (150, 10)):
        o = 1 / (1 + math.exp(min(sharpness * value, 700)))
        if abs(value * sharpness / TENTH - 1) > CLOSE:
            return hint(
                f"at {value:g}, sharpness {sharpness}, the slope is {4 * o * (1 - o):.3f} of the largest"
            )
    return OK


def check_low_rank(answer: object) -> str:
    """Exercise 12.3: a function of p (K, d), n (C, d) and g (d,) that returns the logits (K, C)."""
    if answer is None:
        return UNANSWERED
    generator = torch.Generator().manual_seed(0)
    for k, c, d in ((4, 2, 5), (3, 3, 3), (1, 6, 2)):
        p, n, g = (torch.randn(*size, generator=generator) for size in ((k, d), (c, d), (d,)))
        found, problem = _tried(answer, p, n, g)
        if problem:
            return problem
        if not isinstance(found, Tensor) or found.shape != (k, c):
            return hint(
                f"for K = {k}, C = {c} the result should be a tensor ({k}, {c}), found {_shape(found)}"
            )
        if not torch.allclose(found.double(), torch.einsum("kd,d,cd->kc", p, g, n).double(), atol=ROUNDED):
            return hint(
                "the shape is right, the numbers are not: logit[k, c] = sum over d of p[k, d] g[d] n[c, d]"
            )
    return OK


def check_pull(answer: object) -> str:
    """Exercise 12.2: distances of one primitive to some points; the paper's term is 0, the authors' is not."""
    if answer is None:
        return UNANSWERED
    try:
        distances = torch.as_tensor(answer, dtype=torch.float64).flatten()
        paper, authors = float(distances.square().min()), float(distances.min().square())
    except Exception:  # whatever it is, it becomes a hint
        return hint("the answer is a list of distances, such as [0.1, 0.2]")
    if not math.isfinite(paper + authors):
        return hint("distances are finite numbers")
    if paper > 1e-12:
        return hint(f"the paper's term is {paper:g}: no point is on the surface yet")
    if authors <= 1e-12:
        return hint("the authors' term is 0, too: what does a point inside do to the minimum?")
    return OK


def check_use(answer: object) -> str:
    """Exercise 12.4: a function of W_I (K, C) and W_U (C,), bool, that returns how many primitives and how many nodes
    the shape uses."""
    if answer is None:
        return UNANSWERED
    generator = torch.Generator().manual_seed(1)
    for k, c in ((4, 3), (5, 4), (3, 5)):
        w_i, w_u = torch.rand(k, c, generator=generator) < 0.4, torch.rand(c, generator=generator) < 0.5
        found, problem = _tried(answer, w_i, w_u)
        if problem:
            return problem
        try:
            got = tuple(float(value + 0) for value in found)  # a text has no sum
        except Exception:  # whatever it is, it becomes a hint
            return hint("the function returns two numbers: primitives, nodes")
        if got != (int(w_i[:, w_u].any(1).sum()), int(w_u.sum())):
            what = f"W_I = {w_i.int().tolist()}, W_U = {w_u.int().tolist()}"
            shown = ", ".join(f"{value:g}" for value in got)
            return hint(f"{what} gave {shown}; which primitives does a node that is not united use?")
    return OK


def check_cover(answer: object) -> str:
    """Exercise 12.5: a function of the nodes' points (C, points), bool, that returns which nodes (C,) to keep: few
    that hold 99 % of the points that all hold together."""
    if answer is None:
        return UNANSWERED
    generator = torch.Generator().manual_seed(2)
    for c, share in ((5, 0.4), (12, 0.25), (30, 0.15)):
        inside = torch.rand(c, 400, generator=generator) < share * torch.rand(c, 1, generator=generator)
        found, problem = _tried(answer, inside)
        if problem:
            return problem
        if not isinstance(found, Tensor) or found.dtype != torch.bool or found.shape != (c,):
            return hint(f"for {c} nodes the result should be a bool tensor ({c},), found {_shape(found)}")
        held = inside[found].any(0).sum() / inside.any(0).sum()
        if held < SHARE:
            return hint(f"the nodes that are kept hold {held:.1%} of the points; expected 99 % or more")
        if found.sum() > len(cover(inside, SHARE)):
            return hint(f"{int(found.sum())} nodes are kept, and {len(cover(inside, SHARE))} would do")
    return OK


def _tried(answer: object, *given: Tensor) -> tuple[object, str]:
    """What the function returns, and a hint where it is none or fails, else nothing."""
    if not callable(answer):
        return None, hint("the answer is a function")
    try:
        found = answer(*(each.clone() for each in given))  # it may change what it is given
        return (found.detach().cpu().to_dense() if isinstance(found, Tensor) else found), ""
    except Exception as error:  # a reader's function may fail in any way
        return None, hint(f"the function failed: {_words(error)}")


def _words(error: Exception) -> str:
    """What an error says, in one line."""
    try:
        return " ".join(str(error).split())[:160] or type(error).__name__
    except Exception:  # an error of the reader's own kind may have nothing to say
        return type(error).__name__


def _shape(found: object) -> str:
    return (
        f"{str(found.dtype)[6:]} {tuple(found.shape)}" if isinstance(found, Tensor) else type(found).__name__
    )
