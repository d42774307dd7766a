"""Outlines of pictures: closed rings, their area, an SVG file, and a plate to print or to cut.

Coordinates are the picture's, x right and y DOWN, except for the plate's. Circles are polygons of the same area (see
lib.interpreters.rings). The area needs no polygons: it is exact.
"""

import operator

import torch
from manifold3d import CrossSection, Manifold

from .. import rings as shared
from ..checks import check_segments
from ..rings import Rings, swollen
from .geometry import fold, inside, trapezoid
from .packing import SIDE
from .primitives import Primitive
from .program import Program

DUST = 1e-6  # square pixels: smaller rings are left over from rounding
_AT_ONCE = 1 << 20  # places between borders that `area` looks at in one step


def rings(program: Program, segments: int) -> Rings:
    """The outline: closed rings, their shoelace positive for outer rings and negative for holes."""
    return shared.rings(section(program, segments), DUST)


def section(program: Program, segments: int) -> CrossSection:
    """The shape in the plane as Clipper2 holds it."""
    segments = check_segments(segments)
    operations = {"+": operator.add, "*": operator.xor, "-": operator.sub}
    return fold(program, lambda primitive: _polygon(primitive, segments), operations)


def plate(program: Program, height: float, segments: int) -> Manifold:
    """The picture as a plate, from z = 0 up to `height`. x grows right and y UP: seen from above it is the picture.

    The picture's row y lies at 63 - y.
    """
    upright = [ring[::-1] * (1, -1) + (0, SIDE - 1) for ring in rings(program, segments)]
    return shared.plate(upright, height, name="pixels")


def to_svg(outline: Rings, color: str) -> str:
    """One path in the picture's axes; the file shows the canvas."""
    return shared.svg(outline, color, f"-0.5 -0.5 {SIDE} {SIDE}")


def area(program: Program) -> float:
    """The exact area, in square pixels, of the true shape with its true circles. In milliseconds for what networks
    write; a hundred primitives take a second or so.

    A horizontal line meets each primitive from its left to its right border. Where borders end or cross, the order
    of the borders along the line may change; between two such heights it does not. There, what lies between two
    neighbours is all inside or all outside the shape, and is told from one point; its area is an integral.
    """
    borders, span = _borders(program)
    heights = torch.cat([span.flatten(), _crossings(borders, span)])
    heights = heights.mul(1e9).round().unique() / 1e9  # else rounding makes slabs between equal heights
    step = max(1, _AT_ONCE // len(borders))
    slabs = zip(heights[:-1].split(step), heights[1:].split(step))
    return sum(_area_between(program, borders, span, low, high) for low, high in slabs)


def _polygon(primitive: Primitive, segments: int) -> CrossSection:
    if primitive.kind == "c":
        x, y, r = primitive.numbers
        return CrossSection.circle(r * swollen(segments), segments).translate((x, y))
    (top, bottom), left, right = trapezoid(primitive)
    return CrossSection([[(left[0], top), (right[0], top), (right[1], bottom), (left[1], bottom)]])


def _borders(program: Program) -> tuple[torch.Tensor, torch.Tensor]:
    """(2 p, 5): a, b, sign, c, r of each border x = a + b y + sign sqrt(r^2 - (y - c)^2); (2 p, 2): from y to y."""
    borders, spans = [], []
    for primitive in program.primitives:
        if primitive.kind == "c":
            x, y, r = primitive.numbers
            borders += [(x, 0, -1, y, r), (x, 0, 1, y, r)]
            spans += [(y - r, y + r)] * 2
            continue
        (top, bottom), *edges = trapezoid(primitive)
        for above, below in edges:
            slope = (below - above) / (bottom - top)
            borders.append((above - slope * top, slope, 0, 0, 0))
            spans.append((top, bottom))
    return torch.tensor(borders, dtype=torch.float64), torch.tensor(spans, dtype=torch.float64)


def _crossings(borders: torch.Tensor, span: torch.Tensor) -> torch.Tensor:
    """All y at which two borders may cross; some more do no harm. A crossing that is not there is not a number."""
    straight = borders[:, 2] == 0
    edges = torch.cat([borders[straight, :2], span[straight]], 1).unique(dim=0)
    a, b, top, bottom = edges.unsqueeze(2).unbind(1)
    cx, cy, r = borders[borders[:, 2] > 0][:, [0, 3, 4]].unique(dim=0).T
    lines = (a.T - a) / (b - b.T)
    lines = torch.where((torch.maximum(top, top.T) <= lines) & (lines <= bottom.T), lines, torch.nan)
    # A line in a circle: a quadratic equation, square y^2 + 2 half y + rest = 0.
    square, half, rest = 1 + b**2, b * (a - cx) - cy, (a - cx) ** 2 + cy**2 - r**2
    root = (half**2 - square * rest).sqrt()
    # Two circles meet on a line across the one through their centers, at `along` of the way, `beside` to both sides.
    dx, dy = cx - cx[:, None], cy - cy[:, None]
    apart = dx**2 + dy**2
    along = (apart + r[:, None] ** 2 - r**2) / (2 * apart)
    beside = (r[:, None] ** 2 / apart - along**2).sqrt() * dx
    middle = cy[:, None] + along * dy
    mixed = torch.stack([(root - half) / square, (-root - half) / square])
    mixed = torch.where((top <= mixed) & (mixed <= bottom), mixed, torch.nan)
    found = torch.cat([each.flatten() for each in (lines, mixed, middle + beside, middle - beside)])
    return found[found.isfinite()]


def _area_between(program: Program, borders, span, low, high) -> float:
    """The shape's area in the slabs from y = low to high, between which no borders cross."""
    y = (low + high).unsqueeze(1) / 2
    here = (span[:, 0] < y) & (y < span[:, 1])
    a, b, sign, c, r = borders.T
    x = a + b * y + sign * (r**2 - (y - c) ** 2).clamp(min=0).sqrt()
    x, order = torch.where(here, x, torch.inf).sort(1)
    filled = inside(program, (x[:, 1:] + x[:, :-1]) / 2, y)
    integral = (_integral(borders, high) - _integral(borders, low)).gather(1, order).diff(dim=1)
    return float(torch.where(filled, integral, 0).sum())


def _integral(borders, y):
    """Of each border's x over y, up to a constant: (heights, borders)."""
    a, b, sign, c, r = borders.T
    y = y.unsqueeze(1)
    u = torch.minimum(torch.maximum(y - c, -r), r)
    w = ((r - u) * (r + u)).sqrt()
    return a * y + b * y**2 / 2 + sign * (u * w + r**2 * torch.atan2(u, w)) / 2
