"""REINFORCE: CSGNet learns from pictures without programs, by how alike its own programs' pictures are (paper, 3.1).

For each picture the network draws several programs; a program y earns R(y) = (1 - CD / diagonal) ** 20, and 0 if it
cannot be executed. What is lowered is

    - mean of (R(y) - b) log p(y)         whose gradient is the paper's equation 2, with its sign turned

b, the baseline, changes nothing in the mean, and much in the spread. The paper takes a running average of past rewards,
one number for all pictures ("running"). "image" takes the mean reward of a picture's other programs, "none" takes 0.

The authors' program differs: it draws one program a picture, pays 0.0204 for an invalid one, averages rewards as
0.7 b + 0.3 mean(R) from 0 on, the present ones included, and allows 15 tokens in training.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from ..interpreters.csg import execute_many
from ..metrics.images import image_chamfer, reward
from ..models.csgnet import CSGNet
from ..models.csgnet_decoding import write

BASELINES = ("running", "image", "none")
AVERAGING = 0.9  # share of the past in the running average of rewards
PER_REPORT = 100  # pictures at once when others are scored


class Actor(nn.Module):
    """The network that writes programs by chance, and the running average of what they earned.

    The encoder stays as it is in use: a picture's programs shall not depend on the others of its batch.
    """

    def __init__(self, network: CSGNet):
        super().__init__()
        self.network = network
        self.register_buffer("average", torch.zeros(()))
        self.register_buffer("averaged", torch.zeros((), dtype=torch.long))  # batches

    def train(self, mode: bool = True) -> "Actor":
        super().train(mode)
        self.network.encoder.eval()
        return self

    def forward(
        self, images: Bool[Tensor, "n 64 64"], noise: torch.Generator, copies: int, grammar: bool
    ) -> tuple[Int[Tensor, "rows length"], Float[Tensor, " rows"]]:
        """`copies` programs of each picture, one after another, and the logarithms of their probabilities."""
        written = write(self.network, images, noise, copies, grammar=grammar)
        return written.tokens, written.log_probability

    def baseline(self, rewards: Float[Tensor, "n copies"], kind: str) -> Float[Tensor, "#n #copies"]:
        """What to subtract from the rewards of a batch; afterwards they count among the past ones.

        "running" has no past at the first batch, and takes that batch's mean. Raises ValueError as ReinforceTask does.
        """
        check_baseline(kind, rewards.shape[1])
        past = self.average.clone() if self.averaged else rewards.mean()
        share = AVERAGING if self.averaged else 0.0
        self.average.mul_(share).add_(rewards.mean(), alpha=1 - share)
        self.averaged += 1
        if kind == "running":
            return past.view(1, 1)
        if kind == "none":
            return rewards.new_zeros(1, 1)
        return (rewards.sum(1, keepdim=True) - rewards) / (rewards.shape[1] - 1)


def check_baseline(kind: str, copies: int) -> None:
    """Raises ValueError for a baseline that is unknown, and for "image" with one program a picture."""
    if kind not in BASELINES or copies < 1 + (kind == "image"):
        found = f"the baseline {kind!r} with {copies} programs a picture"
        raise ValueError(f"found {found}; expected one of {BASELINES}, and two or more for 'image'")


@dataclass
class ReinforceTask:
    """Learn from the pictures of `images`; `others` are scored after every epoch. A `Task` for `lib.training.loop.fit`.

    samples   programs drawn for each picture
    baseline  one of BASELINES
    power     of the reward, the paper's gamma
    grammar   draw only programs that can be executed; the paper does not
    about     JSON: data and settings that must be the same when a run goes on
    Raises ValueError for a baseline that is unknown, "image" with one program a picture, a power of 0 or less, and no
    pictures.
    """

    module: Actor
    images: Bool[Tensor, "n 64 64"]
    others: Bool[Tensor, "m 64 64"]
    samples: int
    baseline: str
    power: float
    grammar: bool
    about: dict

    def __post_init__(self) -> None:
        check_baseline(self.baseline, self.samples)
        if not len(self.images) or not len(self.others):
            found = f"{len(self.images)} pictures to learn from, {len(self.others)} to test"
            raise ValueError(f"found {found}; expected some of both")
        if not 0 < self.power < math.inf:
            raise ValueError(f"found the power {self.power} of the reward; expected a number above 0")

    @property
    def network(self) -> nn.Module:
        return self.module

    def __len__(self) -> int:
        return len(self.images)

    def loss(
        self, network: nn.Module, picks: Sequence[int], noise: torch.Generator, progress: float
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """REINFORCE's loss for some pictures; for the log mean reward, share of valid programs, mean length."""
        device = next(network.parameters()).device
        images = self.images[torch.as_tensor(picks)].to(device)
        tokens, log_probability = network(images, noise, self.samples, self.grammar)
        rewards, valid = rewards_of(images.repeat_interleave(self.samples, 0), tokens, self.power)
        shaped = rewards.view(len(images), self.samples)
        advantage = (shaped - self.module.baseline(shaped, self.baseline)).flatten()
        length = (tokens != self.module.network.stop).sum(1).float().mean()
        told = {"reward": rewards.mean(), "valid": valid.float().mean(), "length": length}
        return -(advantage * log_probability).mean(), told

    @torch.no_grad()
    def report(self, network: nn.Module) -> dict[str, float]:
        """Of the other pictures, with the likeliest token each time: mean reward, and mean Chamfer distance, px."""
        device = next(network.parameters()).device
        rewards = distance = 0.0
        for images in self.others.split(PER_REPORT):
            images = images.to(device)
            tokens = write(self.module.network, images, grammar=self.grammar).tokens
            rewards += rewards_of(images, tokens, self.power)[0].sum().item()
            distance += image_chamfer(images, execute_many(tokens).images).sum().item()
        return {"val_reward": rewards / len(self.others), "val_cd": distance / len(self.others)}


@torch.no_grad()
def rewards_of(
    images: Bool[Tensor, "rows 64 64"], tokens: Int[Tensor, "rows length"], power: float = 20
) -> tuple[Float[Tensor, " rows"], Bool[Tensor, " rows"]]:
    """What programs earn for pictures (paper, section 3.1), and which can be executed."""
    shapes = execute_many(tokens)
    earned = reward(image_chamfer(images, shapes.images), power)
    return earned.float().masked_fill(~shapes.valid, 0.0), shapes.valid
