"""Checkers for 03_shapes_to_programs, and the part graphs they are about."""

import torch

from ..extractor import PartGraph, RejectedError, extract, regularise, survey
from ..interpreters.shapeassembly import execute
from . import OK, UNANSWERED, hint
from .parts import assemble, box

STICKS_OUT = 0.02  # how far beyond the broken shape a mended one may reach, world units


def loose_shelf() -> PartGraph:
    """Exercise 3.1: a bookcase with a shelf that is too short to touch its sides."""
    panels = [box("vertical_side_panel", (x, 0.6, 0), (0.04, 1.2, 0.4)) for x in (-0.5, 0.5)]
    boards = [
        box(name, (0, y, 0), (0.96, 0.04, 0.4)) for name, y in (("bottom_panel", 0.02), ("top_panel", 1.18))
    ]
    shelves = [
        box("shelf", (0, 0.45, 0), (0.96, 0.03, 0.36)),
        box("shelf", (0.05, 0.85, 0), (0.6, 0.03, 0.36)),
    ]
    return assemble("storage_furniture", *panels, *boards, *shelves, category="storage")


def rack() -> PartGraph:
    """Exercise 3.2: a table with three thin legs and a thick one, and a row of three rails on its top."""
    top = box("tabletop_surface", (0, 0.72, 0), (1.2, 0.04, 0.7))
    legs = [
        box("leg", (x, 0.35, z), (thick, 0.7, thick))
        for x, z, thick in ((-0.5, -0.25, 0.05), (-0.5, 0.25, 0.05), (0.5, -0.25, 0.05), (0.5, 0.25, 0.12))
    ]
    rails = [box("bar", (0, 0.76, z), (0.7, 0.04, 0.05)) for z in (-0.2, 0.0, 0.2)]
    return assemble("table", top, *legs, *rails)


def check_mended(answer: object, broken: PartGraph) -> str:
    """Exercise 3.1: the same parts with one leaf's box changed, so that the graph is accepted."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, PartGraph):
        return hint(f"the answer should be a PartGraph, this is a {type(answer).__name__}")
    old, new = ({part.id: part for part in graph.root.walk()} for graph in (broken, answer))
    if [(part.id, part.label) for part in broken.root.walk()] != [
        (part.id, part.label) for part in answer.root.walk()
    ]:
        return hint("keep all parts, their labels and their order; change a box with with_box")
    if not answer.leaves.corners().isfinite().all() or (answer.leaves.size <= 0).any():
        return hint("a box needs finite numbers and sides above 0")
    changed = [i for i in old if old[i].is_leaf and not _same_box(old[i], new[i])]
    if len(changed) != 1:
        return hint(f"{len(changed)} boxes differ from the broken graph; change exactly one")
    extraction = extract(answer)
    if not extraction.accepted:
        label = new[changed[0]].label
        return hint(f"with this {label} it is still rejected: {extraction.reason} ({extraction.detail})")
    if len(execute(extraction.program).cuboids) < len(broken.leaves):
        return hint("it is accepted, but a part is gone: too thin to matter, or inside another one?")
    if (answer.leaves.bounds() - broken.leaves.bounds()).abs().max() > STICKS_OUT:
        return hint("it is accepted, but now it reaches beyond the bookcase")
    return OK


def _same_box(old, new) -> bool:
    pairs = ((old.box.size, new.box.size), (old.box.center, new.box.center), (old.box.axes, new.box.axes))
    return all(torch.equal(a, b) for a, b in pairs)


def check_groups(answer: object, graph: PartGraph) -> str:
    """Exercise 3.2: the groups of copies that the extractor finds, as sets of ids, in any order."""
    if answer is None:
        return UNANSWERED
    try:
        given = {frozenset(group) for group in answer}
    except TypeError:
        return hint("the answer is a list of sets of ids, such as [{1, 2}, {3, 4}]")
    leaves = {leaf.id for leaf in graph.root.leaves()}
    if strange := sorted(map(str, frozenset().union(*given) - leaves)):
        return hint(f"there is no leaf with the id {', '.join(strange)}")
    if len(frozenset().union(*given)) < sum(map(len, given)):
        return hint("no part is in two groups")
    right = groups_of(graph)
    for group in sorted(given, key=sorted):
        if group not in right:
            return hint(
                f"{set(group)} is not a group as it stands: two or more of a size, in a row or left and right?"
            )
    return (
        OK if given == right else hint(f"{len(given)} of {len(right)} groups found; what else is repeated?")
    )


def groups_of(graph: PartGraph) -> set[frozenset[int]]:
    """The groups of the root's block, as sets of part ids; none for a graph without a program."""
    try:
        facts = survey(regularise(graph).root, graph.category)
    except RejectedError:
        return set()
    return {frozenset(facts.parts[i].id for i in group.members) for group in facts.groups}
