"""CSG: primitives and boolean operations in postfix order (Sharma et al. 2018). Four verbs and an error.

parse(text) -> Program          execute(program) -> Shape
sample(rng) -> Program          execute_many(programs or tokens) -> Shapes
"""

from .errors import ProgramError
from .executing import execute, execute_many
from .parsing import parse
from .primitives import KINDS, Primitive
from .program import OPERATIONS, Operation, Program, Tree
from .sampling import LENGTHS, Rules, sample, sample_many
from .shape import Picture, Shape, Shapes, Solid
from .tracing import Step, trace
from .vocabulary import Vocabulary, vocabulary_of

__all__ = [
    "KINDS", "LENGTHS", "OPERATIONS", "Operation", "Picture", "Primitive", "Program", "ProgramError", "Rules", "Shape",
    "Shapes", "Solid", "Step", "Tree", "Vocabulary", "execute", "execute_many", "parse", "sample", "sample_many",
    "trace", "vocabulary_of",
]  # fmt: skip
