"""What CSG-Stump Net learns: stumps that contain the right points, without any program (paper, "Training").

    L = mean over points of (T - inside)^2  +  0.001 * mean over primitives of min over points of SDF^2

The second term pulls every primitive's surface to the nearest test point, so that those far away get a gradient. The
authors' program squares the minimum instead ("authors"), which also shrinks primitives until no point is deep inside.

Connections are soft, W = sigmoid(logit). Two ways that were meant to leave less to be decided when W becomes 0 or 1 are
options, to compare with (data_scripts.ablate_stump_net): "steeper", W = sigmoid(s logit) with s growing to 8 in the
second half of a training; and "straight_through", what decided connections say, with the gradient of
soft ones.

In the first half surfaces get sharper, from `dullest` to the paper's 150: a dull surface is seen by more points, which
can pull at it.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from ..interpreters.stump.powers import HIGHEST
from ..interpreters.stump.products import STEEPEST
from ..models.soft_stump import SHARPNESS, SoftStump
from ..models.stump_net import StumpNet
from .solids import Student

PULLS = ("paper", "authors")
CONNECTIONS = ("soft", "steeper", "straight_through")
STEEP = 8.0  # of "steeper" connections, in the end
LENGTHS = {"half", "radius"}  # of what a primitive is told by


@dataclass(frozen=True)
class StumpLesson:
    """How it is taught.

    queries     of each cloud that are asked about in a step, half of them inside
    pull        "paper" or "authors": how the second term is meant; weight: what it is multiplied with
    connections one of CONNECTIONS, see above
    dullest     of the surfaces' sigmoid, at the beginning
    power, temperature  of the soft layers: one of them, see interpreters.stump.layers
    Raises ValueError for other pulls and connections, and for numbers that make no sense.
    """

    queries: int = 512
    pull: str = "paper"
    weight: float = 1e-3
    connections: str = "soft"
    dullest: float = 10.0
    power: float | None = 8.0
    temperature: float | None = None

    def __post_init__(self) -> None:
        if self.pull not in PULLS:
            raise ValueError(f"found the pull {self.pull!r}; expected one of {', '.join(PULLS)}")
        if self.connections not in CONNECTIONS:
            raise ValueError(
                f"found connections {self.connections!r}; expected one of {', '.join(CONNECTIONS)}"
            )
        if not (self.queries >= 2 and 0 <= self.weight < math.inf):
            raise ValueError(
                f"found {self.queries} queries, weight {self.weight}; expected at least 2 and 0, and finite"
            )
        if not 0 < self.dullest <= SHARPNESS:
            raise ValueError(f"found dullest {self.dullest:g}; expected more than 0, at most {SHARPNESS:g}")
        if self.power is not None and self.temperature is not None:
            raise ValueError(
                f"found a power of {self.power:g} and a temperature of {self.temperature:g}; expected one of them, "
                "the other None"
            )
        if self.power is not None and not 0 < self.power <= HIGHEST:
            raise ValueError(f"found a power of {self.power:g}; expected more than 0, at most {HIGHEST:g}")
        if self.temperature is not None and not 0 < self.temperature <= STEEPEST:
            raise ValueError(
                f"found a temperature of {self.temperature:g}; expected more than 0, at most {STEEPEST:g}"
            )

    def steepness(self, progress: float) -> float:
        """Of the connections' sigmoid when a share `progress` of all steps is done."""
        return 1 + (STEEP - 1) * max(0.0, 2 * progress - 1) if self.connections == "steeper" else 1.0

    def sharpness(self, progress: float) -> float:
        """Of the surfaces; it grows by equal factors in equal times."""
        return SHARPNESS * (self.dullest / SHARPNESS) ** max(0.0, 1 - 2 * progress)


class StumpStudent(Student):
    """CSG-Stump Net and its lesson."""

    def __init__(self, network: StumpNet, lesson: StumpLesson):
        super().__init__()
        self.network, self.lesson = network, lesson

    def forward(self, clouds, asked, inside, progress, noise):
        """See Student; the terms are "reconstruction" and "pull"."""
        said = self.network(clouds)
        distances = said.distances(asked)
        found = self._occupancy(said, distances, progress, self.lesson.connections == "straight_through")
        reconstruction, pull = (found - inside).square().mean(), pulled(distances, self.lesson.pull)
        return reconstruction + self.lesson.weight * pull, {"reconstruction": reconstruction, "pull": pull}

    def soft(self, said, distances):
        """See Student; soft with "straight_through", too."""
        return self._occupancy(said, distances, 1.0, False)

    def _occupancy(self, said, distances, progress, straight_through):
        lesson = self.lesson
        steepness, sharpness = lesson.steepness(progress), lesson.sharpness(progress)
        return said.occupancy(
            distances, steepness, lesson.power, lesson.temperature, sharpness, straight_through
        )

    def figures(self, said):
        """See `use`."""
        return use(said)


def pulled(distances: Float[Tensor, "b k m"], pull: str) -> Float[Tensor, ""]:
    """The second term of the loss, without its weight."""
    if pull == "paper":
        return distances.square().amin(2).mean()
    return distances.amin(2).square().mean()


def use(said: SoftStump) -> dict[str, Float[Tensor, " b"]]:
    """Of each stump: primitives and nodes that a decided one uses, mean size of the primitives (their half sides and
    radii, no slopes or exponents), mean entropy of all connections, complements too, in bits."""
    primitives, nodes = said.used()
    chances = torch.cat([each.flatten(1) for each in said.logits], 1).sigmoid()
    lengths = [getattr(batch, name) for batch in said.primitives for name in LENGTHS & batch.counts.keys()]
    sizes = (
        torch.cat([each.flatten(1) for each in lengths], 1) if lengths else chances[:, :1] * 0
    )  # cones alone
    return {
        "primitives": primitives.sum(1),
        "nodes": nodes.sum(1),
        "size": sizes.mean(1),
        "entropy": torch.special.entr(torch.stack([chances, 1 - chances])).sum(0).mean(1)
        / torch.log(torch.tensor(2.0)),
    }
