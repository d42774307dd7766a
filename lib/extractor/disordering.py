"""The ablation "No Order" (paper, section 7.1): the same programs with their canonical order thrown away.

Every order of lines that is still grounded is as likely as the draw of one line after the other makes it. A cuboid is
only used by others once all its own attachments are done, so the shape stays what it was.
"""

from dataclasses import replace

import numpy as np

from ..interpreters.shapeassembly import Attach, Block, Cuboid, Program, Squeeze
from ..interpreters.shapeassembly.program import BBOX


def without_order(program: Program, seed: int) -> Program:
    """A program for the same shape with its cuboids, attachments and macros in an arbitrary order drawn from `seed`."""
    rng, blocks = np.random.default_rng(seed), {block.name for block in program.blocks}
    return Program(tuple(_disordered(block, blocks, rng) for block in program.blocks))


def _disordered(block: Block, blocks: set[str], rng: np.random.Generator) -> Block:
    bbox, *rest = block.statements
    cuboids = _shuffled([s for s in rest if isinstance(s, Cuboid)], rng)
    attaches = [s for s in rest if isinstance(s, Attach | Squeeze)]
    copies = _shuffled([s for s in rest if not isinstance(s, Cuboid | Attach | Squeeze)], rng)
    names = {c.name: c.name if c.name in blocks else f"cube{i}" for i, c in enumerate(cuboids)}
    names[BBOX] = BBOX
    lines = [*cuboids, *_grounded([c.name for c in cuboids], attaches, rng), *copies]
    return Block(block.name, (bbox, *(_renamed(line, names) for line in lines)))


def _shuffled(items: list, rng: np.random.Generator) -> list:
    return [items[i] for i in rng.permutation(len(items))]


def _grounded(cuboids: list[str], attaches: list, rng: np.random.Generator) -> list:
    """The attachments, cuboid by cuboid, each after those it is attached to."""
    own = {name: [s for s in attaches if s.moved == name] for name in cuboids}
    standing, waiting, lines = {BBOX}, list(cuboids), []
    while waiting:
        ready = [name for name in waiting if all(standing.issuperset(_partners(s)) for s in own[name])]
        chosen = ready[rng.integers(len(ready))]
        lines += own[chosen]
        standing.add(chosen)
        waiting.remove(chosen)
    return lines


def _partners(statement: Attach | Squeeze) -> set[str]:
    return {statement.still} if isinstance(statement, Attach) else {statement.first, statement.second}


def _renamed(statement, names: dict[str, str]):
    """The statement with every cuboid called by its new name."""
    fields = [
        field
        for field in ("name", "moved", "still", "first", "second", "source")
        if hasattr(statement, field)
    ]
    return replace(statement, **{field: names[getattr(statement, field)] for field in fields})
