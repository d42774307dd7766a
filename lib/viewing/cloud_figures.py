"""Two small point clouds, and from each point an arrow to its nearest neighbour in the other cloud."""

import matplotlib.pyplot as plt
import torch
from jaxtyping import Float
from matplotlib.figure import Figure
from torch import Tensor

COLORS = ("#1d3557", "#d62839")


def nearest_arrows(a: Float[Tensor, "n 3"], b: Float[Tensor, "m 3"]) -> Figure:
    """Left from a to b, right from b to a, seen from the front (x and y); each arrow with its length."""
    figure, axes = plt.subplots(1, 2, figsize=(7, 3), dpi=100, sharex=True, sharey=True)
    plt.close(figure)
    for ax, one, other, names in zip(axes, (a, b), (b, a), ("ab", "ba"), strict=True):
        distances, nearest = torch.cdist(one, other).min(1)
        for name, points in zip(names, (one, other), strict=True):
            color = COLORS["ab".index(name)]
            ax.scatter(*points[:, :2].T.tolist(), color=color, s=60, zorder=3, label=f"cloud {name}")
        for start, end, length in zip(one.tolist(), other[nearest].tolist(), distances.tolist()):
            arrow = {"arrowstyle": "-|>", "color": "#5b6475", "shrinkA": 4, "shrinkB": 4}
            ax.annotate("", end[:2], start[:2], arrowprops=arrow)
            middle = [(p + q) / 2 for p, q in zip(start[:2], end[:2])]
            place = {"xytext": (5, 5), "textcoords": "offset points", "fontsize": 9}
            ax.annotate(f"{length:.2f}", middle, **place)
        ax.set_title(f"from {names[0]} to {names[1]}: mean {distances.mean():.3f}", fontsize=10)
        ax.set_aspect("equal")
        ax.margins(0.2)
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].legend(fontsize=8, frameon=False, loc="best")
    figure.tight_layout()
    return figure
