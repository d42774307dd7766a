"""What the rival in the manner of UCSG-Net learns (Kania et al. 2020, as its authors' program has it).

    L = mean over points of (T - inside)^2 + 0.1 |margin| + 0.1 mean over primitives of max(|translation| - 0.5, 0)^2
        + 0.1 sum of |temperatures|, once the margin is 0.05 or less

Sizes need no term that keeps them positive: here they are.
"""

from dataclasses import dataclass

import torch

from ..models.ucsg import UCSG
from .solids import Student

WEIGHT = 0.1  # of each further term
NARROW = 0.05  # margin below which choices are driven to be certain


@dataclass(frozen=True)
class UCSGLesson:
    """queries: of each cloud that are asked about in a step. Raises ValueError for too few."""

    queries: int = 512

    def __post_init__(self) -> None:
        if self.queries < 2:
            raise ValueError(f"found {self.queries} queries; expected at least 2")


class UCSGStudent(Student):
    """The network and its lesson."""

    def __init__(self, network: UCSG, lesson: UCSGLesson):
        super().__init__()
        self.network, self.lesson = network, lesson

    def forward(self, clouds, asked, inside, progress, noise):
        """See Student."""
        said = self.network(clouds, noise)
        found = said.occupancy(said.distances(asked))
        places = torch.cat([batch.translation for batch in said.primitives], 1)
        terms = {
            "reconstruction": (found - inside).square().mean(),
            "margin": said.margin.abs(),
            "reach": (places.norm(dim=-1) - 0.5).clamp(min=0).square().mean(),
            "temperature": said.temperatures.abs().sum() * (said.margin.detach() <= NARROW),
        }
        others = terms["margin"] + terms["reach"] + terms["temperature"]
        return terms["reconstruction"] + WEIGHT * others, terms

    def soft(self, said, distances):
        """See Student; without noise."""
        return said.occupancy(distances)

    def figures(self, said):
        """Primitives that a decided tree uses, and the margin."""
        return {"primitives": said.used().sum(1), "margin_now": said.margin.detach().expand(len(said))}
