"""Pictures of CSG in space: the voxels that a network is compared on, and the exact surface behind them.

The grid has z up, pictures have y up (see camera), so meshes are turned: grid x, y, z is x, -z, y of the picture. A
voxel is the unit cube around its center, the coordinates are those of the program.
"""

from collections.abc import Sequence

import numpy as np
import trimesh
from matplotlib.figure import Figure
from torch import Tensor

from lib.interpreters.csg import Program, Solid, execute, parse
from lib.viewing.camera import Camera
from lib.viewing.figure import bounds_of, show

COLOR = (188, 206, 232, 255)
VIEW = {"azimuth": 35.0, "elevation": 30.0}  # from above: programs cut holes into the top
_TURN = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])  # x, y, z -> x, z, -y


def voxel_mesh(solid) -> trimesh.Trimesh:
    """The faces of ON voxels that touch no other ON voxel, z of the grid turned up.

    solid: a Solid, a program of space or its text, or a grid[x, y, z] of booleans.
    """
    grid = np.pad(_grid_of(solid), 1)
    corners = []  # (n, 4, 3) of each of the six directions
    for axis in range(3):
        across = np.eye(3)[[(axis + 1) % 3, (axis + 2) % 3]]
        square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2 @ across
        for side in (1, -1):
            bare = np.argwhere(grid & ~np.roll(grid, -side, axis)) - 1  # the padding comes off again
            corners.append((bare + side / 2 * np.eye(3)[axis])[:, None] + square[::side])
    points = np.concatenate(corners).reshape(-1, 3)
    points, places = np.unique(points, axis=0, return_inverse=True)
    quads = places.reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return _turned(trimesh.Trimesh(points, faces, process=False))


def exact_mesh(solid) -> trimesh.Trimesh:
    """The surface of a Solid, of a program of space or of its text, z of the grid turned up."""
    return _turned(_executed(solid).mesh())


def show_solids(
    solids, titles: Sequence[str] | None = None, *, exact: bool | Sequence[bool] = False, **options
) -> Figure:
    """A sheet of solids, all to one scale: Solids, programs of space, their texts, or grids[x, y, z].

    exact    draw the exact surfaces instead of voxels; one answer for all, or one each.
    options  those of `lib.viewing.figure.show`, such as columns, size or camera.
    """
    solids = list(solids) if isinstance(solids, (list, tuple)) else [solids]
    exact = [exact] * len(solids) if isinstance(exact, bool) else list(exact)
    if len(exact) != len(solids):
        raise ValueError(f"{len(exact)} answers to exact for {len(solids)} solids: one for all, or one each")
    meshes = [(exact_mesh if fine else voxel_mesh)(solid) for solid, fine in zip(solids, exact)]
    figure = show(meshes, titles, **{"camera": Camera(bounds=bounds_of(*meshes), **VIEW), **options})
    for ax in figure.axes:
        ax.xaxis.label.set_parse_math(False)  # $ is a token, not TeX
    return figure


def _grid_of(solid) -> np.ndarray:
    """The voxels as booleans, [x, y, z], of whatever is in space; what is not 0 is ON."""
    solid = _executed(solid)
    grid = solid.grid if isinstance(solid, Solid) else solid
    return grid.detach().bool().cpu().numpy() if isinstance(grid, Tensor) else grid.astype(bool)


def _executed(solid) -> Solid | Tensor | np.ndarray:
    """A Solid, or a grid as it came. Raises TypeError or ValueError for what is not in space."""
    if isinstance(solid, str):
        solid = parse(solid)
    if isinstance(solid, Program):
        solid = execute(solid)
    if isinstance(solid, Solid):
        return solid
    if not isinstance(solid, (Tensor, np.ndarray)):
        raise TypeError(f"cannot draw a {type(solid).__name__}: give a Solid, a program of space, or a grid")
    if solid.ndim != 3:
        raise ValueError(f"found an array {tuple(solid.shape)}; expected grid[x, y, z]")
    return solid


def _turned(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh = mesh.copy()
    mesh.apply_transform(_TURN)
    mesh.visual.face_colors = COLOR
    return mesh
