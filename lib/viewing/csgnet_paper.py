"""Tables 2, 4 and 5 of CSGNet's paper with our own numbers beside them, read from results/csgnet.

    print(table(2))     each method: the paper's number, and ours; a dash where there is none

The programs behind the numbers are others: the authors' test set is not public, ours is made by the rules that the
paper describes. So the columns are no race, they tell what size of numbers to expect.
`data_scripts.measure_csgnet` writes the files; those of networks that learned with a second seed are in `seed_1`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lib.viewing.csgnet_results import RESULTS, SECOND, read_rows


@dataclass(frozen=True)
class Layout:
    """A table: what it shows, its file, the command that makes the file, {quantity in the file: (heading, format)},
    and {method, as in the file: (its name, the paper's numbers)}."""

    title: str
    file: str
    command: str
    columns: Mapping[str, tuple[str, str]]
    methods: Mapping[str, tuple[str, tuple[float, ...]]]


_MEASURE = "python -m data_scripts.measure_csgnet "
_DETECTION = ("circle", "square", "triangle", "mean")
TABLES = {
    2: Layout(
        "random programs of the plane: mean Chamfer distance, px",
        "synthetic_2d.json",
        _MEASURE + "synthetic",
        {"chamfer_px": ("CD", ".2f")},
        {
            "nearest": ("nearest neighbour", (1.94,)),
            "k=1": ("CSGNet, k = 1", (1.69,)),
            "k=5": ("CSGNet, k = 5", (1.46,)),
            "k=10": ("CSGNet, k = 10", (1.39,)),
        },
    ),
    4: Layout(
        "random programs of space: mean IoU, percent",
        "synthetic_3d.json",
        _MEASURE + "synthetic --dimensions 3",
        {"iou_percent": ("IoU", ".1f")},
        {
            "nearest": ("nearest neighbour", (73.2,)),
            "k=1": ("CSGNet, k = 1", (80.1,)),
            "k=5": ("CSGNet, k = 5", (85.3,)),
            "k=10": ("CSGNet, k = 10", (89.2,)),
        },
    ),
    5: Layout(
        "primitives as objects: average precision, percent, and images a second (the paper's on a GPU)",
        "detection.json",
        _MEASURE + "detection",
        {**{name: (name, ".1f") for name in _DETECTION}, "images_a_second": ("images/s", ".0f")},
        {
            "faster_rcnn": ("Faster R-CNN", (87.4, 71.0, 81.8, 80.1, 5)),
            "k=10": ("CSGNet, k = 10", (86.7, 79.3, 83.1, 83.0, 80)),
            "k=40": ("CSGNet, k = 40", (88.1, 80.7, 84.1, 84.3, 20)),
        },
    ),
}


def table(number: int, folder: Path = RESULTS) -> str:
    """A table of the paper as text, ours beside it.

    Raises KeyError for another number than 2, 4 and 5, ValueError for a file that holds no such table.
    """
    layout = TABLES[number]
    path = Path(folder) / layout.file
    found = read_rows(path)
    heading = "".join(f"{name:>20s}" for name, _ in layout.columns.values())
    lines = [
        f"Table {number}, {layout.title}",
        f"{'':20s}{heading}",
        f"{'':20s}" + f"{'paper':>12s}{'here':>8s}" * len(layout.columns),
    ]
    for method, (name, printed) in layout.methods.items():
        ours = found["rows"].get(method, {})
        cells = zip(layout.columns.items(), printed, strict=True)
        lines.append(
            f"{name:20s}" + "".join(_cell(ours, key, form, each) for (key, (_, form)), each in cells)
        )
    return "\n".join(
        [*lines, _about(found, layout), *_second_seed(read_rows(path.parent / SECOND / layout.file), layout)]
    )


def _cell(ours: Mapping, quantity: str, form: str, printed: float) -> str:
    here = format(ours[quantity], form) if quantity in ours else "-"
    return f"{printed:>12{form}}{here:>8s}"


def _second_seed(found: Mapping, layout: Layout) -> list[str]:
    """A line with the first quantity of the methods that learn, measured with weights of another seed."""
    rows = found["rows"]
    quantity, (_, form) = next(iter(layout.columns.items()))
    said = [
        f"{name} {rows[name][quantity]:{form}}" for name in layout.methods if "=" in name and name in rows
    ]
    return [f"(with a second seed: {', '.join(said)})"] if said else []


def _about(found: Mapping, layout: Layout) -> str:
    if not found["rows"]:
        return f"(not measured here yet: {layout.command})"
    known = f", nearest of {found['known']:,} known ones" if "known" in found else ""
    return f"(here: {found['samples']:,} test programs{known}; measured by {layout.command})"
