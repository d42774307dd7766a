"""A person's own shape as the networks want it: OBJ, PLY, STL, OFF, GLB or XYZ file -> points around the origin.

    cloud = read_cloud("mug.obj", count=2048)
    print(cloud.told)                            what was found, and what was done with it
    network(cloud.points[None])                  shapes of diagonal 1
    cloud.back(stump_points)                     the way back into the file's units

A mesh is sampled, uniform by area. Of a cloud without faces points are chosen. Points that are not finite, that come
twice, or that lie far from all others are left out.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import trimesh
from jaxtyping import Float
from scipy.spatial import cKDTree
from torch import Tensor

from .base import DataError

MESHES = (".obj", ".ply", ".stl", ".off", ".glb")
TEXTS = (".xyz", ".txt", ".csv", ".pts")
FEWEST = 20  # points: fewer show no shape
FAR = 8.0  # times as far from its neighbours as points are in the middle: an outlier
NEIGHBOURS = 8
LARGEST = 1 << 28  # bytes of a file


@dataclass(frozen=True)
class OwnCloud:
    """points: (file's point - middle) * scale each, around the origin, their bounding box with diagonal 1.

    told: what was found and done, in sentences.
    """

    points: Float[Tensor, "n 3"]
    middle: Float[Tensor, "3"]
    scale: float
    told: str

    def back(self, points: Float[Tensor, "*n 3"]) -> Float[Tensor, "*n 3"]:
        """Points of the networks' coordinates in those of the file."""
        return points / self.scale + self.middle.to(points)


def read_cloud(path: str | Path, count: int = 2048, seed: int = 0) -> OwnCloud:
    """`count` points of the shape in a file, moved and scaled. Raises DataError for a file that shows no shape."""
    path = Path(path)
    points, told = _points(path, count, seed)
    points, left_out = cleaned(points)
    if len(points) < FEWEST or not np.ptp(points, axis=0).any():
        raise DataError(f"{path}: found {len(points)} points that differ; expected a shape, {FEWEST} or more")
    if left_out:
        told.append(f"Left out: {left_out}.")
    rng = np.random.default_rng(seed)
    chosen = np.resize(rng.permutation(len(points)), count)
    if len(points) < count:
        told.append(f"There are fewer than {count}, so some come twice.")
    low, high = points.min(0), points.max(0)
    middle, scale = (low + high) / 2, float(1 / np.linalg.norm(high - low))
    told.append(
        f"Moved by {_numbers(-middle)} and scaled by {scale:.4g}: its box of {_numbers(high - low)} has diagonal 1 now."
    )
    made = torch.from_numpy((points[chosen] - middle) * scale).float()
    return OwnCloud(made, torch.from_numpy(middle), scale, " ".join(told))


def _points(path: Path, count: int, seed: int) -> tuple[np.ndarray, list[str]]:
    """Points of the file, and what it holds."""
    if count < 1:
        raise DataError(f"found a count of {count}; expected 1 or more")
    kind = path.suffix.lower()
    if kind not in (*MESHES, *TEXTS):
        raise DataError(
            f"{path}: found a file {kind or 'without an ending'}; expected {', '.join((*MESHES, *TEXTS))}"
        )
    try:
        if path.stat().st_size > LARGEST:
            raise DataError(f"{path}: found {path.stat().st_size} bytes; expected at most {LARGEST}")
        if kind in TEXTS:
            return _table(path)
        found = trimesh.load(path, process=False)
    except DataError:
        raise
    except Exception as error:  # readers of meshes raise whatever they meet
        raise DataError(f"{path}: cannot be read as {kind[1:]} ({error})") from error
    if isinstance(found, trimesh.Scene):
        found = found.to_mesh() if found.geometry else trimesh.Trimesh()
    if getattr(found, "faces", None) is not None and len(found.faces):
        area = found.area_faces
        if not (np.isfinite(area).all() and area.sum() > 0):
            raise DataError(f"{path}: found {len(found.faces)} triangles without area; expected a surface")
        points, _ = trimesh.sample.sample_surface(found, 2 * count, seed=seed)
        closed = "a closed surface" if found.is_watertight else "a surface with gaps"
        return np.asarray(points), [f"A mesh of {len(found.faces)} triangles, {closed}."]
    points = np.asarray(getattr(found, "vertices", np.zeros((0, 3))), dtype=float)
    return points, [f"A cloud of {len(points)} points."]


def _table(path: Path) -> tuple[np.ndarray, list[str]]:
    """A text with x, y and z first in each line, between spaces or commas; all else in a line is not looked at."""
    rows = []
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        words = line.split("#")[0].replace(",", " ").replace(";", " ").split()
        try:
            row = [float(word) for word in words[:3]]
        except ValueError:
            if not rows:
                continue  # a heading
            raise DataError(f"{path}, line {number}: found {line[:40]!r}; expected numbers x y z") from None
        if len(row) == 3:
            rows.append(row)
        elif words and rows:
            raise DataError(f"{path}, line {number}: found {len(row)} numbers; expected x y z")
    return np.array(rows).reshape(-1, 3), [f"A cloud of {len(rows)} points."]


def cleaned(points: Float[np.ndarray, "n 3"]) -> tuple[Float[np.ndarray, "m 3"], str]:
    """The points that show a shape, and how many were left out, and why; nothing for none."""
    finite = points[np.isfinite(points).all(1)]
    different = np.unique(finite, axis=0)
    reasons = {"not finite": len(points) - len(finite), "repeated": len(finite) - len(different)}
    if len(different) > NEIGHBOURS:
        away = cKDTree(different).query(different, NEIGHBOURS + 1)[0][:, 1:].mean(1)
        near = away <= FAR * np.median(away)
        reasons["far from all others"] = int((~near).sum())
        different = different[near]
    return different, ", ".join(f"{count} {reason}" for reason, count in reasons.items() if count)


def _numbers(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"
