"""Cuboids as triangles: trimesh meshes, GLB and OBJ."""

import numpy as np
import trimesh

from ..cuboids import Cuboids

# Corners are numbered as `Cuboids.corners` orders them; every triangle is seen counter-clockwise from outside.
TRIANGLES = np.array([
    [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6],  # right, left
    [0, 1, 5], [0, 5, 4], [2, 6, 7], [2, 7, 3],  # top, bottom
    [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5],  # front, back
])  # fmt: skip


def boxes_mesh(cuboids: Cuboids, colors: np.ndarray) -> trimesh.Trimesh:
    """One mesh with 8 corners and 12 triangles per box, in order; colors (n, 3) uint8. A side may be negative."""
    corners = cuboids.detach().corners().cpu().double().numpy()
    # An odd number of negative sides turns a box inside out: turn its triangles back.
    inside_out = (
        np.linalg.det(cuboids.axes.detach().cpu().double().numpy())
        * cuboids.size.detach().cpu().double().prod(-1).numpy()
    ) < 0
    triangles = np.where(inside_out[:, None, None], TRIANGLES[:, ::-1], TRIANGLES)
    faces = triangles + 8 * np.arange(len(corners))[:, None, None]
    return trimesh.Trimesh(
        corners.reshape(-1, 3), faces.reshape(-1, 3), face_colors=np.repeat(colors, 12, 0), process=False
    )


def parts_scene(cuboids: Cuboids, colors: np.ndarray, names: list[str]) -> trimesh.Scene:
    """A scene with one named, coloured body per box."""
    scene = trimesh.Scene()
    for i, name in enumerate(names):
        part = boxes_mesh(cuboids[i : i + 1], colors[i : i + 1])
        part.visual = trimesh.visual.TextureVisuals(
            material=trimesh.visual.material.PBRMaterial(
                baseColorFactor=[*colors[i], 255], metallicFactor=0.0, roughnessFactor=0.8
            )
        )
        scene.add_geometry(part, node_name=name, geom_name=name)
    return scene


def parts_obj(cuboids: Cuboids, names: list[str]) -> str:
    """OBJ text with one object per box (written here because trimesh's OBJ writer drops the parts' names)."""
    lines = []
    for i, name in enumerate(names):
        part = boxes_mesh(cuboids[i : i + 1], np.zeros((1, 3), np.uint8))
        lines.append(f"o {name}")
        lines += ["v " + " ".join(f"{x:.9g}" for x in corner) for corner in part.vertices]
        lines += ["f " + " ".join(str(8 * i + k + 1) for k in face) for face in part.faces]
    return "\n".join(lines) + "\n"
