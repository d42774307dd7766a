"""Part graphs by hand: a few boxes, put together and changed one at a time.

    board = box("tabletop", center=(0, 0.7, 0), size=(1.2, 0.04, 0.8))
    table = assemble("table", board, *legs)        ids 0, 1, 2, … in the order of the tree
    other = with_box(table, 3, center=(0.5, 0.3, 0.2))

World axes and units are those of part graphs: x right, y up, z to the front.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count

import torch

from ..extractor import Part, PartGraph
from ..interpreters.cuboids import Cuboids


def box(label: str, center: Sequence[float], size: Sequence[float], degrees: float = 0.0) -> Part:
    """A leaf. `center` and `size` are x, y, z; `degrees` turn it about the z axis, seen from the front to the left."""
    angle = math.radians(degrees)
    cosine, sine = math.cos(angle), math.sin(angle)
    numbers = (size, center, [[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    return Part(label, Cuboids(*(torch.tensor(each, dtype=torch.float64) for each in numbers)))


def inner(label: str, *children: Part) -> Part:
    """An inner part: an upright box around what it holds."""
    corners = [leaf.box.corners() for child in children for leaf in child.leaves()]
    points = torch.cat(corners)
    low, high = points.amin(0), points.amax(0)
    around = Cuboids(high - low, (low + high) / 2, torch.eye(3, dtype=torch.float64))
    return Part(label, around, children)


def assemble(label: str, *children: Part, category: str = "") -> PartGraph:
    """A part graph of these parts, numbered from 0 (the root) in the order of the tree."""
    return _numbered(PartGraph(inner(label, *children), category or label, f"{label} by hand"))


def with_box(
    graph: PartGraph, number: int, center: Sequence[float] | None = None, size: Sequence[float] | None = None
) -> PartGraph:
    """The graph with another center or size (or both) for the leaf with this id. Raises KeyError for no such leaf."""
    if number not in {leaf.id for leaf in graph.root.leaves()}:
        raise KeyError(f"{graph.name} has no leaf with the id {number}")

    def change(part: Part) -> Part:
        if part.id != number:
            return part
        old = part.box
        new = [
            known if given is None else known.new_tensor(given)
            for known, given in zip((old.size, old.center), (size, center))
        ]
        return replace(part, box=Cuboids(*new, old.axes))

    return graph.with_root(graph.root.map_leaves(change))


def reordered(graph: PartGraph, order: Callable[[list[Part]], Sequence[Part]]) -> PartGraph:
    """The graph with the children of every part in another order: `order` gets the list of them."""

    def visit(part: Part) -> Part:
        return replace(part, children=tuple(order([visit(child) for child in part.children])))

    return graph.with_root(visit(graph.root))


def _numbered(graph: PartGraph) -> PartGraph:
    numbers = count()

    def visit(part: Part) -> Part:
        number = next(numbers)
        return replace(part, id=number, children=tuple(visit(child) for child in part.children))

    return graph.with_root(visit(graph.root))
