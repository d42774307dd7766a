"""Stage 11: from what was found out about each block to the text of a program.

Blocks come breadth-first, cuboids in semantic order (`cube0`, `Program_1`, `cube2`, … by position), then attachments
in their grounded order, then reflect and translate. Numbers have three decimals, as in the authors' data set; for
shapes much larger or smaller than 1, sizes keep the same relative precision.
"""

import math

from jaxtyping import Float
from torch import Tensor

from ..interpreters.shapeassembly import Attach, Block, Cuboid, Program, Reflect, Squeeze, Translate
from ..interpreters.shapeassembly.program import BBOX
from .contacts import BOTTOM, INSIDE, TOP
from .facts import BlockFacts
from .placing import DIGITS, Way
from .symmetry import Group


def write_program(root: BlockFacts) -> Program:
    """The program. Raises ProgramError where the facts make none."""
    queue, blocks, digits = [(root, "Program_0")], [], size_digits(root.size)
    for facts, name in queue:  # grows while it is walked: breadth-first
        names = {}
        for position, part in enumerate(facts.written):
            inner = (facts.inner or {}).get(part)
            names[part] = f"Program_{len(queue)}" if inner else f"cube{position}"
            if inner:
                queue.append((inner, names[part]))
        blocks.append(Block(name, write_block(facts, names, digits)))
    return Program(tuple(blocks))


def size_digits(size: Float[Tensor, "3"]) -> int:
    """Decimals of sizes: three for a shape of 0.5 to 5 units, fewer for larger ones, more for smaller ones."""
    return max(0, DIGITS - math.floor(math.log10(2 * float(size.max()))))


def write_block(facts: BlockFacts, names: dict[int, str], digits: int) -> tuple:
    """The statements of one block; `names` says what its written parts are called."""
    partner_names = {**names, **dict.fromkeys((BOTTOM, TOP, INSIDE), BBOX)}
    cuboids = [Cuboid(BBOX, sides(facts.size, digits), True)]
    cuboids += [
        Cuboid(names[i], sides(facts.boxes.size[i], digits), bool(facts.aligned[i])) for i in facts.written
    ]
    attachments = [statement for way in facts.ways for statement in attach_statements(way, partner_names)]
    order = {part: position for position, part in enumerate(facts.written)}
    copies = [
        copy_statement(group, names) for group in sorted(facts.groups, key=lambda g: order[g.members[0]])
    ]
    return (*cuboids, *attachments, *copies)


def sides(size: Float[Tensor, "3"], digits: int) -> tuple[float, float, float]:
    """Three sides as the text says them; never rounded to nothing."""
    return tuple(max(round(side, digits), 10.0**-digits) for side in size.tolist())


def attach_statements(way: Way, names: dict[int, str]) -> list[Attach | Squeeze]:
    """One squeeze, or an attach for each contact."""
    moved, partners = names[way.cuboid], [names[partner] for partner in way.partners]
    if way.face:
        (center, place), _ = way.points
        axis = next(k for k in range(3) if center[k] != 0.5)
        u, v = (place[k] for k in range(3) if k != axis)
        return [Squeeze(moved, *partners, way.face, (u, v))]
    return [Attach(moved, partner, (*q, *r)) for partner, (q, r) in zip(partners, way.points)]


def copy_statement(group: Group, names: dict[int, str]) -> Reflect | Translate:
    source = names[group.members[0]]
    if group.kind == "reflect":
        return Reflect(source, group.axis)
    return Translate(source, group.axis, len(group.members) - 1, (round(group.distance, DIGITS),))
