"""CSG: primitives and boolean operations in postfix order (Sharma et al. 2018). Four verbs and an error.

parse(text) -> Program          execute(program) -> Shape
sample(rng) -> Program          execute_many(programs or tokens) -> Shapes
"""

from .errors import ProgramError
from .executing import execute, execute_many
from .parsing import parse
from .primitives import KINDS, Primitive
from .program import OPERATIONS, Operation, Program, Tree
from .shape import Picture, Shape, Shapes, Solid
from .vocabulary import Vocabulary, vocabulary_of

__all__ = [
    "KINDS", "OPERATIONS", "Operation", "Picture", "Primitive", "Program", "ProgramError", "Shape", "Shapes", "Solid",
    "Tree", "Vocabulary", "execute", "execute_many", "parse", "vocabulary_of",
]  # fmt: skip
