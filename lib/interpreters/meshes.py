"""Solids of manifold3d as triangles: closed meshes, points on them, STL and GLB files.

Its booleans always make a closed surface, where faces lie on faces too. Curved primitives are polyhedra that are blown
up a little, until they have the volume of the true sphere, cylinder or cone. With 64 segments, no point of a polyhedron
is farther than r/500 from the true surface.
"""

import math
from functools import cache

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from manifold3d import Manifold

COLOR = (94, 139, 186, 255)
_Y_UP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])  # x, y, z -> x, z, -y


@cache
def ball(segments: int) -> Manifold:
    """A polyhedron with the volume of the ball of radius 1."""
    inscribed = Manifold.sphere(1, segments)
    return inscribed.scale(((4 / 3 * math.pi / inscribed.volume()) ** (1 / 3),) * 3)


def triangles(made: Manifold, dust: float) -> trimesh.Trimesh:
    """The surface; without a triangle for an empty shape. Corners that touch stay apart where the surface needs it.

    Bodies that have no more volume than `dust` are left out: they are left over from rounding.
    """
    mesh = made.to_mesh64()
    corners, faces = mesh.vert_properties[:, :3], mesh.tri_verts.astype(np.int64)
    if len(faces):
        faces = faces[_is_kept(corners, faces, dust)]
    if not len(faces):
        return trimesh.Trimesh()
    surface = trimesh.Trimesh(corners, faces, process=False)
    surface.remove_unreferenced_vertices()
    return surface


def _is_kept(
    corners: Float[np.ndarray, "corners 3"], faces: Int[np.ndarray, "faces 3"], dust: float
) -> Bool[np.ndarray, " faces"]:
    """Does each face belong to a body or a cavity that is larger than dust?"""
    edges = faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    body = trimesh.graph.connected_component_labels(edges, len(corners))[faces[:, 0]]
    volume = np.bincount(body, np.linalg.det(corners[faces]) / 6)
    return np.abs(volume[body]) > dust


def points_on(mesh: trimesh.Trimesh, n: int, seed: int) -> Float[np.ndarray, "n 3"]:
    """n points on the surface, uniform by area."""
    rng = np.random.default_rng(seed)
    face = rng.choice(len(mesh.faces), n, p=mesh.area_faces / mesh.area)
    # A random point of a triangle: the root keeps the points from crowding at the first corner.
    root, share = np.sqrt(rng.random((n, 1))), rng.random((n, 1))
    a, b, c = (mesh.vertices[mesh.faces[face, k]] for k in range(3))
    return np.asarray(a + root * (b - a) + root * share * (c - b))


def stl(mesh: trimesh.Trimesh) -> bytes:
    """A binary STL file, z up."""
    return mesh.export(file_type="stl")


def glb(mesh: trimesh.Trimesh, turn: bool) -> bytes:
    """A GLB file of one colour. In GLB y is up: `turn` makes (x, z, -y) of a mesh with z up."""
    mesh = mesh.copy()
    if turn:
        mesh.apply_transform(_Y_UP)
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=COLOR, metallicFactor=0.0, roughnessFactor=0.8
    )
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return trimesh.Scene(mesh).export(file_type="glb")
