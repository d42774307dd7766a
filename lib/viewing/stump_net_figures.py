"""What networks say of point clouds, as figures: clouds above, answers below, a colour for each node or primitive.

sheet({"cloud": clouds, "CSG-Stump Net": meshes}, titles)     a row for each, a column for each shape
parts_of(said, surface, by="node")                            the surface, coloured by what made each face
training_figure(log)                                          loss and IoU over the epochs
gap_figure(said)                                              how decided the connections are
use_figure(used)                                              which primitives and nodes some answers use
rivals_table(), rivals_figure()                               what results/stump_net/ says

Coordinates are the clouds' own, y up, as furniture has it.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import torch
import trimesh
from jaxtyping import Float
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from torch import Tensor

from lib.interpreters.stump import layers
from lib.models.soft_stump import SoftStump
from lib.viewing.camera import Camera
from lib.viewing.figure import bounds_of, draw, draw_points
from lib.viewing.measured_rows import measured_rows
from lib.viewing.stump_solids import COLORS

RESULT = Path(__file__).parents[2] / "results" / "stump_net" / "reconstruction.json"
SECOND = "seed_1"  # the folder beside it, of networks trained with a second seed
COMMAND = "python -m data_scripts.measure_stump_net"
NAMES = {
    "stump_net_64": "CSG-Stump Net, K = C = 64",
    "stump_net_32": "CSG-Stump Net, K = C = 32",
    "stump_net_64_boxes": "CSG-Stump Net, 64 boxes",
    "volumetric_primitives": "volumetric primitives, 64",
    "superquadrics": "superquadrics, 64",
    "ucsg": "UCSG-Net's way",
    "bounding_box": "bounding box",
    "search": "search (notebook 11)",
}
WITHOUT_SEED = (NAMES["bounding_box"], NAMES["search"])
QUANTITIES = {
    "chamfer_mean": ("CD\nmean", ".2f"),
    "iou": ("IoU\n%", ".1f"),
    "f_score": ("F\n%", ".1f"),
    "primitives": ("primi-\ntives", ".1f"),
    "nodes": ("nodes", ".1f"),
    "needed_nodes": ("nodes\nneeded", ".1f"),
    "seconds": ("s per\nshape", ".2f"),
}
AGAIN = {"chamfer_mean": "CD,\nseed 1", "iou": "IoU,\nseed 1"}
_TINT, _PLAIN = 0.35, (188, 206, 232, 255)


def sheet(
    rows: Mapping[str, Sequence], titles: Sequence[str] | None = None, size: float = 1.7, dot: float = 2.0
) -> Figure:
    """Shapes in columns, a named row for each way to see them: meshes, or clouds (n, 3) as points.

    titles  under each column. All of a column are seen by one camera. Raises ValueError for rows of unequal lengths,
    and for none.
    """
    counts = {len(row) for row in rows.values()}
    if len(counts) != 1 or counts == {0} or titles is not None and {len(titles)} != counts:
        raise ValueError(
            f"found rows of {sorted(counts)} shapes and {titles and len(titles)} titles; expected as many, 1 or more"
        )
    columns = counts.pop()
    figure, axes = plt.subplots(
        len(rows), columns, figsize=(size * columns + 0.4, size * len(rows) + 0.3), dpi=100, squeeze=False
    )
    plt.close(figure)
    for k in range(columns):
        camera = Camera(bounds=bounds_of(*[_drawable(row[k]) for row in rows.values()]))
        for ax, row in zip(axes[:, k], rows.values(), strict=True):
            _draw(ax, row[k], camera, dot)
        if titles is not None:
            axes[-1, k].set_xlabel(titles[k], fontsize=8)
    for ax, name in zip(axes[:, 0], rows):
        ax.set_ylabel(name, fontsize=8)
    figure.subplots_adjust(0.04, 0.3 / (size * len(rows)), 1, 1, 0.02, 0.02)
    return figure


def _drawable(thing) -> np.ndarray | trimesh.Trimesh:
    return thing.detach().double().numpy() if isinstance(thing, Tensor) else thing


def _draw(ax, thing, camera: Camera, dot: float) -> None:
    if isinstance(thing, trimesh.Trimesh):
        draw(ax, thing, camera=camera)
    else:
        draw_points(ax, _drawable(thing), camera=camera, size=dot)


def plain(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    """A copy in one light colour."""
    surface = surface.copy()
    surface.visual.face_colors = np.tile(np.array(_PLAIN, np.uint8), (len(surface.faces), 1))
    return surface


@torch.no_grad()
def owners(said: SoftStump, points: Float[Tensor, "m 3"]) -> tuple[Tensor, Tensor]:
    """Of the first cloud's decided answer: which united node each point is in or nearest to, and which of its
    primitives has the surface nearest to the point; numbers (m,) each, counted from 0.

    Raises ValueError for an answer that unites nothing.
    """
    w_c, w_i, w_u = (logits[0] > 0 for logits in said.logits)
    if not w_u.any():
        raise ValueError("found an answer that unites no node; expected one or more")
    distances = said.distances(points.unsqueeze(0))[0]
    values = layers.signed_nodes(distances, w_c, w_i[:, w_u])
    node = w_u.nonzero()[:, 0][values.argmin(0)]
    away = distances.abs().masked_fill(~w_i[:, node], torch.inf)
    return node, away.argmin(0)


def parts_of(said: SoftStump, surface: trimesh.Trimesh, by: str = "node") -> trimesh.Trimesh:
    """A copy of the first cloud's surface, each face in the colour of the node, or the primitive, that it is of.

    The same number has the same colour in every answer of a network. Raises ValueError for another `by`.
    """
    if by not in ("node", "primitive"):
        raise ValueError(f"found by = {by!r}; expected 'node' or 'primitive'")
    surface = surface.copy()
    if surface.is_empty:
        return surface
    found = owners(said, torch.tensor(surface.triangles_center, dtype=torch.float32))
    numbers = found[0 if by == "node" else 1].numpy()
    palette = np.array([to_rgb(color) for color in COLORS])
    colors = 255 * (palette + _TINT * (1 - palette))
    surface.visual.face_colors = np.c_[colors[numbers % len(COLORS)], np.full(len(numbers), 255)].astype(
        np.uint8
    )
    return surface


def training_figure(log: Sequence[Mapping[str, float]]) -> Figure:
    """Left the loss of an epoch, right the IoU of the validation clouds, soft and decided."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 2.8), dpi=100)
    plt.close(figure)
    epochs = [row["epoch"] for row in log]
    left.plot(epochs, [row["reconstruction"] for row in log], color="#5e8bba")
    left.set(xlabel="epoch", ylabel="reconstruction loss")
    for name, label, color in (("val_soft_iou", "soft", "#e28f4f"), ("val_iou", "decided", "#1d3557")):
        right.plot(epochs, [100 * row[name] for row in log], label=label, color=color)
    right.set(xlabel="epoch", ylabel="IoU of test points, %")
    right.legend(fontsize=8, frameon=False)
    for ax in (left, right):
        ax.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    return figure


def gap_figure(said: SoftStump) -> Figure:
    """How many connections of some answers have which value."""
    values = torch.cat([each.flatten() for each in said.logits]).detach().sigmoid().numpy()
    figure, ax = plt.subplots(figsize=(6, 2.6), dpi=100)
    plt.close(figure)
    ax.hist(values, np.linspace(0, 1, 41), color="#1d3557")
    ax.set(yscale="log", xlabel="value of a connection", ylabel="connections")
    ax.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    return figure


def use_figure(used: Mapping[str, Float[np.ndarray, "shapes n"]]) -> Figure:
    """A panel for each name: a row a shape, a column a primitive or node, dark where the shape uses it."""
    figure, axes = plt.subplots(len(used), 1, figsize=(8.5, 1.5 * len(used) + 0.4), dpi=100, squeeze=False)
    plt.close(figure)
    for ax, (name, table) in zip(axes[:, 0], used.items()):
        ax.imshow(
            np.asarray(table, float), cmap="Greys", vmin=0, vmax=1.2, aspect="auto", interpolation="nearest"
        )
        ax.set(ylabel="shape", yticks=[])
        ax.set_xlabel(name, fontsize=9)
    figure.tight_layout()
    return figure


def rivals(path: Path = RESULT, rows: str = "rows") -> dict[str, dict]:
    """The measured rows, CSG-Stump Net first; see `measured_rows` for what is raised."""
    found = measured_rows(path, rows, {"chamfer_mean", "iou"}, COMMAND)
    order = [*NAMES, *sorted(found.keys() - NAMES.keys())]
    return {NAMES.get(name, name): found[name] for name in order if name in found}


def rivals_again(path: Path = RESULT) -> dict[str, dict]:
    """The rows of networks trained with a second seed; none where that was not measured."""
    again = path.parent / SECOND / path.name
    found = rivals(again) if again.is_file() else {}
    return {name: row for name, row in found.items() if name not in WITHOUT_SEED}


def rivals_table(path: Path = RESULT, rows: str = "rows") -> str:
    """The rows as lines of text: Chamfer distances times 1000, see data_scripts.measure_stump_net (their
    sum of both directions is twice the mean).

    The last columns have what networks came to that were trained with a second seed, where that was measured.
    """
    found, quantities = rivals(path, rows), dict(QUANTITIES)
    again = rivals_again(path) if rows == "rows" else {}
    for key, heading in AGAIN.items() if again else ():
        quantities[f"{key}, again"] = heading, QUANTITIES[key][1]
        for name in found.keys() & again.keys():
            found[name] = found[name] | {f"{key}, again": again[name][key]}
    columns = [["", "", *found]]  # two lines of headings
    for key, (heading, form) in quantities.items():
        cells = [format(row[key], form) if key in row else "-" for row in found.values()]
        columns.append([*("\n" + heading).split("\n")[-2:], *cells])
    names, *numbers = [(max(map(len, column)), column) for column in columns]
    aligned = [[f"{cell:{names[0]}}" for cell in names[1]]]
    aligned += [[f"{cell:>{width}}" for cell in column] for width, column in numbers]
    return "\n".join(map("  ".join, zip(*aligned)))


def rivals_figure(path: Path = RESULT) -> Figure:
    """Bars: Chamfer distance (shorter is better) and IoU (longer is better) of each row; a mark where a second seed
    came to."""
    found, again = rivals(path), rivals_again(path)
    figure, axes = plt.subplots(1, 2, figsize=(9.5, 0.34 * len(found) + 0.9), dpi=100, sharey=True)
    plt.close(figure)
    panels = {
        "chamfer_mean": "Chamfer distance x 1000, mean of both ways",
        "iou": "IoU of the test points, %",
    }
    for ax, (key, title) in zip(axes, panels.items()):
        bars = ax.barh(list(found), [row[key] for row in found.values()], color=COLORS[: len(found)])
        form = "%.2f" if key == "chamfer_mean" else "%.1f"
        ax.bar_label(bars, fmt=form, fontsize=8, label_type="center", color="white")
        both = [name for name in found if name in again]
        ax.plot(
            [again[name][key] for name in both], both, "k|", ms=11, mew=1.5, label="trained with another seed"
        )
        ax.set_title(title, fontsize=9)
        ax.margins(x=0.12)
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].invert_yaxis()
    if again:
        axes[0].legend(fontsize=8, frameon=False)
    figure.tight_layout()
    return figure
