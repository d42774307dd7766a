"""Stumps as solids of manifold3d (see lib.interpreters.meshes), and their meshes."""

import numpy as np
import torch
import trimesh
from jaxtyping import Float
from manifold3d import Manifold
from torch import Tensor

from ..checks import check_segments
from ..meshes import ball, triangles
from ..rings import swollen
from .cutting import assemble, reach, side, sight
from .poses import matrices
from .primitives import Box, Cone, Primitive, Sphere
from .program import Stump

DUST = 1e-12  # of the cube around the window: smaller bodies are left over from rounding


def mesh(stump: Stump, window: Float[Tensor, "2 3"], segments: int) -> trimesh.Trimesh:
    """The surface of the shape within the window, closed."""
    dust = DUST * side(window) ** 3
    return triangles(solid(stump, window, segments), dust)


def solid(stump: Stump, window: Float[Tensor, "2 3"], segments: int) -> Manifold:
    """The shape within the window as manifold3d holds it. segments: corners of a whole circle."""
    segments, box = check_segments(segments), sight(stump, window)
    low, high = box.tolist()
    everything = Manifold.cube([b - a for a, b in zip(low, high)]).translate(low)
    return assemble(stump, lambda primitive: _placed(primitive, segments, box), everything, Manifold())


def _placed(primitive: Primitive, segments: int, box: Float[Tensor, "2 3"]) -> Manifold:
    """One primitive where it stands, long enough to reach through the box; empty for one without a volume."""
    single = primitive.to("cpu", torch.float64)
    if not primitive.sizes.all():
        return Manifold()
    turned = matrices(single.rotation).mT  # its own axes as columns
    pose = np.column_stack([turned.numpy(), single.translation.numpy()])
    return _polyhedron(single, segments, reach(single, box)).transform(pose)


def _polyhedron(p: Primitive, segments: int, far: float) -> Manifold:
    """One primitive in its own coordinates, with its true volume."""
    sizes = p.sizes.abs().tolist()
    if isinstance(p, Box):
        return Manifold.cube([2 * half for half in sizes], center=True)
    if isinstance(p, Sphere):
        return ball(segments).scale(sizes * 3)
    height = 2 * far if p.height is None else sizes[1]
    if isinstance(p, Cone):
        height = far if p.height is None else sizes[1]
        upside_down = Manifold.cylinder(height, sizes[0] * height * swollen(segments), 0, segments)
        return upside_down.rotate((180, 0, 0)).translate((0, 0, height))
    return Manifold.cylinder(height, sizes[0] * swollen(segments), circular_segments=segments, center=True)
