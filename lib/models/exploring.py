"""Walking about in the latent space of a program VAE: the codes of programs, ways between them, sums, main directions.

    codes(network, programs)                   where the encoder puts programs, (programs, latent)
    interpolate(network, a, b, steps=8)        programs on the way from a to b (paper, Figure 12)
    analogy(network, a, b, c)                  the program of the code a - b + c
    Directions.of(codes)                       mean, main directions and spread of many codes

A code is the mean of what the encoder believes; nothing here is random. Programs are written in the mode "skip", as the
paper does where a code is given: a line that breaks a rule is left out, so that almost every code gives a program.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from ..interpreters.shapeassembly import Program
from .code_distribution import encoded
from .program_vae import ProgramVAE
from .weights import CheckpointError, read, write
from .writing import write as write_programs

Way = Callable[[Tensor, Tensor, int], Tensor]


def codes(network: ProgramVAE, programs: Sequence[Program]) -> Float[Tensor, "programs latent"]:
    """The latent code of each program: the mean of its distribution.

    Raises ProgramError for a block with more cuboids than a line has room for.
    """
    return encoded(network, programs).mean


def straight(
    start: Float[Tensor, " latent"], end: Float[Tensor, " latent"], steps: int
) -> Float[Tensor, "steps latent"]:
    """Codes on the line from start to end, both included, evenly spaced. Raises ValueError for fewer than 2 steps."""
    share = _shares(steps).to(start)[:, None]
    return (1 - share) * start + share * end


def arc(
    start: Float[Tensor, " latent"], end: Float[Tensor, " latent"], steps: int
) -> Float[Tensor, "steps latent"]:
    """Codes on the arc about the origin from start to end, both included: by even angles, the length changing evenly.

    Random codes of many dimensions all lie about equally far from the origin; a line between two passes nearer to it,
    an arc does not. Opposite codes, and codes at the origin, have no arc: they get the line.
    Raises ValueError for fewer than 2 steps. Source: Shoemake 1985 (slerp).
    """
    share = _shares(steps).to(start.device)[:, None]
    a, b = start.double(), end.double()  # the angle between codes that are nearly parallel needs the digits
    angle = (a @ b / (a.norm() * b.norm())).clamp(-1, 1).arccos()
    if not angle.sin() > 1e-6:  # also where a length is 0 and the angle is not a number
        return straight(start, end, steps)
    unit = (((1 - share) * angle).sin() * a / a.norm() + (share * angle).sin() * b / b.norm()) / angle.sin()
    found = (unit * ((1 - share) * a.norm() + share * b.norm())).to(start)
    found[0], found[-1] = start, end  # to the last bit
    return found


def _shares(steps: int) -> Tensor:
    if steps < 2:
        raise ValueError(f"found {steps} steps; expected at least 2, the two ends")
    return torch.linspace(0, 1, steps, dtype=torch.float64)


def interpolate(
    network: ProgramVAE, a: Program, b: Program, steps: int = 8, path: Way = straight
) -> list[Program]:
    """Programs on the way from a to b. The ends are a and b as the network writes them again.

    path  `straight` or `arc`
    A code that gives no program is left out, so that there may be fewer than `steps`.
    """
    start, end = codes(network, [a, b])
    return write_programs(network, path(start, end, steps), "skip").accepted


Some = Program | Sequence[Program]  # several stand for the mean of their codes


def analogy(network: ProgramVAE, a: Some, b: Some, c: Some) -> Program | None:
    """The program of the code a - b + c: c, changed by what makes a different from b. None where the code gives none.

    Give several programs, and the mean of their codes counts: armchairs minus chairs without arms is steadier than one
    armchair minus one chair. Raises ValueError for an empty sequence.
    """
    code = mean_code(network, a) - mean_code(network, b) + mean_code(network, c)
    return write_programs(network, code[None], "skip").programs[0]


def mean_code(network: ProgramVAE, some: Some) -> Float[Tensor, " latent"]:
    """The code of a program, or the mean code of several. Raises ValueError where there is none."""
    some = [some] if isinstance(some, Program) else list(some)
    if not some:
        raise ValueError("found no programs; expected at least one, to have a mean code")
    return codes(network, some).mean(0)


@dataclass(frozen=True)
class Directions:
    """In which directions many codes differ most (principal components).

    mean    (latent,) of the codes
    axes    (count, latent) unit vectors at right angles, those of the largest spread first
    spread  (count,) standard deviation of the codes along each
    share   (count,) which part of all variance each has
    """

    mean: Float[Tensor, " latent"]
    axes: Float[Tensor, "count latent"]
    spread: Float[Tensor, " count"]
    share: Float[Tensor, " count"]

    @classmethod
    def of(cls, codes: Float[Tensor, "codes latent"], count: int = 8) -> "Directions":
        """Of some codes. An axis points to where its largest entry is positive.

        Raises ValueError for more directions than codes can have: one less than there are, at most their width;
        and for codes that are not finite.
        """
        most = min(len(codes) - 1, codes.shape[-1])
        if not 1 <= count <= most:
            raise ValueError(f"found {count} directions; expected 1 to {most} for {len(codes)} codes")
        if not codes.isfinite().all():
            raise ValueError("found codes that are not finite numbers")
        codes = codes.detach().cpu().double()
        mean = codes.mean(0)
        _, scale, axes = torch.linalg.svd(codes - mean, full_matrices=False)
        largest = axes.gather(1, axes.abs().argmax(1, keepdim=True))
        axes = axes * largest.sign()  # the sign that SVD gives is arbitrary
        variance = scale.square() / (len(codes) - 1)
        share = variance / variance.sum().clamp(min=torch.finfo(torch.float64).tiny)
        return cls(*(x.float() for x in (mean, axes[:count], variance.sqrt()[:count], share[:count])))

    def __len__(self) -> int:
        return len(self.spread)

    def code(
        self, weights: Float[Tensor, "*n count"], base: Float[Tensor, " latent"] | None = None
    ) -> Float[Tensor, "*n latent"]:
        """The code so many standard deviations from the mean, or from `base`, along each direction."""
        return (self.mean if base is None else base) + (weights * self.spread) @ self.axes

    def weights(self, code: Float[Tensor, "*n latent"]) -> Float[Tensor, "*n count"]:
        """How far a code lies from the mean along each direction, standard deviations; 0 along one without spread."""
        along = (code - self.mean) @ self.axes.T
        return torch.where(self.spread > 0, along / self.spread.where(self.spread > 0, 1.0), 0.0)

    def save(self, path: Path) -> None:
        """As a safetensors file."""
        write(path, dict(vars(self)), "Directions", {})

    @classmethod
    def load(cls, path: Path) -> "Directions":
        """What `save` wrote. Raises CheckpointError for anything else."""
        tensors, _ = read(path, "Directions")
        if (found := sorted(tensors)) != (expected := sorted(cls.__dataclass_fields__)):
            raise CheckpointError(f"{path}: found the arrays {found}; expected {expected}")
        return cls(**tensors)
