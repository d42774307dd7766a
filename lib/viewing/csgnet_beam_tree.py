"""Beam search on one picture, step by step, and its tree.

    steps = beam_steps(network, image, k=3)     what was continued, kept, merged and dropped at each token
    tree_figure(steps)                          a column a token; time runs to the right

The search is done again in a few plain lines, one picture at a time, so that nothing stays hidden in a batch; it finds
what `lib.models.csgnet_beams.beam_search` finds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from torch import Tensor

from lib.interpreters.csg import vocabulary_of
from lib.interpreters.csg.tracing import parse_start, trace
from lib.models.csgnet import CSGNet
from lib.models.csgnet_beams import SPARE
from lib.models.csgnet_decoding import log_odds
from lib.models.csgnet_grammar import LONGEST, allowed
from lib.viewing.canvas import COLOR_A, INK, RIM, SOFT, page, stamp, write

KEPT, MERGED, DROPPED = "kept", "merged", "dropped"
GREY = "#bdc3cd"  # of pictures that are not kept
_AISLE, _HIGH, _TOP = 46, 92, 16  # pixels of the page: between two columns, of a row, above the first


@dataclass(frozen=True)
class Beginning:
    """The beginning of a program, after one step of the search.

    tokens   as numbers, with `$` where it has ended
    total    logarithm of its probability;  added: what its last token added
    parent   its place among the kept of the step before;  fate: KEPT, MERGED or DROPPED
    """

    tokens: tuple[int, ...]
    total: float
    added: float
    parent: int
    fate: str = KEPT


@torch.no_grad()
def beam_steps(
    network: CSGNet, image: Bool[Tensor, "64 64"], k: int = 3, longest: int | None = None
) -> list[list[Beginning]]:
    """The candidates of each step, the likeliest first: SPARE * k of them, as many as the search looks at.

    Raises ValueError for a network of space, and less than one program or token.
    """
    longest = LONGEST[2] if longest is None else longest
    if k < 1 or longest < 1 or network.config.dimensions != 2:
        found = f"k = {k}, {longest} tokens, {network.config.dimensions} dimensions"
        raise ValueError(f"found {found}; expected one or more of both, and the plane")
    kept, steps = [Beginning((), 0.0, 0.0, 0)], []
    for room in range(longest, -1, -1):
        candidates = [
            each for place, one in enumerate(kept) for each in _continued(network, image, one, place, room)
        ]
        # Stable: of equally likely ones the first, as in the batched search.
        candidates = sorted(candidates, key=_unlikely)[: SPARE * k]
        candidates = _judged(candidates, network.stop, k)
        kept = [each for each in candidates if each.fate == KEPT]
        steps.append(candidates)
        if all(each.tokens[-1] == network.stop for each in kept):
            break
    return steps


def _unlikely(beginning: Beginning) -> float:
    return -beginning.total


def _continued(network: CSGNet, image: Tensor, one: Beginning, place: int, room: int) -> list[Beginning]:
    """All that may follow one beginning. The network reads it from its start: slow, but plain."""
    if one.tokens and one.tokens[-1] == network.stop:
        return [Beginning(one.tokens, one.total, 0.0, place)]
    before = torch.tensor([[network.start, *one.tokens]])
    scores, _ = network.advance(network.begin(image.unsqueeze(0)), before)
    depth = torch.tensor([_depth(one.tokens, network.stop)])
    rule = allowed(depth, torch.ones(1, dtype=torch.bool), room, network.config.tokens)
    if room == 0:
        rule[:, : network.stop] = False
    odds = log_odds(scores[:, -1], rule)[0]
    found = odds.isfinite().nonzero().flatten().tolist()
    return [Beginning((*one.tokens, t), one.total + float(odds[t]), float(odds[t]), place) for t in found]


def _depth(tokens: Sequence[int], stop: int) -> int:
    """Parts on the stack; the vocabulary ends with three operations and `$`."""
    return sum(1 if token < stop - 3 else -1 for token in tokens)


def _judged(candidates: list[Beginning], stop: int, k: int) -> list[Beginning]:
    """The candidates with their fates. Merged are those that would be kept, if one before did not leave the same parts;
    when k are kept, all others are dropped."""
    seen, kept, found = set(), 0, []
    for each in candidates:
        parts = _parts(each.tokens, stop)
        fate = DROPPED if kept == k else MERGED if parts in seen else KEPT
        seen.add(parts)
        kept += fate == KEPT
        found.append(replace(each, fate=fate))
    return found


def _parts(tokens: Sequence[int], stop: int) -> tuple:
    """The parts on the stack, the operands of unions and intersections sorted, and whether it has ended."""
    stack: list[str] = []
    for token in tokens:
        if token >= stop:
            return (*stack, "$")
        if token < stop - 3:
            stack.append(str(token))
            continue
        right, left = stack.pop(), stack.pop()
        a, b = (left, right) if token == stop - 1 else sorted((left, right))
        stack.append(f"({a} {b} {token})")
    return tuple(stack)


def tree_figure(steps: Sequence[Sequence[Beginning]], *, dropped: int = 1) -> Figure:
    """The tree of a search: a column a step, a box with the top of the stack for each beginning.

    Beside each branch stands what its token added to the logarithm of the probability, below each box the token and
    the sum. Grey: merged with one above it that leaves the same parts, or dropped, at most `dropped` a step.
    """
    shown = [_shown(step, dropped) for step in steps]
    wide = 64 + _AISLE
    width, height = len(shown) * wide + 30, _TOP + max(map(len, shown)) * _HIGH
    figure, ax = page(width, height, min(1.3, 800 / width))
    before: list[tuple[float, float]] = [(6, _TOP + 32)]
    write(ax, "START", 3, _TOP + 24, 7.5, True, ha="left")
    for column, step in enumerate(shown):
        x = 30 + column * wide + _AISLE - 20
        for row, each in enumerate(step):
            _box(ax, each, x, _TOP + row * _HIGH, before[each.parent])
        spots = [(x + 64, _TOP + row * _HIGH + 32) for row in range(len(step))]
        before = [spot for spot, each in zip(spots, step) if each.fate == KEPT]
    return figure


def _shown(step: Sequence[Beginning], dropped: int) -> list[Beginning]:
    """Those that are drawn: kept, merged while there was room, and the first that were dropped."""
    last = max(place for place, each in enumerate(step) if each.fate == KEPT)
    waiting = [each for each in step[last + 1 :] if each.fate == DROPPED][:dropped]
    return [*step[: last + 1], *waiting]


def _box(ax: Axes, each: Beginning, x: float, y: float, start: tuple[float, float]) -> None:
    """One beginning, and the branch that leads to it."""
    words, alive = vocabulary_of(2), each.fate == KEPT
    color = INK if alive else RIM
    ended = each.tokens[-1] == words.stop
    texts = [words.texts[token] for token in each.tokens if token != words.stop]
    stack = trace(parse_start("".join(texts)))[-1].stack
    stamp(
        ax,
        stack[-1].image.numpy(),
        x,
        y,
        (COLOR_A if ended else INK) if alive else GREY,
        rim=color,
    )
    x0, y0 = start[0] + (1 if start[0] > 10 else 24), start[1]
    line = {"linewidth": 1.2 if alive else 0.8, "linestyle": "-" if alive else (0, (3, 2)), "zorder": 0.5}
    ax.plot([x0, x - 1], [y0, y + 32], color=SOFT if alive else RIM, **line)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
    if each.added:
        write(
            ax,
            f"{round(each.added, 2) + 0.0:.2f}",
            x - 12,
            y + 20 + 0.3 * (y0 - y - 32),
            7,
            color=SOFT if alive else RIM,
            bbox=box,
        )
    below = "merged" if each.fate == MERGED else f"{each.total:.2f}"
    write(ax, words.texts[each.tokens[-1]], x + 32, y + 65, 7.5, True, color=color, fontweight="bold")
    write(ax, below, x + 32, y + 75, 7, color=SOFT if alive else RIM)
