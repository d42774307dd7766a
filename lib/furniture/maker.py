"""Making furniture by category and seed, and saying what a part graph is structurally."""

import numpy as np

from lib.extractor.partgraph import CATEGORIES, Part, PartGraph

from .chairs import chair
from .kit import Workshop, finish
from .storage import storage
from .tables import table

DESIGNS = {"chair": chair, "table": table, "storage": storage}


def make(category: str, seed: int) -> PartGraph:
    """One piece of furniture: the same for the same category and seed, whatever was made before.

    Its root box is centred at the origin and 1.55 to 1.95 long from corner to corner; x right, y up, front +z.
    Raises ValueError, naming the choices, for an unknown category.
    """
    if category not in DESIGNS:
        raise ValueError(f"no furniture of category {category!r}: choose one of {', '.join(DESIGNS)}")
    workshop = Workshop(np.random.default_rng([CATEGORIES.index(category), seed]))
    return finish(DESIGNS[category](workshop), workshop, category, f"{category}-{seed:06d}")


def make_many(category: str, count: int, seed: int = 0) -> list[PartGraph]:
    """`count` pieces of furniture, of the seeds `seed`, `seed + 1`, …  Raises ValueError as `make` does."""
    return [make(category, each) for each in range(seed, seed + count)]


def structure(graph: PartGraph) -> tuple:
    """What the graph is apart from sizes: (label, structures of the children, sorted). Equal ones compare equal."""
    return _structure(graph.root)


def _structure(part: Part) -> tuple:
    return part.label, tuple(sorted(_structure(child) for child in part.children))
