"""From a point cloud to a stump, by search alone: surfaces, pieces, solids, matrices.

    surfaces   RANSAC, see `detecting`; then `aligning`
    labels     which test points are inside, from the cloud snapped to its surfaces, see `probing`
    solids     which surfaces bound a part of the solid together, see `pieces`; made boxes and so on by `candidates`
    matrices   a binary program, see `matrices`

(CSG-Stump Net, Ren et al. 2021, "CSG-Stump Structure": detection and binary programming; how is left open there.)
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch

from lib.interpreters.stump import Primitive, Stump
from lib.interpreters.stump.primitives import distances

from .aligning import aligned
from .candidates import candidates
from .checks import check_count
from .clouds import CloudError, PointCloud
from .detecting import Options, detect, snapped, tolerance_of
from .matrices import Matrices, SearchError, check_limits, solve
from .pieces import ends, pieces
from .probing import Probes, probes
from .surfaces import Surface

PROBES = 10_000
STEP = 0.01  # share: probes at the surface are at least so far from it
FAR = 10  # times as far from the middle as half of the points: farther ones are hardly meant


@dataclass(frozen=True, eq=False)
class Found:
    """stump       what was found, without primitives and nodes that are not used
    surfaces    what was detected in the cloud
    candidates  solids that the matrices could choose from, K
    probes      test points and their labels, told from the cloud
    matrices    objective (the share of probes that are wrong), bound, gap and method of the search
    seconds     of each step: "surfaces", "labels", "solids", "matrices"
    """

    stump: Stump
    surfaces: list[Surface]
    candidates: list[Primitive]
    probes: Probes
    matrices: Matrices
    seconds: dict[str, float]

    @property
    def objective(self) -> float:
        return self.matrices.objective

    @property
    def gap(self) -> float:
        return self.matrices.gap


def find_stump(
    cloud: PointCloud,
    seed: int = 0,
    options: Options | None = None,
    nodes: int = 24,
    seconds: float = 10.0,
    search: Callable[..., Matrices] = solve,
) -> Found:
    """A stump for a cloud. The same seed finds the same one, as long as the matrices take less than `seconds`.

    options  of the detection; nodes  at most so many intersections; search  `solve` or `greedy`, of `matrices`
    Raises CloudError where there is no surface, or nothing inside of what there is, and for a bad cloud, seed or
    options; SearchError for bad nodes, seconds or search.
    """
    seed, options = _checked(cloud, seed, options)
    nodes, seconds = check_limits(nodes, seconds)
    if not callable(search):
        raise SearchError(f"search is {search!r:.40}", "the function solve or greedy")
    clock = _Clock()
    tolerance = tolerance_of(cloud, options)
    surfaces = aligned(detect(cloud, seed, options), cloud.points, tolerance)
    if not surfaces:
        raise CloudError(
            "no plane, sphere, cylinder or cone in the cloud", "points on some, with their normals"
        )
    clock.stop("surfaces")
    clean = snapped(cloud, surfaces)
    tests = probes(clean, PROBES, seed, max(STEP * cloud.diagonal, tolerance), _solid(cloud, tolerance))
    clock.stop("labels")
    everything = [*surfaces, *ends(surfaces, cloud.points, tolerance)]
    solids = candidates(everything, pieces(everything, tests, seed), clean.bounds)
    clock.stop("solids")
    inside = distances(solids, torch.from_numpy(tests.points)) <= 0
    matrices = search(inside, torch.from_numpy(tests.inside), nodes=nodes, seconds=seconds)
    clock.stop("matrices")
    stump = Stump(tuple(solids), matrices.complement, matrices.intersection, matrices.union).pruned()
    return Found(stump, surfaces, solids, tests, matrices, clock.seconds)


def _checked(cloud, seed, options) -> tuple[int, Options]:
    if not isinstance(cloud, PointCloud):
        raise CloudError(f"the cloud is a {type(cloud).__name__}", "a PointCloud(points, normals)")
    if not isinstance(options, Options | None):
        raise CloudError(f"options are a {type(options).__name__}", "Options(...)")
    return check_count("seed", seed, 0, CloudError), options or Options()


def _solid(cloud: PointCloud, tolerance: float) -> str:
    """What a cloud must be like to have an inside, with the numbers that show what is likely amiss."""
    share = tolerance / cloud.diagonal
    text = "points all over a solid that is thicker than the tolerance, "
    text += f"{tolerance:.3g} here ({share:.2%} of the diagonal, {cloud.diagonal:.4g}; see Options)"
    away = np.linalg.norm(cloud.points - np.median(cloud.points, axis=0), axis=1)
    if away.max() > FAR * np.median(away):
        text += f"; and no stray points: point {int(away.argmax())} is {away.max():.4g} away from the middle"
    return text


class _Clock:
    def __init__(self):
        self.last, self.seconds = time.perf_counter(), {}

    def stop(self, step: str) -> None:
        now = time.perf_counter()
        self.seconds[step], self.last = now - self.last, now
