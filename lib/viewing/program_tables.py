"""Tables 2 to 6 of the ShapeAssembly paper with our own numbers beside them, as text and as a figure.

    rows = load_rows()                    results/program_vae/CATEGORY_METHOD.json, as many as there are
    print(table(2, rows))                 each quantity as "paper", "here"; a dash where there is no number
    print(not_measured(rows))             and which command measures it
    print(provenance(rows))               seeds, sample counts, dates, versions
    dots_figure(rows)
    print(over_seeds([rows, *others]))    a row by several seeds; the others: RESULTS / "other_seeds"

`data_scripts.measure_program_vae` writes the files. Every row of the paper is named, whether or not it was measured.
The other methods, 3D-PRNN and StructureNet, are the paper's measurements; they are not built here.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lib.viewing.paper_numbers import METHODS, PAPER

RESULTS = Path(__file__).parents[2] / "results" / "program_vae"
COMMAND = "python -m data_scripts.measure_program_vae"
OTHERS = ("3d_prnn", "structurenet")  # measured by the paper only
ABLATIONS = ("flat", "no_order", "no_align", "no_macros")  # of these no weights are committed
Rows = Mapping[str, Mapping[str, Mapping]]  # {category: {method: {quantity: number}}}


class ResultError(ValueError):
    """A file of results that does not hold what its name says. The message says which, and what was found."""


@dataclass(frozen=True)
class Layout:
    """A table: its title, {quantity: (heading, format)}, and the methods that have a row, by their names in files."""

    title: str
    columns: Mapping[str, tuple[str, str]]
    methods: Sequence[str]


OURS = ("ours", "ours_fitted", "ours_authors_rules")  # one network, three ways to sample
_TOLD = (*OURS, "ground_truth")
TABLES = {
    2: Layout(
        "quality",
        {
            "rooted": ("% rooted", ".1f"),
            "stable": ("% stable", ".1f"),
            "stable_of_real": ("÷ real", ".3f"),
            "stable_authors_trial": ("authors' push", ".1f"),
            "fool": ("% fool", ".2f"),
            "frechet": ("Fréchet", ".2f"),
        },
        [*OTHERS, *ABLATIONS, "no_reject", *OURS, "ground_truth"],
    ),
    3: Layout(
        "lines, and macros per line",
        {
            "lines": ("lines", ".1f"),
            "reflect": ("reflect", ".4f"),
            "translate": ("translate", ".4f"),
            "squeeze": ("squeeze", ".4f"),
            "macros_per_line": ("together", ".4f"),
        },
        [*OTHERS, *_TOLD],
    ),
    4: Layout(
        "variability: Chamfer distances; the last column is from the text",
        {
            "generalisation": ("generalis.", ".3f"),
            "coverage": ("coverage", ".3f"),
            "variety": ("variety", ".3f"),
            "novel_percent": ("% novel", ".0f"),
        },
        [*OTHERS, *OURS, "validation"],
    ),
    5: Layout("leaf parts", {"leaves": ("leaf parts", ".2f")}, [*OTHERS, *_TOLD]),
    6: Layout(
        "a step between random codes",
        {"geometric_step": ("geometric", ".4f"), "program_step": ("program", ".2f")},
        ["structurenet", "ours"],
    ),
}
NAMES = METHODS | {
    "ours_fitted": "Ours, fitted",
    "ours_authors_rules": "Ours, their rules",
    "interpolation": "Interpolation",
}
CATEGORIES = tuple(PAPER)


def load_rows(folder: Path = RESULTS) -> dict[str, dict[str, dict]]:
    """Our rows, {category: {method: row}}; nothing where nothing was measured.

    What "interpolation" measures belongs to "ours". Raises ResultError for a file that is not what its name says.
    """
    rows: dict = {category: {} for category in CATEGORIES}
    for path in sorted(Path(folder).glob("*.json")):
        category, _, method = path.stem.partition("_")
        rows.setdefault(category, {})[method] = _row(path, category, method)
    return rows


def _row(path: Path, category: str, method: str) -> dict:
    try:
        row = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:  # no JSON, or no text at all
        raise ResultError(f"{path}: not a result ({error}); measure it again: {COMMAND}") from error
    found = (row.get("category"), row.get("method")) if isinstance(row, dict) else type(row).__name__
    if found != (category, method):
        raise ResultError(f"{path}: found {found}; expected {(category, method)}, as its name says")
    for quantity in {q for layout in TABLES.values() for q in layout.columns} & row.keys():
        if not isinstance(row[quantity], int | float | None) or isinstance(row[quantity], bool):
            raise ResultError(f"{path}: {quantity} is {row[quantity]!r}; expected a number")
    return row


def ours(rows: Rows, category: str, method: str, quantity: str) -> float | None:
    """Our number, or None."""
    if quantity.endswith("_step") and method == "ours":
        method = "interpolation"
    return _number(rows.get(category, {}), method, quantity)


def papers(category: str, method: str, quantity: str) -> float | None:
    """The paper's number, or None."""
    return _number(PAPER[category], method, quantity)


def _number(rows: Mapping[str, Mapping], method: str, quantity: str) -> float | None:
    if quantity != "stable_of_real":
        return rows.get(method, {}).get(quantity)
    stable, real = (rows.get(each, {}).get("stable") for each in (method, "ground_truth"))
    return stable / real if stable is not None and real else None


def table(number: int, rows: Rows, categories: Sequence[str] = CATEGORIES) -> str:
    """Table `number` as lines of text, the paper's and our number of each quantity next to each other."""
    layout = TABLES[number]
    heads = [heading for heading, _ in layout.columns.values()]
    widths = [_width(*column) for column in layout.columns.values()]
    lines = [
        f"Table {number}: {layout.title}",
        " " * 19 + "".join(f"{h:>{2 * w}s}" for h, w in zip(heads, widths)),
    ]
    for category in categories:
        lines.append(f"{category:19s}" + "".join(f"{'paper':>{w}s}{'here':>{w}s}" for w in widths))
        for method in layout.methods:
            cells = ""
            for (quantity, (_, form)), width in zip(layout.columns.items(), widths):
                pair = papers(category, method, quantity), ours(rows, category, method, quantity)
                cells += "".join(f"{_cell(value, form):>{width}s}" for value in pair)
            lines.append(f"  {NAMES[method]:17s}{cells}")
    return "\n".join(lines)


def _width(heading: str, form: str) -> int:
    """Of one of the two numbers under a heading."""
    longest = {".4f": 8, ".2f": 8}.get(form, 7)
    return max(longest, -(-(len(heading) + 2) // 2))


def _cell(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


JUDGED = ("rooted", "stable_of_real", "coverage", "variety", "lines", "novel_percent")


def over_seeds(runs: Sequence[Rows], method: str = "ours_fitted") -> str:
    """A line for each category and quantity: the paper's number for its method, then ours from each run.

    Only the first run has to have the rows of the real shapes.
    """
    columns = {quantity: column for layout in TABLES.values() for quantity, column in layout.columns.items()}
    seeds = [next((row["seed"] for row in _rows_of(run, method)), "-") for run in runs]
    lines = [f"{NAMES[method]:28s}{'paper':>8s}" + "".join(f"{f'seed {seed}':>8s}" for seed in seeds)]
    for category in CATEGORIES:
        real = {"ground_truth": runs[0].get(category, {}).get("ground_truth", {})}
        for quantity in JUDGED:
            heading, form = columns[quantity]
            found = [_number(run.get(category, {}) | real, method, quantity) for run in runs]
            cells = [_cell(value, form) for value in (papers(category, "ours", quantity), *found)]
            lines.append(f"{category:9s}{heading:19s}" + "".join(f"{cell:>8s}" for cell in cells))
    return "\n".join(lines)


def _rows_of(rows: Rows, method: str) -> list[Mapping]:
    return [methods[method] for methods in rows.values() if method in methods]


def not_measured(rows: Rows, categories: Sequence[str] = CATEGORIES) -> str:
    """The rows without a file, a line each, with the command that measures it; "" if there is none."""
    wanted = dict.fromkeys(m for layout in TABLES.values() for m in layout.methods if m not in OTHERS)
    lines = [
        f"{category:9s}{NAMES[method]:18s}{_command(category, method)}"
        for category in categories
        for method in [*wanted, "interpolation"]
        if method not in rows.get(category, {})
    ]
    return "\n".join(lines and ["not measured yet; this would:", *lines])


def _command(category: str, method: str) -> str:
    words = [COMMAND, category]
    if method != "ours":
        words += ["--method", method]
    if method in ABLATIONS:  # `python -m lib.training program_vae --ablation` puts its run there
        words += ["--weights", f"runs/{category}-{method}/program_vae.safetensors"]
    return " ".join(words)


def provenance(rows: Rows) -> str:
    """A line for each of our rows: what it was measured on, and with which version of what."""
    keys = {"samples": 8, "seed": 5, "data": 9, "date": 11, "commit": 9, "code": 13, "weights": 13}
    lines = [f"{'':28s}" + "".join(f"{key:>{width}s}" for key, width in keys.items()) + "  rejected"]
    for category, methods in rows.items():
        for method, row in methods.items():
            told = "".join(f"{str(row.get(key, '-')):>{width}s}" for key, width in keys.items())
            rejected = row.get("rejected_percent")
            share = f"{rejected:9.1f}%" if rejected is not None else f"{'-':>10s}"
            lines.append(f"{category:9s}{NAMES.get(method, method):19s}{told}{share}")
    return "\n".join(lines) if len(lines) > 1 else "no row has been measured yet"


PANELS = {
    "rooted": "% rooted",
    "stable_of_real": "% stable ÷ real",
    "fool": "% fool",
    "generalisation": "generalisation, CD",
    "coverage": "coverage, CD",
    "variety": "variety, CD",
    "lines": "lines",
}
_COLORS = {"chair": "#5e8bba", "table": "#e28f4f", "storage": "#70ad77"}
_MARKS = {"chair": "o", "table": "s", "storage": "D"}


def dots_figure(rows: Rows, panels: Mapping[str, str] = PANELS) -> Figure:
    """A panel a quantity: open marks are the paper's, filled ones ours, a line joins the two. A row a method."""
    columns = min(4, len(panels))
    height = math.ceil(len(panels) / columns)
    figure, axes = plt.subplots(
        height,
        columns,
        figsize=(2.8 * columns, 2.6 * height + 0.4),
        dpi=100,
        squeeze=False,
        layout="constrained",
    )
    plt.close(figure)
    for ax, (quantity, title) in zip(axes.flat, panels.items()):
        _panel(ax, rows, quantity, title)
    for ax in axes.flat[len(panels) :]:
        ax.set_axis_off()
    mark = {"linestyle": "none", "color": "#5b6475", "markersize": 6}
    keys = [Line2D([], [], marker=_MARKS[c], linestyle="none", color=_COLORS[c], label=c) for c in CATEGORIES]
    keys += [Line2D([], [], marker="o", markerfacecolor="white", label="paper", **mark)]
    keys += [Line2D([], [], marker="o", label="here", **mark)]
    where = (
        {"loc": "center", "fontsize": 9}
        if len(axes.flat) > len(panels)
        else {"loc": "outside lower center", "ncols": 5}
    )
    holder = axes.flat[-1] if len(axes.flat) > len(panels) else figure
    holder.legend(handles=keys, frameon=False, **where)
    return figure


def _panel(ax, rows: Rows, quantity: str, title: str) -> None:
    """One quantity: methods of the table that has it from top to bottom, categories a little apart."""
    source = next(layout for layout in TABLES.values() if quantity in layout.columns)
    pairs = {
        m: [(papers(c, m, quantity), ours(rows, c, m, quantity)) for c in CATEGORIES] for m in source.methods
    }
    shown = [method for method, found in pairs.items() if any(pair != (None, None) for pair in found)]
    for line, method in enumerate(shown):
        for shift, category, (paper, here) in zip((-0.22, 0, 0.22), CATEGORIES, pairs[method], strict=True):
            style = {"marker": _MARKS[category], "color": _COLORS[category], "markersize": 5, "zorder": 3}
            at = line + shift
            if paper is not None and here is not None:
                ax.plot([paper, here], [at, at], color=_COLORS[category], linewidth=1, zorder=2)
            if paper is not None:
                ax.plot(paper, at, markerfacecolor="white", **style)
            if here is not None:
                ax.plot(here, at, **style)
    ax.set_yticks(range(len(shown)), [NAMES[m].replace("Ours (", "").rstrip(")") for m in shown], fontsize=8)
    ax.invert_yaxis()
    ax.tick_params(axis="x", labelsize=8)
    ax.set_title(title, fontsize=10)
    for line in range(0, len(shown), 2):
        ax.axhspan(line - 0.5, line + 0.5, color="#f2f3f6", zorder=0)
    ax.spines[["top", "right"]].set_visible(False)
