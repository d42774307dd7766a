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

    def as_row(self) -> dict[str, float]:
        """For tables: rounded to what the paper prints, macros as entries of their own."""
        macros = {macro: round(share, 4) for macro, share in self.macros.items()}
        return {
            "programs": self.programs,
            "lines": round(self.lines, 2),
            **macros,
            "leaves": round(self.leaves, 2),
        }


# Jones et al. 2020, "Ground Truth" rows of Table 3 (lines, macros per line) and Table 5 (leaf parts); the numbers of
# programs are those of the released set. The paper's chair reflect entry contradicts its own total of 0.207.
PAPER_GROUND_TRUTH = {
    "chair": ProgramStatistics(3835, 24.4, {"reflect": 0.080, "translate": 0.009, "squeeze": 0.113}, 9.7),
    "table": ProgramStatistics(6536, 20.0, {"reflect": 0.095, "translate": 0.005, "squeeze": 0.145}, 8.4),
    "storage": ProgramStatistics(1551, 24.7, {"reflect": 0.065, "translate": 0.0147, "squeeze": 0.151}, 10.8),
}


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
