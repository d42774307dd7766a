"""A solid as CSG-Stump Net learns from it: points on its surface with normals, and points of space, in or out.

The solid is moved and scaled so that its bounding box has diagonal 1 and its middle at the origin. Half of the points
of space are inside, half outside. They are chosen from candidates of which half are spread over the bounding box and a
tenth around it, and half lie near the surface, within about 2 % of the diagonal: of thin parts the box alone would say
next to nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass

import igl
import numpy as np
import trimesh
from jaxtyping import Bool, Float

from .base import DataError

AROUND = 1.1  # the candidates' box, as a multiple of the bounding box
NEAR = 0.02  # standard deviation of the distance from the surface, in diagonals
SKIN = 1e-4  # diagonals: so far in front of a face, and behind it, one looks whether the solid is there
ROUNDS = 40  # of candidates; a solid that needs more is hardly one

Contains = Callable[[Float[np.ndarray, "m 3"]], Bool[np.ndarray, " m"]]


@dataclass(frozen=True)
class SolidSample:
    """points, normals (p, 3): on the surface, uniform by area; queries (q, 3): the first half inside, the rest not."""

    points: Float[np.ndarray, "p 3"]
    normals: Float[np.ndarray, "p 3"]
    queries: Float[np.ndarray, "q 3"]


def sample_solid(
    mesh: trimesh.Trimesh, contains: Contains, points: int = 2048, queries: int = 4096, seed: int = 0
) -> SolidSample:
    """Samples of the solid that the faces of `mesh` bound, whichever way they are turned, among others: faces with the
    solid on both sides, inside of another part, are left out, and so are those of sheets without it on any side.

    contains  tells of points (m, 3), in the mesh's coordinates, whether they are in the solid; see `by_winding`
    Raises DataError for a mesh without extent, and where no points are found inside, outside or on it.
    """
    if not len(mesh.faces) or not np.isfinite(mesh.bounds).all() or not np.ptp(mesh.bounds, axis=0).any():
        raise DataError(f"found a mesh of {len(mesh.faces)} faces without extent; expected a solid")
    rng = np.random.default_rng(seed)
    low, high = mesh.bounds
    middle, scale = (low + high) / 2, 1 / np.linalg.norm(high - low)
    fitted = trimesh.Trimesh((mesh.vertices - middle) * scale, mesh.faces, process=False)

    def inside(places: np.ndarray) -> np.ndarray:
        return contains(places / scale + middle)

    on_surface = {"points on the surface": points}
    surface = _enough(lambda: _on_surface(fitted, inside, points, rng), on_surface)[0]
    draw = _Queries(fitted.bounds * AROUND, surface[:, :3], inside, queries, rng)
    halves = {"points inside": queries // 2, "points outside": queries - queries // 2}
    within, beyond = _enough(draw, halves)
    return SolidSample(surface[:, :3], surface[:, 3:], np.concatenate([within, beyond]))


def by_winding(mesh: trimesh.Trimesh) -> Contains:
    """Where the mesh winds around a point: its generalised winding number is nearer to 1, or -1, than to 0.

    That is the inside of a closed mesh, overlapping parts included, and a sensible guess for one with gaps (Jacobson et
    al. 2013; computed as by Barill et al. 2018).
    """
    corners, faces = np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)

    def contains(places: np.ndarray) -> np.ndarray:
        return np.abs(igl.fast_winding_number(corners, faces, np.array(places, dtype=np.float64))) > 0.5

    return contains


def _enough(draw: Callable[[], list[np.ndarray]], wanted: dict[str, int]) -> list[np.ndarray]:
    """Rows of several kinds, drawn until there are enough of each; the first ones."""
    rounds: list[list[np.ndarray]] = []
    for _ in range(ROUNDS):
        rounds.append(draw())
        found = [np.concatenate(kind) for kind in zip(*rounds)]
        if all(len(rows) >= count for rows, count in zip(found, wanted.values())):
            return [rows[:count] for rows, count in zip(found, wanted.values())]
    counts = ", ".join(f"{len(rows)} {name}" for rows, name in zip(found, wanted))
    raise DataError(f"found {counts}; expected a solid, with {max(wanted.values())} of each")


def _on_surface(mesh: trimesh.Trimesh, inside: Contains, count: int, rng) -> list[np.ndarray]:
    """Points of the mesh and directions out of the solid side by side, where the solid is on one side of the face."""
    points, faces = trimesh.sample.sample_surface(mesh, 2 * count, seed=int(rng.integers(2**31)))
    normals = mesh.face_normals[faces]
    in_front, behind = inside(points + SKIN * normals), inside(points - SKIN * normals)
    outward = np.where(in_front[:, None], -normals, normals)
    return [np.concatenate([points, outward], 1)[in_front != behind]]


@dataclass(frozen=True)
class _Queries:
    box: np.ndarray
    surface: np.ndarray
    inside: Contains
    count: int
    rng: np.random.Generator

    def __call__(self) -> list[np.ndarray]:
        """Some candidates: those inside, those outside."""
        spread = self.rng.uniform(*self.box, (self.count, 3))
        near = self.surface[self.rng.integers(len(self.surface), size=self.count)]
        near = near + self.rng.normal(0, NEAR, near.shape)
        candidates = self.rng.permutation(np.concatenate([spread, near]))
        candidates = candidates.astype(np.float16).astype(
            float
        )  # kept so: none may change sides when it is rounded
        is_in = self.inside(candidates)
        return [candidates[is_in], candidates[~is_in]]
