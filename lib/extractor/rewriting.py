"""Programs rewritten for the paper's ablations (section 7.1), where there are no part graphs to extract them from.

    flat        no hierarchy: one block. Its leaves are what the original makes, extracted anew as one level of parts
    no_order    no canonical order: cuboids, attachments and macros in a drawn order (see `disordering`); same shape
    no_align    no cuboid but the bounding boxes is marked as aligned
    no_macros   no squeeze, reflect and translate (see `unfolding`)

What an ablation takes away may take the shape along: a cuboid that is not aligned turns where an aligned one grows.
So a rewritten program has to pass what an extracted one has to pass (paper, section 5.3), as far as its original does.
Without its flags a program that fails is extracted anew from the original's boxes, flags off; it is left out if that
fails too. Left out are also programs with more cuboids in a block than a line of the network's input can name.
"""

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch

from ..interpreters.cuboids import Cuboids
from ..interpreters.shapeassembly import Block, Cuboid, Program, Shape, execute_many
from ..interpreters.shapeassembly.program import BBOX, Statement
from ..metrics.fscore import f_score
from ..metrics.rootedness import is_rooted
from .arranging import flat
from .disordering import without_order
from .extracting import extract_many
from .options import Options
from .partgraph import PartGraph
from .renaming import numbered
from .unfolding import without_macros
from .validating import MIN_F_SCORE, sticking_out

ABLATIONS = ("flat", "no_order", "no_align", "no_macros")
MOST_CUBOIDS = 10  # in a block, beside its bbox: the network's line has eleven places to name one
SAME = (
    1e-3  # share of the diagonal by which corners may move, with three decimals, before a shape is measured
)
FLAT = Options(hierarchy=False)
UNALIGNED = Options(aligned_flag=False)


@dataclass(frozen=True)
class Rewriting:
    """What became of one program.

    program    None if it is left out;  reason  "" or why: one of the extractor's REASONS
    f_score    percent, of the rewritten program's shape against the original's; None where there is no program
    apart      see `apart`, as a share of the shape's diagonal; None where the program was extracted anew
    """

    program: Program | None
    reason: str = ""
    f_score: float | None = None
    apart: float | None = None

    @property
    def extracted(self) -> bool:
        """Was it extracted anew from the original's boxes?"""
        return self.program is not None and self.apart is None


def rewrite_many(
    programs: Sequence[Program], ablation: str, names: Sequence[str] | None = None, category: str = ""
) -> list[Rewriting]:
    """Programs rewritten for one of ABLATIONS, in order.

    names     seed the order of "no_order"; default: "0", "1", …
    category  of the shapes, for the extractor
    Raises ValueError for another ablation, ProgramError for a program whose geometry is not finite.
    """
    if ablation not in ABLATIONS:
        raise ValueError(f"found the ablation {ablation!r}; expected one of {', '.join(ABLATIONS)}")
    names = [str(i) for i in range(len(programs))] if names is None else names
    originals = list(execute_many(programs))
    if ablation == "flat":
        graphs = [flat(graph) for graph in _graphs(originals, names, category)]
        return _extracted(graphs, FLAT)
    change = {"no_order": _disordered, "no_align": _unaligned, "no_macros": _unfolded}[ablation]
    changed = [numbered(change(program, name)) for program, name in zip(programs, names)]
    found = _judged(changed, originals)
    if ablation == "no_align":
        failed = [i for i, rewriting in enumerate(found) if rewriting.reason]
        graphs = _graphs([originals[i] for i in failed], [names[i] for i in failed], category)
        for i, rewriting in zip(failed, _extracted(graphs, UNALIGNED)):
            found[i] = rewriting
    return found


def _disordered(program: Program, name: str) -> Program:
    return without_order(program, zlib.crc32(name.encode()))


def _unaligned(program: Program, _name: str) -> Program:
    return Program(tuple(Block(b.name, tuple(map(_without_flag, b.statements))) for b in program.blocks))


def _without_flag(statement: Statement) -> Statement:
    marked = isinstance(statement, Cuboid) and statement.name != BBOX
    return replace(statement, aligned=False) if marked else statement


def _unfolded(program: Program, _name: str) -> Program:
    return without_macros(program)


def _graphs(shapes: Sequence[Shape], names: Sequence[str], category: str) -> list[PartGraph]:
    return [PartGraph.from_shape(shape, category, name) for shape, name in zip(shapes, names)]


def _extracted(graphs: list[PartGraph], options: Options) -> list[Rewriting]:
    """Programs that the extractor writes for the originals; it has judged them."""
    found = []
    for extraction in extract_many(graphs, options):
        reason = extraction.reason
        if not reason and _too_many(extraction.program):
            reason = "too many cuboids"
        program = None if reason else extraction.program
        found.append(Rewriting(program, reason, extraction.f_score if program else None))
    return found


def _judged(programs: list[Program], originals: list[Shape]) -> list[Rewriting]:
    """Each program with its verdict; the shapes of all are executed as one batch."""
    shapes, found = execute_many(programs), []
    for i, valid in enumerate(shapes.valid.tolist()):
        found.append(_verdict(shapes[i], originals[i]) if valid else Rewriting(None, "not finite"))
    return found


def _verdict(shape: Shape, original: Shape) -> Rewriting:
    """The program, or why it is left out."""
    if _too_many(shape.program):
        return Rewriting(None, "too many cuboids")
    moved = apart(shape.cuboids, original.cuboids) / float(original.boxes.size[0].norm())
    if moved < SAME:
        return Rewriting(shape.program, "", 100.0, moved)
    score = f_score(shape.cuboids, original.cuboids)
    if score < MIN_F_SCORE:
        return Rewriting(None, "different shape")
    if sticking_out(shape) and not sticking_out(original):
        return Rewriting(None, "outside")
    if not is_rooted(shape.cuboids) and is_rooted(original.cuboids):
        return Rewriting(None, "not grounded")
    return Rewriting(shape.program, "", score, moved)


def apart(one: Cuboids, other: Cuboids) -> float:
    """How far two lists of boxes are from being the same, in any order: world units, inf for lists of other lengths.

    A box is as far from another as their corners are: the farthest from its nearest. Each box is compared with the
    nearest of the other list; the result is the largest distance.
    """
    if len(one) != len(other):
        return math.inf
    a, b = one.corners(), other.corners()
    corners = torch.cdist(a.flatten(0, 1), b.flatten(0, 1)).view(len(a), 8, len(b), 8)
    boxes = torch.maximum(
        corners.amin(3).amax(1), corners.amin(1).amax(2)
    )  # (boxes of one, boxes of the other)
    return float(torch.maximum(boxes.amin(1).max(), boxes.amin(0).max()))


def _too_many(program: Program) -> bool:
    most = max(sum(isinstance(s, Cuboid) for s in block.statements) for block in program.blocks) - 1
    return most > MOST_CUBOIDS
