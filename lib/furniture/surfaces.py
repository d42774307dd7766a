"""A dense surface for every leaf: turned legs, pillows, bent backs, rounded boards … inside the leaf's box.

One idea makes them all. A closed curve, the section, is swept along one axis of the unit cube; on its way it grows
and shrinks (the profile), and its middle may wander off (the bend). The result is stretched until it touches the
six faces of the cube, and the leaf's box carries it into the world.

    section     |u|^e + |v|^e = 1      e = 2 is round, e = 40 nearly square
    profile     (share of the way, size of the section) pairs
    bend        how far the middle line bulges, in half thicknesses of the section, and along which axis

Which of them a leaf gets depends on its label, its proportions and a style number: one style a graph, so that the
four legs of a chair are turned alike.
"""

import zlib
from functools import lru_cache

import numpy as np
import torch
import trimesh
from torch import Tensor

from lib.extractor.partgraph import Part, PartGraph

SIDES = 24  # corners of a section
ROUND, SQUARE = 2.0, 40.0  # exponents
POSTS = {
    *("leg", "foot", "central_support", "caster_stem", "bar_stretcher", "lever", "frame_vertical_bar"),
    *("back_frame_vertical_bar", "back_surface_vertical_bar", "arm_near_vertical_bar"),
    *("back_connector", "head_connector"),
}
SOFT = {"seat_single_surface", "headrest", "arm_sofa_style", "arm_horizontal_bar"}
PLATES = {"pedestal", "board", "glass", "arm_writing_table", "countertop"}
FRONTS = {"drawer", "cabinet_door"}

STRAIGHT = ((0.0, 0.97), (0.02, 1.0), (0.98, 1.0), (1.0, 0.97))
TAPERED = ((0.0, 0.55), (0.02, 0.58), (1.0, 1.0))
TURNED = (
    *((0.0, 0.5), (0.05, 0.75), (0.1, 0.5), (0.3, 0.7), (0.5, 0.95), (0.6, 0.6), (0.63, 0.85), (0.66, 0.6)),
    *((0.75, 0.9), (0.8, 1.0), (1.0, 1.0)),
)
VASE = ((0.0, 0.45), (0.04, 0.7), (0.08, 0.45), (0.35, 1.0), (0.6, 0.6), (0.9, 0.7), (0.93, 1.0), (1.0, 1.0))
SPINDLE = tuple((s, 0.6 + 0.4 * np.sin(np.pi * s)) for s in np.linspace(0, 1, 9))
PILLOW = tuple((s, (1 - 0.9 * (2 * s - 1) ** 4) ** (1 / 6)) for s in np.linspace(0, 1, 13).tolist())
KNOBBED = ((0.0, 1.0), (0.85, 1.0), (0.85, 0.06), (0.95, 0.06), (0.96, 0.12), (1.0, 0.1))


@lru_cache(maxsize=512)
def sweep(along: int, exponent: float, profile: tuple, bend: float = 0.0, bent: int = 2) -> trimesh.Trimesh:
    """A section swept along axis number `along` of the unit cube, touching all six faces; treat it as read-only.

    The middle line bulges towards axis number `bent` by a parabola that is `bend` high at both ends.
    """
    share, size = np.array(resampled(profile)).T
    angle = np.arange(SIDES) * 2 * np.pi / SIDES  # with the corners of a square among them
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    section = np.sign(circle) * np.abs(circle) ** (2 / exponent)
    rings = np.empty((len(share), SIDES, 3))
    rings[..., along] = share[:, None]
    rings[..., [axis for axis in range(3) if axis != along]] = size[:, None, None] * section
    if bend:
        rings[..., bent] += bend * (2 * share[:, None] - 1) ** 2
    vertices = np.concatenate([rings.reshape(-1, 3), rings[[0, -1]].mean(axis=1)])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    faces = _tube(len(share), reverse=along == 1)  # the two other axes, x and z, are a left-handed pair then
    return trimesh.Trimesh((vertices - low) / (high - low), faces, process=False)


def resampled(profile: tuple) -> list[tuple[float, float]]:
    """The profile with a point at least every tenth of the way, so that a bend is smooth."""
    points = [profile[0]]
    for (start, a), (end, b) in zip(profile, profile[1:]):
        steps = max(1, int(np.ceil((end - start) / 0.1 - 1e-9)))
        points += [(start + (end - start) * k / steps, a + (b - a) * k / steps) for k in range(1, steps + 1)]
    return points


@lru_cache(maxsize=64)
def _tube(rings: int, reverse: bool) -> np.ndarray:
    """(m, 3) triangles of rings in a row, closed at both ends by their middles, the last two vertices."""
    here, beside = np.arange(SIDES), np.roll(np.arange(SIDES), -1)
    walls = []
    for start in SIDES * np.arange(rings - 1):
        a, b, c, d = start + here, start + beside, start + SIDES + here, start + SIDES + beside
        walls += [np.stack([a, b, d], 1), np.stack([a, d, c], 1)]
    first, last = rings * SIDES, rings * SIDES + 1
    top = SIDES * (rings - 1)
    caps = [np.stack([beside, here, np.full(SIDES, first)], 1)]
    caps.append(np.stack([top + here, top + beside, np.full(SIDES, last)], 1))
    triangles = np.concatenate([*walls, *caps])
    return triangles[:, ::-1] if reverse else triangles


def unit_mesh(label: str, size: np.ndarray, style: int = 0) -> trimesh.Trimesh:
    """The surface of a leaf with this label and these side lengths, in its local coordinates, [0, 1]^3."""
    rng = np.random.default_rng([zlib.crc32(label.encode()), style])
    short, middle, long = np.argsort(size, kind="stable")
    slender = size[long] > 2.5 * size[middle]
    if label in FRONTS:
        return sweep(2, SQUARE, KNOBBED)
    if label == "wheel":
        return sweep(0, ROUND, STRAIGHT)
    if label == "rocker":
        return sweep(2, SQUARE, STRAIGHT, bend=2.5, bent=1)
    if label in POSTS and slender:
        # Only an upright post knows its top from its bottom; a mirrored lying one would be thick at the wrong end.
        profiles = (STRAIGHT, STRAIGHT, TAPERED, TURNED, VASE) if long == 1 else (STRAIGHT, SPINDLE)
        profile = profiles[rng.integers(len(profiles))]
        section = (ROUND, SQUARE)[rng.integers(2)] if profile in (STRAIGHT, TAPERED) else ROUND
        return sweep(int(long), section, profile)
    if label == "back_single_surface":
        bend = (0.0, 1.0, 2.0)[rng.integers(3)]
        return sweep(0, (8.0, SQUARE)[rng.integers(2)], STRAIGHT, bend)
    if label in SOFT:
        return sweep(int(short), (5.0, 8.0, 12.0)[rng.integers(3)], PILLOW)
    if label in PLATES and size[middle] > 0.4 * size[long] > 2 * size[short]:
        corners = (ROUND if label == "pedestal" else 8.0, SQUARE)[rng.integers(2)]
        return sweep(int(short), corners, STRAIGHT)
    return sweep(int(long if slender else short), SQUARE, STRAIGHT)


def style_of(graph: PartGraph) -> int:
    """The style number of a graph: always the same for the same name."""
    return zlib.crc32(graph.name.encode())


def leaf_mesh(part: Part, style: int = 0) -> trimesh.Trimesh:
    """The dense surface of a part in the world, by its label and box; children are not looked at."""
    unit = unit_mesh(part.label, part.box.size.numpy(), style)
    vertices = part.box.world_many(torch.from_numpy(np.array(unit.vertices)))
    return trimesh.Trimesh(vertices.numpy(), unit.faces, process=False)


def dense_mesh(graph: PartGraph) -> trimesh.Trimesh:
    """The dense surfaces of all leaves as one mesh; parts of one label have one colour, as in `graph.mesh()`."""
    style, colors = style_of(graph), graph.mesh().visual.face_colors[::12]  # 12 triangles a box
    meshes = [leaf_mesh(part, style) for part in graph.root.leaves()]
    for mesh, color in zip(meshes, colors):
        mesh.visual.face_colors = np.tile(color, (len(mesh.faces), 1))
    return trimesh.util.concatenate(meshes)


def surface(part: Part, n: int, seed: int = 0, style: int = 0) -> Tensor:
    """(n, 3) float64 world points on the dense surface of one part, uniform by area. `style`: see `style_of`."""
    return _sample([leaf_mesh(part, style)], n, seed)[0]


def dense_surface(graph: PartGraph, n: int, seed: int = 0, with_parts: bool = False):
    """(n, 3) float64 world points on the dense surfaces of all leaves, uniform by area.

    With `with_parts` also (n,) int64: the leaf of each point, counted as in `graph.leaves`.
    """
    style = style_of(graph)
    points, parts = _sample([leaf_mesh(part, style) for part in graph.root.leaves()], n, seed)
    return (points, parts) if with_parts else points


def _sample(meshes: list[trimesh.Trimesh], n: int, seed: int) -> tuple[Tensor, Tensor]:
    """n points, uniform by area, on several meshes, and the number of the mesh of each."""
    rng = np.random.default_rng(seed)
    triangles = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes])
    owner = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    a, b, c = triangles.transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).cumsum()
    chosen = np.minimum(np.searchsorted(area, rng.random(n) * area[-1], side="right"), len(area) - 1)
    # Mirroring the half of the unit square beyond its diagonal keeps the points in the triangle.
    u, v = rng.random((2, n, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen]
    return torch.from_numpy(points), torch.from_numpy(owner[chosen])
