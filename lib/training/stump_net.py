"""What CSG-Stump Net learns: stumps that contain the right points, without any program (paper, "Training").

    L = mean over points of (T - inside)^2  +  0.001 * mean over primitives of min over points of SDF^2

The second term pulls every primitive's surface to the nearest test point, so that those far away get a gradient. The
authors' program squares the minimum instead, which pulls only primitives that contain no point ("authors").

Connections begin soft, W = sigmoid(logit). In the second half of a training the sigmoid gets steeper, so that in the
end little is left to be decided when W becomes 0 or 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ..datasets.solid_clouds import SolidSet
from ..interpreters.stump.powers import HIGHEST
from ..interpreters.stump.products import STEEPEST
from ..models.soft_stump import SoftStump
from ..models.stump_net import StumpNet

PULLS = ("paper", "authors")
PER_REPORT = 20  # clouds at once when others are scored


@dataclass(frozen=True)
class Lesson:
    """How it is taught.

    points, queries  of each cloud that are seen in a step, and asked about (half of these inside)
    pull        "paper" or "authors": how the second term is meant; weight: what it is multiplied with
    steepest    of the connections' sigmoid, at the end
    power, temperature  of the soft layers: one of them, see interpreters.stump.layers
    Raises ValueError for another pull, and for numbers that make no sense.
    """

    points: int = 512
    queries: int = 1024
    pull: str = "paper"
    weight: float = 1e-3
    steepest: float = 8.0
    power: float | None = 8.0
    temperature: float | None = None

    def __post_init__(self) -> None:
        if self.pull not in PULLS:
            raise ValueError(f"found the pull {self.pull!r}; expected one of {', '.join(PULLS)}")
        if self.points < 1 or self.queries < 2 or self.weight < 0 or self.steepest < 1:
            raise ValueError(
                f"found {self.points} points, {self.queries} queries, weight {self.weight}, steepest {self.steepest}; "
                "expected at least 1, 2, 0 and 1"
            )

        if self.power is not None and not 0 < self.power <= HIGHEST:
            raise ValueError(f"found a power of {self.power:g}; expected more than 0, at most {HIGHEST:g}")
        if self.temperature is not None and not 0 < self.temperature <= STEEPEST:
            raise ValueError(
                f"found a temperature of {self.temperature:g}; expected more than 0, at most {STEEPEST:g}"
            )

    def steepness(self, progress: float) -> float:
        """Of the sigmoid when a share `progress` of all steps is done."""
        return 1 + (self.steepest - 1) * max(0.0, 2 * progress - 1)


class Student(nn.Module):
    """The network and what it is asked, as one module: clouds and points of space -> both terms of the loss."""

    def __init__(self, network: StumpNet, lesson: Lesson):
        super().__init__()
        self.network, self.lesson = network, lesson

    def forward(
        self,
        clouds: Float[Tensor, "b n 3"],
        queries: Float[Tensor, "b q 3"],
        inside: Float[Tensor, " q"],
        steepness: float,
    ) -> tuple[Float[Tensor, ""], Float[Tensor, ""]]:
        said = self.network(clouds)
        distances = said.distances(queries)
        found = said.occupancy(distances, steepness, self.lesson.power, self.lesson.temperature)
        return (found - inside).square().mean(), pulled(distances, self.lesson.pull)


def pulled(distances: Float[Tensor, "b k m"], pull: str) -> Float[Tensor, ""]:
    """The second term of the loss, without its weight."""
    if pull == "paper":
        return distances.square().amin(2).mean()
    return distances.amin(2).square().mean()


@dataclass
class StumpTask:
    """Learn the clouds of `train`; those of `other` are scored after every epoch. A `Task` for `lib.training.loop.fit`.

    about  JSON: data and settings that must be the same when a run goes on
    """

    module: Student
    train: SolidSet
    other: SolidSet
    about: dict

    @property
    def network(self) -> nn.Module:
        return self.module

    def __len__(self) -> int:
        return len(self.train)

    def loss(
        self, network: nn.Module, picks: Sequence[int], noise: torch.Generator, progress: float
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """The loss of some clouds; for the log its terms."""
        lesson, device = self.module.lesson, next(network.parameters()).device
        rows = torch.as_tensor(picks)
        clouds = _some(self.train.points[rows], lesson.points, noise)
        halves = [_some(half, lesson.queries // 2, noise) for half in self.train.queries[rows].chunk(2, 1)]
        inside = torch.cat([torch.ones(halves[0].shape[1]), torch.zeros(halves[1].shape[1])])
        asked = clouds.to(device), torch.cat(halves, 1).to(device), inside.to(device)
        reconstruction, pull = network(*asked, lesson.steepness(progress))
        told = {"reconstruction": reconstruction, "pull": pull}
        return reconstruction + lesson.weight * pull, told

    @torch.no_grad()
    def report(self, network: nn.Module) -> dict[str, float]:
        """Of the other clouds: IoU of the solids, told by their queries, soft and decided; how many primitives and
        nodes the decided stumps use, and how undecided connections are, in bits."""
        sums: dict[str, float] = {}
        lesson, device = self.module.lesson, next(network.parameters()).device
        for start in range(0, len(self.other), PER_REPORT):
            some = self.other[start : start + PER_REPORT]
            said = self.module.network(some.points[:, : lesson.points].float().to(device))
            distances = said.distances(some.queries.float().to(device))
            inside = some.inside.bool().to(device)
            soft = said.occupancy(distances, lesson.steepest, lesson.power, lesson.temperature) > 0.5
            rows = {
                "val_soft_iou": iou(soft, inside),
                "val_iou": iou(said.inside(distances), inside),
                **use(said),
            }
            for name, values in rows.items():
                sums[name] = sums.get(name, 0.0) + values.double().sum().item()
        return {name: total / len(self.other) for name, total in sums.items()}


def _some(points: Tensor, count: int, noise: torch.Generator) -> Float[Tensor, "b count 3"]:
    """Some of each cloud's points, the same numbers of all."""
    return points[:, torch.randperm(points.shape[1], generator=noise)[:count]].float()


def iou(found: Tensor, inside: Tensor) -> Float[Tensor, " b"]:
    """Share of queries in both among those in either. Half of the queries are inside: it is not that of volumes."""
    return (found & inside).sum(1) / (found | inside).sum(1)


def use(said: SoftStump) -> dict[str, Float[Tensor, " b"]]:
    """Of each stump: primitives and nodes that a decided one uses, mean size of the primitives, mean entropy of the
    connections in bits."""
    nodes = said.union > 0
    primitives = ((said.intersection > 0) & nodes.unsqueeze(1)).any(2)
    chances = torch.cat([each.flatten(1) for each in (said.intersection, said.union)], 1).sigmoid()
    sizes = torch.cat([batch.sizes.flatten(1) for batch in said.primitives], 1)
    return {
        "primitives": primitives.sum(1),
        "nodes": nodes.sum(1),
        "size": sizes.mean(1),
        "entropy": torch.special.entr(torch.stack([chances, 1 - chances])).sum(0).mean(1)
        / torch.log(torch.tensor(2.0)),
    }
