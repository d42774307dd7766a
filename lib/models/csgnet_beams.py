"""Beam search: the k likeliest programs that a CSGNet knows for each shape, or nearly so.

Of each shape k beginnings are kept. In each step all are continued by all tokens, and the k likeliest are kept.
A program that has ended stays as it is and competes with its probability. Probabilities are added as logarithms.

Beginnings that leave the same parts on the stack, whichever operand of a union or an intersection came first, have the
same continuations and draw the same pictures; only the likelier one is kept, so that the k programs are k different
ones. To tell them, every part has a number (a hash) made of its operation and its operands' numbers.

The authors' search multiplies probabilities, does not end at `$` and keeps duplicates.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from .csgnet import CSGNet, State
from .csgnet_decoding import log_odds
from .csgnet_grammar import LONGEST, OPERATION, PRIMITIVE, allowed, deeper, kinds

SPARE = 3  # times as many candidates as are kept: what is merged leaves room for others
_FACTORS = (-7046029254386353131, 1442695040888963407, 3935559000370003845)  # large odd numbers, for hashing


@dataclass(frozen=True)
class Beams:
    """The programs found for each shape, the likeliest first.

    tokens           (shapes, k, length) padded with `$`
    log_probability  (shapes, k) of each program; -inf where there were fewer than k
    """

    tokens: Int[Tensor, "shapes k length"]
    log_probability: Float[Tensor, "shapes k"]


@dataclass(frozen=True)
class _Search:
    """k beginnings of each shape: tokens, log probability, number of parts, whether not ended, the parts' hashes."""

    tokens: Int[Tensor, "shapes k written"]
    total: Float[Tensor, "shapes k"]
    depth: Int[Tensor, "shapes k"]
    running: Bool[Tensor, "shapes k"]
    parts: Int[Tensor, "shapes k room"]


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
    if k < 1 or longest < 1:
        raise ValueError(f"found {k} programs of {longest} tokens; expected at least one of each")
    shapes, device = len(canvases), canvases.device
    search = _Search(
        torch.full((shapes, 1, 1), network.start, device=device),
        torch.zeros((shapes, 1), device=device),
        torch.zeros((shapes, 1), dtype=torch.long, device=device),
        torch.ones((shapes, 1), dtype=torch.bool, device=device),
        torch.zeros((shapes, 1, longest + 2), dtype=torch.long, device=device),
    )
    state = network.begin(canvases)
    for room in range(longest, -1, -1):
        odds, state = _continued(network, search, state, room, grammar)
        row = (
            search.running.flatten().cumsum(0) - 1
        )  # of the state, which has rows for running beginnings only
        search, parent = _kept(search, odds, k, grammar and merge)
        state = state[row[parent[search.running]]]
        if not search.running.any():
            break
    return Beams(search.tokens[:, :, 1:], search.total)


def _continued(
    network: CSGNet, search: _Search, state: State, room: int, grammar: bool
) -> tuple[Float[Tensor, "shapes k tokens"], State]:
    """Log probability of each beginning with each token after it; the network is asked about the running ones only."""
    running, tokens = search.running, network.config.tokens
    odds = torch.full((*running.shape, tokens), -torch.inf, device=running.device)
    odds[..., network.stop] = 0  # what has ended goes on with `$`, and costs nothing
    scores, state = network.advance(state, search.tokens[:, :, -1][running].unsqueeze(1))
    depth = search.depth[running]
    rule = allowed(depth, torch.ones_like(depth, dtype=torch.bool), room, tokens) if grammar else None
    going_on = log_odds(scores[:, 0], rule)
    if room == 0:  # the end of every program, also of those that are none
        going_on[:, : network.stop] = -torch.inf
    odds[running] = going_on
    return odds + search.total.unsqueeze(-1), state


def _kept(
    search: _Search, odds: Float[Tensor, "shapes k tokens"], k: int, merge: bool
) -> tuple[_Search, Int[Tensor, "shapes kept"]]:
    """The k likeliest continuations of each shape, and which of all beginnings each continues."""
    tokens = odds.shape[-1]
    stop = tokens - 1
    total, place = odds.flatten(1).topk(min((SPARE if merge else 1) * k, odds[0].numel()), 1)
    parent, token = place // tokens, place % tokens
    if merge:
        parts = _pushed(_rows(search.parts, parent), search.depth.gather(1, parent), token, tokens)
        total = total.masked_fill(_repeated(parts, token == stop), -torch.inf)
        total, order = total.topk(min(k, total.shape[1]), 1)
        parent, token, parts = parent.gather(1, order), token.gather(1, order), _rows(parts, order)
    else:
        parts = _rows(search.parts, parent)
    written = torch.cat([_rows(search.tokens, parent), token.unsqueeze(-1)], -1)
    depth = deeper(search.depth.gather(1, parent), token, tokens)
    running = search.running.gather(1, parent) & (token != stop) & (total > -torch.inf)
    first = torch.arange(len(parent), device=parent.device).unsqueeze(1) * search.running.shape[1]
    return _Search(written, total, depth, running, parts), parent + first


def _rows(
    values: Int[Tensor, "shapes k width"], which: Int[Tensor, "shapes some"]
) -> Int[Tensor, "shapes some width"]:
    """Some of each shape's rows."""
    return values.gather(1, which.unsqueeze(-1).expand(-1, -1, values.shape[-1]))


def _pushed(
    parts: Int[Tensor, "shapes some room"],
    depth: Int[Tensor, "shapes some"],
    token: Int[Tensor, "shapes some"],
    tokens: int,
) -> Int[Tensor, "shapes some room"]:
    """The hashes of the parts on each stack after a token; 0 where there is none."""
    kind = kinds(tokens, token.device)[token]
    places = torch.stack([depth - 2, depth - 1, depth], -1).clamp(min=0)
    left, right, _ = parts.gather(2, places).unbind(-1)
    subtracts = (
        token == tokens - 2
    )  # the only operation whose operands are in an order: + * - $ end the vocabulary
    a = torch.where(subtracts, left, torch.minimum(left, right))
    b = torch.where(subtracts, right, torch.maximum(left, right))
    operates, draws = kind == OPERATION, kind == PRIMITIVE
    made = _mixed(torch.where(operates, _mixed(a) + _FACTORS[1] * b, 0) + _FACTORS[0] * (token + 1))
    left, right = torch.where(operates, made, left), torch.where(operates, 0, right)
    parts = parts.scatter(2, places[..., 1:2], right.unsqueeze(-1)).scatter(
        2, places[..., :1], left.unsqueeze(-1)
    )
    new = torch.where(draws, made, parts.gather(2, places[..., 2:]).squeeze(-1))
    return parts.scatter(2, places[..., 2:], new.unsqueeze(-1))


def _mixed(number: Int[Tensor, "*shape"]) -> Int[Tensor, "*shape"]:
    """Another number, as if drawn by chance, the same for the same; int64 that overflows on purpose."""
    number = (number ^ (number >> 29)) * _FACTORS[1]
    return (number ^ (number >> 32)) * _FACTORS[2]


def _repeated(
    parts: Int[Tensor, "shapes some room"], ended: Bool[Tensor, "shapes some"]
) -> Bool[Tensor, "shapes some"]:
    """Which rows have the same parts as one before them, and have ended or not like it."""
    place = torch.arange(1, parts.shape[-1] + 1, device=parts.device)
    key = _mixed(_mixed(parts + _FACTORS[0] * place).sum(-1) + ended)
    return (key.unsqueeze(1) == key.unsqueeze(2)).tril(-1).any(2)
