"""Fit the numbers of a program to a point cloud: gradient descent through the interpreter (paper, section 7.3)."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from tqdm import tqdm

from ..interpreters.cuboids import Cuboids, skew
from ..interpreters.shapeassembly import Program, ProgramError, execute
from ..metrics.points import chamfer_distance

SMALLEST = 0.01  # of a cuboid's side, world units, while fitting
FIRST_SEED = 1_000_000  # of the steps' samples: far from the small seeds with which targets are drawn


@dataclass(frozen=True)
class Fit:
    """history: losses (steps,), and every parameter vector (steps, p); parameters: those with the lowest loss."""

    losses: Float[Tensor, " steps"]
    path: Float[Tensor, "steps p"]

    @property
    def best(self) -> int:
        """The step with the lowest loss."""
        return int(self.losses.argmin())

    @property
    def parameters(self) -> Float[Tensor, " p"]:
        return self.path[self.best]


def fit_program(
    program: Program, target: Float[Tensor, "m 3"], steps: int = 150, rate: float = 0.01, points: int = 512
) -> Fit:
    """Adam on the program's continuous parameters; the loss is the Chamfer distance to `target`, world units.

    Each step samples `points` fresh surface points (seeded, so that a run can be repeated). Sizes stay above
    SMALLEST, coordinates in [0, 1]. Raises ProgramError where the geometry stops being finite.
    """
    low, high = _limits(program)

    def surface(vector: Tensor, seed: int) -> Tensor:
        return execute(program, vector).surface_points(points, seed)

    return _descend(program.parameters(), (low, high), surface, target, steps, rate)


def fit_cuboids(
    start: Cuboids, target: Float[Tensor, "m 3"], steps: int = 150, rate: float = 0.01, points: int = 512
) -> Fit:
    """The same descent on free boxes: nine numbers each (size, center, turn), nothing to hold them together."""
    vector = torch.cat([start.size, start.center, torch.zeros_like(start.size)], -1).detach()
    low = torch.full_like(vector, -torch.inf)
    low[:, :3] = SMALLEST

    def surface(vector: Tensor, seed: int) -> Tensor:
        return free_cuboids(vector, start).surface_points(points, seed)

    limits = low.flatten(), torch.full_like(low, torch.inf).flatten()
    return _descend(vector.flatten(), limits, surface, target, steps, rate)


def free_cuboids(vector: Float[Tensor, " p"], start: Cuboids) -> Cuboids:
    """Boxes from a vector of `fit_cuboids`: size, center, and a turn (axis times angle) from the axes of `start`."""
    size, center, turn = vector.reshape(-1, 9).split(3, dim=-1)
    return Cuboids(size, center, start.axes.detach() @ torch.linalg.matrix_exp(skew(turn)).mT)


def _descend(
    vector: Float[Tensor, " p"],
    limits: tuple[Tensor, Tensor],
    surface: Callable[[Tensor, int], Tensor],
    target: Float[Tensor, "m 3"],
    steps: int,
    rate: float,
) -> Fit:
    """Adam from `vector`, kept within `limits`; surface(vector, seed) gives the points to compare."""
    vector = vector.detach().clamp(*limits).requires_grad_()
    optimizer = torch.optim.Adam([vector], lr=rate)
    losses, path = [], []
    for step in tqdm(range(steps), desc="fitting", leave=False, disable=None):
        loss = chamfer_distance(surface(vector, FIRST_SEED + step), target.to(vector))
        if not loss.isfinite():
            raise ProgramError(
                f"step {step}: the distance to the target is not finite", expected="a smaller rate"
            )
        losses.append(loss.detach())
        path.append(vector.detach().clone())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        with torch.no_grad():
            vector.clamp_(*limits)
    return Fit(torch.stack(losses), torch.stack(path))


def _limits(program: Program) -> tuple[Tensor, Tensor]:
    """Smallest and largest value of each parameter while fitting: sizes positive, coordinates in [0, 1]."""
    is_size = torch.tensor([name.split(":")[2] == "Cuboid" for name in program.parameter_names()])
    low, high = torch.zeros(len(is_size)).double(), torch.ones(len(is_size)).double()
    low[is_size], high[is_size] = SMALLEST, torch.inf
    return low, high
