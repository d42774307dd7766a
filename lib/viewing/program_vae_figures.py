"""How the program VAE sees programs: lines as rows of numbers, a batch level by level, codes along the tree of blocks.

lines_figure(block)                        the matrix of a block: a row a line, the 63 columns by name
levels_figure(levels)                      a batch as it is packed: a row a node, a column a step
flow_figure(program, up, latent, down)     codes on their way up through the encoder and down through the decoder
"""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from torch import Tensor

from lib.interpreters.shapeassembly import Block, Cuboid, Program
from lib.models.program_lines import COMMANDS, FIELD, WIDTH, block_lines
from lib.models.program_table import Level

COMMAND_COLORS = dict(
    zip(COMMANDS, ("#c9ced8", "#5e8bba", "#e28f4f", "#9379b8", "#c2679a", "#70ad77", "#7b8494"))
)
INK, LINK = "#1b1f27", "#d62839"
SHOWN = 12  # numbers of a code in a picture
ROW, STRIP = 3.4, 5.0  # of `flow_figure`: from one level to the next, width of a code; a line is 1 wide


def lines_figure(block: Block, width: float = 11.0) -> Figure:
    """A row a line, a column a number: ones and numbers are dark, zeros white; fields are set apart by lines."""
    matrix = np.array(block_lines(block))
    figure, ax = plt.subplots(figsize=(width, 1.1 + 0.2 * len(matrix)), dpi=100)
    plt.close(figure)
    ax.imshow(matrix.clip(0, 1), cmap="Blues", vmin=0, vmax=1.25, aspect="auto", interpolation="nearest")
    ax.set_yticks(range(len(matrix)), [s.to_text() for s in block.statements], fontsize=7, family="monospace")
    for where in FIELD.values():
        ax.axvline(where.start - 0.5, color="#aab2c0", linewidth=0.8)
    middles = [(where.start + where.stop - 1) / 2 for where in FIELD.values()]
    ax.set_xticks(middles, FIELD, rotation=90, fontsize=7)
    ax.xaxis.tick_top()
    ax.set_xlim(-0.5, WIDTH - 0.5)
    ax.tick_params(length=0)
    ax.spines[:].set_color("#aab2c0")
    figure.tight_layout()
    return figure


def levels_figure(levels: Sequence[Level], width: float = 9.0) -> Figure:
    """A panel a level: rows are its nodes, the longest first; each cell is a line, coloured by its command."""
    heights = [len(level.size) for level in levels]
    figure, axes = plt.subplots(
        len(levels), 1, figsize=(width, 0.8 + 0.6 * len(levels) + 0.22 * sum(heights)), dpi=100, squeeze=False,
        height_ratios=heights, sharex=True, layout="constrained",
    )  # fmt: skip
    plt.close(figure)
    for ax, level in zip(axes[:, 0], levels):
        _draw_level(ax, level, max(len(level.steps) for level in levels))
    axes[-1, 0].set_xlabel("step", fontsize=9)
    handles = [Patch(color=color, label=name) for name, color in COMMAND_COLORS.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False, fontsize=8)
    return figure


def _draw_level(ax: Axes, level: Level, longest: int) -> None:
    steps = np.repeat(np.arange(len(level.steps)), level.steps)
    commands = level.lines[:, FIELD["command"]].argmax(-1).tolist()
    for step, node, command in zip(steps, level.node.tolist(), commands):
        cell = Rectangle((step - 0.46, node - 0.44), 0.92, 0.88, color=COMMAND_COLORS[COMMANDS[command]])
        ax.add_patch(cell)
    names = [f"program {program}" for program in level.program.tolist()]
    ax.set_yticks(range(len(names)), names, fontsize=8)
    ax.set(xlim=(-0.6, longest - 0.4), ylim=(len(names) - 0.4, -0.6))
    ax.set_title(f"level {level.depth}", loc="left", fontsize=9)
    ax.tick_params(length=0, labelsize=8)
    ax.spines[:].set_visible(False)


Codes = Mapping[str, Float[Tensor, " hidden"]]  # block name -> its code


def flow_figure(program: Program, up: Codes, latent: Float[Tensor, " latent"], down: Codes) -> Figure:
    """Left the encoder, right the decoder: each block is a row of lines, each code a strip of its first numbers.

    The codes of inner blocks go to, or come from, the line that declares the cuboid which they fill. A strip's colours
    go as far as its largest number.
    """
    blocks = {block.name: block for block in program.blocks}
    places = _places(program)
    span = max(x + len(blocks[name].statements) + 2 for name, (x, _) in places.items()) + STRIP + 1.5
    depth = max(level for _, level in places.values())
    figure, ax = plt.subplots(figsize=(12, 1.3 + 1.0 * (depth + 1)), dpi=100)
    plt.close(figure)
    gap = STRIP + 3.0  # the latent code stands between the two halves
    for side, codes, start in (("encoder", up, 0.0), ("decoder", down, span + gap)):
        ax.text(start, 1.7, side, fontsize=11, color=INK, weight="bold")
        for name, (x, level) in places.items():
            _draw_block(ax, blocks[name], start + x, -ROW * level, codes[name], side, blocks)
        _draw_links(ax, blocks, places, start, side)
    _draw_code(ax, span + 1.2, 0.0, latent, "latent code")
    root_end = len(program.blocks[0].statements) + 2 + 0.6 + STRIP
    _draw_arrow(ax, (root_end + 0.2, 0.5), (span + 1.1, 0.5))
    _draw_arrow(ax, (span + 1.3 + STRIP, 0.5), (span + gap - 0.1, 0.5))
    ax.set(xlim=(-0.5, 2 * span + gap), ylim=(-ROW * depth - 2.0, 2.6))
    ax.axis("off")
    handles = [Patch(color=color, label=command) for command, color in COMMAND_COLORS.items()]
    ax.legend(
        handles=handles, loc="lower center", bbox_to_anchor=(0.5, -0.06), ncols=7, frameon=False, fontsize=8
    )
    figure.tight_layout()
    return figure


def _children(block: Block, blocks: Mapping[str, Block]) -> list[tuple[int, str]]:
    """(line, name) of the cuboids that other blocks fill; line 0 is start."""
    return [
        (number, s.name)
        for number, s in enumerate(block.statements, start=1)
        if isinstance(s, Cuboid) and s.name in blocks
    ]


def _places(program: Program) -> dict[str, tuple[float, int]]:
    """Where each block begins, in lines, and its level: blocks of a level stand side by side."""
    blocks = {block.name: block for block in program.blocks}
    places, ends = {}, {}
    waiting = [(program.blocks[0].name, 0)]
    for name, level in waiting:  # grows while it is walked
        places[name] = (ends.get(level, 0.0), level)
        ends[level] = places[name][0] + len(blocks[name].statements) + 2 + STRIP + 2.0
        waiting += [(child, level + 1) for _, child in _children(blocks[name], blocks)]
    return places


def _strip_first(side: str) -> bool:
    """The decoder begins with a code, the encoder ends with one."""
    return side == "decoder"


def _draw_block(
    ax: Axes, block: Block, x: float, y: float, code: Tensor, side: str, blocks: Mapping[str, Block]
) -> None:
    commands = ["start", *(s.command for s in block.statements), "end"]
    first = x + (STRIP + 0.6 if _strip_first(side) else 0)
    for number, command in enumerate(commands):
        ax.add_patch(Rectangle((first + number + 0.06, y), 0.88, 1, fc=COMMAND_COLORS[command], lw=0))
    for number, _ in _children(block, blocks):
        ax.add_patch(
            Rectangle((first + number + 0.06, y), 0.88, 1, fill=False, edgecolor=LINK, linewidth=1.6)
        )
    _draw_code(ax, x if _strip_first(side) else x + len(commands) + 0.6, y, code, block.name)


def _draw_code(ax: Axes, x: float, y: float, code: Tensor, name: str) -> None:
    values = code.detach()[None, :SHOWN].numpy()
    most = max(float(abs(values).max()), 1e-6)
    ax.imshow(
        values, cmap="PuOr", vmin=-most, vmax=most, extent=(x, x + STRIP, y, y + 1), zorder=2, aspect="auto"
    )
    ax.add_patch(Rectangle((x, y), STRIP, 1, fill=False, edgecolor=INK, linewidth=0.8, zorder=3))
    plain = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
    ax.text(x + STRIP / 2, y - 0.15, name, fontsize=7, ha="center", va="top", color=INK, bbox=plain, zorder=5)


def _draw_links(
    ax: Axes, blocks: Mapping[str, Block], places: Mapping[str, tuple[float, int]], start: float, side: str
) -> None:
    for name, (x, level) in places.items():
        shift = STRIP + 0.6 if _strip_first(side) else 0
        for number, child in _children(blocks[name], blocks):
            line = (start + x + shift + number + 0.5, -ROW * level)
            child_x, child_level = places[child]
            offset = 0 if _strip_first(side) else len(blocks[child].statements) + 2 + 0.6
            strip = (start + child_x + offset + STRIP / 2, -ROW * child_level + 1)
            tail, head = (line, strip) if _strip_first(side) else (strip, line)
            _draw_arrow(ax, tail, head)


def _draw_arrow(ax: Axes, tail: tuple[float, float], head: tuple[float, float]) -> None:
    style = {"arrowstyle": "-|>", "color": LINK, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", head, tail, arrowprops=style)
