"""OpenSCAD files of stumps, CSG programs and ShapeAssembly programs, and back. Two verbs and an error.

write(stump or program) -> text           also stump.to_openscad(), program.to_openscad()
read(text) -> Stump, Program or Parts     of the files that we write, parameters edited by hand
"""

from .errors import ScadError
from .parts import Parts
from .reading import read
from .writing import write

__all__ = ["Parts", "ScadError", "read", "write"]
