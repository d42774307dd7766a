"""A rival in the manner of UCSG-Net (Kania et al. 2020): layers that choose two shapes and combine them in all ways.

    primitives    boxes and balls; O = 1 - clip(distance / margin, 0, 1), the margin learned, driven to 0
    a layer       for each of its nodes a left and a right operand, each a choice among all inputs; its outputs are
                  left or right, left and right, left without right, right without left:
                  clip(l + r), clip(l + r - 1), clip(l - r), clip(r - l)
    inputs        of the first layer the primitives, of the next ones these and the outputs of the layer before
    the last      has one node, of which only "left or right" is the shape

A GRU walks along with the layers: what was chosen before decides, with the code, what is chosen next. (It is told the
softmax weights; UCSG-Net's is told those with noise and temperature.) Choices are softmax weights, in training with
Gumbel noise and a learned temperature, driven to 0; when all is decided, the one with the greatest weight, and a
primitive ends where its O is one half: distance = margin / 2. (UCSG-Net keeps its noise when it is tested, which makes
its answers random; here it is off.)
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from ..interpreters.checks import sizes
from ..interpreters.stump import Box, Primitive, Sphere
from .dgcnn import DGCNN
from .stump_net import PrimitiveHead, decoder

LEAST, MOST = 1e-3, 2.0  # temperatures
STATE = 256  # numbers of the GRU's state
DEEPEST = 64  # layers: the paper's have five, and each next one sees all before


@dataclass(frozen=True)
class UCSGConfig:
    """each: primitives of a kind; layers; nodes: of all layers but the last; the rest: see StumpNetConfig.

    Raises ValueError for sizes that are no whole numbers from 1, and more than 64 layers.
    """

    each: int = 32
    layers: int = 5
    nodes: int = 12
    feature: int = 256
    widths: tuple[int, ...] = (256, 512)
    neighbours: int = 8
    points: int = 256

    def __post_init__(self) -> None:
        numbers = (self.each, self.layers, self.nodes, self.feature, self.points, self.neighbours)
        if not sizes(*numbers, *self.widths) or not self.widths:
            raise ValueError(f"found {self}; expected whole sizes of at least 1, and one width or more")
        if self.layers > DEEPEST:
            raise ValueError(f"found {self.layers} layers; expected at most {DEEPEST}")


@dataclass(frozen=True)
class SoftTree:
    """What the network says: primitives by kind, the logits of each layer's choices (b, 2, inputs, nodes), margin,
    temperatures, and the noise of the choices, None for none."""

    primitives: tuple[Primitive, ...]
    choices: tuple[Float[Tensor, "b 2 _inputs _nodes"], ...]
    margin: Float[Tensor, ""]
    temperatures: Float[Tensor, " layers"]
    noise: tuple[Tensor, ...] | None

    def __len__(self) -> int:
        return len(self.choices[0])

    def distances(self, points: Float[Tensor, "b m 3"]) -> Float[Tensor, "b k m"]:
        """Signed distance of each point to each primitive."""
        return torch.cat([batch.distance(points.unsqueeze(1)) for batch in self.primitives], 1)

    @property
    def width(self) -> Float[Tensor, ""]:
        """The margin; never quite 0, nor below it, where a training may bring it."""
        return self.margin.clamp(min=1e-4)

    def occupancy(self, distances: Float[Tensor, "b k m"]) -> Float[Tensor, "b m"]:
        """From 0 outside to 1 inside; differentiable."""
        inside = 1 - (distances / self.width).clamp(0, 1)
        found = inside
        for k, logits in enumerate(self.choices):
            logits = logits if self.noise is None else logits + self.noise[k]
            weights = (logits / self.temperatures[k].clamp(LEAST, MOST)).softmax(2)
            left, right = (weights[:, side].mT @ found for side in (0, 1))
            last = k == len(self.choices) - 1
            found = (
                _combined(left, right, last) if last else torch.cat([_combined(left, right, last), inside], 1)
            )
        return found[:, 0]

    def inside(self, distances: Float[Tensor, "b k m"]) -> Bool[Tensor, "b m"]:
        """The same with all decided."""
        return self.signed(distances) <= 0

    def signed(self, distances: Float[Tensor, "b k m"]) -> Float[Tensor, "b m"]:
        """Decided, too: negative inside, 0 on the surface; the smaller of two for "or", the larger for "and"."""
        # A training that is cut short leaves a margin as wide as a leg: at distance 0 its legs would be too thin.
        found = distances = distances - self.width / 2
        for logits in self.choices:
            chosen = logits.argmax(2)  # (b, 2, nodes)
            rows = chosen.unsqueeze(-1).expand(-1, -1, -1, found.shape[2])
            left, right = (found.gather(1, rows[:, side]) for side in (0, 1))
            either = torch.minimum(left, right)
            others = torch.maximum(left, right), torch.maximum(left, -right), torch.maximum(right, -left)
            found = torch.cat([either, *others, distances], 1)
        return found[:, 0]  # the last layer has one node

    def used(self) -> Bool[Tensor, "b k"]:
        """Which primitives the decided tree chooses, directly or through layers in between."""
        needed = torch.ones(
            len(self), 1, dtype=torch.bool, device=self.margin.device
        )  # nodes of the last layer
        primitives = torch.zeros(len(self), self.choices[0].shape[2], dtype=torch.bool, device=needed.device)
        for logits in reversed(self.choices):
            chosen = torch.zeros(logits.shape[0], logits.shape[2], dtype=torch.bool, device=needed.device)
            chosen = (
                chosen.float().scatter_add(1, logits.argmax(2).flatten(1), needed.float().repeat(1, 2)).bool()
            )
            count = chosen.shape[1] - primitives.shape[1]  # outputs of the layer before
            primitives |= chosen[:, count:]
            needed = chosen[:, :count].unflatten(1, (4, count // 4)).any(1) if count else chosen[:, :0]
        return primitives


def _combined(left: Tensor, right: Tensor, union_only: bool) -> Tensor:
    union = (left + right).clamp(0, 1)
    if union_only:
        return union
    return torch.cat(
        [union, (left + right - 1).clamp(0, 1), (left - right).clamp(0, 1), (right - left).clamp(0, 1)], 1
    )


class UCSG(nn.Module):
    """Points (b, n, 3) of shapes of diagonal 1 around the origin to a `SoftTree` of each; of more points than
    `config.points` the first are looked at."""

    def __init__(self, config: UCSGConfig):
        super().__init__()
        self.config = config
        code = config.widths[-1]
        self.encoder = DGCNN(config.feature, config.neighbours)
        self.decoder = decoder(config.feature, *config.widths)
        self.primitives = nn.ModuleList(PrimitiveHead(kind, code, config.each) for kind in (Box, Sphere))
        inputs = [2 * config.each] + [2 * config.each + 4 * config.nodes] * (config.layers - 1)
        nodes = [config.nodes] * (config.layers - 1) + [1]
        last = [k == config.layers - 1 for k in range(config.layers)]
        self.choose = nn.ModuleList(Choice(code, *sizes) for sizes in zip(inputs, nodes, last))
        self.first = nn.Parameter(torch.full((STATE,), 0.01))
        self.margin = nn.Parameter(torch.ones(()))
        self.temperatures = nn.Parameter(torch.full((config.layers,), MOST))

    def forward(self, points: Float[Tensor, "b n 3"], noise: torch.Generator | None = None) -> SoftTree:
        """noise: of the choices, on the CPU; None: there is none."""
        code = self.decoder(self.encoder(points[:, : self.config.points]))
        state, choices = self.first.expand(len(code), -1), []
        for choose in self.choose:
            logits, state = choose(code, state)
            choices.append(logits)
        drawn = None if noise is None else tuple(_gumbel(each, noise) for each in choices)
        return SoftTree(
            tuple(head(code) for head in self.primitives),
            tuple(choices),
            self.margin,
            self.temperatures,
            drawn,
        )


class Choice(nn.Module):
    """What a layer's nodes choose: (code, state) -> logits (b, 2, inputs, nodes), next state."""

    def __init__(self, code: int, inputs: int, nodes: int, last: bool):
        super().__init__()
        self.shape = (2, inputs, nodes)
        self.walk = nn.GRUCell(code, STATE)
        self.logits = nn.Linear(STATE, 2 * inputs * nodes)
        if last:  # nothing is chosen after it
            self.told = None
            return
        self.told = nn.Sequential(
            nn.Linear(2 * inputs * nodes, STATE), nn.LeakyReLU(0.01), nn.Linear(STATE, STATE)
        )

    def forward(self, code: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        state = self.walk(code, state)
        logits = self.logits(state).unflatten(1, self.shape)
        if self.told is not None:
            state = state + self.told(logits.softmax(2).flatten(1))
        return logits, state


def _gumbel(like: Tensor, noise: torch.Generator) -> Tensor:
    """Gumbel noise of the same shape."""
    drawn = torch.rand(like.shape, generator=noise).clamp(1e-9, 1 - 1e-7)
    return -(-drawn.log()).log().to(like)
