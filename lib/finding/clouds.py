"""Point clouds with normals: checked ones, and made ones to try a search on.

Units are those of the points; a length that is called a share is a share of the cloud's diagonal.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import cKDTree
from torch import Tensor

from .checks import check_count, is_number

FEWEST = 100  # points: fewer do not show what a surface is
FLAT = 1e-6  # share: thinner clouds lie in one plane
TILT = 10.0  # radians that a normal is off for each diagonal that points are off: a share of 0.5 % tilts by 3 degrees


class CloudError(ValueError):
    """A cloud in which nothing can be found: says what was found and what was expected."""

    def __init__(self, found: str, expected: str):
        super().__init__(f"{found}; expected {expected}")
        self.found, self.expected = found, expected


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points on the surface of a solid, and the directions that lead out of it there; any length but 0. A point that
    comes again counts once, with its first normal.

    Raises CloudError for no or too few points, numbers that are not finite, points that lie in one plane, and for
    normals that are missing, fewer, or zero.
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]

    def __post_init__(self):
        points, normals = _table("points", self.points), _normals(self.normals)
        _check_points(points)
        if len(normals) != len(points):
            raise CloudError(f"{len(points)} points and {len(normals)} normals", "a normal for each point")
        points, normals = _different(points, normals)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        if not length.all():
            raise CloudError(f"the normal of point {int(np.argmin(length))} is zero", "a direction")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "normals", normals / length)

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows) -> "PointCloud":
        """Some of the points."""
        return PointCloud(self.points[rows], self.normals[rows])

    @cached_property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lowest and highest coordinates."""
        return np.stack([self.points.min(0), self.points.max(0)])

    @cached_property
    def diagonal(self) -> float:
        """Length of the diagonal of the bounds."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @cached_property
    def tree(self) -> cKDTree:
        """For nearest neighbours."""
        return cKDTree(self.points)


def sample_cloud(
    mesh: trimesh.Trimesh, n: int = 10_000, seed: int = 0, noise: float = 0.0, outliers: float = 0.0
) -> PointCloud:
    """n points on a mesh, uniform by area, with the normals of their faces.

    noise     share; each coordinate is off by a normal deviate of this size, and each normal tilted by one of TILT
              times as many radians about both directions across it, as normals are that were estimated from such points
    outliers  of all points, 0 to 1: these lie anywhere in the mesh's bounds instead, and point anywhere
    Raises CloudError for what is no mesh or has no area, and for numbers out of range.
    """
    if not isinstance(mesh, trimesh.Trimesh):
        raise CloudError(f"the mesh is a {type(mesh).__name__}", "a trimesh.Trimesh")
    n, seed = check_count("n", n, FEWEST, CloudError), check_count("seed", seed, 0, CloudError)
    if not len(mesh.faces) or not mesh.area > 0:
        raise CloudError(f"a mesh of {len(mesh.faces)} faces and area {mesh.area:g}", "a surface")
    if not (is_number(noise) and is_number(outliers) and noise >= 0 and 0 <= outliers <= 1):
        raise CloudError(f"noise {noise} and outliers {outliers}", "noise 0 or more, outliers 0 to 1")
    rng = np.random.default_rng(seed)
    points, faces = trimesh.sample.sample_surface(mesh, n, seed=seed)
    points, normals = np.array(points), np.array(mesh.face_normals[faces])
    low, high = mesh.bounds
    points += rng.normal(size=points.shape) * noise * np.linalg.norm(high - low)
    normals += rng.normal(size=normals.shape) * noise * TILT
    wrong = rng.permutation(n)[: round(outliers * n)]
    points[wrong] = rng.uniform(low, high, (len(wrong), 3))
    normals[wrong] = rng.normal(size=(len(wrong), 3))
    return PointCloud(points, normals)


def _table(name: str, given) -> np.ndarray:
    try:
        made = np.asarray(given.detach().cpu() if isinstance(given, Tensor) else given)
        table = made.real.astype(float)
    except (TypeError, ValueError):
        raise CloudError(f"{name} are a {type(given).__name__}", "numbers (n, 3)") from None
    if np.iscomplexobj(made):
        raise CloudError(f"{name} are complex", "numbers (n, 3)")
    if table.size == 0:
        raise CloudError(f"the cloud has no {name}", "numbers (n, 3)")
    if table.ndim != 2 or table.shape[1] != 3:
        raise CloudError(f"{name} have the shape {table.shape}", "(n, 3)")
    if not np.isfinite(table).all():
        row = int(np.argmin(np.isfinite(table).all(1)))
        raise CloudError(f"{name}[{row}] is {table[row].tolist()}", "finite numbers")
    return table


def _normals(given) -> np.ndarray:
    if given is None:
        raise CloudError(
            "the cloud has no normals",
            "one outward normal a point: sample_cloud(mesh) has them; for a scan, a program such as MeshLab or Open3D "
            "estimates them from neighbours and turns them outwards",
        )
    return _table("normals", given)


def _check_points(points: np.ndarray) -> None:
    if len(points) < FEWEST:
        raise CloudError(f"the cloud has {len(points)} points", f"at least {FEWEST}")
    sizes = np.linalg.svd(points - points.mean(0), compute_uv=False) / np.sqrt(len(points))
    if sizes[0] == 0:
        raise CloudError("all points of the cloud are one", "the surface of a solid")
    if sizes[2] <= FLAT * sizes[0]:
        what = "on a line" if sizes[1] <= FLAT * sizes[0] else "in a plane"
        raise CloudError(f"all points of the cloud lie {what}", "the surface of a solid")


def _different(points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Without points that came before, in the same order."""
    first = np.sort(np.unique(points, axis=0, return_index=True)[1])
    if len(first) < FEWEST:
        raise CloudError(f"the cloud has {len(first)} different points", f"at least {FEWEST}")
    return points[first], normals[first]
