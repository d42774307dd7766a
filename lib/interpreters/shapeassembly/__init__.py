"""ShapeAssembly: cuboids attached to one another in a hierarchy (Jones et al. 2020). Four verbs and an error.

parse(text) -> Program          execute(program) -> Shape
sample(rng) -> Program          execute_many(programs) -> Shapes
"""

from .errors import ProgramError
from .executing import execute, execute_many, trace
from .expanding import expand
from .parsing import parse
from .program import Attach, Block, Cuboid, Program, Reflect, Squeeze, Translate
from .sampling import sample
from .shape import Shape, Shapes

__all__ = [
    "Attach", "Block", "Cuboid", "Program", "ProgramError", "Reflect", "Shape", "Shapes", "Squeeze", "Translate",
    "execute", "execute_many", "expand", "parse", "sample", "trace",
]  # fmt: skip
