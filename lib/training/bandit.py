"""Policy gradient where everything can be computed by hand: two arms, and one number θ to learn.

    p = 1 / (1 + exp(-θ))           probability of arm 1; arm 0 has 1 - p
    J = p R1 + (1 - p) R0           the mean reward; arm k always pays Rk
    dJ/dθ = p (1 - p) (R1 - R0)     its slope
    (R - b) d log p(arm)/dθ         REINFORCE's estimate of that slope from one draw; b is the baseline

As with CSGNet's programs, chance lies in what is tried, not in what it earns. All numbers are float64 tensors.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from .reinforce import AVERAGING

Rewards = tuple[float, float]  # of arm 0 and of arm 1
BASELINES = ("none", "running")


def exact_gradient(theta: Float[Tensor, "*n"], rewards: Rewards) -> Float[Tensor, "*n"]:
    """dJ/dθ."""
    p = theta.sigmoid()
    return p * (1 - p) * (rewards[1] - rewards[0])


def pull(theta: Float[Tensor, "*n"], noise: torch.Generator) -> Int[Tensor, "*n"]:
    """An arm for each θ, drawn by its probability."""
    return (torch.rand(theta.shape, generator=noise, dtype=theta.dtype) < theta.sigmoid()).long()


def estimate(
    theta: Float[Tensor, "*n"],
    arms: Int[Tensor, "*n"],
    rewards: Rewards,
    baseline: Float[Tensor, "*n"] | float = 0.0,
) -> Float[Tensor, "*n"]:
    """REINFORCE's estimate of dJ/dθ from each draw. The slope of log p(arm) is 1 - p for arm 1, and -p for arm 0."""
    paid = torch.tensor(rewards, dtype=theta.dtype)[arms]
    return (paid - baseline) * (arms - theta.sigmoid())


def spread(
    theta: Float[Tensor, "*n"], rewards: Rewards, baseline: Float[Tensor, "*n"] | float = 0.0
) -> Float[Tensor, "*n"]:
    """Standard deviation of one estimate: it takes two values, one with probability p."""
    p = theta.sigmoid()
    apart = (rewards[1] - baseline) * (1 - p) + (rewards[0] - baseline) * p
    return (p * (1 - p)).sqrt() * apart.abs()


def learn(
    rewards: Rewards, steps: int, rate: float, runs: int, noise: torch.Generator, baseline: str = "none"
) -> Float[Tensor, "runs moments"]:
    """The probability of arm 1 before the first step and after each, in many runs from θ = 0 that are independent.

    A step draws one arm and moves θ by rate times the estimate. "running" subtracts the average of past rewards.
    Raises ValueError for another baseline.
    """
    if baseline not in BASELINES:
        raise ValueError(f"found the baseline {baseline!r}; expected one of {', '.join(BASELINES)}")
    theta = torch.zeros(runs, dtype=torch.float64)
    paid = torch.tensor(rewards, dtype=theta.dtype)
    past, found = paid.mean().expand(runs), [theta.sigmoid()]  # at θ = 0 both arms are as likely
    for _ in range(steps):
        arms = pull(theta, noise)
        theta = theta + rate * estimate(theta, arms, rewards, past if baseline == "running" else 0.0)
        past = AVERAGING * past + (1 - AVERAGING) * paid[arms]
        found.append(theta.sigmoid())
    return torch.stack(found, 1)
