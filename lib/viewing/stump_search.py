"""A search for a stump's matrices, measured: how good they are and how long it takes as the primitives become more."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

_STYLES = {"program": ("#0072b2", "o"), "greedy": ("#e08700", "s")}
_OTHER = ("#009e73", "^")
_LABEL = {"program": "binary program", "greedy": "greedy cover"}


def search_figure(rows: Sequence[Mapping], limit: float | None = None) -> Figure:
    """Share of wrong points (left) and seconds (right) against the number of primitives K, a curve a method.

    rows   such as {"primitives": 16, "method": "program", "objective": 0.02, "seconds": 1.5}, and perhaps a "bound":
           no matrices can be less wrong, and what lies between is shaded.
    limit  seconds that a search may take, drawn as a line.    Raises ValueError for no rows.
    """
    if not rows:
        raise ValueError("found no rows; expected one or more")
    figure, (wrong, slow) = plt.subplots(1, 2, figsize=(8, 3), dpi=100)
    plt.close(figure)
    for method in dict.fromkeys(row["method"] for row in rows):
        mine = sorted((row for row in rows if row["method"] == method), key=_primitives)
        _curves(wrong, slow, method, mine)
    if limit is not None:
        slow.axhline(limit, color="#667080", linewidth=1, linestyle=(0, (4, 3)))
        slow.annotate("time limit", (0.02, limit), xycoords=("axes fraction", "data"), xytext=(0, 3),
                      textcoords="offset points", fontsize=8, color="#667080")  # fmt: skip
    slow.set_yscale("log")
    for ax, label in ((wrong, "wrong points, %"), (slow, "seconds")):
        _dress(ax, sorted({_primitives(row) for row in rows}), label)
    wrong.set_ylim(bottom=0)
    wrong.legend(fontsize=8, frameon=False)
    figure.tight_layout()
    return figure


def _curves(wrong: Axes, slow: Axes, method: str, rows: list[Mapping]) -> None:
    color, marker = _STYLES.get(method, _OTHER)
    style = {"color": color, "marker": marker, "markersize": 5, "linewidth": 1.6}
    counts, objectives = [_primitives(row) for row in rows], [100 * row["objective"] for row in rows]
    wrong.plot(counts, objectives, label=_LABEL.get(method, method), **style)
    slow.plot(counts, [row["seconds"] for row in rows], **style)
    if method != "greedy" and all("bound" in row for row in rows):  # a greedy cover proves next to nothing
        bounds = [100 * row["bound"] for row in rows]
        wrong.fill_between(counts, bounds, objectives, color=color, alpha=0.15, linewidth=0)


def _primitives(row: Mapping) -> int:
    return row["primitives"]


def _dress(ax: Axes, counts: list[int], label: str) -> None:
    ax.set_xscale("log", base=2)
    ax.set_xticks(counts, map(str, counts))
    ax.minorticks_off()
    ax.set(xlabel="primitives K", ylabel=label)
    ax.spines[["top", "right"]].set_visible(False)
