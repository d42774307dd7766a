"""Outlines of plane figures: closed rings out of Clipper2 (by way of manifold3d), points on them, plates and SVG files.

Circles are polygons whose corners lie a little outside the true circle, so that both have the same area: with 64
corners no point of the polygon is farther than r/1200 from the circle. Clipper2 rounds coordinates to 8 decimals.
"""

import math
import re

import numpy as np
from jaxtyping import Float
from manifold3d import CrossSection, Manifold

LOWEST, HIGHEST = 1e-6, 1e6  # plates beyond would lose their corners to rounding
_COLOR = re.compile(r"#?[A-Za-z0-9]+|[a-z]+\([0-9., %]*\)")

Rings = list[Float[np.ndarray, "_ 2"]]  # corners; not all rings have as many


def rings(section: CrossSection, dust: float) -> Rings:
    """The outline: closed rings, each (corners, 2) without its first corner repeated.

    Their `shoelace` is positive for outer rings and negative for holes. Rings that enclose no more than `dust` are left
    out: they are left over from rounding.
    """
    contours = (contour for contour in section.to_polygons() if abs(shoelace(contour)) > dust)
    return [np.asarray(contour, dtype=np.float64) for contour in contours]


def swollen(segments: int) -> float:
    """How much farther out the corners of a polygon are than the circle that has the same area."""
    return math.sqrt(2 * math.pi / segments / math.sin(2 * math.pi / segments))


def shoelace(ring: Float[np.ndarray, "corners 2"]) -> float:
    """The area within a ring, the sum of x y' - x' y over 2; negative for one that runs the other way round."""
    x, y = ring[:, 0], ring[:, 1]
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def points_on(outline: Rings, n: int, seed: int) -> Float[np.ndarray, "n 2"]:
    """n points on the rings, uniform by length."""
    start = np.concatenate(outline)
    step = np.concatenate([np.roll(ring, -1, axis=0) for ring in outline]) - start
    rng = np.random.default_rng(seed)
    length = np.linalg.norm(step, axis=1)
    edge = rng.choice(len(start), n, p=length / length.sum())
    return start[edge] + rng.random((n, 1)) * step[edge]


def plate(upright: Rings, height: float, unit: float = 1.0, name: str = "") -> Manifold:
    """The figure from z = 0 up, rings with y up. unit: how long a unit of the rings is, `height` being a true length;
    name: what the message calls a length of 1. Raises ValueError for a height that is far too low or high."""
    if not LOWEST * unit <= height <= HIGHEST * unit:
        expected = f"{LOWEST * unit:g} to {HIGHEST * unit:g} {name}".rstrip()
        raise ValueError(f"found a height of {height}; expected {expected}")
    return CrossSection(upright).extrude(height / unit) if upright else Manifold()


def svg(outline: Rings, color: str, canvas: str) -> str:
    """One path, y DOWN; canvas: the file's viewBox, a square. Coordinates are rounded to 3 decimals."""
    if not _COLOR.fullmatch(color):
        raise ValueError(f"found {color!r}; expected a colour such as '#5e8bba' or 'black'")
    path = "\n".join("M" + " ".join(f"{_short(x)},{_short(y)}" for x, y in ring) + "Z" for ring in outline)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{canvas}" width="512" height="512">\n'
        f'<path fill="{color}" fill-rule="evenodd" d="\n{path}"/>\n</svg>\n'
    )


def _short(number: float) -> str:
    """At most 3 decimals, and no -0."""
    return f"{round(float(number), 3) + 0.0:.10g}"
