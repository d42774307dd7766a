"""The whole way from a part graph to a program: the stages in their order, and what comes out.

graph --regularise--> graph --survey--> facts about every block --write_program--> program --judge_shape--> accepted?
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..interpreters.shapeassembly import Program, ProgramError, execute_many
from .arranging import collapse
from .disordering import without_order
from .errors import PartGraphError, RejectedError
from .facts import BlockFacts
from .options import CANONICAL, Options
from .partgraph import PartGraph
from .regularising import regularise
from .surveying import survey
from .symmetry import ALIKE_IF_MANY
from .validating import judge_shape, too_many
from .writing import write_program


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

    def __repr__(self) -> str:
        score = "" if self.f_score is None else f", F-score {self.f_score:.1f}"
        return f"<Extraction {f'rejected: {self.reason}' if self.reason else 'accepted'}{score}>"

    @property
    def accepted(self) -> bool:
        return not self.reason


def extract(graph: PartGraph, options: Options = CANONICAL) -> Extraction:
    """One part graph to a program; see Extraction."""
    return extract_many([graph], options)[0]


def extract_many(graphs: Sequence[PartGraph], options: Options = CANONICAL) -> list[Extraction]:
    """Many part graphs, in order; their programs are executed as one batch. Never raises for what a graph holds.

    Raises PartGraphError for what is no PartGraph at all.
    """
    for graph in graphs:
        if not isinstance(graph, PartGraph):
            raise PartGraphError(
                f"found a {type(graph).__name__}", "a PartGraph, such as PartGraph.read(path)"
            )
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
        if limited and too_many(write_program(facts)):
            facts = survey(regular.root, graph.category, options, ALIKE_IF_MANY)
        program = write_program(facts)
        detail = too_many(program) if limited else ""
        if not options.canonical_order:
            program = without_order(program, zlib.crc32(graph.name.encode()))
        return Extraction(program, "too many cuboids" if detail else "", detail, graph=regular, facts=facts)
    except RejectedError as error:
        return Extraction(None, error.reason, error.detail, graph=regular, facts=facts)
    except ProgramError as error:
        return Extraction(None, "not a program", str(error), graph=regular, facts=facts)
