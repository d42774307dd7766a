"""Names as the data set has them: `cube{i}` for the i-th cuboid of a block, `Program_{k}` for the k-th block.

Blocks are counted breadth-first, as they are first mentioned; a cuboid that block k fills is called `Program_{k}`.
"""

from dataclasses import replace

from ..interpreters.shapeassembly import Block, Cuboid, Program
from ..interpreters.shapeassembly.program import BBOX, Statement

FIELDS = ("name", "moved", "still", "first", "second", "source")  # of statements, wherever one has them


def numbered(program: Program) -> Program:
    """The same program, its blocks in breadth-first order, with cuboids and blocks named by their positions."""
    sources = {block.name: block for block in program.blocks}
    queue, blocks = [program.blocks[0].name], []
    for origin in queue:  # grows while it is walked: breadth-first
        names, block = {BBOX: BBOX}, sources[origin]
        declared = [s.name for s in block.statements if isinstance(s, Cuboid) and s.name != BBOX]
        for position, name in enumerate(declared):
            names[name] = f"Program_{len(queue)}" if name in sources else f"cube{position}"
            queue += [name] if name in sources else []
        statements = tuple(renamed(statement, names) for statement in block.statements)
        blocks.append(Block(f"Program_{len(blocks)}", statements))
    return Program(tuple(blocks))


def renamed(statement: Statement, names: dict[str, str]) -> Statement:
    """The statement with every cuboid called by its new name."""
    return replace(statement, **{f: names[getattr(statement, f)] for f in FIELDS if hasattr(statement, f)})
