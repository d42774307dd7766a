"""Stages 1 to 3: rearrange the hierarchy so that parts that touch are siblings (paper, Appendix C, "Semantic
Hierarchy Arrangement"). Boxes stay as they are; only who is whose child changes. Part graph in, part graph out.

    without_slivers   parts too thin to matter go
    shorten_chains    a node with a single child becomes that child (before the others, and again after them)
    collapse          nodes whose inside is detail become leaves
    flatten           the leaves of some nodes become their direct children
    hold              what a cabinet's frame holds moves into it (storage only)
    limit_levels      what lies deeper than a program may reach moves up
"""

from dataclasses import replace

from .errors import RejectedError
from .labels import COLLAPSED, FLATTENED, FRAME, HELD_BY_FRAME
from .partgraph import Part, PartGraph

SLIVER = 0.004  # thinner than this share of the shape's longest side: PartNet's fringe (the authors: 0.01 of about 1)
LEVELS = 3  # blocks within blocks in every program of the authors' data set


def without_slivers(graph: PartGraph) -> PartGraph:
    """Leaves with a side below SLIVER of the shape's longest side are dropped, and nodes that they leave empty.

    Raises RejectedError ("empty") when nothing is left.
    """
    bounds = graph.leaves.bounds()
    thinnest = SLIVER * float((bounds[1] - bounds[0]).max())
    return prune(graph, lambda part: float(part.box.size.min()) >= thinnest)


def prune(graph: PartGraph, keep) -> PartGraph:
    """The graph without the leaves that `keep` refuses."""

    def visit(part: Part) -> Part | None:
        if part.is_leaf:
            return part if keep(part) else None
        children = tuple(child for child in map(visit, part.children) if child is not None)
        return replace(part, children=children) if children else None

    root = visit(graph.root)
    if root is None:
        raise RejectedError("empty", "no part is left after dropping slivers and hidden parts")
    return graph.with_root(root)


def collapse(graph: PartGraph) -> PartGraph:
    """Drawers, doors, casters, … become leaves: their own box stands for what is inside."""
    labels = COLLAPSED.get(graph.category, set())

    def visit(part: Part) -> Part:
        children = () if part.label in labels else tuple(map(visit, part.children))
        return replace(part, children=children)

    return graph.with_root(visit(graph.root))


def flatten(graph: PartGraph) -> PartGraph:
    """The leaves of a chair's back, arms, base, … (FLATTENED) become the node's direct children."""
    labels = FLATTENED.get(graph.category, set())

    def visit(part: Part) -> Part:
        if part.label in labels and part.children:
            return replace(part, children=tuple(part.leaves()))
        return replace(part, children=tuple(map(visit, part.children)))

    return graph.with_root(visit(graph.root))


def flat(graph: PartGraph) -> PartGraph:
    """All leaves directly below the root: no hierarchy at all (one of the paper's ablations)."""
    return graph.with_root(replace(graph.root, children=tuple(graph.root.leaves())))


def hold(graph: PartGraph) -> PartGraph:
    """Shelves, drawers, doors, … next to a cabinet's frame move into the frame, whose sides they touch."""
    held, children = HELD_BY_FRAME.get(graph.category, set()), graph.root.children
    frames = [part for part in children if part.label == FRAME and part.children]
    if not frames:
        return graph
    moved = tuple(part for part in children if part.label in held)
    frame = replace(frames[0], children=(*frames[0].children, *moved))
    kept = tuple(frame if part is frames[0] else part for part in children if part not in moved)
    return graph.with_root(replace(graph.root, children=kept))


def shorten_chains(graph: PartGraph) -> PartGraph:
    """A node with a single child gives way to that child, which takes a label of the chain.

    The topmost says most; but a label that one of the rules above goes by stays, except in the root's place.
    """
    telling = (
        COLLAPSED.get(graph.category, set())
        | FLATTENED.get(graph.category, set())
        | HELD_BY_FRAME.get(graph.category, set())
        | {FRAME}
    )

    def visit(part: Part, is_root: bool = False) -> Part:
        while len(part.children) == 1 and not (is_root and part.children[0].is_leaf):
            (child,) = part.children
            keeps = is_root or part.label in telling or child.label not in telling
            part = replace(child, label=part.label if keeps else child.label, id=part.id)
        return replace(part, children=tuple(map(visit, part.children)))

    return graph.with_root(visit(graph.root, is_root=True))


def limit_levels(graph: PartGraph, levels: int = LEVELS) -> PartGraph:
    """Nodes below the last level that programs have give their leaves to the node above."""

    def visit(part: Part, level: int) -> Part:
        if level == levels and part.children:
            return replace(part, children=tuple(part.leaves()))
        return replace(part, children=tuple(visit(child, level + 1) for child in part.children))

    return graph.with_root(visit(graph.root, 1))
