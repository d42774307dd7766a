"""Programs as solids of manifold3d (see lib.interpreters.meshes).

They have the grid's coordinates x, y, z, z up; voxel k has its center at k. Faces on faces are the rule here, where
centers lie on a grid of eight.
"""

import operator

from manifold3d import Manifold

from ..checks import check_segments
from ..meshes import ball
from ..rings import swollen
from .geometry import flat_half, fold, round_radius
from .primitives import Primitive
from .program import Program

DUST = 1e-6  # cubic voxels: smaller bodies are left over from rounding


def solid(program: Program, segments: int) -> Manifold:
    """The shape in space as manifold3d holds it."""
    segments = check_segments(segments)
    operations = {"+": operator.add, "*": operator.xor, "-": operator.sub}
    return fold(program, lambda primitive: _polyhedron(primitive, segments), operations)


def _polyhedron(primitive: Primitive, segments: int) -> Manifold:
    x, y, z, size, *rest = primitive.numbers
    if primitive.kind == "sp":
        return ball(segments).scale((round_radius(size),) * 3).translate((x, y, z))
    if primitive.kind == "cu":
        return Manifold.cube((2 * flat_half(size),) * 3, center=True).translate((x, y, z))
    radius, height = round_radius(size) * swollen(segments), 2 * flat_half(*rest)
    return Manifold.cylinder(height, radius, circular_segments=segments, center=True).translate((x, y, z))
