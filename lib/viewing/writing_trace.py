"""How the network writes the outermost block of a program, line by line: what it wants, what the rules allow it.

steps = root_block(network, code)      every line, those that were tried and left out included
commands_figure(steps)                 a row a line, a column a command: probability, and what is forbidden
pairs_figure(steps[4])                 of one attach, all pairs of cuboids: score, and what is forbidden
"""

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib.pyplot as plt
import torch
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from torch import Tensor

from lib.models.program_lines import COMMAND, COMMANDS, FIELD, statement_of
from lib.models.program_vae import ProgramVAE
from lib.models.writing_level import LevelWriter
from lib.models.writing_line import SMALLEST, LineWriter
from lib.models.writing_rules import Rules
from lib.models.written_blocks import NAMES, Node

INK, WANTED, TAKEN = "#1b1f27", "#d62839", "#1b7f4d"


@dataclass(frozen=True)
class Step:
    """One line: logits are what the network says, before any rule.

    commands, allowed      (7,) logits of COMMANDS, and which of them the rules allow
    pairs, allowed_pairs   (declared, declared) [moved, still]: logit of moved + logit of still, were it an attach
    taken                  number of the command that was written
    pair                   the pair that was written, of an attach; else None
    text                   the line, or its command where it has no more
    valid                  whether its cuboids stay within the bounding box
    """

    commands: Float[Tensor, "7"]
    allowed: Bool[Tensor, "7"]
    pairs: Float[Tensor, "declared declared"]
    allowed_pairs: Bool[Tensor, "declared declared"]
    taken: int
    pair: tuple[int, int] | None
    text: str
    valid: bool

    @property
    def wanted(self) -> int:
        """The command that the network would have written without rules."""
        return int(self.commands.argmax())

    @property
    def wanted_pair(self) -> tuple[int, int]:
        """The pair (moved, still) that it would have attached."""
        return divmod(int(self.pairs.argmax()), len(self.pairs))

    @property
    def overruled(self) -> str:
        """What the rules forbade: "command", "pair", or ""."""
        if self.wanted != self.taken:
            return "command"
        return "pair" if self.pair is not None and self.pair != self.wanted_pair else ""


class _Tracer(LevelWriter):
    """Takes notes while it writes one block."""

    def _settle(self, lines: Tensor, state: Tensor) -> None:
        before, line = self.states[torch.tensor([0])], lines[0]
        declared = int(before.declared[0])
        logits = self.network.line.cuboids(state, one_hot_attach(state))[0]
        pairs = (logits[0, :, None] + logits[1, None, :])[:declared, :declared]
        super()._settle(lines, state)
        taken = int(line[FIELD["command"]].argmax())
        ended = COMMANDS[taken] in ("start", "end")
        statement = None if ended else statement_of(line, NAMES)
        attach = COMMANDS[taken] == "attach"
        pair = tuple(int(line[FIELD[role]].argmax()) for role in ("first", "second")) if attach else None
        valid = ended or statement in self.nodes[0].statements[-1:]
        text = COMMANDS[taken] if statement is None else _short(statement.to_text())
        allowed = before.commands()[0], before.pairs()[0, :declared, :declared]
        commands = self.network.line.command(state)[0]
        self.steps.append(Step(commands, allowed[0], pairs, allowed[1], taken, pair, text, valid))


def one_hot_attach(state: Float[Tensor, "n hidden"]) -> Float[Tensor, "n 7"]:
    """The command "attach", for each row of `state`."""
    command = state.new_zeros(len(state), len(COMMANDS))
    command[:, COMMAND["attach"]] = 1
    return command


@torch.no_grad()
def root_block(network: ProgramVAE, code: Float[Tensor, " latent"], rules: Rules | None = None) -> list[Step]:
    """The lines of the outermost block that a code leads to; a line that leaves the bounding box is left out."""
    size = network.root_size(code[None]).clamp(min=SMALLEST)
    line = LineWriter(network.line, rules or Rules())
    tracer = _Tracer(network, [Node(0)], code[None], size, 0, "skip", line, [""])
    tracer.steps = []
    tracer.run()
    return tracer.steps


def commands_figure(steps: Sequence[Step], width: float = 8.0) -> Figure:
    """Probabilities of the commands; a cross: forbidden. A red ring: what the network wanted, a green dot: taken."""
    figure, ax = plt.subplots(figsize=(width, 1.0 + 0.24 * len(steps)), dpi=100)
    plt.close(figure)
    names = [step.text if step.valid else f"left out: {step.text}" for step in steps]
    _grid(ax, torch.stack([s.commands for s in steps]).softmax(-1), torch.stack([s.allowed for s in steps]))
    for row, step in enumerate(steps):
        _mark(ax, (row, step.wanted), (row, step.taken))
    ax.set_yticks(range(len(steps)), names, fontsize=7, family="monospace")
    ax.set_xticks(range(len(COMMANDS)), COMMANDS, fontsize=8)
    return _finished(figure, ax)


def pairs_figure(step: Step, width: float = 3.6) -> Figure:
    """All pairs of an attach: dark is a high score; marks as in `commands_figure`.

    Raises ValueError for other lines.
    """
    if step.pair is None:
        raise ValueError(f"the line is {step.text!r}; expected an attach")
    figure, ax = plt.subplots(figsize=(width, width), dpi=100)
    plt.close(figure)
    low, high = step.pairs.min(), step.pairs.max()
    _grid(ax, (step.pairs - low) / (high - low).clamp(min=1e-9), step.allowed_pairs)
    _mark(ax, step.wanted_pair, step.pair)
    names = NAMES[: len(step.pairs)]
    ax.set_yticks(range(len(names)), names, fontsize=8)
    ax.set_xticks(range(len(names)), names, fontsize=8, rotation=60, ha="left", rotation_mode="anchor")
    ax.set_ylabel("moved", fontsize=9)
    ax.set_title("still", fontsize=9)
    return _finished(figure, ax)


def _grid(ax: Axes, values: Float[Tensor, "rows columns"], allowed: Bool[Tensor, "rows columns"]) -> None:
    ax.imshow(values.numpy(), cmap="Blues", vmin=0, vmax=1.2, aspect="auto", interpolation="nearest")
    for row, column in (~allowed).nonzero().tolist():
        color = "#ffffff" if values[row, column] > 0.6 else "#6b7484"
        ax.plot(column, row, "x", color=color, markersize=5, markeredgewidth=1.0)


def _mark(ax: Axes, wanted: tuple[int, int], taken: tuple[int, int]) -> None:
    """Places are (row, column)."""
    ring = {"markersize": 9, "markerfacecolor": "none", "markeredgewidth": 1.5}
    ax.plot(wanted[1], wanted[0], "o", color=WANTED, **ring)
    ax.plot(taken[1], taken[0], "o", color=TAKEN, markersize=4, markeredgecolor="white", markeredgewidth=0.6)


def _finished(figure: Figure, ax: Axes) -> Figure:
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    ax.spines[:].set_color("#aab2c0")
    figure.tight_layout()
    return figure


def _short(text: str) -> str:
    """A line with its numbers rounded to two decimals: six would not fit."""
    head, _, rest = text.partition("(")
    words = (word.rstrip(")") for word in rest.split(", "))
    return f"{head}({', '.join(f'{float(word):.2f}' if '.' in word else word for word in words)})"
