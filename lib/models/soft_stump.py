"""What CSG-Stump Net says of a batch of clouds: stumps whose connections are not decided yet.

W = sigmoid(steepness * logit)      while it learns; larger steepness: nearer to 0 and 1
W = [logit > 0]                     decided: a Stump of the language
O = sigmoid(-sharpness * distance)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..interpreters.stump import KINDS, Primitive, Stump, layers

SHARPNESS = 150.0  # of occupancy, per unit of length: the paper's eta, as in the authors' program
POWER = 8.0  # of the soft layers' means, see interpreters.stump.powers


@dataclass(frozen=True)
class SoftStump:
    """primitives: a batch (b, count) of each kind; the logits of the three matrices."""

    primitives: tuple[Primitive, ...]
    complement: Float[Tensor, "b k"]
    intersection: Float[Tensor, "b k c"]
    union: Float[Tensor, "b c"]

    def __len__(self) -> int:
        return len(self.union)

    def distances(self, points: Float[Tensor, "b m 3"]) -> Float[Tensor, "b k m"]:
        """Signed distance of each point to each primitive, negative inside."""
        return torch.cat([batch.distance(points.unsqueeze(1)) for batch in self.primitives], 1)

    def occupancy(
        self,
        distances: Float[Tensor, "b k m"],
        steepness: float = 1.0,
        power: float | None = POWER,
        temperature: float | None = None,
        sharpness: float = SHARPNESS,
        straight_through: bool = False,
    ) -> Float[Tensor, "b m"]:
        """From 0 outside to 1 inside, of points with these distances; differentiable. See `layers.soft`.

        power, temperature  of the means: the one that is used, the other one None. Raises ValueError for both.
        straight_through: the values are those of decided connections, the gradient is that of soft ones
        """
        values = torch.sigmoid(-sharpness * distances)
        matrices = [torch.sigmoid(steepness * logits) for logits in self.logits]
        found = layers.soft(values, *matrices, temperature, power)[1]
        if not straight_through:
            return found
        with torch.no_grad():
            matrices = [(logits > 0).to(values) for logits in self.logits]
            decided = layers.soft(values, *matrices, temperature, power)[1]
        return found + (decided - found).detach()

    def inside(self, distances: Float[Tensor, "b k m"]) -> Bool[Tensor, "b m"]:
        """The same with all decided."""
        return layers.binary(distances <= 0, *(logits > 0 for logits in self.logits))[1]

    def signed(self, distances: Float[Tensor, "b k m"]) -> Float[Tensor, "b m"]:
        """Decided, too: negative inside, 0 on the surface; see `layers.signed` and `matrices`."""
        return torch.stack([layers.signed(*each) for each in zip(distances, *self.matrices)])

    @property
    def logits(self) -> tuple[Tensor, Tensor, Tensor]:
        """Complement (b, K), intersection (b, K, C), union (b, C)."""
        return self.complement, self.intersection, self.union

    @property
    def matrices(self) -> tuple[Bool[Tensor, "b k"], Bool[Tensor, "b k c"], Bool[Tensor, "b c"]]:
        """W_C, W_I and W_U, decided. Raises ValueError for logits that are no numbers: those of spoiled weights."""
        if any(logits.isnan().any() for logits in self.logits):
            raise ValueError(
                "found connections that are no numbers; expected a network that answers with numbers"
            )
        return tuple(logits > 0 for logits in self.logits)

    def used(self) -> tuple[Bool[Tensor, "b k"], Bool[Tensor, "b c"]]:
        """Which primitives and which nodes each decided stump uses: nodes that are united, and what these select."""
        nodes = self.union > 0
        return ((self.intersection > 0) & nodes.unsqueeze(1)).any(2), nodes

    def stumps(self) -> Sequence[Stump]:
        """The decided stump of each cloud, on the CPU, without what it does not use.

        Raises ValueError for primitives that the language does not have, a rival's superquadrics; see also `matrices`.
        """
        if foreign := [batch.name for batch in self.primitives if batch.name not in KINDS]:
            raise ValueError(f"found primitives of the kind {foreign[0]!r}; expected {', '.join(KINDS)}")
        matrices = [matrix.cpu() for matrix in self.matrices]
        batches = [batch.to("cpu") for batch in self.primitives]
        found = []
        for i in range(len(self)):
            primitives = [batch[i][k] for batch in batches for k in range(batch.translation.shape[1])]
            primitives = [type(p).with_numbers(p, p.numbers.detach()) for p in primitives]
            found.append(Stump(primitives, *(matrix[i] for matrix in matrices)).pruned())
        return found
