"""A map of this repository as a picture: what flows into what, and which notebook shows it."""

from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

NOTEBOOKS = Path(__file__).parents[2] / "notebooks"
INK = "#5b6475"

# name: (x, y, width, text, notebook, colour); x and y of the middle, in a 126 x 46 plan
_ROOMS = {
    "parts": (10, 36, 16, "part graphs\nof furniture", "03", "#e8eef6"),
    "program": (36, 36, 17, "ShapeAssembly\nprogram", "01", "#d6e4f5"),
    "network": (36, 10, 17, "network that\nwrites programs", "04 05", "#f6e3d2"),
    "shape": (63, 36, 15, "shape:\nboxes, mesh", "00 01", "#dcefdc"),
    "fit": (63, 10, 15, "fit by\ngradient", "02", "#f6e3d2"),
    "measure": (88, 36, 17, "metrics,\npictures", "06", "#ece4f3"),
    "csg": (88, 10, 17, "CSG program:\npicture, voxels", "08", "#d6e4f5"),
    "stump": (114, 36, 19, "CSG-Stump:\nthree matrices", "11", "#d6e4f5"),
    "readers": (114, 10, 19, "networks that\nread shapes", "09 10 12", "#f6e3d2"),
}
# from, to, word, offset of the word from the middle of the arrow
_DOORS = (
    ("parts", "program", "extract", (0, 1.6)),
    ("program", "shape", "execute", (0, 1.6)),
    ("shape", "measure", "", (0, 0)),
    ("program", "network", "learn", (-6, 0)),
    ("network", "program", "write", (5, 2)),
    ("shape", "fit", "compare", (5.5, 0)),
    ("fit", "program", "change\nnumbers", (6, 2.5)),
    ("csg", "measure", "same\nquestions", (-6, -1)),
    ("csg", "readers", "learn", (0, -4)),
    ("readers", "csg", "write", (0, 2.5)),
    ("readers", "stump", "write", (4.5, 0)),
    ("csg", "stump", "convert", (6, -4)),
    ("stump", "csg", "", (0, 0)),
    ("stump", "measure", "", (0, 0)),
)


def house_map() -> Figure:
    """The flow from data to programs to shapes to networks; small numbers are notebooks, dashed rooms are planned."""
    figure, ax = plt.subplots(figsize=(10.2, 3.65), dpi=100)
    plt.close(figure)
    built = {path.name[:2] for path in NOTEBOOKS.glob("[0-9][0-9]_*.ipynb")}
    walls = {
        name: _room(ax, *room, planned=not built & set(room[4].split())) for name, room in _ROOMS.items()
    }
    for start, end, word, offset in _DOORS:
        _door(ax, start, end, walls, word, offset)
    ax.set(xlim=(0, 126), ylim=(2, 45), aspect="equal")
    ax.axis("off")
    figure.subplots_adjust(0, 0, 1, 1)
    return figure


def _room(ax: Axes, x, y, width, text: str, notebook: str, color: str, planned: bool) -> FancyBboxPatch:
    corner, style = (x - width / 2, y - 5.5), "--" if planned else "-"
    walls = FancyBboxPatch(
        corner, width, 11, boxstyle="round,pad=0.6", facecolor="white" if planned else color, edgecolor=INK,
        linestyle=style, zorder=2,
    )  # fmt: skip
    ax.add_patch(walls)
    ax.text(
        x, y + 0.8, text, ha="center", va="center", fontsize=9.5, color=INK if planned else "black", zorder=3
    )
    number = f"{notebook} planned" if planned else notebook
    ax.text(x + width / 2, y - 5.7, number, ha="right", va="bottom", fontsize=7.5, color=INK, zorder=3)
    return walls


def _door(ax: Axes, start: str, end: str, walls: dict, word: str, offset: tuple[float, float]) -> None:
    """An arrow between two rooms; it runs beside its opposite where there is one."""
    (x0, y0), (x1, y1) = _ROOMS[start][:2], _ROOMS[end][:2]
    both = any((end, start) == door[:2] for door in _DOORS)
    level = y0 == y1
    aside = (1.6 if (x1 < x0 if level else y1 > y0) else -1.6) if both else 0
    right, up = (0, aside) if level else (aside, 0)
    style = {
        "arrowstyle": "-|>",
        "color": INK,
        "linewidth": 1.3,
        "patchA": walls[start],
        "patchB": walls[end],
    }
    ax.annotate("", (x1 + right, y1 + up), (x0 + right, y0 + up), arrowprops=style, zorder=1)
    ax.text(
        (x0 + x1) / 2 + offset[0], (y0 + y1) / 2 + offset[1], word, ha="center", fontsize=8.5, color="#1b1f27"
    )
