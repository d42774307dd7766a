"""Macros made visible: a block rewritten with nothing but `Cuboid` and `attach` (paper, Appendix B)."""

import torch

from .checking import check_block
from .compiling import Compiler
from .machine import Machine
from .program import Attach, Block, Cuboid


def expand(block: Block) -> Block:
    """The same block without squeeze, reflect and translate; it builds the same cuboids in the same order.

    Copies become cuboids of their own, declared with the size their source has in the end; where a copy is attached
    depends on where its source came to stand, so the block is executed to find out. Raises ProgramError for a block
    that makes no sense.
    """
    check_block(block)
    compiler = Compiler()
    rows = compiler.add(block).rows
    numbers = [n for s in block.statements for n in s.numbers]
    machine = Machine(compiler, torch.tensor([numbers], dtype=torch.float64))
    name_of = {row: name for name, row in rows.items()}
    aligned = {s.name: s.aligned for s in block.statements if isinstance(s, Cuboid)}
    copies = [
        Cuboid(name_of[clone], _numbers(machine.state.size[0, source]), aligned[name_of[source]])
        for clone, source in zip(compiler.clones, compiler.sources, strict=True)
    ]
    declared = [s for s in block.statements if isinstance(s, Cuboid)]
    return Block(block.name, (*declared, *copies, *_attaches(machine, name_of)))


def _attaches(machine: Machine, name_of: dict[int, str]) -> list[Attach]:
    """Every attach the machine carried out, in program order: those of the text, then those of the copies."""
    attaches, offset = [], 0
    for table in (machine.build, machine.copy):
        for place in table.order.argsort():
            moved, still = (name_of[int(table.columns[end][place])] for end in ("moved", "still"))
            ends = machine.points[0, 2 * (offset + place) : 2 * (offset + place) + 2]
            attaches.append(Attach(moved, still, _numbers(ends.flatten())))
        offset += len(table.order)
    return attaches


def _numbers(values: torch.Tensor) -> tuple[float, ...]:
    return tuple(
        round(value, 12) for value in values.tolist()
    )  # hides the rounding of the way there and back
