"""Stages 0 to 6 one after the other: from the part graph of a file to one that programs are written for."""

from dataclasses import replace

from .arranging import collapse, flat, flatten, hold, limit_levels, shorten_chains, without_slivers
from .bounding import refit
from .options import CANONICAL, Options
from .partgraph import Part, PartGraph
from .shortening import shorten
from .snapping import snap_leaves
from .soundness import sound


def stages(graph: PartGraph, options: Options = CANONICAL) -> list[tuple[str, PartGraph]]:
    """(name, part graph) after each step of rearranging it, the input first: for looking at.

    input, in_order, without_slivers, shorten_chains, collapse, flatten, hold, flat (only if options.hierarchy is
    off), snap_leaves, shorten, shorten_chains_again, limit_levels, refit. Raises RejectedError.
    """
    steps = [
        ("in_order", lambda graph: in_order(sound(graph))),
        ("without_slivers", without_slivers),
        ("shorten_chains", shorten_chains),
        ("collapse", collapse),
        ("flatten", flatten),
        ("hold", hold),
        *([] if options.hierarchy else [("flat", flat)]),
        ("snap_leaves", snap_leaves),
        ("shorten", shorten),
        ("shorten_chains_again", shorten_chains),
        ("limit_levels", limit_levels),
        ("refit", refit),
    ]
    graphs = [("input", graph)]
    for name, step in steps:
        graphs.append((name, step(graphs[-1][1])))
    return graphs


def regularise(graph: PartGraph, options: Options = CANONICAL) -> PartGraph:
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
