"""CSG-Stump Net: a cloud of points in, a stump out, learned without any program (Ren et al. 2021, "CSG-Stump Net").

    encoder      DGCNN: points -> feature
    decoder      linear layers: feature -> code
    primitives   code -> sizes, translation and rotation of K primitives, as many of each kind
    connections  code -> logits of W_C (K), W_I (K, C) and W_U (C)

A linear layer from the code to all K C logits of W_I is the paper's (head "linear"): at K = C = 256 it alone has 134
million weights. The default ("low_rank") gives each primitive and each node a learned embedding, p_k and n_c, and lets
the code weigh the products of their numbers:

    logit_kc = sum_d p_kd g_d(code) n_cd

Outputs are scaled to shapes of diagonal 1 around the origin, and a new network begins with something sensible: small
primitives all over the place, node c that selects primitive c, and a union of all nodes. Where primitive c has no end,
the node selects one of those that have, too: a cylinder is cut by a box. With the head "own" node c is primitive c for
ever: boxes alone are then a rival in the manner of volumetric primitives (Tulsiani et al. 2017), and superquadrics
another (Paschalidou et al. 2019). Of these papers they have the primitives and their union; loss and training are those
of this network, so that what differs are the layers, and none has its paper's probability that a primitive exists.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ..interpreters.checks import sizes
from ..interpreters.stump import KINDS, Primitive
from .dgcnn import DGCNN
from .soft_stump import SoftStump
from .superquadrics import Superquadric

SOLID = ("box", "cylinder", "sphere", "cone")
MADE_OF = {name: KINDS[name] for name in SOLID} | {"superquadric": Superquadric}
ENDLESS = ("cylinder", "cone")
HEADS = ("low_rank", "linear", "own")
CODE_SLOPE = 0.01  # of the decoder's leaky ReLU
REACH = 0.5  # translations and sizes lie within
STEEPEST = 2.0  # slope of a cone
SHARPEST, ROUNDEST = 0.2, 1.6  # exponents of a superquadric: from 0.2 to 1.8, at first 0.63
ON, OFF = 3.0, -3.0  # logits of connections at first: 0.95 and 0.05


@dataclass(frozen=True)
class StumpNetConfig:
    """Sizes of the network; the defaults are the paper's, but for the head.

    primitives, nodes   K and C
    kinds       of primitives; there are as many of each, in this order
    head        "low_rank", "linear" or "own", see above; rank: numbers of an embedding
    feature, widths     of the encoder's output, and of the decoder's layers, the code last
    neighbours  of a point, for the encoder, see DGCNN
    points      of a cloud that are looked at, the first ones: how near neighbours are depends on it
    complement  False: no primitive is complemented, as in the authors' program
    Raises ValueError for other heads and kinds, sizes below 1, K that the kinds do not divide, and for the head "own"
    with another C than K.
    """

    primitives: int = 256
    nodes: int = 256
    kinds: tuple[str, ...] = SOLID
    head: str = "low_rank"
    rank: int = 256
    feature: int = 256
    widths: tuple[int, ...] = (512, 1024, 2048)
    neighbours: int = 20
    complement: bool = True
    points: int = 2048

    def __post_init__(self) -> None:
        if self.head not in HEADS:
            raise ValueError(f"found the head {self.head!r}; expected one of {', '.join(HEADS)}")
        if not self.kinds or not set(self.kinds) <= MADE_OF.keys():
            raise ValueError(f"found the kinds {self.kinds}; expected some of {', '.join(MADE_OF)}")
        numbers = (self.primitives, self.nodes, self.rank, self.feature, self.points, self.neighbours)
        if not sizes(*numbers, *self.widths) or not self.widths:
            raise ValueError(f"found {self}; expected whole sizes of at least 1, and one width or more")
        if self.primitives % len(self.kinds) or self.head == "own" and self.nodes != self.primitives:
            found = f"{self.primitives} primitives of {len(self.kinds)} kinds, {self.nodes} nodes, head {self.head!r}"
            raise ValueError(
                f"found {found}; expected as many of each kind, and with the head 'own' as many nodes"
            )

    @staticmethod
    def compact(primitives: int = 64, nodes: int = 64, **others) -> "StumpNetConfig":
        """A network that two cores can train; `others` are fields by name."""
        small = {"rank": 128, "widths": (256, 512), "neighbours": 8, "points": 256}
        return StumpNetConfig(primitives, nodes, **small | others)


class StumpNet(nn.Module):
    """Points (b, n, 3) of shapes of diagonal 1 around the origin, in any order, to a `SoftStump` of each.

    Of more points than `config.points` the first are looked at; with fewer answers are worse.
    """

    def __init__(self, config: StumpNetConfig):
        super().__init__()
        self.config = config
        self.encoder = DGCNN(config.feature, config.neighbours)
        self.decoder = decoder(config.feature, *config.widths)
        code = config.widths[-1]
        each = config.primitives // len(config.kinds)
        self.primitives = nn.ModuleList(PrimitiveHead(MADE_OF[kind], code, each) for kind in config.kinds)
        self.to_complement = _quiet(code, config.primitives, OFF) if config.complement else None
        self.to_intersection = _connections(config)
        self.to_union = _quiet(code, config.nodes, ON)
        self.register_buffer("first", first_selection(config), persistent=False)

    def forward(self, points: Float[Tensor, "b n 3"]) -> SoftStump:
        """What the network says of each cloud."""
        code = self.decoder(self.encoder(points[:, : self.config.points]))
        primitives = tuple(head(code) for head in self.primitives)
        if self.to_complement is None:
            complement = code.new_full((len(code), self.config.primitives), -torch.inf)
        else:
            complement = self.to_complement(code)
        intersection = self.first.expand(len(code), -1, -1)
        if self.to_intersection is not None:
            intersection = intersection + self.to_intersection(code)
        return SoftStump(primitives, complement, intersection, self.to_union(code))


class PrimitiveHead(nn.Module):
    """A code (b, code) to (b, count) primitives of one kind."""

    def __init__(self, kind: type[Primitive], code: int, count: int):
        super().__init__()
        self.kind, self.count = kind, count
        self.widths = {
            "rotation": 4,
            "translation": 3,
            **{n: w for n, w in kind.counts.items() if n != "height"},
        }
        self.numbers = _quiet(code, count * sum(self.widths.values()))
        with torch.no_grad():
            bias = self.numbers.bias.view(count, -1)
            bias[:, :4] = _turns(count) if kind.name in ENDLESS else torch.tensor([1.0, 0, 0, 0])
            bias[:, 4:7].uniform_(-1, 1)

    def forward(self, code: Float[Tensor, "b code"]) -> Primitive:
        numbers = self.numbers(code).view(len(code), self.count, -1).split(list(self.widths.values()), -1)
        given = dict(zip(self.widths, numbers))
        return self.kind(**{name: self._scaled(name, value) for name, value in given.items()})

    def _scaled(self, name: str, value: Float[Tensor, "b count k"]) -> Tensor:
        if name == "rotation":
            return value
        if name == "translation":
            return REACH * value.tanh()
        if name == "exponents":
            return ROUNDEST * torch.sigmoid(value - 1) + SHARPEST
        most = STEEPEST if name == "slope" else REACH
        value = most * torch.sigmoid(value - 1.5)  # 0.18 of the most at first
        return value if self.kind.counts[name] > 1 else value.squeeze(-1)


class LowRank(nn.Module):
    """A code (b, code) to logits (b, K, C): a weighted sum of `rank` products of embeddings."""

    def __init__(self, code: int, primitives: int, nodes: int, rank: int):
        super().__init__()
        scale = rank**-0.25  # of both: logits begin as large as the code's weights, whatever the rank
        self.of_primitives = nn.Parameter(scale * torch.randn(primitives, rank))
        self.of_nodes = nn.Parameter(scale * torch.randn(nodes, rank))
        self.weights = _quiet(code, rank)

    def forward(self, code: Float[Tensor, "b code"]) -> Float[Tensor, "b K C"]:
        return (self.of_primitives * self.weights(code).unsqueeze(1)) @ self.of_nodes.T


def first_selection(config: StumpNetConfig) -> Float[Tensor, "K C"]:
    """Logits of W_I that a new network begins with, see above; with the head "own" it keeps them."""
    nodes = torch.arange(config.nodes)
    own, each = nodes % config.primitives, config.primitives // len(config.kinds)
    kind, place = own // each, own % each
    on, off = (torch.inf, -torch.inf) if config.head == "own" else (ON, OFF)
    first = torch.full((config.primitives, config.nodes), off)
    first[own, nodes] = on
    bounded = [k for k, name in enumerate(config.kinds) if name not in ENDLESS]
    if config.head != "own" and bounded:
        endless = torch.tensor([name in ENDLESS for name in config.kinds])[kind]
        first[torch.where(endless, bounded[0] * each + place, own), nodes] = on
    return first


def _connections(config: StumpNetConfig) -> nn.Module | None:
    if config.head == "own":
        return None
    code, shape = config.widths[-1], (config.primitives, config.nodes)
    if config.head == "low_rank":
        return LowRank(code, *shape, config.rank)
    return nn.Sequential(_quiet(code, config.primitives * config.nodes), nn.Unflatten(1, shape))


def decoder(*widths: int) -> nn.Sequential:
    """Linear layers and leaky ReLUs from each width to the next, as the authors begin them."""
    layers = []
    for wide, next_wide in zip(widths, widths[1:]):
        layers += [nn.Linear(wide, next_wide), nn.LeakyReLU(CODE_SLOPE)]
        nn.init.xavier_normal_(layers[-2].weight)
        nn.init.zeros_(layers[-2].bias)
    return nn.Sequential(*layers)


def _quiet(wide: int, outputs: int, bias: float = 0.0) -> nn.Linear:
    """A linear layer whose outputs are near its bias at first."""
    layer = nn.Linear(wide, outputs)
    nn.init.normal_(layer.weight, std=0.1 / wide**0.5)
    nn.init.constant_(layer.bias, bias)
    return layer


def _turns(count: int) -> Float[Tensor, "count 4"]:
    """Rotations that lay the z axis along z, y, x, -z, … in turn."""
    half = 0.5**0.5
    turns = torch.tensor([[1, 0, 0, 0], [half, half, 0, 0], [half, 0, half, 0], [0, 1, 0, 0], [half, -half, 0, 0],
                          [half, 0, -half, 0]])  # fmt: skip
    return turns[torch.arange(count) % len(turns)]
