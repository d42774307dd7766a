"""Pictures of CSG-Stumps in space: their surfaces, and point clouds in which primitives were found.

A stump has z up, pictures have y up (see camera), so everything is turned: x, y, z of the stump is x, -z, y of the
picture. A surface shows the colours of the primitives that its faces belong to, so a hole has that of the drill.
"""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
import torch
import trimesh
from jaxtyping import Float, Int
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lib.interpreters.stump import Shape, Stump, execute, parse
from lib.viewing.camera import Camera
from lib.viewing.figure import bounds_of, draw_points, show
from lib.viewing.voxels import COLOR, VIEW

# Told apart by colour-blind readers too, neighbours above all: the first eight. With more than all, they come again.
COLORS = ("#0072b2", "#e08700", "#009e73", "#b5588f", "#56b4e9", "#d55e00", "#8a7f2d", "#5b6475")
COLORS += ("#7b1e3a", "#e6d200", "#8fd175", "#14181f")
NONE = "#c3c9d3"  # of points that belong to no primitive
_TINT = 0.45  # of white in the colours of surfaces: shades are seen on them, too
_TURN = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # rows: x, y, z of the picture


def solid_figure(
    solids, titles: Sequence[str] | None = None, *, same_scale: bool = True, colored: bool = True, **options
) -> Figure:
    """Solids side by side: Stumps of space, their texts, their Shapes, or a trimesh.Trimesh with z up.

    same_scale  one camera for all.      colored  faces have their primitives' colours; a Trimesh is always plain.
    options     those of `lib.viewing.figure.show`, such as columns or size; details replace the cameras.
    Raises TypeError for what is no solid, and ProgramError for a bad text.
    """
    solids = list(solids) if isinstance(solids, (list, tuple)) else [solids]
    meshes = [solid_mesh(solid, colored) for solid in solids]
    everything = bounds_of(*meshes)
    cameras = [Camera(bounds=everything if same_scale else bounds_of(mesh), **VIEW) for mesh in meshes]
    return show(meshes, titles, **{"details": [{"camera": camera} for camera in cameras], **options})


def solid_mesh(solid, colored: bool = True) -> trimesh.Trimesh:
    """The surface of a Stump, its text or its Shape, or a copy of a mesh; z is turned up."""
    mesh, stump = _mesh_of(solid)
    mesh = mesh.copy()
    colors = np.tile(COLOR, (len(mesh.faces), 1))
    if stump is not None and colored and len(mesh.faces):
        palette = np.array([_tinted(number) for number in range(len(stump.primitives))])
        colors = palette[nearest_primitive(stump, mesh.triangles_center)]
    mesh.visual.face_colors = colors.astype(np.uint8)
    mesh.vertices = mesh.vertices @ _TURN.T
    return mesh


def nearest_primitive(stump: Stump, points: Float[np.ndarray, "m 3"]) -> Int[np.ndarray, " m"]:
    """Which primitive's surface each point is nearest to, counted from 0; only those that the shape uses."""
    distances = stump.distances(torch.tensor(np.asarray(points))).detach().abs()
    distances[~stump.intersection[:, stump.union].any(1)] = torch.inf
    return distances.argmin(0).cpu().numpy()


def cloud_figure(
    points: Float[np.ndarray, "n 3"],
    labels: Int[np.ndarray, " n"] | Sequence[int] | None = None,
    names: Sequence[str] | None = None,
    *,
    normals: Float[np.ndarray, "n 3"] | None = None,
    size: float = 4.2,
) -> Figure:
    """A point cloud with z up, coloured by the number of the primitive that each point was found to belong to.

    labels   from 0; negative: to none.    names  of the primitives, for the legend, which also counts their points.
    normals  where points on the far side shall be left out.    size  inches.
    Raises ValueError where labels or names are too few.
    """
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    labels = np.full(len(points), -1) if labels is None else np.asarray(labels)
    if len(labels) != len(points):
        raise ValueError(f"{len(labels)} labels for {len(points)} points: one each, please")
    names = (
        [f"primitive {k + 1}" for k in range(labels.max(initial=-1) + 1)] if names is None else list(names)
    )
    if len(names) <= labels.max(initial=-1):
        raise ValueError(f"{len(names)} names, but a point has the label {labels.max()}; labels count from 0")
    palette = np.array([to_rgb(COLORS[k % len(COLORS)]) for k in range(len(names))] + [to_rgb(NONE)])
    figure, ax = plt.subplots(figsize=(size + 1.9, size), dpi=100)
    plt.close(figure)
    turned = points @ _TURN.T
    camera = Camera(bounds=bounds_of(turned), **VIEW)
    seen = np.ones(len(points), bool)
    if normals is not None:
        seen = ((camera.eye - turned) * (normals @ _TURN.T)).sum(1) > 0
    draw_points(ax, turned[seen], camera=camera, color=palette[np.maximum(labels[seen], -1)])
    figure.subplots_adjust(0, 0, size / (size + 1.9), 1)
    counts = [(name, (labels == k).sum(), palette[k]) for k, name in enumerate(names)]
    keys = [
        Line2D([], [], marker="o", linestyle="", color=color, label=f"{name}: {count:,}")
        for name, count, color in [*counts, ("none", (labels < 0).sum(), palette[-1])]
        if count
    ]
    figure.legend(handles=keys, loc="center right", fontsize=8, frameon=False, handletextpad=0.2)
    return figure


def _mesh_of(solid) -> tuple[trimesh.Trimesh, Stump | None]:
    """The mesh of whatever is a solid, and the stump behind it if there is one."""
    solid = parse(solid) if isinstance(solid, str) else solid
    solid = execute(solid) if isinstance(solid, Stump) else solid
    if isinstance(solid, Shape) and solid.dimensions == 3:
        return solid.mesh(), solid.program
    if isinstance(solid, trimesh.Trimesh):
        return solid, None
    what = "a stump of the plane" if isinstance(solid, Shape) else f"a {type(solid).__name__}"
    raise TypeError(f"cannot draw {what}: give a stump of space, its text, its shape, or a Trimesh")


def _tinted(number: int) -> np.ndarray:
    """The colour of a primitive's faces, 0..255 with opacity."""
    color = np.array(to_rgb(COLORS[number % len(COLORS)]))
    return np.append(255 * (color + _TINT * (1 - color)), 255)
