"""Surfaces in a point cloud by random trial: efficient RANSAC (Schnabel, Wahl, Klein 2007), many trials at once.

Three points that lie near one another, with their normals, make a plane, a sphere, a cylinder, and a cone. Those that
their own points agree with are tried on some of the points that are left; the best are fitted to what lies on them, and
the very best, if it has enough points that hang together, is taken and its points are put away. That goes on until
trials find nothing any more. At last every surface is fitted to all of its points once more.

Ours, because what there is does not serve: CGAL's binding has this method, but no seed, its numbers come as a text of
six digits, and its licence (GPL) is not this project's; pyransac3d knows no normals and no cones, Open3D only planes.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .checks import check_count, is_number
from .clouds import CloudError, PointCloud
from .probing import spread, tilt
from .surfaces import KINDS, Surface, measure, reasonable, through

LEVELS = (16, 60, 240, 960)  # the three points are among so many neighbours: small surfaces need near ones
TRIED_ON = 1200  # points that tell how good a trial is
BEST = 3  # trials of each kind that are fitted
HANDICAP = {
    "plane": 1.0,
    "cylinder": 0.65,
    "sphere": 0.6,
    "cone": 0.55,
}  # round ones can nestle against flat ones


@dataclass(frozen=True)
class Options:
    """tolerance  share: how far a point may be from its surface; None: about three times the noise, 0.4 % to 2.5 %
    angle      degrees that its normal may be off; None: three and a half times its noise, 10 to 25
    fewest     share of the cloud's points that make a surface
    trials     threes of points at once
    patience   rounds of trials that may find nothing in a row
    most       surfaces: detection ends with so many, as on a torus, which no number of these surfaces is made of
    Raises CloudError for anything else."""

    tolerance: float | None = None
    angle: float | None = None
    fewest: float = 0.004
    trials: int = 300
    patience: int = 12
    most: int = 60

    def __post_init__(self):
        for name, most in (("tolerance", 1), ("angle", 90), ("fewest", 1)):
            given = getattr(self, name)
            if given is None and name != "fewest":
                continue
            if not is_number(given) or not 0 < given <= most:
                raise CloudError(f"{name} is {given!r:.40}", f"a number, more than 0 and at most {most}")
        for name in ("trials", "patience", "most"):
            check_count(name, getattr(self, name), 1, CloudError)


def detect(cloud: PointCloud, seed: int, options: Options | None = None) -> list[Surface]:
    """The surfaces of a cloud, the one with most points first. The same seed finds the same ones."""
    return _Search(cloud, np.random.default_rng(seed), options or Options()).run()


def tolerance_of(cloud: PointCloud, options: Options) -> float:
    """How far a point may be from its surface, a length."""
    if options.tolerance is not None:
        return options.tolerance * cloud.diagonal
    return float(np.clip(3.3 * spread(cloud) / cloud.diagonal, 0.004, 0.025)) * cloud.diagonal


def angle_of(cloud: PointCloud, options: Options) -> float:
    """How far a normal may be off, radians."""
    if options.angle is not None:
        return float(np.radians(options.angle))
    return float(np.clip(3.5 * tilt(cloud), np.radians(10), np.radians(25)))


class _Search:
    def __init__(self, cloud: PointCloud, rng: np.random.Generator, options: Options):
        self.cloud, self.rng, self.options = cloud, rng, options
        self.tolerance = tolerance_of(cloud, options)
        self.cos = float(np.cos(angle_of(cloud, options)))
        self.fewest = max(12, round(options.fewest * len(cloud)))
        self.graph = neighbours(cloud)
        self.left = np.ones(len(cloud), bool)

    def run(self) -> list[Surface]:
        options, surfaces, failures = self.options, [], 0
        while len(surfaces) < options.most and failures < options.patience and self.left.sum() >= self.fewest:
            best = self.best()
            failures = 0 if best else failures + 1
            if best:
                surfaces.append(best)
                self.left[best.members] = False
        return self.settled(surfaces)

    def best(self) -> Surface | None:
        """The best surface of one round of trials, fitted; None where none has enough points."""
        found, best = None, 0.0
        for surface in self.trials():
            surface = self.improved(surface)
            if surface is not None and (merit := self.merit(surface)) > best:
                found, best = surface, merit
        return found

    def merit(self, surface: Surface) -> float:
        """How many points lie on a surface, those far away or with other normals counting less: on a surface that is
        really there most are near, on one that merely passes by they are everywhere within the tolerance."""
        points, normals = self.cloud.points[surface.members], self.cloud.normals[surface.members]
        off = surface.distance(points) / self.tolerance
        tilt = (1 - (surface.normals(points) * normals).sum(1)) / (1 - self.cos)  # as the angle squared
        return float((1 - off**2 - tilt).clip(0).sum()) * HANDICAP[surface.kind]

    def trials(self) -> list[Surface]:
        """The most promising surfaces through three points."""
        left = np.flatnonzero(self.left)
        three = left[self.threes(self.cloud.points[left])]
        some = self.rng.permutation(left)[:TRIED_ON]
        found = []
        for kind in KINDS:
            numbers, turned = self.sound(kind, three)
            score = self.agreeing(kind, numbers, turned, some).sum(1)
            for i in np.argsort(-score, kind="stable")[:BEST]:
                found.append(Surface(kind, numbers[i], bool(turned[i]), some[:0]))
        return found

    def threes(self, points: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "h 3"]:
        """Which three points, that lie near one another, make each trial."""
        seeds = self.rng.integers(len(points), size=self.options.trials)
        most = min(LEVELS[-1], len(points))
        _, near = cKDTree(points).query(points[seeds], most)
        level = np.minimum(self.rng.choice(LEVELS, len(seeds)), most)
        others = (self.rng.random((len(seeds), 2)) * (level[:, None] - 1)).astype(int) + 1
        return np.column_stack([seeds, np.take_along_axis(near, others, 1)])

    def sound(self, kind: str, three: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(numbers, turned) of the surfaces that their own three points lie on."""
        points, normals = self.cloud.points[three], self.cloud.normals[three]
        numbers = through(kind, points, normals)
        good = reasonable(kind, numbers, self.cloud.diagonal)
        numbers, points, normals = numbers[good], points[good], normals[good]
        distance, direction = _each(kind, numbers, points)
        agrees = (direction * normals).sum(2)
        sign = np.sign(agrees.sum(1))
        on = (np.abs(distance) < self.tolerance).all(1) & (agrees * sign[:, None] > self.cos).all(1)
        if kind == "plane":
            on &= sign > 0
        return numbers[on], sign[on] < 0

    def agreeing(self, kind, numbers, turned, rows, wider=1.0) -> Bool[np.ndarray, "h n"]:
        """Which of these points of the cloud lie on each surface."""
        distance, direction = measure(kind, numbers, self.cloud.points[rows])
        agrees = np.einsum("hnd,nd->hn", direction, self.cloud.normals[rows])
        agrees *= np.where(turned, -1, 1)[:, None]
        return (np.abs(distance) < wider * self.tolerance) & (agrees > self.cos)

    def improved(self, surface: Surface) -> Surface | None:
        """Fitted twice to what lies on it; None if too few points of those that are left then do."""
        for wider in (2.0, 1.0):
            surface = self.populated(surface, self.left, wider)
            if len(surface.members) < self.fewest:
                return None
            surface = surface.fitted(self.cloud.points)
            if not reasonable(surface.kind, surface.numbers[None], self.cloud.diagonal)[0]:
                return None
        surface = self.populated(surface, self.left)
        return surface if len(surface.members) >= self.fewest else None

    def populated(self, surface: Surface, among: Bool[np.ndarray, " n"], wider: float = 1.0) -> Surface:
        """With all points that lie on it and hang together with enough others that do."""
        rows = np.flatnonzero(among)
        on = rows[
            self.agreeing(surface.kind, surface.numbers[None], np.array([surface.turned]), rows, wider)[0]
        ]
        _, part = connected_components(self.graph[on][:, on], directed=False)
        kept = np.bincount(part, minlength=1) >= self.fewest / 3
        return replace(surface, members=on[kept[part]])

    def settled(self, surfaces: list[Surface]) -> list[Surface]:
        """Fitted to all points that lie on them, each point on the nearest surface; doubles and remnants left out."""
        every = np.ones(len(self.cloud), bool)
        surfaces = [self.populated(surface, every) for surface in surfaces]
        surfaces = [surface.fitted(self.cloud.points) for surface in surfaces if len(surface.members)]
        return shared_out(self.cloud, surfaces, self.tolerance, self.cos, self.fewest)


def shared_out(cloud, surfaces: list[Surface], tolerance: float, cos: float, fewest: int) -> list[Surface]:
    """Each point is a member of the nearest of the surfaces it lies on; a surface that keeps too few is left out."""
    while surfaces:
        distance = np.stack([np.abs(s.distance(cloud.points)) for s in surfaces])
        agrees = np.stack([(s.normals(cloud.points) * cloud.normals).sum(1) for s in surfaces])
        distance[(distance > tolerance) | (agrees < cos)] = np.inf
        nearest = np.where(np.isfinite(distance.min(0)), distance.argmin(0), -1)
        counts = np.bincount(nearest[nearest >= 0], minlength=len(surfaces))
        if counts.min() >= fewest:
            surfaces = [replace(s, members=np.flatnonzero(nearest == i)) for i, s in enumerate(surfaces)]
            return sorted(surfaces, key=_members, reverse=True)
        surfaces = [s for i, s in enumerate(surfaces) if i != counts.argmin()]
    return surfaces


def snapped(cloud: PointCloud, surfaces: list[Surface]) -> PointCloud:
    """The points that lie on a surface, moved onto it, with its normals: noise and outliers are gone."""
    points, normals = [], []
    for surface in surfaces:
        own = cloud.points[surface.members]
        out = surface.normals(own)
        points.append(own - surface.distance(own)[:, None] * (-out if surface.turned else out))
        normals.append(out)
    return PointCloud(np.concatenate(points), np.concatenate(normals))


def neighbours(cloud: PointCloud, count: int = 10) -> csr_array:
    """Which points are among the nearest ones of which, (n, n)."""
    _, near = cloud.tree.query(cloud.points, count + 1)
    rows = np.repeat(np.arange(len(cloud)), count)
    return csr_array((np.ones(len(rows), np.int8), (rows, near[:, 1:].ravel())), shape=(len(cloud),) * 2)


def _each(
    kind: str, numbers: np.ndarray, points: Float[np.ndarray, "h 3 3"]
) -> tuple[np.ndarray, np.ndarray]:
    """Distances (h, 3) and directions (h, 3, 3) of each surface's own three points."""
    pairs = [measure(kind, numbers, points[:, i].reshape(-1, 3)) for i in range(3)]
    own = np.arange(len(numbers))
    return np.stack([d[own, own] for d, _ in pairs], 1), np.stack([g[own, own] for _, g in pairs], 1)


def _members(surface: Surface) -> int:
    return len(surface.members)
