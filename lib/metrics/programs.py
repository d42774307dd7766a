"""How long programs are and how they are written (ShapeAssembly paper, Tables 3 and 5)."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from ..interpreters.shapeassembly import Program, Shapes

MACROS = ("reflect", "translate", "squeeze")


@dataclass(frozen=True)
class ProgramStatistics:
    """programs, lines (mean per program), macros per line by kind and together, leaves (mean per shape)."""

    programs: int
    lines: float
    macros: dict[str, float]
    leaves: float

    @property
    def macros_per_line(self) -> float:
        """All macros, per line."""
        return sum(self.macros.values())


def program_statistics(programs: Sequence[Program], shapes: Shapes) -> ProgramStatistics:
    """Counts over a set of programs and the shapes they execute to.

    A line is any statement inside a block, each block's bbox line included; headers and braces do not count.
    Macros per line: all macros of the set divided by all lines of the set (not the mean of each program's share).
    A leaf part is a drawn cuboid of the executed shape, copies included. Raises ValueError for an empty set.
    """
    if not len(programs):
        raise ValueError("no programs to count")
    commands = Counter(statement.command for program in programs for _, _, statement in program.statements())
    lines = sum(commands.values())
    return ProgramStatistics(
        programs=len(programs),
        lines=lines / len(programs),
        macros={macro: commands[macro] / lines for macro in MACROS},
        leaves=sum(shapes.count) / len(programs),
    )
