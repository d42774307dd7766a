"""The ablation "No Macros" (paper, section 7.1): the same shapes without squeeze, reflect and translate.

Within a block the interpreter's `expand` writes a squeeze as two attaches and a copy as a cuboid of its own. A copy
of a cuboid that a block fills needs a block of its own too, written so that it makes what the interpreter shows there.

A block of cuboids and attaches is mirrored about an axis by mirroring every attachment point: q becomes 1 - q along
that axis, for both partners. Each cuboid then stands at the mirrored place, its axes turned to match. Which axes are
mirrored follows from the interpreter's rules (its `hierarchy`): contents of a reflected block are mirrored, but what
lies two levels below is turned with its box and not mirrored; in signs, that is the other two axes' mirror image.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ..interpreters.shapeassembly import Attach, Block, Cuboid, Program, Reflect, Translate, expand
from ..interpreters.shapeassembly.program import AXES, BBOX, Number
from .placing import DIGITS
from .renaming import numbered, renamed

Signs = tuple[int, ...]  # (3,): -1 for an axis that is mirrored, else 1
UNCHANGED: Signs = (1, 1, 1)


def without_macros(program: Program) -> Program:
    """A program for the same shape, of Cuboid and attach alone; its leaves may come in another order.

    Numbers have three decimals, as the data set's, so corners move by about a thousandth of the shape. Raises
    ProgramError where the original makes no sense.
    """
    blocks = {block.name: block for block in program.blocks}
    expanded = {name: expand(block) for name, block in blocks.items()}
    queue, written = [_Use(program.blocks[0].name)], []
    for use in queue:  # grows while it is walked: breadth-first
        sources = _sources(blocks[use.block])
        mirrored, names, sizes = _product(use.frame, _mirror(use.flip)), {BBOX: BBOX}, {}
        for name in _declared(expanded[use.block]):
            source, flip = sources.get(name, (name, None))
            names[name] = f"Program_{len(queue)}" if source in blocks else name
            if source in blocks:
                # As in the data set: a box that is filled is as large as its block says.
                sizes[name] = blocks[source].statements[0].numbers
                within = mirrored if use.flip is None else _product(mirrored, (-1, -1, -1))
                queue.append(_Use(source, flip, within))
        lines = [_mirrored(line, mirrored, sizes) for line in expanded[use.block].statements]
        written.append(Block(f"Program_{len(written)}", tuple(renamed(line, names) for line in lines)))
    return numbered(Program(tuple(written)))


@dataclass(frozen=True)
class _Use:
    """A place where a block's contents are shown.

    flip   the axis that the reflect which made this copy mirrors
    frame  signs: the box that is filled has, in the new program, the interpreter's axes times these
    """

    block: str
    flip: str | None = None
    frame: Signs = UNCHANGED


def _sources(block: Block) -> dict[str, tuple[str, str | None]]:
    """Clone -> the cuboid it copies, and the axis of its reflect; clones are named as the interpreter names them."""
    copies = []
    for statement in block.statements:
        if isinstance(statement, Reflect):
            copies.append((statement.source, statement.axis))
        elif isinstance(statement, Translate):
            copies += [(statement.source, None)] * statement.count
    first = len(_declared(block))
    return {f"cube{first + i}": copy for i, copy in enumerate(copies)}


def _declared(block: Block) -> list[str]:
    return [s.name for s in block.statements if isinstance(s, Cuboid) and s.name != BBOX]


def _mirrored(statement: Cuboid | Attach, signs: Signs, sizes: dict[str, tuple]) -> Cuboid | Attach:
    """The statement in the mirrored block, its numbers rounded; `sizes` of some cuboids are other than it says."""
    if isinstance(statement, Cuboid):
        numbers = _rounded(sizes.get(statement.name, statement.numbers))
        sides = tuple(max(side, 10.0**-DIGITS) for side in numbers)
        return Cuboid(statement.name, sides, statement.aligned)
    places = [q if sign > 0 else 1 - q for q, sign in zip(statement.numbers, (*signs, *signs))]
    return Attach(statement.moved, statement.still, _rounded(places))


def _rounded(numbers: Sequence[Number]) -> tuple[Number, ...]:
    return tuple(round(number, DIGITS) for number in numbers)


def _mirror(axis: str | None) -> Signs:
    return tuple(-1 if name == axis else 1 for name in AXES)


def _product(one: Signs, other: Signs) -> Signs:
    return tuple(a * b for a, b in zip(one, other))
