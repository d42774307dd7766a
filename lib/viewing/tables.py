"""Numbers side by side as bars."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

_COLORS = ("#9aa5b8", "#e28f4f", "#5e8bba", "#70ad77")


def compare_bars(
    rows: Mapping[str, Mapping[str, Mapping[str, float]]], quantities: Mapping[str, str]
) -> Figure:
    """One panel a quantity, one group of bars a category, one colour a source.

    rows        {source: {category: {quantity: number}}}, such as {"paper": {"chair": {"lines": 24.4}}}
    quantities  {quantity: title of its panel}
    """
    sources = list(rows)
    categories = list(rows[sources[0]])
    wide = max(3.1, 0.34 * len(sources) * len(categories))  # inches; each bar has room for its number
    figure, axes = plt.subplots(
        1, len(quantities), figsize=(wide * len(quantities), 2.8), dpi=100, squeeze=False
    )
    plt.close(figure)
    width = 0.8 / len(sources)
    for ax, (quantity, title) in zip(axes[0], quantities.items(), strict=True):
        for number, source in enumerate(sources):
            heights = [rows[source][category][quantity] for category in categories]
            place = np.arange(len(categories)) + (number - (len(sources) - 1) / 2) * width
            bars = ax.bar(place, heights, width * 0.94, label=source, color=_COLORS[number % len(_COLORS)])
            ax.bar_label(bars, fmt="%.3g", fontsize=7, padding=1)
        ax.set_xticks(np.arange(len(categories)), categories)
        ax.set_title(title, fontsize=10)
        ax.margins(y=0.15)
        ax.spines[["top", "right"]].set_visible(False)
    figure.tight_layout(rect=(0, 0.08, 1, 1))
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=len(sources), fontsize=8, frameon=False)
    return figure
