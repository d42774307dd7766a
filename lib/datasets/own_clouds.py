"""A person's own shape as the networks want it: OBJ, PLY, STL, OFF, GLB or XYZ file -> points around the origin.

    cloud = read_cloud("mug.obj", count=2048)
    print(cloud.told)                            what was found, and what was done with it
    network(cloud.points[None])                  shapes of diagonal 1; it looks at as many as in its training
    cloud.back(stump_points)                     the way back into the file's units

A mesh is sampled, uniform by area. Of a cloud without faces points are chosen. Points that are not finite, that come
twice, or that lie far from all others are left out.
"""

import codecs
import io
import itertools
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import trimesh
from jaxtyping import Float
from scipy.spatial import cKDTree
from torch import Tensor

from ..interpreters.checks import whole
from .base import DataError

MESHES = (".obj", ".ply", ".stl", ".off", ".glb")
TEXTS = (".xyz", ".txt", ".csv", ".pts")
FEWEST = 20  # points: fewer show no shape
FAR = 8.0  # times as far from its neighbours as points are in the middle: an outlier
NEIGHBOURS = 8
LARGEST = 1 << 28  # bytes of a file
MOST = 1 << 20  # points that can be asked for
SMALL, BIG = 1e-30, 1e30  # the networks' single precision can hold what lies between
SAMPLED = 1 << 14  # points of a mesh, however few are asked for: their box is nearly the mesh's
AXES = ["x", "y", "z"]
WITH_COMMA = re.compile(r"[-+]?\d+(,\d+)?([eE][-+]?\d+)?")  # a number with a decimal comma, or a whole one


@dataclass(frozen=True)
class OwnCloud:
    """points: (file's point - middle) * scale each, around the origin. The box of all points that were left, of which
    these are some, has diagonal 1; of a mesh, that of 16,384 of its points or more.

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
    """`count` points of the shape in a file, in random order, moved and scaled; fewer where a cloud has no more.

    Raises DataError for a file that shows no shape, and for a count or a seed that is none.
    """
    path = Path(path)
    points, told = _points(path, *_asked(count, seed))
    points, left_out = cleaned(points)
    if len(points) < FEWEST or not np.ptp(points, axis=0).any():
        raise DataError(f"{path}: found {len(points)} points that differ; expected a shape, {FEWEST} or more")
    if left_out:
        told.append(f"Left out: {left_out}.")
    rng = np.random.default_rng(seed)
    chosen = rng.permutation(len(points))[:count]
    if len(points) < count:
        told.append(f"Left are {len(points)} points, fewer than {count}.")
    low, high = points.min(0), points.max(0)
    if np.abs(points).max() > BIG or (high - low).max() < SMALL:
        raise DataError(
            f"{path}: found x, y, z from {_numbers(low)} to {_numbers(high)}; expected a shape between {SMALL:g} and "
            f"{BIG:g} in size"
        )
    middle, sides = (low + high) / 2, high - low
    scale = float(1 / np.linalg.norm(sides))
    moved = f"Moved by {_numbers(0 - middle)} and scaled by {scale:.4g}"  # 0 - 0 is 0, -0 would be told
    told.append(f"{moved}: its box of {_numbers(sides)} has diagonal 1 now.")
    made = torch.from_numpy((points[chosen] - middle) * scale).float()
    return OwnCloud(made, torch.from_numpy(middle), scale, " ".join(told))


def _asked(count: int, seed: int) -> tuple[int, int]:
    """The same as ints. Raises DataError."""
    if whole(count) is None or not 1 <= count <= MOST:
        raise DataError(f"found a count of {count!r}; expected a whole number from 1 to {MOST}")
    if whole(seed) is None or seed < 0:
        raise DataError(f"found a seed of {seed!r}; expected a whole number, 0 or more")
    return whole(count), whole(seed)


def _points(path: Path, count: int, seed: int) -> tuple[np.ndarray, list[str]]:
    """Points of the file, and what it holds."""
    kind = path.suffix.lower()
    if kind not in (*MESHES, *TEXTS):
        raise DataError(
            f"{path}: found a file {kind or 'without an ending'}; expected {', '.join((*MESHES, *TEXTS))}"
        )
    try:
        if path.stat().st_size > LARGEST:
            raise DataError(f"{path}: found {path.stat().st_size} bytes; expected at most {LARGEST}")
        if not path.is_file():
            raise DataError(f"{path}: found a folder, a device, or the like; expected a file")
        return _table(path) if kind in TEXTS else _geometry(path, count, seed)
    except DataError:
        raise
    except Exception as error:  # readers of meshes raise whatever they meet
        told = f"{path}: cannot be read as {kind[1:]} ({error})"
        raise DataError(f"{told}; expected a whole file of that kind") from error


def _geometry(path: Path, count: int, seed: int) -> tuple[np.ndarray, list[str]]:
    """Points on all meshes of a file; where it has none, all its vertices."""
    content = path.read_bytes().removeprefix(codecs.BOM_UTF8)  # which hides the first line of an OBJ file
    found = trimesh.load(io.BytesIO(content), file_type=path.suffix[1:].lower(), process=False)
    parts = found.dump() if isinstance(found, trimesh.Scene) else [found]
    meshes = [part for part in parts if isinstance(part, trimesh.Trimesh) and len(part.faces)]
    if not meshes:
        vertices = [np.asarray(part.vertices, dtype=float).reshape(-1, 3) for part in parts]
        points = np.concatenate([np.zeros((0, 3)), *vertices])
        if not len(points):
            kind = path.suffix[1:].lower()
            raise DataError(
                f"{path}: found neither triangles nor points; expected a whole file of the kind {kind}"
            )
        return points, [f"A cloud of {len(points)} points."]
    mesh = trimesh.util.concatenate(meshes)
    with np.errstate(over="ignore", invalid="ignore"):
        area = mesh.area_faces.sum()
    if not 0 < area < np.inf:
        raise DataError(f"{path}: found {len(mesh.faces)} triangles of area {area:g}; expected a surface")
    points, _ = trimesh.sample.sample_surface(mesh, max(2 * count, SAMPLED), seed=seed)
    closed = "a closed surface" if _is_closed(mesh) else "a surface with gaps"
    return np.asarray(points), [f"A mesh of {len(mesh.faces)} triangles, {closed}."]


def _is_closed(mesh: trimesh.Trimesh) -> bool:
    """Whatever common corners the file repeats: all in STL, others at seams."""
    corners, numbers = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return trimesh.Trimesh(corners, numbers.reshape(-1)[mesh.faces], process=False).is_watertight


def _table(path: Path) -> tuple[np.ndarray, list[str]]:
    """A text with x, y and z first in each line, between spaces, commas or semicolons; all else is not looked at.

    Between spaces, semicolons, or commas with a space behind, numbers may have decimal commas.
    """
    rows = []
    content = path.read_bytes()
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = content.decode("utf-16" if wide else "utf-8", errors="replace").removeprefix("\ufeff")
    for number, line in enumerate(text.splitlines(), start=1):
        words = _cells(line.split("#")[0])
        try:
            row = [float(word.replace(",", ".")) for word in words[:3]]
        except ValueError:
            if rows or _told_otherwise(words):
                found = f"{path}, line {number}: found {line[:40]!r}"
                raise DataError(f"{found}; expected numbers x y z, the first in each line") from None
            continue  # a heading
        if len(row) == 3:
            rows.append(row)
        elif words and rows:
            raise DataError(f"{path}, line {number}: found {len(row)} numbers; expected x y z")
    if not rows:
        raise DataError(f"{path}: found no line that begins with three numbers; expected one for each point")
    return np.array(rows).reshape(-1, 3), [f"A cloud of {len(rows)} points."]


def _cells(line: str) -> list[str]:
    """What stands between semicolons, spaces or commas; empty texts where nothing stands between two marks."""
    words = [word.removesuffix(",") for word in line.split()]
    if ";" in line:
        parts = line.split(";")
    elif len(words) >= 3 and all(map(WITH_COMMA.fullmatch, words[:3])):
        return words
    else:
        parts = line.split(",") if "," in line else words
    return list(itertools.chain.from_iterable(part.split() or [""] for part in parts)) if words else []


def _told_otherwise(words: list[str]) -> bool:
    """Whether it is no heading over x, y, z: a row with a gap, or names of which others come first."""
    names = [word.strip("\"'/").lower() for word in words]
    gap = "" in words[:3] and any(word and WITH_COMMA.fullmatch(word.replace(".", ",")) for word in words[:3])
    return gap or set(AXES) <= set(names) and names[:3] != AXES


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
