"""What networks learn that read point clouds: solids that contain the right points, without any program.

A `Student` is a network together with how it is taught; a `SolidTask` gives it clouds, some of their points at a time,
and asks about points of space, half of which are inside.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from ..datasets.solid_clouds import SolidSet

PER_REPORT = 20  # clouds at once when others are scored


@runtime_checkable
class Said(Protocol):
    """What a network says of a batch of clouds: a SoftStump, or a SoftTree."""

    def distances(self, points: Float[Tensor, "b m 3"]) -> Float[Tensor, "b k m"]:
        """Signed distance of each point to each primitive."""

    def inside(self, distances: Float[Tensor, "b k m"]) -> Bool[Tensor, "b m"]:
        """Which points are in the solid, all connections decided."""

    def signed(self, distances: Float[Tensor, "b k m"]) -> Float[Tensor, "b m"]:
        """The same as a field: negative inside, 0 on the surface."""


class Lesson(Protocol):
    """How a network is taught. queries: of each cloud that are asked about in a step, half of them inside."""

    queries: int


class Student(nn.Module):
    """A network and how it is taught, as one module. The network's config says how many points of a cloud it sees, the
    lesson how many points of space are asked about."""

    network: nn.Module
    lesson: Lesson

    def forward(
        self,
        clouds: Float[Tensor, "b n 3"],
        asked: Float[Tensor, "b q 3"],
        inside: Float[Tensor, " q"],
        progress: float,
        noise: torch.Generator,
    ) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
        """The loss when a share `progress` of all steps is done, and its terms by name."""
        raise NotImplementedError

    def soft(self, said: Said, distances: Float[Tensor, "b k m"]) -> Float[Tensor, "b m"]:
        """Occupancy as in the last step of the training."""
        raise NotImplementedError

    def figures(self, said: Said) -> dict[str, Float[Tensor, " b"]]:
        """What the log tells of each answer, by name."""
        raise NotImplementedError


@dataclass
class SolidTask:
    """Learn the clouds of `train`; those of `other` are scored after every epoch. A `Task` for `lib.training.loop.fit`.

    about  JSON: data and settings that must be the same when a run goes on
    """

    student: Student
    train: SolidSet
    other: SolidSet
    about: dict

    @property
    def network(self) -> nn.Module:
        return self.student

    def __len__(self) -> int:
        return len(self.train)

    def loss(
        self, network: nn.Module, picks: Sequence[int], noise: torch.Generator, progress: float
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """The loss of some clouds, and its terms."""
        device, rows = next(network.parameters()).device, torch.as_tensor(picks)
        clouds = _some(self.train.points[rows], self.student.network.config.points, noise)
        queries = self.train.queries[rows].chunk(2, 1)
        halves = [_some(half, self.student.lesson.queries // 2, noise) for half in queries]
        inside = torch.cat([torch.ones(halves[0].shape[1]), torch.zeros(halves[1].shape[1])])
        asked = clouds.to(device), torch.cat(halves, 1).to(device), inside.to(device)
        return network(*asked, progress, noise)

    @torch.no_grad()
    def report(self, network: nn.Module) -> dict[str, float]:
        """Of the other clouds: IoU of the solids, told by their queries, soft and decided, and the student's figures,
        all means."""
        sums: dict[str, float] = {}
        device = next(network.parameters()).device
        for start in range(0, len(self.other), PER_REPORT):
            some = self.other[start : start + PER_REPORT]
            said = self.student.network(some.points.float().to(device))
            distances = said.distances(some.queries.float().to(device))
            inside = some.inside.bool().to(device)
            rows = {
                "val_soft_iou": iou(self.student.soft(said, distances) > 0.5, inside),
                "val_iou": iou(said.inside(distances), inside),
                **self.student.figures(said),
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
