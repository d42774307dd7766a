"""CSGNet writes: the likeliest token each time (greedy), or one drawn by its probability. Beam search: `csgnet_beams`.

write(network, images)                         greedy
write(network, images, noise=generator)        drawn; with gradients where they are switched on, for REINFORCE
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from ..interpreters.checks import whole
from .csgnet import CSGNet
from .csgnet_grammar import LONGEST, allowed, deeper


@dataclass(frozen=True)
class Written:
    """What was written, a row each: tokens (padded with `$`, one at least), and the logarithm of their probability."""

    tokens: Int[Tensor, "rows length"]
    log_probability: Float[Tensor, " rows"]


def write(
    network: CSGNet,
    canvases: Bool[Tensor, "shapes *canvas"],
    noise: torch.Generator | None = None,
    copies: int = 1,
    longest: int | None = None,
    grammar: bool = True,
) -> Written:
    """One program for each shape, or `copies` of them one after another: rows are shapes x copies.

    canvases  images (64, 64) or grids (64, 64, 64), bool
    noise     a generator on the CPU, from which tokens are drawn; without it each is the likeliest one
    longest   tokens of a program, `$` not counted: the paper's, if not given
    grammar   only programs that can be executed; without it the network may write anything, as in the paper
    Raises ValueError for less than one copy or token, for noise that is no generator, and for canvases that the network
    does not take.
    """
    if not isinstance(noise, torch.Generator | None):
        raise ValueError(f"found noise {noise!r}; expected a torch.Generator, or None")
    longest = LONGEST[network.config.dimensions] if longest is None else longest
    if None in (whole(copies), whole(longest)) or copies < 1 or longest < 1:
        raise ValueError(f"found {copies} copies of {longest} tokens; expected at least one of each")
    shape = torch.arange(len(canvases), device=canvases.device).repeat_interleave(copies)
    state = network.begin(canvases)[shape]
    token = torch.full_like(shape, network.start)
    depth, running = torch.zeros_like(shape), torch.ones_like(shape, dtype=torch.bool)
    total, tokens = torch.zeros(len(shape), device=shape.device), []
    for room in range(longest, 0, -1):
        scores, state = network.advance(state, token.unsqueeze(1))
        rule = allowed(depth, running, room, network.config.tokens) if grammar else None
        odds = log_odds(scores[:, 0], rule)
        token = odds.argmax(1) if noise is None else _drawn(odds, noise)
        token = torch.where(running, token, network.stop)
        total = total + odds.gather(1, token.unsqueeze(1)).squeeze(1) * running
        depth = deeper(depth, token, network.config.tokens)
        running = running & (token != network.stop)
        tokens.append(token)
        if not running.any():
            break
    else:  # no room is left: what has not ended ends here, and this is no choice: its probability is 1
        tokens.append(torch.full_like(token, network.stop))
    return Written(torch.stack(tokens, 1), total)


def log_odds(
    scores: Float[Tensor, "rows tokens"], rule: Bool[Tensor, "rows tokens"] | None
) -> Float[Tensor, "rows tokens"]:
    """Logarithms of the probabilities that scores stand for, among the tokens that the rule allows."""
    scores = scores.float()
    return (scores if rule is None else scores.where(rule, -torch.inf)).log_softmax(1)


def _drawn(odds: Float[Tensor, "rows tokens"], noise: torch.Generator) -> Int[Tensor, " rows"]:
    """A token a row: the first at which the sum of all probabilities up to it reaches a random height, above 0."""
    sums = odds.detach().exp().cumsum(1)
    height = (1 - torch.rand(len(odds), generator=noise)).to(odds)
    first = torch.searchsorted(sums, (height * sums[:, -1]).unsqueeze(1)).squeeze(1)
    return first.clamp(max=odds.shape[1] - 1)  # past the end where probabilities are NaN: the loss will tell
