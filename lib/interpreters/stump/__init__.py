"""CSG-Stump: any solid in three layers of primitives (Ren et al. 2021). Four verbs and an error.

parse(text) -> Stump            execute(stump) -> Shape
sample(rng) -> Stump            execute_many(stumps) -> Shapes
"""

from .errors import ProgramError
from .executing import Shapes, execute, execute_many
from .parsing import parse
from .primitives import KINDS, Box, Circle, Cone, Cylinder, HalfPlane, Primitive, Sphere, Square, Triangle
from .program import Stump
from .sampling import sample
from .shape import Picture, Shape, Solid
from .trees import Constant, Form, disjunctive_form

__all__ = [
    "KINDS", "Box", "Circle", "Cone", "Constant", "Cylinder", "Form", "HalfPlane", "Picture", "Primitive",
    "ProgramError", "Shape", "Shapes", "Solid", "Sphere", "Square", "Stump", "Triangle", "disjunctive_form", "execute",
    "execute_many", "parse", "sample",
]  # fmt: skip
