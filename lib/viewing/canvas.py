"""Figures of pictures in the plane: sheets of them, two compared, and a program's primitives over its picture.

A figure is one page in pixels of the pictures, x to the right and y DOWN, on which pictures are stamped like prints.
Whatever makes a picture may be given: a Picture, a program or its text, an image[y, x] of booleans.
"""

import re
from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon, Rectangle
from torch import Tensor, tensor

from lib.interpreters.csg import KINDS, Picture, Primitive, Program, Shapes, Tree, execute, parse
from lib.interpreters.csg.packing import SIDE
from lib.interpreters.csg.primitives import triangle_corners

DPI, WIDTH, GAP = 100, 800, 8  # dots an inch, widest page in dots, pixels between two pictures
INK, PAPER, GRID, RIM, SOFT = "#24344d", "#ffffff", "#e9edf3", "#b8c0cc", "#667080"
COLOR_A, COLOR_B, BOTH = "#0072b2", "#e08700", "#9aa3b0"  # told apart by colour-blind readers too
COLORS = {"c": "#d55e00", "s": "#0072b2", "t": "#009e73"}  # of circles, squares and triangles


def image_of(picture) -> np.ndarray:
    """image[y, x] of whatever makes a picture. Raises TypeError or ValueError for what is none."""
    if isinstance(picture, str):
        picture = parse(picture)
    refuse_space(picture)
    if isinstance(picture, Program):
        picture = execute(picture)
    if isinstance(picture, Picture):
        return picture.image.cpu().numpy()
    if isinstance(picture, Tensor):
        picture = picture.detach().cpu().numpy()
    if not isinstance(picture, np.ndarray):
        kind = type(picture).__name__
        raise TypeError(f"cannot draw a {kind}: give a Picture, a program, its text, or an image[y, x]")
    if picture.ndim != 2 or not np.isin(picture, (0, 1)).all():
        raise ValueError(
            f"found an array {picture.shape} of {picture.dtype}; expected image[y, x] of booleans"
        )
    return picture.astype(bool)


def refuse_space(thing) -> None:
    """Raises TypeError for a program, a shape or shapes of space."""
    if getattr(thing, "dimensions", 2) == 3:
        found = "Shapes" if isinstance(thing, Shapes) else f"a {type(thing).__name__}"
        expected = "an image or a program of the plane; show_solids of lib.viewing.voxels draws space"
        raise TypeError(f"found {found} in space; expected {expected}")


def page(width: int, height: int, scale: float) -> tuple[Figure, Axes]:
    """An empty page of so many pixels, `scale` dots each; the figure is closed in pyplot."""
    figure = plt.figure(figsize=(width * scale / DPI, height * scale / DPI), dpi=DPI)
    plt.close(figure)
    ax = figure.add_axes((0, 0, 1, 1), xlim=(0, width), ylim=(height, 0), autoscale_on=False)
    ax.axis("off")
    return figure, ax


def fitting_scale(width: int, largest: float = 4) -> float:
    """Dots a pixel, so that so many pixels fit a notebook: whole where possible, then pixels stay sharp squares."""
    scale = min(largest, WIDTH / max(1, width))
    return int(scale) if scale >= 2 else max(1, int(4 * scale) / 4)


def stamp(
    ax: Axes, image: np.ndarray, x: float, y: float, color: str = INK, rim: str = RIM, wide: float = 0.8
):
    """One picture with its upper left corner at (x, y): ON pixels in a colour, a light line every eight pixels."""
    height, width = image.shape
    _paste(ax, np.where(image[..., None], to_rgba(color), to_rgba(PAPER)), x, y)
    if dots_of(ax) > 1.2:
        lines = np.arange(8, min(height, width), 8) + 0.5  # pixel k has its center at k + 0.5 on the page
        style = {"color": RIM, "alpha": 0.28, "linewidth": 0.6, "zorder": 1.1}
        ax.vlines(x + lines[lines < width], y, y + height, **style)
        ax.hlines(y + lines[lines < height], x, x + width, **style)
    frame(ax, x, y, width, height, rim, wide)


def overlay(ax: Axes, a: np.ndarray, b: np.ndarray, x: float, y: float) -> None:
    """Two pictures of one size on each other, as `stamp` places one: blue only in a, orange only in b, grey in both."""
    colors = np.full((*a.shape, 3), to_rgb(PAPER))
    for part, color in ((a & b, BOTH), (a & ~b, COLOR_A), (b & ~a, COLOR_B)):
        colors[part] = to_rgb(color)
    _paste(ax, colors, x, y)
    frame(ax, x, y, a.shape[1], a.shape[0])


def _paste(ax: Axes, colors: np.ndarray, x: float, y: float) -> None:
    height, width = colors.shape[:2]
    # Where a pixel is not a whole number of dots, some would come out wider than their neighbours: smooth them there.
    sharp = "nearest" if abs(dots_of(ax) - round(dots_of(ax))) < 1e-6 else "auto"
    ax.imshow(colors, extent=(x, x + width, y + height, y), interpolation=sharp, aspect="auto", zorder=1)


def frame(ax: Axes, x: float, y: float, width: float, height: float, color: str = RIM, wide: float = 0.8):
    """A thin frame around a picture."""
    ax.add_patch(Rectangle((x, y), width, height, fill=False, edgecolor=color, linewidth=wide, zorder=1.3))


def dots_of(ax: Axes) -> float:
    """How many dots a pixel of the page has."""
    return ax.figure.get_figwidth() * DPI / np.ptp(ax.get_xlim())


def write(ax: Axes, text: str, x: float, y: float, size: float = 9, code: bool = False, **style) -> None:
    """Text below the point (x, y), in the middle; code in the type of code."""
    family = "monospace" if code else None
    style = {"ha": "center", "va": "top", "color": "#1b1f27", "linespacing": 1.15, **style}
    ax.text(x, y, text, fontsize=size, family=family, parse_math=False, **style)  # $ is a token, not TeX


def show_pictures(
    pictures, titles: Sequence[str] | None = None, *, columns: int | None = None, scale: float | None = None
) -> Figure:
    """A sheet of pictures: one, a sequence of them, or Shapes as executed by `execute_many`.

    titles   one under each.      columns  6 when left out, or 10 from 25 pictures on.
    scale    dots a pixel: when left out, as large as a notebook is wide, 4 at most.
    Raises ValueError when the titles are not as many as the pictures, and TypeError for pictures of space. A blank
    picture with a cross was no program.
    """
    images, valid = _images(pictures)
    titles = [""] * len(images) if titles is None else list(titles)
    if len(titles) != len(images):
        raise ValueError(f"{len(titles)} titles for {len(images)} pictures: one each, please")
    columns = max(1, min(columns or (6 if len(images) < 25 else 10), len(images)))
    cell = max((image.shape[1] for image in images), default=SIDE) + GAP
    scale = scale or fitting_scale(columns * cell)
    titles = [_wrapped(title, int(cell * scale / 7.2)) for title in titles]  # a letter is 7.2 dots wide
    below = round(14 * max((t.count("\n") + bool(t) for t in titles), default=0) / scale)
    row = max((image.shape[0] for image in images), default=SIDE) + GAP + below
    figure, ax = page(columns * cell, max(1, -(-len(images) // columns)) * row, scale)
    for place, (image, title, good) in enumerate(zip(images, titles, valid)):
        x, y = place % columns * cell + GAP // 2, place // columns * row + GAP // 2
        stamp(ax, image, x, y)
        if not good:
            ax.plot([x + 8, x + 56, np.nan, x + 8, x + 56], [y + 8, y + 56, np.nan, y + 56, y + 8], color=RIM)
        write(ax, title, x + image.shape[1] / 2, y + image.shape[0] + 4 / scale, 8.5, _is_code(title))
    return figure


def _images(pictures) -> tuple[list[np.ndarray], Sequence[bool]]:
    """Images, and which of them are of programs that are valid. Raises TypeError for what is no picture."""
    refuse_space(pictures)
    if isinstance(pictures, Shapes):
        return list(pictures.images.cpu().numpy()), pictures.valid.tolist()
    many = isinstance(pictures, (list, tuple)) or getattr(pictures, "ndim", 2) == 3
    images = [image_of(picture) for picture in (pictures if many else [pictures])]
    return images, [True] * len(images)


def _is_code(title: str) -> bool:
    return re.search(r"\w\([\d, ]+\)", title) is not None


def _wrapped(title: str, width: int) -> str:
    """Lines of at most so many letters where the title has a place to break: a blank, or the end of a token."""
    lines = []
    for line in title.splitlines():
        lines.append("")
        for piece in re.findall(r"\w+\([^()]*\)[-+*]*|\w+|\s+|.", line):
            if lines[-1] and len(lines[-1]) + len(piece) > width:
                lines.append("")
            lines[-1] += piece if lines[-1] else piece.lstrip()
    return "\n".join(lines)


def show_difference(a, b, titles: Sequence[str] = ("A", "B"), *, scale: float = 3) -> Figure:
    """Two pictures, and where they differ: blue only in A, orange only in B, grey in both."""
    a, b = image_of(a), image_of(b)
    if a.shape != b.shape:
        raise ValueError(f"the pictures are {a.shape} and {b.shape}; expected the same size")
    (height, width), (first, second) = a.shape, titles
    legend = round(50 / scale)
    figure, ax = page(3 * (width + GAP), height + GAP + legend, scale)
    places = [GAP // 2 + k * (width + GAP) for k in range(3)]
    top, under = GAP // 2, GAP // 2 + height + 5 / scale
    for x, image, title, color in zip(places, (a, b), (first, second), (COLOR_A, COLOR_B)):
        stamp(ax, image, x, top, color)
        write(ax, f"{title}: {image.sum():,} px", x + width / 2, under)
    stamp(ax, a & b, places[2], top, BOTH)
    for only, color in ((a & ~b, COLOR_A), (b & ~a, COLOR_B)):
        _paste(ax, np.where(only[..., None], to_rgba(color), 0.0), places[2], top)
    parts = [(a & ~b, f"only {first}", COLOR_A), (a & b, "both", BOTH), (b & ~a, f"only {second}", COLOR_B)]
    keys = [Patch(color=color, label=f"{name} {part.sum():,}") for part, name, color in parts]
    _legend(ax, keys, 1.5 * (width + GAP), under + 22 / scale)
    write(ax, f"intersection over union {overlap(a, b):.3f}", places[2] + width / 2, under)
    return figure


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union of two images; 1 for two blank ones."""
    union = (a | b).sum()
    return float((a & b).sum() / union) if union else 1.0


def show_primitives(programs, titles: Sequence[str] | None = None, *, scale: float | None = None) -> Figure:
    """The outlines of each program's primitives over its picture; dashed ones are cut away.

    programs: one, or a sequence of at most six side by side; programs or texts.
    """
    many = isinstance(programs, (list, tuple))
    programs = [parse(p) if isinstance(p, str) else p for p in (programs if many else [programs])]
    titles = [""] * len(programs) if titles is None else list(titles)
    if len(titles) != len(programs):
        raise ValueError(f"{len(titles)} titles for {len(programs)} programs: one each, please")
    cell = SIDE + GAP
    scale = scale or fitting_scale(len(programs) * cell, largest=6)
    lines = max((title.count("\n") + bool(title) for title in titles), default=0)
    below = round(14.4 * lines) + 4 * (lines > 0)  # dots that titles take
    figure, ax = page(len(programs) * cell, cell + round((24 + below) / scale), scale)
    for place, (program, title) in enumerate(zip(programs, titles)):
        x, y = place * cell + GAP // 2, GAP // 2
        stamp(ax, image_of(program), x, y, "#d3d9e2")
        for primitive, cut in signed(program):
            outline(ax, primitive, cut, x, y)
        write(ax, title, x + SIDE / 2, y + SIDE + 4 / scale)
    kinds = [
        kind for kind in COLORS if any(p.kind == kind for program in programs for p in program.primitives)
    ]
    keys = [Line2D([], [], color=COLORS[kind], label=KINDS[kind].name) for kind in kinds]
    if any(cut for program in programs for _, cut in signed(program)):
        keys.append(Line2D([], [], color=SOFT, linestyle=(0, (3, 2)), label="cut away"))
    _legend(ax, keys, len(programs) * cell / 2, cell + (below - 4) / scale)
    return figure


def signed(program: Program) -> list[tuple[Primitive, bool]]:
    """Each primitive, and whether it stands on the right of an odd number of subtractions."""
    found, waiting = [], [(program.tree(), False)]
    while waiting:
        node, cut = waiting.pop()
        if isinstance(node, Tree):
            waiting += [(node.right, cut ^ (node.operation.symbol == "-")), (node.left, cut)]
        else:
            found.append((node, cut))
    return found


def outline(ax: Axes, primitive: Primitive, cut: bool, x: float, y: float) -> None:
    """The outline of a primitive of the plane on the picture at (x, y); dashed if it is cut away."""
    rim = rim_of(primitive)
    if isinstance(rim, list):
        shape = Polygon([(x + u, y + v) for u, v in rim])
    else:
        shape = Circle((x + rim[0], y + rim[1]), rim[2])
    shape.set(fill=False, edgecolor=COLORS[primitive.kind], linewidth=1.8, zorder=1.2, joinstyle="round")
    shape.set_linestyle((0, (3, 2)) if cut else "-")
    ax.add_patch(shape)
    shape.set_clip_path(Rectangle((x, y), SIDE, SIDE, transform=ax.transData))


def rim_of(primitive: Primitive) -> tuple[float, float, float] | list[tuple[float, float]]:
    """The rim of the pixels of a primitive of the plane: x, y and radius of a circle, or corners. Pixel 0 is 0 to 1."""
    px, py, r = primitive.numbers
    if primitive.kind == "c":
        return px + 0.5, py + 0.5, r - 0.5
    if primitive.kind == "s":
        half = 1.412 * r / 2
        left, top, right, bottom = (int(edge) for edge in (px - half, py - half, px + half, py + half))
        return [(left, top), (right + 1, top), (right + 1, bottom + 1), (left, bottom + 1)]
    apex, base, left, right = (int(edge) for edge in triangle_corners(tensor(primitive.numbers)))
    return [(px + 0.5, apex - 0.5), (right + 1, base + 1), (left, base + 1)]


def _legend(ax: Axes, keys: list, x: float, y: float) -> None:
    style = {"ncols": len(keys), "fontsize": 8, "frameon": False, "handlelength": 1.2, "columnspacing": 0.9}
    place = {"loc": "upper center", "bbox_to_anchor": (x, y), "bbox_transform": ax.transData}
    legend = ax.legend(handles=keys, borderpad=0, borderaxespad=0, handletextpad=0.4, **style, **place)
    for text in legend.get_texts():
        text.set_parse_math(False)
