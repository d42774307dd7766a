"""CSG-Stump: any solid in three layers of primitives (Ren et al. 2021). Four verbs and an error.

parse(text) -> Stump            execute(stump) -> Shape
sample(rng) -> Stump            execute_many(stumps) -> Shapes
"""

from .errors import ProgramError
from .executing import execute
from .parsing import parse
from .primitives import KINDS, Box, Circle, Cone, Cylinder, HalfPlane, Primitive, Sphere, Square, Triangle
from .program import Stump
from .shape import Shape

__all__ = [
    "KINDS", "Box", "Circle", "Cone", "Cylinder", "HalfPlane", "Primitive", "ProgramError", "Shape", "Sphere", "Square",
    "Stump", "Triangle", "execute", "parse",
]  # fmt: skip
