"""Stages 7 to 10 for every block of a shape: what touches what, what is a copy of what, what is attached when."""

from collections.abc import Sequence
from dataclasses import replace

from jaxtyping import Float
from torch import Tensor

from .arranging import LEVELS
from .bounding import seen_from
from .contacts import connecting_contacts, floating, mark_firm
from .errors import RejectedError
from .facts import BlockFacts
from .labels import RANKED
from .options import CANONICAL, Options
from .ordering import best_first, grounded_order
from .partgraph import Part, stack
from .placing import judge, ways_to_place
from .snapping import is_upright, snap
from .subprograms import join, join_components
from .symmetry import ALIKE, find_groups

MAY_COST = 3  # steps of misfit that a sub-assembly of its own may cost its parts


def semantic_order(parts: Sequence[Part], category: str, size: Float[Tensor, "3"]) -> list[Part]:
    """By the label's rank, then by where the part's center is: first coarsely, then exactly (paper, section 5.2)."""
    ranks, longest = {label: rank for rank, label in enumerate(RANKED.get(category, ()))}, float(size.max())

    def key(part: Part) -> tuple:
        center = [round(x / longest, 6) + 0.0 for x in part.box.center.tolist()]
        coarse = [round(2 * x) for x in center]
        return ranks.get(part.label, len(ranks)), sum(coarse), *coarse, *center, *part.box.size.tolist()

    return sorted(parts, key=key)


def survey(
    node: Part, category: str, options: Options = CANONICAL, alike: float = ALIKE, level: int = 1
) -> BlockFacts:
    """All facts about a node's block and, through it, about those below. Raises RejectedError.

    alike   how exact copies must be, see `symmetry`
    """
    facts = look(seen_from(node.box, node.children), node.box.size, category, options)
    if options.macros and options.hierarchy and level < LEVELS:
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
    """Parts of a block in order, their straightened boxes, their contacts, and every way to hold each of them.

    Raises RejectedError ("disconnected").
    """
    parts = semantic_order(parts, category, size)
    boxes = snap(stack(parts))
    aligned = is_upright(boxes) & options.aligned_flag
    contacts = mark_firm(connecting_contacts(boxes, size), [stack(part.leaves()) for part in parts])
    if loose := floating(len(parts), contacts):
        names = ", ".join(parts[i].label for i in sorted(loose))
        raise RejectedError("disconnected", f"no chain of contacts holds {names}")
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
    try:
        inside = look(seen_from(node.box, node.children), node.box.size, category, options)
        before = grounded_order(facts.written, facts.open_ways)
        after = grounded_order(inside.written, inside.open_ways)
    except RejectedError:
        return False
    allowed = max(MAY_COST * facts.tolerance, *(way.misfit for way in before if way.cuboid in component))
    return max(way.misfit for way in after) <= allowed
