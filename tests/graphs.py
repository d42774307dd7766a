"""Part graphs for tests: boxes by size and center, trees of them, random boxes, and furniture extracted once."""

import math
import random
from dataclasses import replace
from functools import cache

import torch

from lib.extractor import BlockFacts, Extraction, Options, Part, PartGraph, extract_many
from lib.extractor.options import CANONICAL
from lib.extractor.surveying import look
from lib.furniture import make
from lib.interpreters.cuboids import Cuboids

from .conftest import unchecked

CATEGORIES = ("chair", "table", "storage")


def tensor(numbers) -> torch.Tensor:
    return torch.tensor(numbers, dtype=torch.float64)


def turn(degrees: float, axis: int) -> torch.Tensor:
    """Axes turned about x, y or z (0, 1, 2), counterclockwise when that axis points at you."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    axes = torch.eye(3, dtype=torch.float64)
    axes[i, i] = axes[j, j] = c
    axes[i, j], axes[j, i] = s, -s
    return axes


def box(size, center=(0, 0, 0), axes=None) -> Cuboids:
    """A single box, upright unless told otherwise."""
    axes = torch.eye(3, dtype=torch.float64) if axes is None else torch.as_tensor(axes, dtype=torch.float64)
    return Cuboids(tensor(size), tensor(center), axes)


def between(low, high) -> Cuboids:
    """An upright box by its lowest and highest corner."""
    return box([b - a for a, b in zip(low, high)], [(a + b) / 2 for a, b in zip(low, high)])


def batch(*boxes: Cuboids) -> Cuboids:
    return Cuboids(*(torch.stack([getattr(b, name) for b in boxes]) for name in ("size", "center", "axes")))


def leaf(size, center=(0, 0, 0), label: str = "other", axes=None) -> Part:
    return Part(label, box(size, center, axes))


def node(label: str, *children: Part) -> Part:
    """An inner part with the bounds of its leaves as its box."""
    low, high = batch(*(each.box for child in children for each in child.leaves())).bounds()
    return Part(label, box((high - low).tolist(), ((high + low) / 2).tolist()), children)


def graph(*parts: Part, category: str = "", name: str = "") -> PartGraph:
    return PartGraph(node("root", *parts), category, name)


def tree(part: Part):
    """Nested labels: a leaf is its label, an inner part (label, child, child, …)."""
    return (part.label, *map(tree, part.children)) if part.children else part.label


def facts_of(*parts: Part, size=(2, 2, 2), **options) -> BlockFacts:
    """Contacts and ways of a block whose box is centered at the origin, no groups, no order."""
    return look(list(parts), tensor(size), "", Options(**options))


def random_axes(generator: torch.Generator, count: int) -> torch.Tensor:
    """Right-handed axes in all directions, (count, 3, 3)."""
    q, _ = torch.linalg.qr(torch.randn(count, 3, 3, generator=generator, dtype=torch.float64))
    return q * torch.linalg.det(q).view(-1, 1, 1)  # -1 times a 3x3 matrix changes the sign of its determinant


def random_boxes(seed: int, count: int, spread: float = 1.0) -> Cuboids:
    """Boxes turned anyhow, sides 0.1 to 1, centers in a cube of side `spread`."""
    generator = torch.Generator().manual_seed(seed)
    size = 0.1 + 0.9 * torch.rand(count, 3, generator=generator, dtype=torch.float64)
    center = spread * (torch.rand(count, 3, generator=generator, dtype=torch.float64) - 0.5)
    return Cuboids(size, center, random_axes(generator, count))


def shuffled(graph: PartGraph, seed: int) -> PartGraph:
    """The same graph with siblings in another order and new ids."""
    rng = random.Random(seed)

    def visit(part: Part) -> Part:
        children = [visit(child) for child in part.children]
        rng.shuffle(children)
        return replace(part, children=tuple(children), id=rng.randrange(10**9))

    return graph.with_root(visit(graph.root))


def scaled(graph: PartGraph, by: float) -> PartGraph:
    def visit(part: Part) -> Part:
        box = Cuboids(part.box.size * by, part.box.center * by, part.box.axes)
        return replace(part, box=box, children=tuple(map(visit, part.children)))

    return graph.with_root(visit(graph.root))


def corner_set(boxes: Cuboids) -> list[list[tuple]]:
    """The corners of each box (n) in an order that names of axes do not change; 1e-6: rounding of turned boxes."""
    return [sorted(tuple(round(x, 6) + 0.0 for x in p) for p in own) for own in boxes.corners().tolist()]


def blocks(facts: BlockFacts) -> list[BlockFacts]:
    """Facts about a block and about all below it."""
    return [facts, *(below for inner in (facts.inner or {}).values() for below in blocks(inner))]


@cache
def _piece(category: str, seed: int) -> PartGraph:
    return make(category, seed)


@cache
def _extracted(category: str, seed: int) -> Extraction:
    return extract_all([_piece(category, seed)], Options(keep_rejected=True))[0]


def furniture(category: str, count: int) -> list[PartGraph]:
    """The first pieces of furniture, made once for all tests."""
    with unchecked():
        return [_piece(category, seed) for seed in range(count)]


def extracted(category: str, count: int) -> list[Extraction]:
    """What becomes of them, found once for all tests; rejected programs are kept."""
    return [_extracted(category, seed) for seed in range(count)]


def extract_all(graphs, options: Options = CANONICAL) -> list[Extraction]:
    """As `extract_many`, without shape checks."""
    with unchecked():
        return extract_many(graphs, options)


def text(extraction: Extraction) -> str:
    """The program, or why there is none."""
    return extraction.program.to_text() if extraction.program else extraction.reason
