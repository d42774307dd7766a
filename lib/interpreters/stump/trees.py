"""Trees of operations -> stump, and back: the same solid at every point.

A tree is a `csg.Tree` with primitives of this language at its leaves, or one leaf alone. Complements are pushed down
to the leaves and intersections below unions, as in school algebra:

    A - B = A * not B        not (A + B) = not A * not B        A * (B + C) = A * B + A * C

What is left is a union of terms, each an intersection of primitives and complements: the disjunctive form, whose terms
are a stump's S. It can be exponentially longer than the tree, so it is kept short all the way: a term with A and not A
is empty, and a term within another one is redundant. At the end, literals go that change nothing (`terms` has the
rules). Equal primitives are one.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import torch

from ..csg.program import Operation, Tree
from ..quoting import quoted
from .errors import ProgramError
from .primitives import Primitive
from .program import EVERYTHING, NOTHING, Stump, check_primitives
from .terms import intersected, literals, shortened, united

MOST_TERMS = 1 << 14  # that one step may make; the paper has 256 nodes
COUNTED = 10**100  # no further: subtrees that stand in several places could make numbers that fill the memory


class Constant(Enum):
    """Leaves without numbers: the whole space, and the empty set."""

    EVERYTHING = EVERYTHING
    NOTHING = NOTHING


Node = Tree | Primitive | Constant
Key = tuple[int, bool]  # id of a node, and whether it is complemented


@dataclass(frozen=True)
class Form:
    """The disjunctive form of a tree.

    primitives  the tree's distinct ones, in the order of its leaves
    terms       see `terms`; none is redundant, and they are sorted by their literals
    leaves      how many primitives the tree has at its leaves, equal ones counted again
    expanded    how many terms there would be if nothing was simplified; 10^100 stands for more, too
    """

    primitives: tuple[Primitive, ...]
    terms: tuple[int, ...]
    leaves: int
    expanded: int


def from_tree(tree: Node) -> Stump:
    """The stump that is the same solid, without the primitives that it does not need.

    Rows follow the tree's leaves; a primitive used both ways has two rows, its complement second. Raises ProgramError
    for what is no tree, for one without primitives, and, before it fills the memory, for a form of too many terms.
    """
    form = disjunctive_form(tree)
    used = literals(form.terms) or [0]  # a stump has at least one primitive
    rows = {literal: row for row, literal in enumerate(used)}
    intersection = torch.zeros(len(used), len(form.terms), dtype=torch.bool)
    for column, term in enumerate(form.terms):
        intersection[[rows[literal] for literal in literals([term])], column] = True
    complement = torch.tensor([literal % 2 == 1 for literal in used])
    primitives = tuple(form.primitives[literal // 2] for literal in used)
    return Stump(primitives, complement, intersection, torch.ones(len(form.terms), dtype=torch.bool))


def disjunctive_form(tree: Node) -> Form:
    """The tree as a union of terms. Raises ProgramError like `from_tree`."""
    steps = _children_first(tree)
    places = _places(steps)
    leaves, expanded = _count(steps)
    uses = Counter(key for _, _, operands in steps for key in operands)
    terms: dict[Key, list[int]] = {}
    for node, negated, operands in steps:
        if not operands:
            terms[id(node), negated] = _leaf(node, negated, places)
            continue
        left, right = (terms[key] for key in operands)
        is_union = _is_union(node, negated)
        if (many := len(left) + len(right) if is_union else len(left) * len(right)) > MOST_TERMS:
            raise _too_many(leaves, expanded, many)
        terms[id(node), negated] = (united if is_union else intersected)(left, right)
        for key in operands:  # a thousand steps of ten thousand terms would fill the memory
            uses[key] -= 1
            if not uses[key]:
                terms.pop(key, None)
    (last,) = terms.values()
    return Form(tuple(places), tuple(shortened(last)), leaves, expanded)


def _is_union(node: Tree, negated: bool) -> bool:
    """not (A * B) is a union too: not A + not B; and so is not (A - B) = not A + B."""
    return (node.operation.symbol == "+") != negated


def _children_first(tree: Node) -> list[tuple[Node, bool, tuple[Key, ...]]]:
    """Every node with whether it is complemented and the keys of its operands, each once, leaves from left to right.

    Without recursion: a chain of a thousand operations would be too deep. A subtree that stands in several places is
    visited once (twice, where it is complemented somewhere).
    """
    steps, seen, waiting = [], set(), [(tree, False, False)]
    above: set[Key] = set()  # what the node stands below
    while waiting:
        node, negated, is_done = waiting.pop()
        operands, key = _operands(node, negated), (id(node), negated)
        if is_done or not operands:
            if is_done or key not in seen:
                steps.append((node, negated, tuple((id(operand), sign) for operand, sign in operands)))
            above.discard(key)
        elif key in above:
            raise ProgramError("an operation of the tree stands below itself", expected="a tree that ends")
        elif key not in seen:
            above.add(key)
            waiting.append((node, negated, True))
            waiting += [(operand, sign, False) for operand, sign in reversed(operands)]
        seen.add(key)
    return steps


def _operands(node: Node, negated: bool) -> tuple[tuple[Node, bool], ...]:
    """What a node combines, complements pushed down; nothing for a leaf. Raises ProgramError for what is no node."""
    if isinstance(node, Primitive | Constant):
        return ()
    if not isinstance(node, Tree):
        found = f"the tree has a leaf {quoted(str(node))}, a {type(node).__module__}.{type(node).__name__}"
        raise ProgramError(found, expected="a primitive of this language, such as Sphere(0.5)")
    if not isinstance(node.operation, Operation):
        found = f"the tree has an operation {quoted(str(node.operation))}"
        raise ProgramError(found, expected="Operation of + * or -")
    return (node.left, negated), (node.right, negated != (node.operation.symbol == "-"))


def _places(steps: Sequence) -> dict[Primitive, int]:
    """The number of each distinct primitive. Raises ProgramError where there are none, or some that do not match."""
    leaves = dict.fromkeys(node for node, _, _ in steps if isinstance(node, Primitive))
    if not leaves:
        raise ProgramError("the tree has no primitives", expected="at least one, such as Sphere(0.5)")
    check_primitives(tuple(leaves))
    return {primitive: place for place, primitive in enumerate(leaves)}


def _count(steps: Sequence) -> tuple[int, int]:
    """How many leaves the tree has, and how many terms without simplification; up to COUNTED both are exact."""
    counts: dict[Key, tuple[int, int]] = {}
    for node, negated, operands in steps:
        if operands:
            (leaves, terms), (more_leaves, more_terms) = (counts[key] for key in operands)
            terms = terms + more_terms if _is_union(node, negated) else terms * more_terms
            counts[id(node), negated] = min(leaves + more_leaves, COUNTED), min(terms, COUNTED)
        else:
            is_empty = node is (Constant.EVERYTHING if negated else Constant.NOTHING)
            counts[id(node), negated] = int(isinstance(node, Primitive)), int(not is_empty)
    return counts[id(node), negated]


def _leaf(node: Primitive | Constant, negated: bool, places: dict[Primitive, int]) -> list[int]:
    if isinstance(node, Primitive):
        return [1 << 2 * places[node] + negated]
    return [0] if (node is Constant.EVERYTHING) != negated else []


def _too_many(leaves: int, expanded: int, many: int) -> ProgramError:
    found = f"the tree expands to {_short(expanded)} intersections of its {_short(leaves)} leaves, and to {many:,} "
    found += "at one step where it is simplified on the way"
    return ProgramError(found, expected=f"at most {MOST_TERMS:,}")


def _short(count: int) -> str:
    return f"{count:,}" if count < 10**15 else f"about 10^{round(math.log10(count))}"


def to_tree(stump: Stump) -> Node:
    """A tree that is the same solid, of the united nodes only.

    In each node what is inside is intersected first, then what is outside is subtracted; the nodes are united. All
    three are balanced: 256 nodes are 8 operations deep. A node of complements only starts from Constant.EVERYTHING.
    Two stumps have no primitives in their nodes; their first one comes along, so that every tree converts back:
    A * nothing where no node is united, A + everything where one is the whole space.
    """
    nodes = [_node_tree(stump, column) for column in stump.intersection[:, stump.union].T.tolist()]
    if not nodes:
        return Tree(Operation("*"), stump.primitives[0], Constant.NOTHING)
    if Constant.EVERYTHING in nodes:
        return Tree(Operation("+"), stump.primitives[0], Constant.EVERYTHING)
    return joined("+", nodes)


def _node_tree(stump: Stump, column: Sequence[bool]) -> Node:
    """One intersection node; column: which F it selects."""
    sides: tuple[list[Primitive], list[Primitive]] = [], []
    for primitive, outside, selected in zip(stump.primitives, stump.complement.tolist(), column):
        if selected:
            sides[outside].append(primitive)
    inside, outside = sides
    tree = joined("*", inside) if inside else Constant.EVERYTHING
    return Tree(Operation("-"), tree, joined("+", outside)) if outside else tree


def joined(symbol: str, nodes: Sequence[Node]) -> Node:
    """All nodes combined by one operation, in order, balanced."""
    if len(nodes) == 1:
        return nodes[0]
    half = (len(nodes) + 1) // 2
    return Tree(Operation(symbol), joined(symbol, nodes[:half]), joined(symbol, nodes[half:]))
