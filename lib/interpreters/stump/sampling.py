"""Random stumps, for tests and demonstrations, not for realism.

A node starts from one bounded primitive; each further one, of any kind and perhaps complemented, takes a fair part of
the node away but not all. So every primitive has an effect and the shape is bounded. A node may also take over a
primitive of another one. Every node has points that no other one has. All this is told from a grid of points in the
cube from -1/2 to 1/2 around the origin, or in the square. Numbers have three decimals, so that texts are readable.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..checks import whole
from .errors import ProgramError
from .poses import ANGLES
from .primitives import Box, Circle, Cone, Cylinder, HalfPlane, Primitive, Sphere, Square, Triangle
from .program import Stump

MOST_PRIMITIVES = 16  # more seldom find room in the cube
FILLED = (0.02, 0.6)  # share of the cube that a shape takes
_KEPT = (
    0.15,
    0.95,
)  # least share of its first primitive that a node keeps; most that one more primitive leaves
_OWN = 0.004  # share of the cube that only this node takes
_GRID = {2: 40, 3: 14}  # points along a side, by dimension
_TRIES, _DRAWS = 100, 30  # for a stump, and for a node or a primitive of it

BOUNDED = {2: (Square, Circle, Triangle), 3: (Box, Sphere, Cylinder, Cone)}
ENDLESS = {2: (HalfPlane,), 3: (Cylinder, Cone)}  # without a height


def sample(
    rng: np.random.Generator, dimensions: int = 3, primitives: int | None = None, nodes: int | None = None
) -> Stump:
    """A random stump; two to eight primitives and up to four nodes, all united, unless told otherwise.

    Raises ProgramError for what is no Generator, and for a number that cannot be.
    """
    if not isinstance(rng, np.random.Generator):
        expected = "a numpy Generator, such as np.random.default_rng(0)"
        raise ProgramError(f"found {rng!r:.40}", expected=expected)
    if whole(dimensions) not in _GRID:
        raise ProgramError(f"{dimensions!r:.40} dimensions", expected="2 or 3")
    if primitives is None:
        least = 2 if nodes is None else max(2, _checked(nodes, MOST_PRIMITIVES, "nodes"))
        primitives = int(rng.integers(least, max(least, 8) + 1))
    primitives = _checked(primitives, MOST_PRIMITIVES, "primitives")
    if nodes is None:
        nodes = int(rng.integers(1, min(primitives, 4) + 1))
    nodes = _checked(nodes, primitives, "nodes")
    for _ in range(_TRIES):
        if stump := _draw(rng, dimensions, primitives, nodes):
            return stump
    raise ProgramError(f"found no stump of {primitives} primitives and {nodes} nodes", expected="fewer")


def _checked(given, most: int, what: str) -> int:
    number = whole(given)
    if number is None or not 1 <= number <= most:
        raise ProgramError(f"{given!r:.40} {what}", expected=f"a whole number from 1 to {most}")
    return number


@dataclass(frozen=True)
class _Row:
    """A primitive, whether it is complemented, and the F that this makes, on the grid."""

    primitive: Primitive
    outside: bool
    inside: Bool[Tensor, " m"]


def _draw(rng: np.random.Generator, dimensions: int, primitives: int, nodes: int) -> Stump | None:
    """One attempt."""
    cuts = np.sort(rng.choice(np.arange(1, primitives), nodes - 1, replace=False))
    largest = 0.4 / max(1, nodes - 2) ** (1 / dimensions)  # many nodes need room
    made: list[list[_Row]] = []
    for count in np.diff([0, *cuts, primitives]).tolist():  # primitives that are new in each node
        node = next(filter(None, (_node(rng, dimensions, count, largest, made) for _ in range(_DRAWS))), None)
        if node is None:
            return None
        made.append(node)
    rows = [row for node in made for row in node]
    if not _is_apart(_share(rng, rows, made)) or not FILLED[0] <= _union(made).float().mean() <= FILLED[1]:
        return None
    intersection = [[any(row is other for other in node) for node in made] for row in rows]
    complement = [row.outside for row in rows]
    return Stump([row.primitive for row in rows], complement, intersection, [True] * nodes)


def _node(
    rng: np.random.Generator, dimensions: int, count: int, largest: float, others: Sequence[list[_Row]]
) -> list[_Row] | None:
    """A node of so many new primitives; None where one of them finds no place."""
    node, least = [], _KEPT[0] ** (1 / max(1, count - 1))
    for _ in range(count):
        rows = (_row(rng, dimensions, largest, bounded=not node) for _ in range(_DRAWS))
        row = next((row for row in rows if not node or _cuts(row, node, least)), None)
        if row is None:
            return None
        node.append(row)
    return node if _is_apart([*others, node]) else None


def _row(rng: np.random.Generator, dimensions: int, largest: float, bounded: bool) -> _Row:
    primitive = _primitive(rng, dimensions, largest, bounded)
    outside = not bounded and bool(rng.random() < 0.5)
    return _Row(primitive, outside, (primitive.distance(_grid(dimensions)) <= 0) ^ outside)


def _cuts(row: _Row, node: Sequence[_Row], least: float) -> bool:
    """Does F take away a fair part of the node but not all?"""
    before = _intersection(node)
    after = before & row.inside
    return bool(after.float().mean() >= _OWN) and least <= float(after.sum() / before.sum()) <= _KEPT[1]


def _share(rng: np.random.Generator, rows: Sequence[_Row], nodes: list[list[_Row]]) -> list[list[_Row]]:
    """The nodes, of which some take over a primitive of another one."""
    for node in nodes:
        row = rows[int(rng.integers(len(rows)))]
        if rng.random() < 0.5 and all(row is not own for own in node) and _cuts(row, node, 0.5):
            node.append(row)
    return nodes


def _intersection(node: Sequence[_Row]) -> Bool[Tensor, " m"]:
    return torch.stack([row.inside for row in node]).all(0)


def _union(nodes: Sequence[Sequence[_Row]]) -> Bool[Tensor, " m"]:
    return torch.stack([_intersection(node) for node in nodes]).any(0)


def _is_apart(nodes: Sequence[Sequence[_Row]]) -> bool:
    """Has every node points of its own?"""
    held = torch.stack([_intersection(node) for node in nodes])  # (nodes, points)
    return bool(((held & (held.sum(0) == 1)).float().mean(1) >= _OWN).all())


def _primitive(rng: np.random.Generator, dimensions: int, largest: float, bounded: bool) -> Primitive:
    """A primitive of any kind in the cube; about one in four that may be boundless is."""
    endless = not bounded and rng.random() < 0.25
    kinds = (ENDLESS if endless else BOUNDED)[dimensions]
    kind = kinds[int(rng.integers(len(kinds)))]
    sizes = {key: _size(rng, key, width, largest) for key, width in kind.counts.items()}
    if endless:
        sizes.pop("height", None)
    pose = {"translation": _rounded(rng.uniform(-0.35, 0.35, dimensions))}
    if kind not in (Sphere, Circle) and rng.random() < 0.5:
        pose["rotation"] = _rounded(rng.normal(size=ANGLES[dimensions]))
    return kind(**sizes, **pose)


def _size(rng: np.random.Generator, key: str, width: int, largest: float) -> list[float] | float:
    low, high = {"slope": (0.3, 1.2), "height": (0.75 * largest, 2 * largest)}.get(
        key, (largest / 4, largest)
    )
    numbers = _rounded(rng.uniform(low, high, width))
    return numbers if width > 1 else numbers[0]


def _rounded(numbers: np.ndarray) -> list[float]:
    return np.round(numbers, 3).tolist()


@cache
def _grid(dimensions: int) -> Float[Tensor, "m d"]:
    side = (torch.arange(_GRID[dimensions], dtype=torch.float64) + 0.5) / _GRID[dimensions] - 0.5
    return torch.stack(torch.meshgrid(*[side] * dimensions, indexing="ij"), -1).flatten(0, -2)
