"""OpenSCAD file -> Stump, CSG program or Parts."""

from ..csg.program import Program
from ..stump.program import Stump
from . import parts, programs, stumps
from .document import Name
from .errors import ScadError
from .evaluating import contents, describe
from .frame import check_frame
from .parsing import parse
from .stump_reading import read_stump

_READERS = {
    stumps.LANGUAGE: read_stump,
    programs.LANGUAGE: programs.read_program,
    parts.LANGUAGE: parts.read_parts,
}


def read(text: str) -> Stump | Program | parts.Parts:
    """What a file says that `write` wrote and a person may have edited.

    Parameters may be any numbers, sums, differences, products and quotients of them, and other parameters from above;
    comments, blanks and the order of modules are free. Raises ScadError with line, column, what was found and what was
    expected, for everything that we would not write. `read(write(x)) == x` for stumps, CSG programs and Parts.
    """
    file = contents(parse(text))
    language = file.parameters.get("language")
    if not isinstance(language, str) or language not in _READERS:  # what is nested deep is slow to hash
        found = "no parameter 'language'" if language is None else f"language is {describe(language)}"
        place = file.place(Name("language"))
        raise ScadError(found, *place, expected=" or ".join(f'language = "{name}";' for name in _READERS))
    check_frame(file)
    return _READERS[language](file)
