"""Stump, CSG program, ShapeAssembly program or Parts -> OpenSCAD file."""

from ..csg.program import Program as CSGProgram
from ..shapeassembly.program import Program as AssemblyProgram
from ..stump.program import Stump
from .errors import ScadError
from .helpers import with_helpers
from .parts import Parts, parts_of, write_parts
from .printing import to_text
from .programs import write_program
from .stumps import write_stump


def write(shape: Stump | CSGProgram | AssemblyProgram | Parts) -> str:
    """A file for OpenSCAD, which `read` reads back. Of a ShapeAssembly program it holds the boxes.

    Raises ScadError for anything else, and ShapeAssembly's ProgramError where a program's geometry is not finite.
    """
    if isinstance(shape, Stump):
        document = write_stump(shape)
    elif isinstance(shape, CSGProgram):
        document = write_program(shape)
    elif isinstance(shape, AssemblyProgram | Parts):
        document = write_parts(shape if isinstance(shape, Parts) else parts_of(shape))
    else:
        raise ScadError(f"found a {type(shape).__name__}", expected="a Stump, a Program or Parts")
    return to_text(with_helpers(document))
