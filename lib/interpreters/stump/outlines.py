"""Stumps of the plane as closed rings (see lib.interpreters.rings): outlines, areas, plates, SVG files.

Clipper2 rounds to 8 decimals. So it works on a canvas of 64 units, whatever the window's size, as for CSG's pictures.
"""

import math

import numpy as np
import torch
import trimesh
from jaxtyping import Float
from manifold3d import CrossSection
from torch import Tensor

from .. import rings as shared
from ..checks import MOST_SEGMENTS, check_segments
from ..meshes import triangles
from ..rings import Rings, swollen
from .cutting import assemble, reach, side, sight
from .poses import matrices
from .primitives import Circle, Primitive, Square, Triangle
from .program import Stump

SIDE = 64  # of the canvas, its middle at the origin
DUST = 1e-6  # square and cubic canvas units: smaller rings and bodies are left over from rounding

Window = Float[Tensor, "2 2"]


def outline(stump: Stump, window: Window, segments: int) -> Rings:
    """Closed rings in the stump's coordinates, their shoelace positive for outer rings and negative for holes."""
    middle, unit = _canvas(window)
    return [ring * unit + middle for ring in _rings(stump, window, segments)]


def area(stump: Stump, window: Window) -> float:
    """The area of the shape within the window, with as fine circles as there are."""
    return _section(stump, window, MOST_SEGMENTS).area() * _canvas(window)[1] ** 2


def plate(stump: Stump, window: Window, height: float | None, segments: int) -> trimesh.Trimesh:
    """The shape from z = 0 up to `height`, by default an eighth of the window's longest side."""
    middle, unit = _canvas(window)
    height = SIDE / 8 * unit if height is None else height
    made = shared.plate(_rings(stump, window, segments), height, unit)
    surface = triangles(made, DUST * min(1, height / unit))
    if not surface.is_empty:
        surface.vertices = surface.vertices * unit + (*middle, 0)
    return surface


def to_svg(outline: Rings, window: Window, color: str) -> str:
    """One path, turned upside down, as y points down in SVG; the file shows a square about the window."""
    middle, unit = _canvas(window)
    drawn = [(ring - middle) / unit * (1, -1) for ring in outline]
    return shared.svg(drawn, color, f"{-SIDE // 2} {-SIDE // 2} {SIDE} {SIDE}")


def _canvas(window: Window) -> tuple[Float[np.ndarray, "2"], float]:
    """The point at the canvas's middle, and how long a canvas unit is."""
    low, high = window.numpy()
    return (low + high) / 2, side(window) / SIDE or 1.0


def _rings(stump: Stump, window: Window, segments: int) -> Rings:
    return shared.rings(_section(stump, window, check_segments(segments)), DUST)


def _section(stump: Stump, window: Window, segments: int) -> CrossSection:
    """The shape within the window as Clipper2 holds it, on the canvas."""
    (middle, unit), box = _canvas(window), sight(stump, window)

    def polygon(corners: Float[np.ndarray, "corners 2"]) -> CrossSection:
        return CrossSection([(corners - middle) / unit])

    (left, low), (right, high) = box.tolist()
    everything = polygon(np.array([(left, low), (right, low), (right, high), (left, high)]))
    return assemble(
        stump, lambda primitive: polygon(_corners(primitive, segments, box)), everything, CrossSection()
    )


def _corners(primitive: Primitive, segments: int, box: Window) -> Float[np.ndarray, "corners 2"]:
    """Of one primitive, counter-clockwise, in the stump's coordinates; large enough to reach through the box."""
    single = primitive.to("cpu", torch.float64)
    own = np.array(_own_corners(single, segments, reach(single, box)))
    return own @ matrices(single.rotation).numpy() + single.translation.numpy()


def _own_corners(p: Primitive, segments: int, far: float) -> list[tuple[float, float]]:
    sizes = p.sizes.abs().tolist()
    if isinstance(p, Circle):
        angles, radius = 2 * math.pi / segments, sizes[0] * swollen(segments)
        return [(radius * math.cos(k * angles), radius * math.sin(k * angles)) for k in range(segments)]
    if isinstance(p, Triangle):
        left, right, height = sizes
        return [(-left, 0), (right, 0), (0, height)]
    x, y = sizes if isinstance(p, Square) else (far, far)
    top = y if isinstance(p, Square) else 0  # a half-plane ends at its line
    return [(-x, -y), (x, -y), (x, top), (-x, top)]
