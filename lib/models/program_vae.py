"""The program VAE: a network that reads and writes hierarchical ShapeAssembly programs (paper, section 6.1, Figure 6).

    encoder, from the innermost blocks to the root
        line -> MLP -> GRU over the lines of a block; its last state is the code of the block. The line that declares a
        cuboid which another block fills is replaced by the code of that block.
        root code -> mu, log variance;  latent = mu + exp(log variance / 2) noise

    decoder, from the root to the innermost blocks
        the code of a block is the GRU's first state. Previous line -> MLP -> GRU -> line decoder -> next line.
        A cuboid that is to be filled gets a code, from the GRU's state at its line and the code of its own block.

Sizes and the order of fields are those of the authors' program. All nodes of a level are computed together, whichever
program they belong to: the authors' network sees one program at a time.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.utils.rnn import PackedSequence

from .program_lines import COMMANDS, FIELD, MAX_CUBOIDS, WIDTH, WIDTHS
from .program_table import Level

DEPTHS = 3  # the one-hot of a level: 0, 1, and everything deeper


@dataclass(frozen=True)
class ProgramVAEConfig:
    """Sizes of the network. The defaults are the paper's: 2.1 million weights.

    hidden  width of the GRUs, of block codes and of the large MLPs
    head    width of the first layer of the small MLPs; the second has half of it
    slope   of the leaky ReLU
    """

    hidden: int = 256
    head: int = 128
    slope: float = 0.2


@dataclass(frozen=True)
class Posterior:
    """Where the encoder believes each program's latent code to be: a normal distribution per coordinate."""

    mean: Float[Tensor, "programs latent"]
    log_variance: Float[Tensor, "programs latent"]

    def at(self, noise: Float[Tensor, "programs latent"]) -> Float[Tensor, "programs latent"]:
        """The code that standard normal `noise` leads to."""
        return self.mean + (self.log_variance / 2).exp() * noise


@dataclass(frozen=True)
class Predictions:
    """What the decoder says of every line of a batch, given the lines before it (teacher forcing).

    state    (lines, hidden) GRU outputs, level by level
    code     (lines, hidden) the code of the block that a line is in
    size     (lines, 3) the bounding box of that block, world units
    targets  (lines, 63) what should have been written
    leaf     (lines,) 0 where the target declares a cuboid that another block fills, else 1
    root     (programs, 3) predicted sides of each program's bounding box, world units
    """

    state: Float[Tensor, "lines hidden"]
    code: Float[Tensor, "lines hidden"]
    size: Float[Tensor, "lines 3"]
    targets: Float[Tensor, "lines 63"]
    leaf: Float[Tensor, " lines"]
    root: Float[Tensor, "programs 3"]


def mlp(*widths: int, slope: float) -> nn.Sequential:
    """Linear layers with leaky ReLU between them, none after the last (paper, section 6.2)."""
    layers: list[nn.Module] = []
    for inner, outer in zip(widths, widths[1:]):
        layers += [nn.Linear(inner, outer), nn.LeakyReLU(slope)]
    return nn.Sequential(*layers[:-1])


class LineDecoder(nn.Module):
    """State of the GRU -> one line, by small MLPs; each is told what was already decided about the line."""

    def __init__(self, config: ProgramVAEConfig):
        super().__init__()
        hidden, head = config.hidden, config.head

        def small(extra: int, width: int) -> nn.Sequential:
            return mlp(hidden + extra, head, head // 2, width, slope=config.slope)

        self._command = small(0, len(COMMANDS))
        self._cuboids = small(len(COMMANDS), 3 * MAX_CUBOIDS)
        self._size = small(3, 3)
        self._aligned = small(3, 1)
        self._attach = mlp(hidden + 2 * MAX_CUBOIDS, hidden, hidden, 6, slope=config.slope)
        self._squeeze = small(3 * MAX_CUBOIDS, WIDTHS["face"] + WIDTHS["uv"])
        self._symmetry = small(MAX_CUBOIDS + 3, WIDTHS["axis"] + 2)
        self._leaf = mlp(2 * hidden, head, head // 4, 1, slope=config.slope)
        self._child = mlp(2 * hidden, hidden, hidden, hidden, slope=config.slope)

    def command(self, state: Float[Tensor, "n hidden"]) -> Float[Tensor, "n 7"]:
        """Logits of COMMANDS."""
        return self._command(state)

    def cuboids(
        self, state: Float[Tensor, "n hidden"], command: Float[Tensor, "n 7"]
    ) -> Float[Tensor, "n 3 11"]:
        """Logits of the first, second and third cuboid, given the one-hot command."""
        return self._cuboids(torch.cat([state, command], -1)).unflatten(-1, (3, MAX_CUBOIDS))

    def size(
        self, state: Float[Tensor, "n hidden"], size: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n 3"], Float[Tensor, " n"]]:
        """Sides of a cuboid, world units, and the logit of its being aligned; given those of its bounding box."""
        given = torch.cat([state, size], -1)
        return self._size(given), self._aligned(given).squeeze(-1)

    def attach(
        self, state: Float[Tensor, "n hidden"], cuboids: Float[Tensor, "n 3 11"]
    ) -> Float[Tensor, "n 6"]:
        """The two points of an attach, given one-hots of its cuboids (the third is not used)."""
        return self._attach(torch.cat([state, cuboids[:, :2].flatten(1)], -1))

    def squeeze(
        self, state: Float[Tensor, "n hidden"], cuboids: Float[Tensor, "n 3 11"]
    ) -> tuple[Float[Tensor, "n 6"], Float[Tensor, "n 2"]]:
        """Logits of the face, and (u, v), given one-hots of the three cuboids."""
        found = self._squeeze(torch.cat([state, cuboids.flatten(1)], -1))
        return found[:, : WIDTHS["face"]], found[:, WIDTHS["face"] :]

    def symmetry(
        self,
        state: Float[Tensor, "n hidden"],
        cuboids: Float[Tensor, "n 3 11"],
        size: Float[Tensor, "n 3"],
    ) -> tuple[Float[Tensor, "n 3"], Float[Tensor, " n"], Float[Tensor, " n"]]:
        """Logits of the axis, number of copies and distance, given the one-hot first cuboid and the bounding box."""
        found = self._symmetry(torch.cat([state, cuboids[:, 0], size], -1))
        return found[:, : WIDTHS["axis"]], found[:, -2], found[:, -1]

    def leaf(self, state: Float[Tensor, "n hidden"], code: Float[Tensor, "n hidden"]) -> Float[Tensor, " n"]:
        """Logit of a cuboid's being a leaf, given the code of its block."""
        return self._leaf(torch.cat([state, code], -1)).squeeze(-1)

    def child(
        self, state: Float[Tensor, "n hidden"], code: Float[Tensor, "n hidden"]
    ) -> Float[Tensor, "n hidden"]:
        """The code of the block that fills a cuboid, given the code of its own block."""
        return self._child(torch.cat([state, code], -1))


class ProgramVAE(nn.Module):
    """Encoder and decoder. `forward` is for training; `lib.models.writing` lets the decoder write."""

    def __init__(self, config: ProgramVAEConfig = ProgramVAEConfig()):  # noqa: B008 - it is frozen
        super().__init__()
        self.config = config
        hidden, slope = config.hidden, config.slope
        self.read_line = mlp(WIDTH, hidden, hidden, hidden, slope=slope)
        self.reader = nn.GRU(hidden, hidden)
        self.first_state = nn.Parameter(torch.randn(hidden) * 0.1)
        self.summary = nn.Linear(hidden, hidden)
        self.mean = nn.Linear(hidden, hidden)
        self.log_variance = nn.Linear(hidden, hidden)
        self.previous_line = mlp(WIDTH + 3 + DEPTHS, hidden, hidden, hidden, slope=slope)
        self.writer = nn.GRU(hidden, hidden)
        self.line = LineDecoder(config)
        self.root_size = mlp(hidden, hidden, hidden, 3, slope=slope)

    def encode(self, levels: list[Level]) -> Posterior:
        """A batch of programs -> their latent codes, as distributions; programs in the batch's order."""
        codes, above = None, None
        for level in reversed(levels):
            rows = self.read_line(level.lines)
            if codes is not None:
                rows = rows.index_copy(0, above, codes)
            start = self.first_state.expand(1, len(level.size), -1).contiguous()
            _, last = self.reader(PackedSequence(rows, level.steps), start)
            codes, above = last[0], level.filled
        # The longest node stands first; programs are wanted in their own order.
        codes = torch.empty_like(codes).index_copy(0, levels[0].program, codes)
        summary = self.summary(codes).relu()
        return Posterior(self.mean(summary), self.log_variance(summary))

    def decode(self, latent: Float[Tensor, "programs latent"], levels: list[Level]) -> Predictions:
        """What the decoder would write after each line of the given programs."""
        code = latent[levels[0].program]
        parts = []
        for level, below in zip(levels, [*levels[1:], None]):
            node = level.node[level.inputs]
            rows = self.read_previous(level.lines[level.inputs], level.size[node], level.depth)
            state, _ = self.writer(PackedSequence(rows, level.steps[1:]), code[None])
            own, leaf = code[node], torch.ones_like(rows[:, 0])
            if below is not None:
                at = below.filled - len(level.size)  # rows of `lines` -> rows of `targets`
                code = self.line.child(state.data[at], own[at])
                leaf[at] = 0
            parts.append((state.data, own, level.size[node], level.targets, leaf))
        state, code, size, targets, leaf = (torch.cat(part) for part in zip(*parts))
        return Predictions(state, code, size, targets, leaf, self.root_size(latent))

    def read_previous(
        self, lines: Float[Tensor, "n 63"], size: Float[Tensor, "n 3"], depth: int
    ) -> Float[Tensor, "n hidden"]:
        """The writer's input: the previous line, its block's bounding box and the level of the block."""
        level = lines.new_zeros(len(lines), DEPTHS)
        level[:, min(depth, DEPTHS - 1)] = 1
        return self.previous_line(torch.cat([lines, size, level], -1))

    def forward(
        self, levels: list[Level], noise: Float[Tensor, "programs latent"]
    ) -> tuple[Posterior, Predictions]:
        """Reads programs and predicts them again, through latent codes that `noise` picks."""
        posterior = self.encode(levels)
        return posterior, self.decode(posterior.at(noise), levels)


def one_hot_fields(lines: Float[Tensor, "n 63"]) -> Float[Tensor, "n 3 11"]:
    """The first, second and third cuboid of each line."""
    return torch.stack([lines[:, FIELD[name]] for name in ("first", "second", "third")], 1)
