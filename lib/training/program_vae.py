"""What the program VAE learns: to write the programs that it reads. The command is in `program_vae_command`."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from ..models.program_table import Level, ProgramTable, batch_of
from ..models.program_vae import ProgramVAE
from .program_loss import LossWeights, program_loss, total_loss

PER_REPORT = 256  # programs at once when other data is scored


class ReadAndWrite(nn.Module):
    """The network and what it is asked to do, as one module: programs -> the terms of the loss."""

    def __init__(self, network: ProgramVAE):
        super().__init__()
        self.network = network

    def forward(self, levels: list[Level], noise: Tensor) -> dict[str, Tensor]:
        posterior, found = self.network(levels, noise)
        root = torch.empty_like(found.root).index_copy(0, levels[0].program, levels[0].size)
        return program_loss(self.network.line, posterior, found, root)


@dataclass
class ProgramTask:
    """Learn the programs of `train`; `other` is scored after every epoch. A `Task` for `lib.training.loop.fit`.

    annealing  share of all steps in which the weight of the KL term grows from 0 to its full size
    about      JSON: data and settings that must be the same when a run goes on
    """

    module: ReadAndWrite
    train: ProgramTable
    other: ProgramTable | None
    weights: LossWeights
    annealing: float
    about: dict

    @property
    def network(self) -> nn.Module:
        return self.module

    def __len__(self) -> int:
        return len(self.train)

    def loss(
        self, network: nn.Module, picks: Sequence[int], noise: torch.Generator, progress: float
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """Weighted loss of some programs and its unweighted terms, means over these programs."""
        device = next(network.parameters()).device
        levels = [level.to(device) for level in batch_of(self.train, picks)]
        hidden = self.module.network.config.hidden
        terms = network(levels, torch.randn(len(picks), hidden, generator=noise).to(device))
        grown = min(1.0, progress / self.annealing) if self.annealing else 1.0
        weights = LossWeights(self.weights.one_hot, self.weights.number, self.weights.kl * grown)
        return total_loss(terms, weights), terms

    @torch.no_grad()
    def report(self, network: nn.Module) -> dict[str, float]:
        """Loss of the other programs with the codes at their means, and its terms."""
        if self.other is None:
            return {}
        device = next(network.parameters()).device
        sums: dict[str, float] = {}
        for start in range(0, len(self.other), PER_REPORT):
            picks = range(start, min(start + PER_REPORT, len(self.other)))
            levels = [level.to(device) for level in batch_of(self.other, picks)]
            terms = network(levels, torch.zeros(len(picks), self.module.network.config.hidden, device=device))
            terms = {"loss": total_loss(terms, self.weights), **terms}
            for name, value in terms.items():
                sums[name] = sums.get(name, 0.0) + value.item() * len(picks)
        return {f"val_{name}": value / len(self.other) for name, value in sums.items()}
