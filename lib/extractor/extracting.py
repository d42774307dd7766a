"""The whole way from a part graph to a program: the stages in their order, and what comes out.

graph --regularise--> graph --survey--> facts about every block --write_program--> program --validate--> accepted?
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

from jaxtyping import Float
from torch import Tensor

from ..interpreters.shapeassembly import Program, ProgramError, execute_many
from .arranging import LEVELS, collapse, flat, flatten, hold, limit_levels, shorten_chains, without_slivers
from .bounding import refit, seen_from
from .contacts import connecting_contacts, mark_firm
from .disordering import without_order
from .errors import RejectedError
from .facts import BlockFacts
from .labels import RANKED
from .ordering import best_first, grounded_order
from .partgraph import Part, PartGraph, stack
from .placing import judge, ways_to_place
from .shortening import shorten
from .snapping import is_upright, snap, snap_leaves
from .soundness import sound
from .subprograms import join, join_components
from .symmetry import ALIKE, ALIKE_IF_MANY, find_groups
from .validating import MAX_LEAVES, check_complexity, judge_shape, leaf_count
from .writing import write_program

MAY_COST = 3  # steps of misfit that a sub-assembly of its own may cost its parts


@dataclass(frozen=True)
class Options:
    """What an extraction may leave out: the ablations of the paper's section 7.1, and rejected programs for study.

    Without macros or hierarchy a shape needs more lines: there the limit on the number of cuboids does not apply, so
    that an ablation can be made of the same shapes.
    """

    canonical_order: bool = (
        True  # False: lines in an arbitrary (but grounded) order, drawn by the graph's name
    )
    aligned_flag: bool = True  # False: no cuboid is marked as aligned
    macros: bool = True  # False: no squeeze, reflect or translate
    hierarchy: bool = True  # False: all leaves in one block
    keep_rejected: bool = False  # True: programs that fail validation are handed out, with their reason


@dataclass(frozen=True, eq=False)
class Extraction:
    """What became of one part graph.

    program  None if rejected (unless Options.keep_rejected)
    reason   "" if accepted, else one of REASONS;  detail says more
    f_score  percent, of the executed program against the part graph; None if there was nothing to execute
    graph    the part graph after all rearranging;  facts  what was found out about its blocks
    """

    program: Program | None
    reason: str = ""
    detail: str = ""
    f_score: float | None = None
    graph: PartGraph | None = None
    facts: BlockFacts | None = None

    @property
    def accepted(self) -> bool:
        return not self.reason


def stages(graph: PartGraph, options: Options = Options()) -> list[tuple[str, PartGraph]]:
    """The part graph after each step of rearranging it, by name, the input first: for looking at."""
    steps = [
        without_slivers,
        collapse,
        flatten,
        hold,
        snap_leaves,
        shorten,
        shorten_chains,
        limit_levels,
        refit,
    ]
    if not options.hierarchy:
        steps.insert(steps.index(hold) + 1, flat)
    graphs = [("input", graph), ("in_order", in_order(sound(graph)))]
    for step in steps:
        graphs.append((step.__name__, step(graphs[-1][1])))
    return graphs


def regularise(graph: PartGraph, options: Options = Options()) -> PartGraph:
    """The part graph after all steps. Raises RejectedError when no part is left."""
    return stages(graph, options)[-1][1]


def in_order(graph: PartGraph) -> PartGraph:
    """Siblings in an order that depends on what they are, not on how the file lists them."""

    def visit(part: Part) -> tuple[tuple, Part]:
        pairs = sorted((visit(child) for child in part.children), key=lambda pair: pair[0])
        numbers = (*part.box.center.tolist(), *part.box.size.tolist(), *part.box.axes.flatten().tolist())
        key = (part.label, numbers, tuple(key for key, _ in pairs))
        return key, replace(part, children=tuple(child for _, child in pairs))

    return graph.with_root(visit(graph.root)[1])


def semantic_order(parts: Sequence[Part], category: str, size: Float[Tensor, "3"]) -> list[Part]:
    """By the label's rank, then by where the part's center is: first coarsely, then exactly (paper, section 5.2)."""
    ranks = {label: rank for rank, label in enumerate(RANKED.get(category, ()))}

    def key(part: Part) -> tuple:
        center = [round(x, 6) + 0.0 for x in part.box.center.tolist()]
        coarse = [round(2 * x / float(size.max())) for x in center]
        return ranks.get(part.label, len(ranks)), sum(coarse), *coarse, *center, *part.box.size.tolist()

    return sorted(parts, key=key)


def survey(
    node: Part, category: str, options: Options = Options(), alike: float = ALIKE, level: int = 1
) -> BlockFacts:
    """All facts about a node's block and, through it, about those below. Raises RejectedError.

    alike   how exact copies must be, see `symmetry`
    """
    facts = look(seen_from(node.box, node.children), node.box.size, category, options)
    if options.macros and level < LEVELS:
        joined = join_components(facts, alike, lambda c: holds_together(c, facts, category, options))
        if len(joined) != len(facts.parts):
            facts = look(joined, node.box.size, category, options)
    if options.macros:
        facts = replace(facts, groups=tuple(find_groups(facts, alike)))
    order = grounded_order(facts.written, facts.open_ways, facts.label)
    inner = {
        i: survey(facts.parts[i], category, options, alike, level + 1)
        for i in facts.written
        if facts.parts[i].children
    }
    return replace(facts, ways=tuple(order), inner=inner)


def look(parts: Sequence[Part], size: Float[Tensor, "3"], category: str, options: Options) -> BlockFacts:
    """Parts of a block in order, their straightened boxes, their contacts, and every way to hold each of them."""
    parts = semantic_order(parts, category, size)
    boxes = snap(stack(parts))
    aligned = is_upright(boxes) & options.aligned_flag
    contacts = mark_firm(connecting_contacts(boxes, size), [stack(part.leaves()) for part in parts])
    ways = [
        way
        for i, upright in enumerate(aligned.tolist())
        for way in ways_to_place(i, contacts, boxes, size, not upright, options.macros)
    ]
    misfits = judge(ways, boxes, aligned, size).tolist()
    facts = BlockFacts(tuple(parts), boxes, aligned, size, tuple(contacts))
    return replace(facts, ways=best_first(ways, misfits, facts.tolerance, aligned.tolist()))


def holds_together(component: list[int], facts: BlockFacts, category: str, options: Options) -> bool:
    """Would these parts, in a block of their own, be held about as well as they are in theirs?"""
    node = join([facts.parts[i] for i in component])
    inside = look(seen_from(node.box, node.children), node.box.size, category, options)
    try:
        before = grounded_order(facts.written, facts.open_ways)
        after = grounded_order(inside.written, inside.open_ways)
    except RejectedError:
        return False
    allowed = max(MAY_COST * facts.tolerance, *(way.misfit for way in before if way.cuboid in component))
    return max(way.misfit for way in after) <= allowed


def extract(graph: PartGraph, options: Options = Options()) -> Extraction:
    """One part graph to a program; see Extraction."""
    return extract_many([graph], options)[0]


def extract_many(graphs: Sequence[PartGraph], options: Options = Options()) -> list[Extraction]:
    """Many part graphs, in order; their programs are executed as one batch. Never raises for what a graph holds."""
    written = [_written(graph, options) for graph in graphs]
    runnable = [i for i, extraction in enumerate(written) if extraction.program is not None]
    shapes = execute_many([written[i].program for i in runnable])
    valid = shapes.valid.tolist()
    for row, i in enumerate(runnable):
        if not valid[row]:
            written[i] = replace(written[i], reason="not finite", detail="its geometry cannot be computed")
        elif not written[i].reason:
            reason, detail, f_score = judge_shape(shapes[row], collapse(graphs[i]))
            written[i] = replace(written[i], reason=reason, detail=detail, f_score=f_score)
    return [
        extraction if extraction.accepted or options.keep_rejected else replace(extraction, program=None)
        for extraction in written
    ]


def _written(graph: PartGraph, options: Options) -> Extraction:
    """The program of one graph, not yet executed."""
    regular = facts = None
    try:
        regular = regularise(graph, options)
        facts = survey(regular.root, graph.category, options)
        limited = options.macros and options.hierarchy
        if limited and leaf_count(write_program(facts)) > MAX_LEAVES:
            facts = survey(regular.root, graph.category, options, ALIKE_IF_MANY)
        program = write_program(facts)
        if limited:
            check_complexity(program)
        if not options.canonical_order:
            program = without_order(program, zlib.crc32(graph.name.encode()))
        return Extraction(program, graph=regular, facts=facts)
    except RejectedError as error:
        return Extraction(None, error.reason, error.detail, graph=regular, facts=facts)
    except ProgramError as error:
        return Extraction(None, "not a program", str(error), graph=regular, facts=facts)
