"""A ShapeAssembly program as data: blocks of five kinds of statement (paper, Table 1).

    program   := block+                                   the first block is the root
    block     := "Assembly" NAME "{" bbox Cuboid* (attach | squeeze)* (reflect | translate)* "}"
    Cuboid    := NAME "=" "Cuboid" "(" length "," height "," width ["," aligned] ")"
    attach    := "attach" "(" moved "," still "," x1 "," y1 "," z1 "," x2 "," y2 "," z2 ")"
    squeeze   := "squeeze" "(" moved "," first "," second "," face "," u "," v ")"
    reflect   := "reflect" "(" source "," axis ")"
    translate := "translate" "(" source "," axis "," count "," distance ")"

A cuboid that bears the name of a block is filled by that block. Everything written as a decimal number (sizes,
attachment points, u, v, distance) is a continuous *parameter*; the rest is *structure*.
"""

from collections.abc import Iterator, Sequence
from dataclasses import InitVar, dataclass, replace
from typing import ClassVar

import torch
from torch import Tensor

from .errors import ProgramError

AXES = ("X", "Y", "Z")
FACES = ("right", "left", "top", "bot", "front", "back")
BBOX = "bbox"
Number = int | float  # a number stays as it was written: 1 is not turned into 1.0


@dataclass(frozen=True, slots=True)
class Cuboid:
    """A new box of a given size (length, height, width). `aligned`: attachments never turn it."""

    command: ClassVar[str] = "Cuboid"
    name: str
    numbers: tuple[Number, Number, Number]
    aligned: bool = False

    def to_text(self) -> str:
        return f"{self.name} = Cuboid({_join(*self.numbers, self.aligned)})"

    @property
    def structure(self) -> tuple:
        return (self.command, self.name, self.aligned)


@dataclass(frozen=True, slots=True)
class Attach:
    """Bring local point (x1, y1, z1) of `moved` to local point (x2, y2, z2) of `still`; only `moved` changes."""

    command: ClassVar[str] = "attach"
    moved: str
    still: str
    numbers: tuple[Number, Number, Number, Number, Number, Number]

    def to_text(self) -> str:
        return f"attach({_join(self.moved, self.still, *self.numbers)})"

    @property
    def structure(self) -> tuple:
        return (self.command, self.moved, self.still)


@dataclass(frozen=True, slots=True)
class Squeeze:
    """Put `moved` between `first` and `second`: its `face` on `first`, its opposite face on `second`, at (u, v)."""

    command: ClassVar[str] = "squeeze"
    moved: str
    first: str
    second: str
    face: str
    numbers: tuple[Number, Number]

    def to_text(self) -> str:
        return f"squeeze({_join(self.moved, self.first, self.second, self.face, *self.numbers)})"

    @property
    def structure(self) -> tuple:
        return (self.command, self.moved, self.first, self.second, self.face)


@dataclass(frozen=True, slots=True)
class Reflect:
    """Add the mirror image of `source` about the plane through the bbox center normal to `axis`."""

    command: ClassVar[str] = "reflect"
    source: str
    axis: str
    numbers: tuple[()] = ()

    def to_text(self) -> str:
        return f"reflect({_join(self.source, self.axis)})"

    @property
    def structure(self) -> tuple:
        return (self.command, self.source, self.axis)


@dataclass(frozen=True, slots=True)
class Translate:
    """Add `count` copies of `source` along `axis`, the last `distance` bbox sides away."""

    command: ClassVar[str] = "translate"
    source: str
    axis: str
    count: int
    numbers: tuple[Number]

    def to_text(self) -> str:
        return f"translate({_join(self.source, self.axis, self.count, *self.numbers)})"

    @property
    def structure(self) -> tuple:
        return (self.command, self.source, self.axis, self.count)


Statement = Cuboid | Attach | Squeeze | Reflect | Translate


@dataclass(frozen=True, slots=True)
class Block:
    """One level of a shape: its bounding box first, then the statements that fill it."""

    name: str
    statements: tuple[Statement, ...]

    def to_text(self) -> str:
        """The block as text, one statement a line."""
        lines = [f"Assembly {self.name} {{", *(f"\t{s.to_text()}" for s in self.statements), "}"]
        return "\n".join(lines) + "\n"


@dataclass(frozen=True, slots=True)
class Program:
    """A whole, checked program. Raises ProgramError when its blocks make no sense (see `checking`)."""

    blocks: tuple[Block, ...]
    source: InitVar["object | None"] = None  # where the text stood, so that errors can point at it

    @classmethod
    def unchecked(cls, blocks: tuple[Block, ...]) -> "Program":
        """A program that need not make sense yet, such as the first lines of one."""
        program = object.__new__(cls)
        object.__setattr__(program, "blocks", blocks)
        return program

    def __post_init__(self, source) -> None:
        from .checking import check  # here, because checking needs the names above

        check(self.blocks, source)

    def to_text(self) -> str:
        """The program as text; `parse(program.to_text()) == program`."""
        return "".join(block.to_text() for block in self.blocks)

    def to_openscad(self) -> str:
        """An OpenSCAD file of the boxes that the program makes; `openscad.read` gives these as `Parts`."""
        from ..openscad import write

        return write(self)

    def statements(self) -> Iterator[tuple[Block, int, Statement]]:
        """Every statement in text order, with its block and its index in the block."""
        for block in self.blocks:
            for index, statement in enumerate(block.statements):
                yield block, index, statement

    @property
    def parameter_count(self) -> int:
        """p: how many continuous parameters the program has."""
        return sum(len(statement.numbers) for _, _, statement in self.statements())

    def parameters(self) -> Tensor:
        """(p,) float64: every continuous parameter, in text order."""
        numbers = [n for _, _, statement in self.statements() for n in statement.numbers]
        return torch.tensor(numbers, dtype=torch.float64)

    def parameter_names(self) -> tuple[str, ...]:
        """(p,) names such as `Program_0:1:Cuboid:0`: block, statement, command, index in the statement."""
        return tuple(
            f"{block.name}:{index}:{statement.command}:{i}"
            for block, index, statement in self.statements()
            for i in range(len(statement.numbers))
        )

    def with_parameters(self, parameters: Tensor | Sequence[float]) -> "Program":
        """The same structure with other numbers, (p,). Raises ProgramError for a wrong count or bad numbers."""
        numbers = torch.as_tensor(parameters, dtype=torch.float64).detach().flatten().tolist()
        if len(numbers) != self.parameter_count:
            raise ProgramError(
                f"{len(numbers)} parameters given", expected=f"{self.parameter_count} for this program"
            )
        rest = iter(numbers)
        return Program(
            tuple(
                replace(
                    block,
                    statements=tuple(
                        replace(s, numbers=tuple(next(rest) for _ in s.numbers)) for s in block.statements
                    ),
                )
                for block in self.blocks
            )
        )

    @property
    def structure(self) -> tuple:
        """What is left without the parameters: comparable and hashable."""
        return tuple((block.name, tuple(s.structure for s in block.statements)) for block in self.blocks)


def _join(*arguments) -> str:
    return ", ".join(map(str, arguments))
