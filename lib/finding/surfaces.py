"""The four surfaces that points can lie on: planes, spheres, cylinders, and cones, many of a kind at once.

    kind       numbers                        signed distance, negative inside
    plane      normal n, point p              n . (x - p)
    sphere     center c, radius r             |x - c| - r
    cylinder   axis a, point p, radius r      |y| - r                          y: x - p across the axis
    cone       axis a, apex p, angle t        |y| cos t - z sin t              z: x - p along the axis; |x - p| behind

A normal or an axis has any length but 0; the cone opens along its axis, and t is half of its angle, in radians. All go
on for ever. `turned`: the solid is on the other side, where the surface is that of a hole.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import least_squares

KINDS = ("plane", "sphere", "cylinder", "cone")  # simple ones first
WIDTHS = {"plane": 6, "sphere": 4, "cylinder": 7, "cone": 7}
FITTED = 600  # points that a fit looks at
EVALUATIONS = 30  # steps of a fit
TINY = 1e-12  # share of the longest of some vectors: shorter ones have no direction


@dataclass(frozen=True, eq=False)
class Surface:
    """kind, numbers (see above), whether it is turned, and which points of the cloud lie on it."""

    kind: str
    numbers: Float[np.ndarray, " p"]
    turned: bool
    members: Int[np.ndarray, " m"]

    def distance(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        """Signed: negative inside of the surface, whether turned or not."""
        return measure(self.kind, self.numbers[None], points)[0][0]

    def normals(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Out of the solid."""
        return measure(self.kind, self.numbers[None], points)[1][0] * (-1 if self.turned else 1)

    @property
    def axis(self) -> Float[np.ndarray, "3"]:
        """Unit: a plane's normal, a cylinder's or cone's axis; a sphere has none."""
        return self.numbers[:3] / np.linalg.norm(self.numbers[:3])

    @property
    def place(self) -> Float[np.ndarray, "3"]:
        """A plane's or a cylinder's point, a sphere's center, a cone's apex."""
        return self.numbers[:3] if self.kind == "sphere" else self.numbers[3:6]

    @property
    def size(self) -> float:
        """Radius, or a cone's angle."""
        return float(self.numbers[-1])

    def fitted(self, points: Float[np.ndarray, "n 3"]) -> "Surface":
        """Moved and sized to lie as near as can be to its members, of which a few may be far off.

        Distances count squared up to about the scale of the usual one and singly beyond (soft l1).
        """
        some = points[self.members]
        some = some[np.linspace(0, len(some) - 1, min(len(some), FITTED)).astype(int)]
        middle, size = some.mean(0), float(np.sqrt(((some - some.mean(0)) ** 2).sum(1).mean()))
        some = (some - middle) / size  # so that all numbers are about 1
        start = _scaled(self.kind, self.numbers, -middle / size, 1 / size)
        numbers = _plane(start, some) if self.kind == "plane" else _least(self.kind, start, some)
        return replace(self, numbers=_scaled(self.kind, numbers, middle, size))


def _plane(numbers: np.ndarray, points: np.ndarray) -> np.ndarray:
    middle = points.mean(0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    return np.concatenate([normal * np.sign(normal @ numbers[:3]), middle])


def _least(kind: str, numbers: np.ndarray, points: np.ndarray) -> np.ndarray:
    def residuals(numbers):
        return measure(kind, numbers[None], points)[0][0]

    usual = max(float(np.median(np.abs(residuals(numbers)))), 1e-6)
    found = least_squares(residuals, numbers, loss="soft_l1", f_scale=usual, max_nfev=EVALUATIONS)
    return _tidy(kind, found.x, points)


def _scaled(kind: str, numbers: np.ndarray, shift: np.ndarray, scale: float) -> np.ndarray:
    """The same surface in coordinates x -> scale x + shift."""
    numbers, place = numbers.copy(), slice(0, 3) if kind == "sphere" else slice(3, 6)
    numbers[place] = scale * numbers[place] + shift
    if kind in ("sphere", "cylinder"):
        numbers[-1] *= scale
    return numbers


def measure(
    kind: str, numbers: Float[np.ndarray, "h p"], points: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "h n"], Float[np.ndarray, "h n 3"]]:
    """Signed distances of n points to h surfaces of a kind, and the directions, unit, in which they grow."""
    if kind == "sphere":
        offset = points - numbers[:, None, :3]
        length = _lengths(offset)
        return length - np.abs(numbers[:, 3:]), offset / length[..., None]
    axis = numbers[:, None, :3] / _lengths(numbers[:, None, :3])[..., None]
    offset = points - numbers[:, None, 3:6]
    along = (offset * axis).sum(2)
    if kind == "plane":
        return along, np.broadcast_to(axis, offset.shape)
    across = offset - along[..., None] * axis
    rho = _lengths(across)
    if kind == "cylinder":
        return rho - np.abs(numbers[:, 6:]), across / rho[..., None]
    cos, sin = np.cos(numbers[:, 6:]), np.sin(numbers[:, 6:])
    mantle = rho * cos - along * sin
    behind = along < 0
    direction = across / rho[..., None] * cos[..., None] - axis * sin[..., None]
    return np.where(behind, _lengths(offset), mantle), direction


def through(
    kind: str, points: Float[np.ndarray, "h 3 3"], normals: Float[np.ndarray, "h 3 3"]
) -> Float[np.ndarray, "h p"]:
    """The surface through each three points (h, which, xyz) and their normals; where there is none, numbers that are
    not finite. Schnabel et al. 2007."""
    with np.errstate(all="ignore"):
        return _THROUGH[kind](points, normals)


def _plane_through(p, n):
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.hstack([normal * np.sign((normal * n.sum(1)).sum(1, keepdims=True)), p.mean(1)])


def _sphere_through(p, n):
    """The center is where the lines along two normals come nearest to each other."""
    center = _meeting(p[:, 0], n[:, 0], p[:, 1], n[:, 1])
    return np.hstack([center, np.linalg.norm(p[:, :2] - center[:, None], axis=2).mean(1, keepdims=True)])


def _cylinder_through(p, n):
    """The axis is across two normals; in the plane across the axis, the lines along the normals meet on it."""
    axis = np.cross(n[:, 0], n[:, 1])
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    flat = p[:, :2] - (p[:, :2] * axis[:, None]).sum(2, keepdims=True) * axis[:, None]
    flat += (p[:, :1] * axis[:, None]).sum(2, keepdims=True) * axis[:, None]
    center = _meeting(flat[:, 0], n[:, 0], flat[:, 1], n[:, 1])
    radius = np.linalg.norm(flat - center[:, None], axis=2).mean(1, keepdims=True)
    return np.hstack([axis, center, radius])


def _cone_through(p, n):
    """The apex is where the three tangent planes meet. One step from it to each point: a plane across the axis."""
    determinant = np.linalg.det(n)
    apex = np.full((len(p), 3), np.nan)
    good = np.abs(determinant) > 1e-3
    apex[good] = np.linalg.solve(n[good], (n * p).sum(2)[good][..., None])[..., 0]
    steps = p - apex[:, None]
    steps /= np.linalg.norm(steps, axis=2, keepdims=True)
    axis = np.cross(steps[:, 1] - steps[:, 0], steps[:, 2] - steps[:, 0])
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    axis *= np.sign((axis * steps.sum(1)).sum(1, keepdims=True))
    angle = np.arccos(np.clip((steps * axis[:, None]).sum(2), -1, 1)).mean(1, keepdims=True)
    return np.hstack([axis, apex, angle])


_THROUGH = {
    "plane": _plane_through,
    "sphere": _sphere_through,
    "cylinder": _cylinder_through,
    "cone": _cone_through,
}


def reasonable(kind: str, numbers: Float[np.ndarray, "h p"], diagonal: float) -> Bool[np.ndarray, " h"]:
    """Finite, neither so large or blunt that it is nearly a plane nor so sharp that it is nearly a cylinder."""
    good = np.isfinite(numbers).all(1)
    if kind == "cone":
        good &= (numbers[:, 6] > np.radians(4)) & (numbers[:, 6] < np.radians(80))
        return good & (np.abs(numbers[:, 3:6]).max(1) < 4 * diagonal)
    return good if kind == "plane" else good & (np.abs(numbers[:, -1]) < diagonal / 2)


def _tidy(kind: str, numbers: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Of a round surface: a unit axis, a size above 0, and a cylinder's point beside its members."""
    numbers = numbers.copy()
    if kind != "sphere":
        numbers[:3] /= np.linalg.norm(numbers[:3])
    if kind == "cylinder":
        numbers[3:6] += ((points.mean(0) - numbers[3:6]) @ numbers[:3]) * numbers[:3]
    numbers[-1] = abs(numbers[-1])
    return numbers


def _meeting(p, u, q, v) -> np.ndarray:
    """The middle of the shortest way between the lines p + s u and q + t v; not finite where they are parallel."""
    w, b = p - q, (u * v).sum(1)
    d, e = (u * w).sum(1), (v * w).sum(1)
    scale = 1 - b * b
    scale = np.where(scale > 1e-4, scale, np.nan)
    s, t = (b * e - d) / scale, (e - b * d) / scale
    return (p + s[:, None] * u + q + t[:, None] * v) / 2


def _lengths(vectors: np.ndarray) -> np.ndarray:
    """None is 0, so that all can be divided by; how small the least ones are depends on no unit."""
    lengths = np.sqrt((vectors**2).sum(-1))
    return np.maximum(lengths, max(np.finfo(float).tiny, TINY * lengths.max(initial=0.0)))
