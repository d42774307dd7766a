"""Training a PointNet to name the class of a point cloud."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, pi

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn.functional import cross_entropy

from ..models.point_net import PointNet, PointNetConfig

WARM_UP = 0.2  # share of the steps in which the learning rate rises


@dataclass(frozen=True)
class PointNetSchedule:
    """epochs; batch: clouds a step; points: how many of a cloud's points are seen in a step, others in the next;
    rate: the greatest learning rate, reached after a fifth of the steps and lowered to almost 0 after that."""

    epochs: int = 12
    batch: int = 32
    points: int = 256
    rate: float = 4e-3


def new_point_net(config: PointNetConfig, seed: int) -> PointNet:
    """A network with weights drawn from `seed`; random numbers drawn later do not change."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return PointNet(config)


def train_epochs(
    network: PointNet,
    points: Float[Tensor, "shapes n 3"],
    labels: Int[Tensor, " shapes"],
    schedule: PointNetSchedule,
    seed: int,
) -> Iterator[float]:
    """Train, epoch by epoch: yields the mean cross-entropy of each, and whoever asks may measure in between.

    Order and points are drawn from `seed`. Adam; one cycle of the learning rate. Batch norm needs batches of two or
    more clouds, so a last batch of one is left out of its epoch. Raises ValueError where there are fewer than two.
    """
    if len(points) < 2:
        raise ValueError(f"found {len(points)} clouds to train with; expected at least 2")
    generator = torch.Generator().manual_seed(seed)
    steps = len(_batches(torch.arange(len(points)), schedule.batch))
    optimizer = torch.optim.Adam(network.parameters(), lr=schedule.rate)
    cycle = torch.optim.lr_scheduler.LambdaLR(
        optimizer, lambda step: _share_of_rate((step + 0.5) / (steps * schedule.epochs))
    )
    for _ in range(schedule.epochs):
        network.train()
        losses = []
        for rows in _batches(torch.randperm(len(points), generator=generator), schedule.batch):
            seen = torch.randperm(points.shape[1], generator=generator)[: schedule.points]
            losses.append(_step(network, optimizer, points[rows][:, seen], labels[rows]))
            cycle.step()
        yield float(torch.stack(losses).mean())


def _batches(order: Int[Tensor, " shapes"], batch: int) -> list[Int[Tensor, " rows"]]:
    return [rows for rows in order.split(batch) if len(rows) > 1]


def _share_of_rate(done: float) -> float:
    """Of the greatest learning rate, when this share of the steps is done: up a line, down half a cosine."""
    return min(done / WARM_UP, (1 + cos(pi * (done - WARM_UP) / (1 - WARM_UP))) / 2)


def _step(network: PointNet, optimizer, points: Tensor, labels: Tensor) -> Tensor:
    """One step of the optimizer; returns the loss."""
    like = next(network.parameters())
    loss = cross_entropy(network(points.to(like)), labels.to(like.device))
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    return loss.detach()
