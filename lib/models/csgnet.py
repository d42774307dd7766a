"""CSGNet: a network that reads a picture, or a grid of voxels, and writes the CSG program that draws it.

    encoder    convolutions over the canvas; its output, flattened, is the feature of the shape
    decoder    a GRU. Before each token it sees the feature and the token before:
               ReLU(embedding) beside the feature -> GRU -> ReLU(linear) -> linear -> scores of all tokens

(Sharma et al. 2018, section 3 and Tables 6 to 9.) Plane and space differ by their config alone. The feature is the same
at every token, so its share of the GRU's input is computed once a shape: the same numbers as with the paper's
concatenation, at half to two thirds of the work. START, what comes before the first token, is the embedding after all
others.
"""

from dataclasses import dataclass
from itertools import chain

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from ..interpreters.checks import sizes
from ..interpreters.csg import vocabulary_of
from ..interpreters.csg.packing import SIDE

NORMS = ("none", "batch")


@dataclass(frozen=True)
class CSGNetConfig:
    """Sizes of the network. The defaults are the paper's in the plane (Tables 6 and 7): 31 million weights.

    dimensions  2 for the plane, 3 for space
    tokens      of the vocabulary, `$` included
    channels    of each convolution, the first one's first; after it comes ReLU
    kernels     their widths; strides: how far they move; pools: how many outputs along each side become one, by maximum
    norm        what comes after each convolution and pooling: "none", or "batch" (paper, in space)
    embedding, hidden   widths of what stands for a token, and of the GRU
    dropout     share of the values that are dropped in training: after convolutions, GRU and linear layer
    head        width of the layer between GRU and scores; None: that of the GRU (paper)
    Raises ValueError for lists of different lengths, sizes that are no whole numbers from 1, and canvases that
    do not divide.
    """

    dimensions: int = 2
    tokens: int = 400
    channels: tuple[int, ...] = (8, 16, 32)
    kernels: tuple[int, ...] = (3, 3, 3)
    strides: tuple[int, ...] = (1, 1, 1)
    pools: tuple[int, ...] = (2, 2, 2)
    norm: str = "none"
    embedding: int = 128
    hidden: int = 2048
    dropout: float = 0.2
    head: int | None = None

    def __post_init__(self) -> None:
        lists = (self.channels, self.kernels, self.strides, self.pools)
        if self.dimensions not in (2, 3) or len({*map(len, lists)}) != 1:
            raise ValueError(f"found {self}; expected 2 or 3 dimensions, and lists of one length")
        widths = (self.embedding, self.hidden, self.hidden if self.head is None else self.head)
        if not sizes(self.tokens, *widths, *chain(*lists)) or self.tokens < 5 or not self.channels:
            raise ValueError(f"found {self}; expected whole sizes of at least 1, and 5 tokens")
        if any(kernel < stride or (kernel - stride) % 2 and stride > 1 for kernel, stride in self.windows):
            raise ValueError(f"found {self}; expected kernels as wide as strides, or wider by an even number")
        if self.norm not in NORMS:
            raise ValueError(f"found the norm {self.norm!r}; expected one of {', '.join(NORMS)}")
        if not 0 <= self.dropout < 1:
            raise ValueError(f"found a dropout of {self.dropout}; expected a share below 1")
        _ = self.feature

    @property
    def windows(self) -> tuple[tuple[int, int], ...]:
        """Kernel and stride of each convolution."""
        return tuple(zip(self.kernels, self.strides))

    @property
    def feature(self) -> int:
        """How many numbers the encoder writes. Raises ValueError where strides and pools do not divide the canvas."""
        side = SIDE
        for shrinks in (*self.strides, *self.pools):
            if side % shrinks:
                raise ValueError(f"found {self}; expected strides and pools that divide {SIDE} pixels")
            side //= shrinks
        return self.channels[-1] * side**self.dimensions

    @classmethod
    def paper(cls, dimensions: int = 2) -> "CSGNetConfig":
        """The paper's sizes: Tables 6 and 7 for the plane, 8 and 9 for space.

        Raises ValueError for other dimensions than 2 and 3.
        """
        if _checked(dimensions) == 2:
            return cls()
        channels, ones, twos = (32, 64, 128, 256, 256), (1,) * 5, (2,) * 5
        return cls(3, 6635, channels, (4, 4, 3, 3, 3), ones, twos, "batch", hidden=1500)

    @classmethod
    def compact(cls, dimensions: int = 2) -> "CSGNetConfig":
        """Sizes that train on two cores: convolutions that stride instead of pooling, and a smaller GRU.

        Raises ValueError for other dimensions than 2 and 3.
        """
        if _checked(dimensions) == 2:
            channels, kernels, strides = (16, 32, 64, 64, 16), (4, 4, 4, 3, 1), (2, 2, 2, 1, 1)
            return cls(2, 400, channels, kernels, strides, (1,) * 5, "batch", 64, 768, 0.0, 256)
        # Blocks of 8 voxels at once, the grid on which shapes stand, and a wide GRU: with smaller windows and a GRU of
        # 224 as much time teaches less (200 s on one core: loss 3.9 instead of 3.5).
        channels, kernels, strides = (48, 128, 128, 16), (8, 2, 3, 1), (8, 2, 1, 1)
        return cls(3, 6635, channels, kernels, strides, (1,) * 4, "batch", 32, 512, 0.0, 256)


def _checked(dimensions: int) -> int:
    if dimensions not in (2, 3):
        raise ValueError(f"found {dimensions!r} dimensions; expected 2 or 3")
    return dimensions


@dataclass(frozen=True)
class State:
    """Where the decoder is, for each row of a batch: what the feature adds to the GRU's gates, and the GRU's state."""

    feature: Float[Tensor, "rows gates"]
    hidden: Float[Tensor, "rows hidden"]

    def __getitem__(self, rows: Int[Tensor, " some"]) -> "State":
        """Some of the rows, in another order, also repeated."""
        return State(self.feature[rows], self.hidden[rows])


class CSGNet(nn.Module):
    """Shapes in, scores of the next token out."""

    def __init__(self, config: CSGNetConfig = CSGNetConfig()):
        super().__init__()
        self.config = config
        self.encoder = _encoder(config)
        self.embedding = nn.Embedding(config.tokens + 1, config.embedding)
        self.gru = nn.GRUCell(config.feature + config.embedding, config.hidden)  # its weights; see `_advance`
        self.head = nn.Linear(config.hidden, config.head or config.hidden)
        self.scores = nn.Linear(self.head.out_features, config.tokens)
        self.dropout = nn.Dropout(config.dropout)

    @property
    def start(self) -> int:
        """What stands before the first token."""
        return self.config.tokens

    @property
    def stop(self) -> int:
        """The token `$`."""
        return self.config.tokens - 1

    def begin(self, canvases: Bool[Tensor, "rows *canvas"]) -> State:
        """Before the first token of each shape; canvases are images (64, 64) [y, x] or grids (64, 64, 64) [x, y, z].

        Raises ValueError for canvases of another shape or type.
        """
        expected = (SIDE,) * self.config.dimensions
        if not isinstance(canvases, Tensor) or canvases.dtype != torch.bool or canvases.shape[1:] != expected:
            kind = type(canvases).__name__
            found = (
                f"{str(canvases.dtype)[6:]} {tuple(canvases.shape)}" if kind == "Tensor" else f"as a {kind}"
            )
            raise ValueError(
                f"found canvases {found}; expected a bool tensor (n, {', '.join(map(str, expected))})"
            )
        weight = self.gru.weight_ih[:, : self.config.feature]
        kind = canvases.device.type
        # Straight to what convolutions compute with: by way of float32, a third of a training step went into copies.
        pixels_type = torch.get_autocast_dtype(kind) if torch.is_autocast_enabled(kind) else weight.dtype
        pixels = canvases.view(torch.uint8).unsqueeze(1).to(pixels_type)
        feature = nn.functional.linear(self.encoder(pixels).flatten(1), weight, self.gru.bias_ih)
        return State(feature, feature.new_zeros(len(canvases), self.config.hidden))

    def advance(
        self, state: State, before: Int[Tensor, "rows steps"]
    ) -> tuple[Float[Tensor, "rows steps tokens"], State]:
        """Scores (logits) of what comes after each of some tokens, and the state after the last.

        before  tokens 0 to START, at least one a row; their range is not checked, which would slow down small networks.
        Raises ValueError for other shapes.
        """
        steps = before.shape[1:]
        if len(before) != len(state.feature) or len(steps) != 1 or not steps[0]:
            found = f"tokens {tuple(before.shape)} for {len(state.feature)} shapes"
            raise ValueError(f"found {found}; expected as many rows, and one token or more in each")
        weight = self.gru.weight_ih[:, self.config.feature :]
        # A token's share of the gates: computed for each token of the vocabulary, or for each that is given, whichever
        # are fewer.
        if before.numel() > len(self.embedding.weight):
            inputs = nn.functional.linear(self.embedding.weight.relu(), weight)[before]
        else:
            inputs = nn.functional.linear(self.embedding(before).relu(), weight)
        hidden, states = state.hidden, []
        for each in inputs.unbind(1):
            hidden = self._advance(each + state.feature, hidden)
            states.append(hidden)
        seen = self.dropout(torch.stack(states, 1))
        return self.scores(self.dropout(self.head(seen).relu())), State(state.feature, hidden)

    def _advance(self, inputs: Float[Tensor, "rows gates"], hidden: Tensor) -> Float[Tensor, "rows hidden"]:
        """One step of the GRU (torch.nn.GRUCell gives its formula), whose inputs were multiplied before."""
        memory = nn.functional.linear(hidden, self.gru.weight_hh, self.gru.bias_hh)
        size = self.config.hidden
        reset, update = (inputs[:, : 2 * size] + memory[:, : 2 * size]).sigmoid().chunk(2, 1)
        new = torch.addcmul(inputs[:, 2 * size :], reset, memory[:, 2 * size :]).tanh()
        return torch.lerp(new, hidden, update)

    def forward(
        self, canvases: Bool[Tensor, "rows *canvas"], tokens: Int[Tensor, "rows steps"]
    ) -> Float[Tensor, "rows steps tokens"]:
        """Scores of every token of known programs, each given those before it (teacher forcing).

        Raises ValueError as `begin` and `advance` do, and for what are no tokens.
        """
        if tokens.numel() and not 0 <= tokens.min() <= tokens.max() <= self.stop:
            raise ValueError(f"found tokens {tokens.min()} to {tokens.max()}; expected 0 to {self.stop}")
        before = torch.cat([torch.full_like(tokens[:, :1], self.start), tokens[:, :-1]], 1)
        return self.advance(self.begin(canvases), before)[0]


def _encoder(config: CSGNetConfig) -> nn.Sequential:
    """Convolution, ReLU, dropout, pooling and norm, as often as there are channels; in space pooling before dropout.

    So they stand in Tables 6 and 8.
    """
    plane = config.dimensions == 2
    convolution, pooling, batch_norm = (
        (nn.Conv2d, nn.MaxPool2d, nn.BatchNorm2d) if plane else (nn.Conv3d, nn.MaxPool3d, nn.BatchNorm3d)
    )
    norms = {"none": nn.Identity, "batch": batch_norm}
    layers: list[nn.Module] = []
    inner = 1
    for channels, (kernel, stride), pool in zip(config.channels, config.windows, config.pools):
        padding = "same" if stride == 1 else (kernel - stride) // 2
        layers += [convolution(inner, channels, kernel, stride, padding), nn.ReLU()]
        reduced = [pooling(pool)] if pool > 1 else []
        dropped = [nn.Dropout(config.dropout)] if config.dropout else []
        layers += dropped + reduced if plane else reduced + dropped
        layers += [norms[config.norm](channels)]
        inner = channels
    return nn.Sequential(*layers)


def check_reader(network: CSGNet, dimensions: int) -> None:
    """Raises ValueError for a network of other dimensions, or with another vocabulary than that of the language."""
    found, tokens = network.config, len(vocabulary_of(dimensions))
    if (found.dimensions, found.tokens) != (dimensions, tokens):
        spaces = {2: "the plane", 3: "space"}
        raise ValueError(
            f"found a network of {spaces[found.dimensions]} with {found.tokens} tokens; "
            f"expected one of {spaces[dimensions]} with {tokens}"
        )
