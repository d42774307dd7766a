"""Searches for a stump's matrices, measured: how good they are and how long they take as the primitives become more."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lib.viewing.canvas import SOFT

# search -> what it is called, its colour and marker
_CURVES = {
    "layers": ("paper's program", "#009e73", "^"),
    "solve": ("our search", "#0072b2", "o"),
    "greedy": ("greedy cover", "#e08700", "s"),
}
_BOUNDED = "solve"  # the search whose lower bound is drawn: it is the best one that is proven


def search_figure(found: Mapping) -> Figure:
    """Share of wrong points (left) and seconds (right) against the number of primitives K, a curve a search.

    found: results/stump_search.json, which `python -m data_scripts.measure_stump_search` writes: its "rows" and
    "limit_seconds". What is shaded lies between our search's answer and what is proven: no matrices are better than
    the lower edge. Raises ValueError for no rows.
    """
    rows = found["rows"]
    if not rows:
        raise ValueError("found no rows; expected one or more")
    figure, (wrong, slow) = plt.subplots(1, 2, figsize=(8, 3.2), dpi=100)
    plt.close(figure)
    for search in dict.fromkeys(row["search"] for row in rows):
        _curves(
            wrong, slow, search, sorted((row for row in rows if row["search"] == search), key=_primitives)
        )
    slow.axhline(found["limit_seconds"], color=SOFT, linewidth=1, linestyle=(0, (4, 3)))
    place = {"xycoords": ("axes fraction", "data"), "xytext": (0, 3), "textcoords": "offset points"}
    slow.annotate("time limit", (0.02, found["limit_seconds"]), fontsize=8, color=SOFT, **place)
    slow.set_yscale("log")
    for ax, label in ((wrong, "wrong points, %"), (slow, "seconds")):
        _dress(ax, sorted({_primitives(row) for row in rows}), label)
    wrong.set_ylim(bottom=0)
    wrong.legend(fontsize=8, frameon=False)
    figure.tight_layout()
    return figure


def _curves(wrong: Axes, slow: Axes, search: str, rows: list[Mapping]) -> None:
    label, color, marker = _CURVES[search]
    style = {"color": color, "marker": marker, "markersize": 5, "linewidth": 1.6}
    counts, percents = [_primitives(row) for row in rows], [row["wrong_percent"] for row in rows]
    wrong.plot(counts, percents, label=label, **style)
    slow.plot(counts, [row["seconds"] for row in rows], **style)
    if search == _BOUNDED:
        bounds = [row["bound_percent"] for row in rows]
        wrong.fill_between(counts, bounds, percents, color=color, alpha=0.15, linewidth=0, label="not proven")


def _primitives(row: Mapping) -> int:
    return row["primitives"]


def _dress(ax: Axes, counts: list[int], label: str) -> None:
    """K on a scale of doublings; only those numbers are written that have room, the others get a tick."""
    ax.set_xscale("log", base=2)
    written, last = [], 0.0
    for count in counts:
        roomy = count >= 1.3 * last
        written.append(str(count) if roomy else "")
        last = count if roomy else last
    ax.set_xticks(counts, written)
    ax.minorticks_off()
    ax.set(xlabel="primitives K", ylabel=label)
    ax.spines[["top", "right"]].set_visible(False)
