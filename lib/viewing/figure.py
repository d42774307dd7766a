"""Figures: a shape on matplotlib axes, contact sheets, film strips, point clouds.

A shape is drawn as a picture (`lib.viewing.picture`), and everything that explains it (ghosts of boxes, points,
arrows, labels) as matplotlib lines and text in the same camera's coordinates. Whatever has `.mesh()` is a shape;
so are a `trimesh.Trimesh`, a `Cuboids`, and None (an empty picture).

Functions that return a figure have closed it in pyplot already: a notebook cell that ends with it shows it once.
"""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import trimesh
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import ArrayLike

from lib.interpreters.cuboids import Cuboids
from lib.interpreters.shapeassembly.meshing import boxes_mesh
from lib.viewing.camera import UNIT_BOUNDS, Camera
from lib.viewing.picture import finite, render

DPI = 100
GHOST, POINT, ARROW = "#5b6475", "#d62839", "#1d3557"  # colours of the overlays
PLAIN = np.array([168, 182, 205], dtype=np.uint8)  # of boxes that have no colours of their own
# Corners are numbered as `Cuboids.corners` orders them: bits x, y, z; an edge changes one bit.
BOX_EDGES = [(a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit]


def mesh_of(shape) -> trimesh.Trimesh:
    """The mesh of whatever can be drawn. Raises TypeError, naming the type, for anything else."""
    if shape is None:
        return trimesh.Trimesh()
    if isinstance(shape, trimesh.Trimesh):
        return shape
    if isinstance(shape, Cuboids):
        return boxes_mesh(shape, np.tile(PLAIN, (len(shape), 1)))
    if hasattr(shape, "mesh"):
        return shape.mesh()
    kind = type(shape).__name__
    raise TypeError(f"cannot draw a {kind}: it needs a method mesh(), or to be a Trimesh or Cuboids")


def bounds_of(*things) -> np.ndarray:
    """(2, 3) lowest and highest corner around shapes, Cuboids or (n, 3) points; the unit cube around nothing."""
    clouds = []
    for thing in things:
        points = thing if isinstance(thing, np.ndarray) else finite(mesh_of(thing)).triangles
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        clouds.append(points[np.isfinite(points).all(axis=1)])
    points = np.concatenate([*clouds, np.empty((0, 3))])
    return np.stack([points.min(axis=0), points.max(axis=0)]) if len(points) else np.array(UNIT_BOUNDS)


def draw(
    ax: Axes,
    shape,
    *,
    camera: Camera | None = None,
    ghost: Cuboids | None = None,
    points: ArrayLike | Mapping[str, ArrayLike] | None = None,
    arrows: Sequence[tuple] = (),
    labels: Mapping[str, Sequence] | Sequence[tuple] = (),
    opacity: float = 1.0,
    shadow: bool = True,
) -> Camera:
    """Draw one shape, and what explains it, on matplotlib axes; returns the camera, for further overlays.

    camera   where to look from; left out, one that frames the shape and its ghost.
    ghost    boxes drawn as dashed wireframes, such as the bounding box of an assembly.
    points   (n, 3) world points drawn as dots, or {colour: (n, 3)} for several colours.
    arrows   (start, end) or (start, end, colour), each point (3,).
    labels   (text, point) pairs, or {text: point}.
    opacity  of the picture, 0..1: below 1 it lets the overlays speak.
    """
    camera = camera or Camera(bounds=bounds_of(shape, ghost))
    pixels = int(np.clip(np.ptp(ax.get_window_extent().get_points(), axis=0).min(), 32, 1200) + 0.5)
    image = render(mesh_of(shape), camera, pixels, shadow)
    ax.imshow(image, extent=camera.window, interpolation="bilinear", alpha=opacity, zorder=2)
    _frame(ax, camera)
    if ghost is not None:
        draw_ghost(ax, ghost, camera)
    for color, group in points.items() if isinstance(points, Mapping) else [(POINT, points)]:
        if group is not None:
            dot = {"s": 34, "edgecolors": "white", "linewidths": 1.0, "zorder": 5}
            ax.scatter(*camera.project(group).T, c=[to_rgb(color)], **dot)
    for start, end, *color in arrows:
        draw_arrow(ax, start, end, camera, *color)
    for text, point in labels.items() if isinstance(labels, Mapping) else labels:
        draw_label(ax, text, point, camera)
    return camera


def draw_ghost(ax: Axes, cuboids: Cuboids, camera: Camera, color: str = GHOST) -> None:
    """Boxes as dashed wireframes. The three edges at a box's farthest corner pass behind the picture."""
    for corners in cuboids.corners().detach().cpu().numpy():
        flat, farthest = camera.project(corners), int(camera.depth(corners).argmax())
        for edge in BOX_EDGES:
            behind = farthest in edge
            depth = {"alpha": 0.55, "zorder": 1} if behind else {"alpha": 0.9, "zorder": 3}
            ax.plot(*flat[list(edge)].T, color=color, linewidth=0.9, linestyle=(0, (4, 3)), **depth)


def draw_arrow(ax: Axes, start, end, camera: Camera, color: str = ARROW) -> None:
    """An arrow between two world points (3,)."""
    tail, head = camera.project(np.array([start, end], dtype=float))
    style = {"arrowstyle": "-|>", "color": color, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", head, tail, arrowprops=style, zorder=6)


def draw_label(ax: Axes, text: str, point, camera: Camera) -> None:
    """Small text beside a world point (3,), with a white rim so that it can be read on any colour."""
    spot = camera.project(np.array([point], dtype=float))[0]
    rim = [withStroke(linewidth=2.5, foreground="white")]
    place = {"xytext": (4, 4), "textcoords": "offset points", "zorder": 7}
    ax.annotate(text, spot, fontsize=8, color="#1b1f27", path_effects=rim, **place)


def draw_points(
    ax: Axes, points: ArrayLike, *, camera: Camera | None = None, color=None, size: float = 4.0
) -> Camera:
    """Draw a point cloud (n, 3), nearer points over farther ones and a little darker; returns the camera.

    color: a matplotlib colour, or (n, 3) or (n, 4) in 0..1, one a point. size: area of a dot in square points.
    """
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    camera = camera or Camera(bounds=bounds_of(points))
    depth = camera.depth(points)
    order = np.argsort(-depth)
    given = np.asarray("#3d5a80" if color is None else color)
    colors = np.broadcast_to(given[..., :3] if given.ndim else to_rgb(str(given)), points.shape)
    haze = 0.45 * (depth - depth.min(initial=np.inf)) / max(np.ptp(depth), 1e-9) if len(points) else depth
    colors = colors + (1 - colors) * haze[:, None]  # far points fade towards the white page
    ax.scatter(*camera.project(points)[order].T, s=size, c=colors[order], linewidths=0, zorder=4)
    _frame(ax, camera)
    return camera


def show(
    shapes,
    titles: Sequence[str] | None = None,
    *,
    columns: int | None = None,
    size: float = 2.4,
    same_scale: bool = False,
    details: Sequence[Mapping] | None = None,
    **options,
) -> Figure:
    """A sheet of shapes: one shape, or a sequence of them, side by side.

    titles      one under each picture.        columns  in the sheet; at most 6 when left out.
    size        inches a picture.              same_scale  one camera for all, so sizes can be compared.
    details     one mapping of `draw` options a picture; `options` are `draw` options for all of them.
    Raises ValueError when titles or details are not as many as the shapes.
    """
    shapes = list(shapes) if isinstance(shapes, (list, tuple)) else [shapes]
    titles, details = _one_each(titles, shapes, "titles", ""), _one_each(details, shapes, "details", {})
    if same_scale and "camera" not in options:
        ghosts = [detail.get("ghost", options.get("ghost")) for detail in details]
        options["camera"] = Camera(bounds=bounds_of(*shapes, *ghosts))
    lines = max((title.count("\n") + 1 for title in titles if title), default=0)
    figure, axes = _sheet(len(shapes), columns, size, lines)
    for ax, shape, title, detail in zip(axes, shapes, titles, details, strict=True):
        draw(ax, shape, **{**options, **detail})
        ax.set_xlabel(title, fontsize=9)
    return figure


def film_strip(
    states: Sequence, captions: Sequence[str], *, columns: int | None = None, size: float = 2.4, **options
) -> Figure:
    """The states of a program as it runs, one frame each, seen by one camera; captions in the type of code.

    Options are those of `show`; `details` gives one frame its own ghost, points, arrows or labels.
    """
    with plt.rc_context({"font.family": "monospace"}):
        return show(states, captions, columns=columns, size=size, same_scale=True, **options)


def _one_each(given, shapes: list, what: str, empty) -> list:
    """One entry a shape, or ValueError."""
    given = [empty] * len(shapes) if given is None else list(given)
    if len(given) != len(shapes):
        raise ValueError(f"{len(given)} {what} for {len(shapes)} shapes: one each, please")
    return given


def _sheet(count: int, columns: int | None, size: float, lines: int) -> tuple[Figure, list[Axes]]:
    """A figure, closed in pyplot, and its square axes, with room for `lines` of text under each."""
    columns = max(1, min(columns or 6, count))
    rows, row_height = max(1, -(-count // columns)), size + 0.18 * lines + 0.04 * bool(lines)
    figure = plt.figure(figsize=(columns * size, rows * row_height), dpi=DPI)
    plt.close(figure)
    axes, height = [], rows * row_height
    for row, column in list(np.ndindex(rows, columns))[:count]:
        low = (rows - row) * row_height - size  # inches from the bottom
        axes.append(figure.add_axes((column / columns, low / height, 1 / columns, size / height)))
    return figure, axes


def _frame(ax: Axes, camera: Camera) -> None:
    """Show exactly the camera's window, without ticks or a box around it."""
    left, right, bottom, top = camera.window
    ax.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xticks=[], yticks=[])
    ax.spines[:].set_visible(False)
