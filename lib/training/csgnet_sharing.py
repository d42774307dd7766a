"""While CSGNet learns, tokens that have a number in common share weights: what it learns of one helps the others.

In space there are 6,631 primitives, and of a million random programs each is in a few hundred. But a cylinder at
x = 24 is at x = 24 whatever its y, z, r and h. So the weights of a token, in the layer that scores tokens and in the
embedding, are a sum: the token's own, and those of each of its numbers (by kind of primitive). A sum of weights is
again weights: in the end they are added up, and what is left is the paper's network (Tables 7 and 9), without sharing.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.utils import parametrize

from ..interpreters.csg import KINDS, Vocabulary, vocabulary_of
from ..models.csgnet import CSGNet


class Shared(nn.Module):
    """A token's own weights, plus those of its numbers. numbers: (tokens, values) 0 or 1, which values a token has."""

    def __init__(self, numbers: Float[Tensor, "tokens values"], width: int):
        super().__init__()
        self.register_buffer("numbers", numbers, persistent=False)
        self.of_numbers = nn.Parameter(torch.zeros(numbers.shape[1], width))

    def forward(self, own: Float[Tensor, "tokens width"]) -> Float[Tensor, "tokens width"]:
        return own + self.numbers @ self.of_numbers


def share(network: CSGNet) -> None:
    """Let the network's tokens share weights; what it computes is the same at first."""
    numbers = numbers_of(vocabulary_of(network.config.dimensions))
    parametrize.register_parametrization(
        network.scores, "weight", Shared(numbers, network.scores.in_features)
    )
    with_start = torch.cat([numbers, numbers.new_zeros(1, numbers.shape[1])])
    parametrize.register_parametrization(
        network.embedding, "weight", Shared(with_start, network.config.embedding)
    )


def unshare(network: CSGNet) -> None:
    """Add up the weights: the network computes the same without sharing."""
    for layer in (network.scores, network.embedding):
        parametrize.remove_parametrizations(layer, "weight", leave_parametrized=True)


def numbers_of(vocabulary: Vocabulary) -> Float[Tensor, "tokens values"]:
    """1 where a token is a primitive of a kind with a value of a field, such as circles with r = 8, and by kind."""
    values: dict[tuple, int] = {}
    rows = []
    for primitive in vocabulary.primitives:
        fields = zip(KINDS[primitive.kind].fields, primitive.numbers)
        facts = [(primitive.kind,), *((primitive.kind, *fact) for fact in fields)]
        rows.append([values.setdefault(fact, len(values)) for fact in facts])
    found = torch.zeros(len(vocabulary), len(values))
    for token, places in enumerate(rows):
        found[token, places] = 1
    return found
