"""Small CSGNets with random weights, and slow, plain definitions of what their programs are.

Their vocabularies have a few primitives; then come + * - and `$`, as in the real ones.
"""

from collections.abc import Iterator

import torch

from lib.models.csgnet import CSGNet, CSGNetConfig


def random_network(
    seed: int, tokens: int = 9, dimensions: int = 2, sharpness: float = 20.0, norm: str = "none"
) -> CSGNet:
    """In evaluation mode; the sharper, the more its tokens differ in their probabilities, and by what came before."""
    torch.manual_seed(seed)
    network = CSGNet(CSGNetConfig(dimensions, tokens, (2,), (8,), (8,), (1,), norm, 6, 16, 0.0)).eval()
    with torch.no_grad():
        network.scores.weight *= sharpness
        network.embedding.weight *= 3
    return network


def random_canvases(seed: int, count: int, dimensions: int = 2) -> torch.Tensor:
    """Noise, of which ever more is ON."""
    noise = torch.rand(count, *(64,) * dimensions, generator=torch.Generator().manual_seed(seed))
    return noise < torch.linspace(0.1, 0.9, count).view(-1, *(1,) * dimensions)


def allowed_next(written: list[int], tokens: int, longest: int) -> Iterator[int]:
    """The tokens after which a program of at most `longest` tokens can still be finished: by counting, one by one."""
    stop = tokens - 1
    depth = sum(-1 if token >= stop - 3 else 1 for token in written)
    for token in range(tokens):
        after = depth + (0 if token == stop else -1 if token >= stop - 3 else 1)
        left = longest - len(written) - (token != stop)
        if after >= 1 and left >= 0 and (after == 1 if token == stop else after - 1 <= left):
            yield token


def choices_of(written: list[int], tokens: int, longest: int, grammar: bool) -> Iterator[int]:
    """What the network may choose from. Without grammar that is everything, until nothing but `$` fits."""
    if grammar:
        return allowed_next(written, tokens, longest)
    return iter(range(tokens) if len(written) < longest else [tokens - 1])


def all_programs(tokens: int, longest: int) -> list[list[int]]:
    """Every program of at most `longest` tokens, each with its `$`."""
    found, open_ones = [], [[]]
    while open_ones:
        written = open_ones.pop()
        for token in allowed_next(written, tokens, longest):
            (found if token == tokens - 1 else open_ones).append([*written, token])
    return found


def is_program(row: list[int], tokens: int, longest: int) -> bool:
    """One part in the end, never an operation without two parts, `$` from there on, not too long."""
    stop = tokens - 1
    end = row.index(stop) if stop in row else len(row)
    depth = 0
    for token in row[:end]:
        if token >= stop - 3 and depth < 2:
            return False
        depth += -1 if token >= stop - 3 else 1
    return depth == 1 and end <= longest and end < len(row) and set(row[end:]) == {stop}


def log_probability(
    network: CSGNet, canvas: torch.Tensor, row: list[int], longest: int, grammar: bool = True
) -> torch.Tensor:
    """Logarithm of the probability with which the network writes a program, up to its first `$`: token by token, each
    among those that may follow, with the scores of teacher forcing."""
    stop = network.stop
    row = row[: row.index(stop) + 1]
    scores, total = network(canvas.unsqueeze(0), torch.tensor([row]))[0], torch.zeros(())
    for place, token in enumerate(row):
        choices = list(choices_of(row[:place], stop + 1, longest, grammar))
        total = total + scores[place, token] - scores[place, choices].logsumexp(0)
    return total
