"""How CSGNet reads a picture and writes a program: what it makes of the pixels, and what it expects at each token.

features_figure(image, {"first": maps, …})     the maps that convolutions make of a picture
expected_figure(image, chances)                where each kind of primitive is expected, by size
steps_figure(image, chances, tokens)           one token after another: what was expected, what was written
rules_figure(rules)                            which tokens may come next, by the number of parts and the room left
learning_figure(logs, levels, guess)           loss and distance over the epochs, beside what guessing costs

`chances` are the probabilities of the 400 tokens of the plane; a row a step where there are several.
"""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from torch import Tensor

from lib.interpreters.csg import KINDS, vocabulary_of
from lib.interpreters.csg.packing import SIDE
from lib.interpreters.csg.vocabulary import SIZES
from lib.viewing.canvas import COLORS, GAP, INK, RIM, SOFT, outline, page, stamp, write

FAINT = "#d3d9e2"  # a picture behind something
ENDINGS = {"+": "#5e8bba", "*": "#9379b8", "-": "#e28f4f", "$": "#1b1f27"}  # colours of what is no primitive
LEAST = 0.02  # a probability below is not drawn
NAMED = 0.05  # a probability from which on its number is written
CURVES = ("#5e8bba", "#e28f4f", "#70ad77", "#9379b8")


def features_figure(
    image: Bool[Tensor, "h w"], layers: Mapping[str, Float[Tensor, "channels _ _"]], *, most: int = 16
) -> Figure:
    """The picture, and a row for each layer with its first `most` maps; dark is large, white is the smallest."""
    count = min(most, max(len(maps) for maps in layers.values()))
    figure, axes = plt.subplots(
        len(layers), count + 2, figsize=(0.62 * (count + 2), 0.85 * len(layers)), dpi=110, squeeze=False,
        width_ratios=(1.3, 0.25, *[1] * count),
    )  # fmt: skip
    plt.close(figure)
    for ax in axes.flat:
        ax.set_axis_off()
    axes[0, 0].imshow(image.numpy(), cmap="Greys")
    for row, (name, maps) in zip(axes, layers.items()):
        for ax, each in zip(row[2:], maps.detach().numpy()):
            ax.imshow(each, cmap="Blues", vmin=each.min(), vmax=max(each.max(), each.min() + 1e-6))
            ax.set_axis_on()
            ax.set(xticks=[], yticks=[])
            ax.spines[:].set_color(RIM)
        row[2].set_title(name, fontsize=8, loc="left", pad=3)
    figure.subplots_adjust(0.005, 0.02, 0.995, 0.88, 0.08, 0.35)
    return figure


def expected_figure(image: Bool[Tensor, "64 64"], chances: Float[Tensor, " tokens"]) -> Figure:
    """A row a kind of primitive, a column a size: each field is a center, the darker the likelier the token.

    Fields with at least NAMED show their percentage. White: no such token. Right, what is no primitive.
    """
    left, cell = 52, SIDE + GAP
    width, height = left + len(SIZES) * cell + 60, len(COLORS) * cell + 18
    figure, ax = page(width, height, 800 / width)
    top = chances[:-4].max()
    for row, kind in enumerate(COLORS):
        write(
            ax, KINDS[kind].name, left - 6, 18 + row * cell + SIDE / 2 - 4, 9, ha="right", color=COLORS[kind]
        )
    for column, size in enumerate(SIZES):
        write(ax, f"r = {size}", left + column * cell + SIDE / 2, 3, 8.5, color=SOFT)
        for row in range(len(COLORS)):
            stamp(ax, image.numpy(), left + column * cell, 18 + row * cell, FAINT)
    named: list[tuple[float, float]] = []  # where a percentage stands: others would cover it
    for token in chances[:-4].argsort(descending=True).tolist():
        primitive, chance = vocabulary_of(2).primitives[token], float(chances[token])
        x, y, r = primitive.numbers
        x, y = x + left + SIZES.index(r) * cell, y + 18 + list(COLORS).index(primitive.kind) * cell
        free = all(abs(x - u) > 20 or abs(y - v) > 18 for u, v in named)
        text = f"{chance:.0%}" if chance >= NAMED and free else ""
        _field(ax, (x, y), COLORS[primitive.kind], (chance / float(top)) ** 0.5, text)
        named += [(x, y)] * bool(text)
    _endings(ax, chances, width - 50, 18)
    return figure


def _field(ax: Axes, center: tuple[float, float], color: str, share: float, text: str) -> None:
    """A square around one center, the more opaque the greater its share of the likeliest, and a text below."""
    x, y = center[0] - 3.5, center[1] - 3.5
    ax.add_patch(Rectangle((x, y), 8, 8, facecolor=color, alpha=share * 0.9 + 0.04, linewidth=0, zorder=2))
    write(ax, text, x + 4, y + 8.5, 7.5, zorder=4, fontweight="bold")


def _endings(ax: Axes, chances: Float[Tensor, " tokens"], x: float, y: float) -> None:
    for row, (symbol, chance) in enumerate(zip(ENDINGS, chances[-4:].tolist())):
        style = {"ha": "left", "color": ENDINGS[symbol]}
        write(ax, f"{symbol}  {chance:.0%}", x, y + 15 * row, 9, True, **style)


def steps_figure(
    image: Bool[Tensor, "64 64"],
    chances: Float[Tensor, "steps tokens"],
    tokens: Sequence[int],
    *,
    columns: int = 8,
) -> Figure:
    """A column a token: above, the primitives that were expected, the more opaque the likelier; below them the share
    of each kind of token, and what was written with its probability."""
    words, wide, high = vocabulary_of(2), SIDE + 22, SIDE + 84
    columns = min(columns, len(tokens))
    rows = -(-len(tokens) // columns)
    scale = min(1.6, 800 / (columns * wide))
    figure, ax = page(columns * wide, rows * high, scale)
    for place, (token, odds) in enumerate(zip(tokens, chances)):
        x, y = place % columns * wide + 11, place // columns * high + 4
        stamp(ax, image.numpy(), x, y, FAINT)
        for primitive, chance in zip(words.primitives, odds.tolist()):
            if chance >= LEAST:
                outline(ax, primitive, False, x, y)
                ax.patches[-1].set_alpha(min(1.0, chance**0.5))
        _kinds(ax, odds, x, y + SIDE + 4)
        write(ax, words.texts[token], x + SIDE / 2, y + SIDE + 51, 9, True, fontweight="bold")
        write(ax, f"{odds[token]:.0%}", x + SIDE / 2, y + SIDE + 62, 8, color=SOFT)
    return figure


def _kinds(ax: Axes, chances: Float[Tensor, " tokens"], x: float, y: float) -> None:
    """Seven bars: circles, squares and triangles together, + * - and $."""
    kinds = [primitive.kind for primitive in vocabulary_of(2).primitives]
    sums = {KINDS[k].name: sum(p for p, kind in zip(chances.tolist(), kinds) if kind == k) for k in COLORS}
    shares = sums | dict(zip(ENDINGS, chances[-4:].tolist()))
    colors = (*COLORS.values(), *ENDINGS.values())
    for row, ((name, share), color) in enumerate(zip(shares.items(), colors)):
        ax.add_patch(Rectangle((x + 22, y + 6.4 * row + 0.8), 42 * share, 4.6, color=color, linewidth=0))
        write(ax, name, x + 20, y + 6.4 * row, 6, ha="right", color=SOFT)
    ax.plot([x + 22, x + 22], [y, y + 45], color=RIM, linewidth=0.7)


def rules_figure(rules: Bool[Tensor, "depths rooms kinds"]) -> Figure:
    """For each number of parts on the stack (down) and each room (across): P a primitive, O an operation, $ the end.

    rules   [parts, room, (primitive, operation, end)]. Grey fields cannot be reached: parts that cannot be joined
            any more.
    """
    depths, rooms, _ = rules.shape
    figure, ax = plt.subplots(figsize=(0.75 * rooms + 1, 0.5 * depths + 0.8), dpi=100)
    plt.close(figure)
    letters = (("P", COLORS["s"]), ("O", COLORS["c"]), ("$", INK))
    for depth, room in np.ndindex(depths, rooms):
        reached = depth <= room + 1 and room + depth > 0
        ax.add_patch(
            Rectangle(
                (room - 0.5, depth - 0.5), 1, 1, facecolor="white" if reached else "#e3e6ec", edgecolor=RIM
            )
        )
        for place, (letter, color) in enumerate(letters):
            if reached and rules[depth, room, place]:
                style = {"ha": "center", "va": "center", "fontweight": "bold", "parse_math": False}
                ax.text(room + 0.28 * (place - 1), depth, letter, color=color, fontsize=11, **style)
    ax.set(xlim=(-0.5, rooms - 0.5), ylim=(depths - 0.5, -0.5), xticks=range(rooms), yticks=range(depths))
    ax.set(xlabel="room: tokens that may still come before the end", ylabel="parts")
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    figure.tight_layout()
    return figure


def learning_figure(
    logs: Mapping[str, Sequence[Mapping[str, float]]], levels: Mapping[str, float], guess: float
) -> Figure:
    """Left the loss on other programs over the epochs, with lines at `levels`; right the Chamfer distance of what is
    written to what is shown, px, with a line at that of a guess."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.1), dpi=100)
    plt.close(figure)
    for color, (name, log) in zip(CURVES, logs.items()):
        for ax, quantity in zip(axes, ("val_loss", "val_cd")):
            epochs = [row["epoch"] for row in log]
            ax.plot(epochs, [row[quantity] for row in log], "o-", markersize=3, color=color, label=name)
    for ax, lines in zip(axes, (levels, {"another program's picture": guess})):
        for name, height in lines.items():
            ax.axhline(height, color=SOFT, linewidth=0.9, linestyle=(0, (4, 3)))
            ax.annotate(name, (1, height), (0, 3), textcoords="offset points", ha="right", fontsize=7.5,
                        xycoords=("axes fraction", "data"), color=SOFT)  # fmt: skip
        ax.set(xlabel="epoch", ylim=(0, None))
        ax.margins(y=0.1)
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].set_title("loss", fontsize=10)
    axes[1].set_title("Chamfer distance (px)", fontsize=10)
    axes[1].legend(fontsize=8, frameon=False)
    figure.tight_layout()
    return figure
