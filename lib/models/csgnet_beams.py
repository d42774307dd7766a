"""Beam search: the k likeliest programs that a CSGNet knows for each shape, or nearly so.

Of each shape k beginnings are kept. In each step all are continued by all tokens, and the k likeliest are kept.
A program that has ended stays as it is and competes with its probability. Probabilities are added as logarithms.

Beginnings that leave the same parts on the stack, whichever operand of a union or an intersection came first, have the
same continuations and draw the same pictures; only the likelier one is kept, so that the k programs are k different
ones. A part is written as a tuple, (primitive,) or (operation, operand, operand), the same for either order.

The authors' search multiplies probabilities, does not end at `$` and keeps duplicates.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from ..interpreters.checks import whole
from .csgnet import CSGNet, State
from .csgnet_decoding import log_odds
from .csgnet_grammar import LONGEST, OPERATIONS, allowed, deeper

SPARE = 3  # times as many candidates as are kept: what is merged leaves room for others
Stack = tuple[tuple, ...]  # parts, bottom first


@dataclass(frozen=True)
class Beams:
    """The programs found for each shape, the likeliest first.

    tokens           (shapes, k, length) padded with `$`
    log_probability  (shapes, k) of each program; -inf, and nothing but `$`, where there were fewer than k
    """

    tokens: Int[Tensor, "shapes k length"]
    log_probability: Float[Tensor, "shapes k"]


@dataclass(frozen=True)
class _Beginnings:
    """k of each shape: tokens (START first), log probability, number of parts, whether not ended.

    A log probability of -inf says that there is none; so it is for all but one before the first token.
    """

    tokens: Int[Tensor, "shapes k written"]
    total: Float[Tensor, "shapes k"]
    depth: Int[Tensor, "shapes k"]
    running: Bool[Tensor, "shapes k"]


@dataclass(frozen=True)
class _Candidates:
    """Beginnings with one token more, the likeliest first: which beginning, which token, log probability."""

    parent: Int[Tensor, "shapes some"]
    token: Int[Tensor, "shapes some"]
    total: Float[Tensor, "shapes some"]


@torch.no_grad()
def beam_search(
    network: CSGNet,
    canvases: Bool[Tensor, "shapes *canvas"],
    k: int = 10,
    longest: int | None = None,
    grammar: bool = True,
    merge: bool = True,
) -> Beams:
    """The k likeliest programs of each shape (paper, section 3.2).

    canvases  images (64, 64) or grids (64, 64, 64), bool
    longest   tokens of a program, `$` not counted: the paper's, if not given
    grammar   only programs that can be executed; without it nothing is merged
    merge     keep one of those that are the same but for the order of operands
    Raises ValueError for less than one program or token, and for canvases that the network does not take.
    """
    longest = LONGEST[network.config.dimensions] if longest is None else longest
    if None in (whole(k), whole(longest)) or k < 1 or longest < 1:
        raise ValueError(f"found {k} programs of {longest} tokens; expected at least one of each")
    state, search = network.begin(canvases), _start(network, canvases, k)
    stacks: list[list[Stack]] = [[()] * k for _ in range(len(canvases))]
    for room in range(longest, 0, -1):
        odds, state = _continued(network, search, state, room, grammar)
        if grammar and merge:
            candidates, stacks = _merged(_likeliest(odds, SPARE * k), stacks, k, network.stop)
        else:
            candidates = _likeliest(odds, k)
        # The state has rows for running beginnings only: this is which one each has.
        row = search.running.flatten().cumsum(0).view_as(search.running) - 1
        search = _followed(search, candidates, network.config.tokens)
        if not search.running.any():
            break
        state = state[row.gather(1, candidates.parent)[search.running]]
    else:  # no room is left: what has not ended ends here, and this is no choice
        search = replace(search, tokens=nn.functional.pad(search.tokens, (0, 1), value=network.stop))
    none = search.total.isneginf().unsqueeze(-1)
    return Beams(search.tokens[:, :, 1:].masked_fill(none, network.stop), search.total)


def _start(network: CSGNet, canvases: Bool[Tensor, "shapes *canvas"], k: int) -> _Beginnings:
    """Before the first token."""
    zero = torch.zeros((len(canvases), k), dtype=torch.long, device=canvases.device)
    first = torch.arange(k, device=canvases.device).expand_as(zero) == 0
    total = torch.where(first, 0.0, -torch.inf)
    return _Beginnings((zero + network.start).unsqueeze(-1), total, zero, first)


def _continued(
    network: CSGNet, search: _Beginnings, state: State, room: int, grammar: bool
) -> tuple[Float[Tensor, "shapes k tokens"], State]:
    """Log probability of each beginning with each token after it; the network is asked about the running ones only."""
    running, tokens = search.running.flatten().nonzero().squeeze(1), network.config.tokens
    before, depth = search.tokens[:, :, -1].flatten()[running], search.depth.flatten()[running]
    scores, state = network.advance(state, before.unsqueeze(1))
    rule = allowed(depth, torch.ones_like(depth, dtype=torch.bool), room, tokens) if grammar else None
    odds = scores.new_full((search.running.numel(), tokens), -torch.inf, dtype=torch.float)
    odds[:, network.stop] = 0  # what has ended goes on with `$`, and costs nothing
    odds[running] = log_odds(scores[:, 0], rule)
    return odds.view(*search.running.shape, tokens) + search.total.unsqueeze(-1), state


def _likeliest(odds: Float[Tensor, "shapes k tokens"], some: int) -> _Candidates:
    """So many of all continuations of each shape's beginnings; all, where there are fewer."""
    tokens = odds.shape[2]
    total, place = odds.flatten(1).topk(min(some, odds.shape[1] * tokens), 1)
    return _Candidates(place // tokens, place % tokens, total)


def _merged(
    candidates: _Candidates, stacks: list[list[Stack]], k: int, stop: int
) -> tuple[_Candidates, list[list[Stack]]]:
    """The first k candidates of each shape with different parts, and these parts; stacks: of the beginnings."""
    possible = (~candidates.total.isneginf()).sum(1).tolist()
    rows = zip(stacks, candidates.parent.tolist(), candidates.token.tolist(), possible)
    found = [_different(stack, parents[:n], tokens, k, stop) for stack, parents, tokens, n in rows]
    column = [[*each.values()] + [-1] * (k - len(each)) for each in found]
    place = torch.tensor(column, dtype=torch.long, device=candidates.total.device).view(-1, k)
    parent, token, total = (each.gather(1, place.clamp(min=0)) for each in vars(candidates).values())
    total = total.masked_fill(place < 0, -torch.inf)
    return _Candidates(parent, token, total), [[*each, *[()] * (k - len(each))] for each in found]


def _different(
    stacks: list[Stack], parents: list[int], tokens: list[int], k: int, stop: int
) -> dict[Stack, int]:
    """Of one shape's candidates the first k with different parts: their parts, and which candidates they are."""
    found: dict[Stack, int] = {}
    for place, (parent, token) in enumerate(zip(parents, tokens)):
        found.setdefault(_pushed(stacks[parent], token, stop), place)
        if len(found) == k:
            break
    return found


def _pushed(stack: Stack, token: int, stop: int) -> Stack:
    """The parts after a token: + * - $ are the last of the vocabulary. Operands of + and * are sorted."""
    if token == stop:
        return stack
    if token < stop - OPERATIONS:
        return *stack, (token,)
    *below, left, right = stack
    if token < stop - 1:
        left, right = sorted((left, right))
    return *below, (token, left, right)


def _followed(search: _Beginnings, candidates: _Candidates, tokens: int) -> _Beginnings:
    """The candidates as beginnings."""
    parent, token, stop = candidates.parent, candidates.token, tokens - 1
    before = search.tokens.gather(1, parent.unsqueeze(-1).expand(-1, -1, search.tokens.shape[-1]))
    depth = deeper(search.depth.gather(1, parent), token, tokens)
    running = search.running.gather(1, parent) & (token != stop) & ~candidates.total.isneginf()
    return _Beginnings(torch.cat([before, token.unsqueeze(-1)], -1), candidates.total, depth, running)
