"""Blocks while a network writes them, and the program that they are in the end."""

from dataclasses import dataclass, field, replace

from torch import Tensor

from ..interpreters.shapeassembly import Attach, Block, Cuboid, ProgramError, Squeeze
from ..interpreters.shapeassembly.program import BBOX, Statement
from .program_lines import MAX_CUBOIDS
from .program_table import ROOT

NAMES = [BBOX, *(f"cube{i}" for i in range(MAX_CUBOIDS - 1))]  # of a block's cuboids, for the time being
_ROLES = ("name", "moved", "still", "first", "second", "source")  # fields of statements that name cuboids


@dataclass
class Node:
    """A block as it was written, all its cuboids named cube0, cube1, … for the time being.

    program     which program of the batch it belongs to
    statements  without start and end, the bbox line first
    fillings    cuboid -> code (hidden,) of the block that is to fill it, and its size (3,) as written
    children    cuboid -> the block that fills it
    """

    program: int
    statements: list[Statement] = field(default_factory=list)
    fillings: dict[int, tuple[Tensor, Tensor]] = field(default_factory=dict)
    children: dict[int, "Node"] = field(default_factory=dict)

    def standing(self) -> list[str]:
        """Cuboids that an attach or squeeze connects to the bbox, as they were declared."""
        moved = {s.moved for s in self.statements if isinstance(s, Attach | Squeeze)} - {BBOX}
        return [s.name for s in self.statements if isinstance(s, Cuboid) and s.name in moved]


def blocks_of(root: Node) -> tuple[Block, ...]:
    """All blocks of a program, breadth-first; cuboids that stand on nothing are left out, with what is in them.

    Raises ProgramError where one of these is used all the same; within the rules none is.
    """
    blocks, waiting = [], [(root, ROOT)]
    for node, name in waiting:  # grows while it is walked
        names = {BBOX: BBOX}
        for old in node.standing():
            child = node.children.get(NAMES.index(old))
            filled = child is not None and bool(child.standing())
            names[old] = f"Program_{len(waiting)}" if filled else f"cube{len(names) - 1}"
            if filled:
                waiting.append((child, names[old]))
        blocks.append(Block(name, tuple(_renamed(s, names) for s in node.statements if _stays(s, names))))
    return tuple(blocks)


def _stays(statement: Statement, names: dict[str, str]) -> bool:
    """All but the declarations of cuboids that stand on nothing."""
    return not isinstance(statement, Cuboid) or statement.name in names


def _renamed(statement: Statement, names: dict[str, str]) -> Statement:
    roles = [role for role in _ROLES if hasattr(statement, role)]
    for role in roles:
        if (name := getattr(statement, role)) not in names:
            expected = "a cuboid that is connected to the bounding box"
            raise ProgramError(
                f"{statement.command} names {name}, which stands on nothing", expected=expected
            )
    return replace(statement, **{role: names[getattr(statement, role)] for role in roles})
