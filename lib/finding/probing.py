"""The target occupancy: which of some test points are inside, told from an oriented cloud alone.

A point's winding number is the share of all directions in which it sees the surface from within: with an area a_i for
each cloud point p_i and its outward normal n_i,

    w(x) = sum_i a_i n_i . (p_i - x) / (4 pi |p_i - x|^3)          about 1 inside, about 0 outside

(Barill et al. 2018, Fast winding numbers for soups and clouds).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from .clouds import CloudError, PointCloud

NEAR = 12  # neighbours that tell a point's area
AT_ONCE = 1 << 22  # pairs of points in one step
MOST = 20_000  # points of a cloud that labels are told from
AROUND = 0.15  # share: so far around the bounds it must be empty, too
ENOUGH = 0.25  # of the probes below the surface must be in the solid
DOUBT = 0.2  # winding numbers so near to 1/2 tell nothing


@dataclass(frozen=True, eq=False)
class Probes:
    """points (n, 3); inside (n): in the solid, as far as the cloud tells."""

    points: Float[np.ndarray, "n 3"]
    inside: Bool[np.ndarray, " n"]


def probes(
    cloud: PointCloud,
    n: int,
    seed: int,
    step: float,
    expected: str = "points all over a surface, with outward normals",
) -> Probes:
    """About n test points with their labels, without those in doubt: half at `step` (a length) from the cloud's points,
    along their normals or against them; a quarter anywhere in the bounds, and a quarter in wider ones.

    Of a cloud of more than MOST points, so many are looked at, chosen at random.
    Raises CloudError where nothing is inside, with what is `expected` for that.
    """
    rng = np.random.default_rng(seed)
    low, high = cloud.bounds
    if len(cloud) > MOST:
        cloud = cloud[np.sort(rng.choice(len(cloud), MOST, replace=False))]
    widths = np.repeat([[step], [AROUND * cloud.diagonal]], [n // 4, n - n // 2 - n // 4], axis=0)
    anywhere = rng.uniform(low - widths, high + widths)
    at, side = rng.integers(len(cloud), size=n // 2), rng.choice([-step, step], (n // 2, 1))
    points = np.concatenate([anywhere, cloud.points[at] + side * cloud.normals[at]])
    number = winding_numbers(cloud, points)
    near = number[n - n // 2 :]
    if (near[side[:, 0] > 0] < -0.5 - DOUBT).mean() > ENOUGH:
        raise CloudError("the normals point into the solid", "outward ones: -normals")
    if (near[side[:, 0] < 0] > 0.5 + DOUBT).mean() < ENOUGH:
        raise CloudError("the cloud has no inside", expected)
    sure = np.abs(number - 0.5) > DOUBT
    return Probes(points[sure], number[sure] > 0.5)


def winding_numbers(cloud: PointCloud, points: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, " m"]:
    """About 1 inside of the surface, 0 outside."""
    middle, size = cloud.bounds.mean(0), cloud.diagonal  # single precision needs small numbers
    own = areas(cloud) / size**2
    closest = (own / 4).astype(np.float32)  # squared: nearer to a point than half a gap its neighbours decide
    weights = (own[:, None] * cloud.normals / (4 * np.pi)).astype(np.float32)
    places = ((cloud.points - middle) / size).astype(np.float32)
    points = ((points - middle) / size).astype(np.float32)
    # n . (p - x) = n . p - n . x, and |p - x|^2 = |p|^2 - 2 p . x + |x|^2: two matrix products for each block
    fixed, squares = (weights * places).sum(1), (places**2).sum(1)
    blocks = []
    for block in np.array_split(points, max(1, len(points) * len(cloud) // AT_ONCE)):
        square = squares - 2 * block @ places.T + (block**2).sum(1, keepdims=True)
        np.maximum(square, closest, out=square)
        blocks.append(((fixed - block @ weights.T) / (square * np.sqrt(square))).sum(1))
    return np.concatenate(blocks).astype(float)


def areas(cloud: PointCloud) -> Float[np.ndarray, " n"]:
    """The area that each point stands for: a disc's, shared by the neighbours in it that face the same way."""
    reach, near = cloud.tree.query(cloud.points, NEAR + 1)
    alike = (cloud.normals[near[:, 1:]] * cloud.normals[:, None]).sum(2) > 0.5
    return np.pi * reach[:, -1] ** 2 / alike.sum(1).clip(1)


def spread(cloud: PointCloud) -> float:
    """The noise: how far points are from the plane of their neighbours, a length, at the flatter places."""
    groups = cloud.points[_groups(cloud, 16)]
    groups = groups - groups.mean(1, keepdims=True)
    sizes = np.linalg.svd(groups, compute_uv=False)[:, 2] / np.sqrt(groups.shape[1] - 3)
    return float(np.quantile(sizes, 0.3))


def tilt(cloud: PointCloud) -> float:
    """The noise of normals: how far they are turned about each direction, radians, at the flattest places."""
    groups = cloud.normals[_groups(cloud, 10)]
    middle = groups.mean(1, keepdims=True)
    middle /= np.maximum(np.linalg.norm(middle, axis=2, keepdims=True), 1e-12)
    off = np.arccos(np.clip((groups * middle).sum(2), -1, 1))
    return float(np.quantile(np.sqrt((off**2).sum(1) / 2 / (groups.shape[1] - 1)), 0.1))


def _groups(cloud: PointCloud, size: int) -> np.ndarray:
    """A thousand points and their neighbours, (1000, size)."""
    some = np.linspace(0, len(cloud) - 1, min(len(cloud), 1000)).astype(int)
    return cloud.tree.query(cloud.points[some], size)[1]
