"""Where the codes of real programs lie, as one normal distribution: a better place to sample from than the prior.

The KL term pulls the codes of the training programs towards a standard normal distribution, but not all the way: they
have another mean, some directions are wider than 1, and directions go together. `of` fits mean and covariance to the
codes that the encoder gives, each blurred by its own variance. The paper samples from the standard normal distribution;
this is ours (one Gaussian after training: Ghosh et al. 2020, "From variational to deterministic autoencoders").
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from ..interpreters.shapeassembly import Program
from .program_table import ProgramTable, batch_of
from .program_vae import Posterior, ProgramVAE
from .weights import CheckpointError, read, write

AT_ONCE = 256  # programs: bounds the memory


@torch.no_grad()
def encoded(network: ProgramVAE, programs: Sequence[Program]) -> Posterior:
    """Where the encoder believes each program's code to be.

    Raises ProgramError for a block with more cuboids than a line has room for.
    """
    device = network.first_state.device
    nothing = torch.zeros(0, network.config.hidden, device=device)
    parts = [Posterior(nothing, nothing)]
    for first in range(0, len(programs), AT_ONCE):
        table = ProgramTable.of(programs[first : first + AT_ONCE])
        parts.append(network.encode([level.to(device) for level in batch_of(table, range(len(table)))]))
    return Posterior(*(torch.cat([getattr(p, name) for p in parts]) for name in ("mean", "log_variance")))


@dataclass(frozen=True)
class CodeDistribution:
    """A normal distribution of latent codes.

    mean    (latent,)
    factor  (latent, latent) lower triangle L with L Lᵀ the covariance
    """

    mean: Float[Tensor, " latent"]
    factor: Float[Tensor, "latent latent"]

    @classmethod
    def of(cls, network: ProgramVAE, programs: Sequence[Program]) -> "CodeDistribution":
        """Of some programs' codes. Raises ValueError for fewer than two programs."""
        if len(programs) < 2:
            raise ValueError(f"found {len(programs)} programs; expected at least 2, to have a covariance")
        posterior = encoded(network, programs)
        codes, blur = posterior.mean.cpu().double(), posterior.log_variance.cpu().double().exp().mean(0)
        factor = torch.linalg.cholesky(torch.cov(codes.T) + torch.diag(blur))
        return cls(codes.mean(0).float(), factor.float())

    def at(self, noise: Float[Tensor, "codes latent"]) -> Float[Tensor, "codes latent"]:
        """The codes that standard normal `noise` leads to."""
        return self.mean + noise @ self.factor.T

    def save(self, path: Path) -> None:
        """As a safetensors file."""
        write(path, dict(vars(self)), type(self).__name__, {})

    @classmethod
    def load(cls, path: Path) -> "CodeDistribution":
        """What `save` wrote. Raises CheckpointError for anything else."""
        tensors, _ = read(path, cls.__name__)
        found = {name: tuple(tensor.shape) for name, tensor in tensors.items()}
        latent = tensors["mean"].numel() if "mean" in tensors else 0
        if found != {"mean": (latent,), "factor": (latent, latent)}:
            raise CheckpointError(f"{path}: found arrays {found}; expected mean (n,) and factor (n, n)")
        return cls(**tensors)
