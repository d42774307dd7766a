"""Random trees with primitives of the stump language, and the definitions of tree and stump in three lines each."""

import numpy as np
import torch

from lib.interpreters.csg import Operation, Tree
from lib.interpreters.stump import KINDS, Constant, Primitive, Stump
from lib.interpreters.stump.poses import ANGLES
from lib.interpreters.stump.primitives import distances

OPERATIONS = tuple(map(Operation, "+*-"))
Masks = dict[Primitive, torch.Tensor]


def random_primitive(rng: np.random.Generator, dimensions: int) -> Primitive:
    """Any kind, boundless ones included, about the middle of the unit cube."""
    kinds = [kind for kind in KINDS.values() if kind.dimensions == dimensions]
    kind = kinds[rng.integers(len(kinds))]
    sizes = {key: torch.tensor(rng.uniform(0.1, 0.5, n)).squeeze(-1) for key, n in kind.counts.items()}
    if dimensions == 3 and "height" in sizes and rng.random() < 0.5:
        del sizes["height"]
    pose = rng.uniform(-0.3, 0.3, dimensions), rng.normal(size=ANGLES[dimensions])
    return kind(**sizes, translation=torch.tensor(pose[0]), rotation=torch.tensor(pose[1]))


def random_tree(rng: np.random.Generator, leaves: list, count: int) -> Tree | Primitive:
    """A tree with so many leaves, drawn from the list: the same one may stand in several places."""
    if count == 1:
        return leaves[rng.integers(len(leaves))]
    left = int(rng.integers(1, count))
    parts = random_tree(rng, leaves, left), random_tree(rng, leaves, count - left)
    return Tree(OPERATIONS[rng.integers(3)], *parts)


def probes(rng: np.random.Generator, primitives: list[Primitive], count: int) -> torch.Tensor:
    """Points of the unit cube, half of them moved onto the surface of one of the primitives, as near as it goes."""
    dimensions = primitives[0].dimensions
    points = torch.from_numpy(rng.uniform(-0.5, 0.5, (count, dimensions)))
    moving = points[: count // 2].clone().requires_grad_()
    rows = torch.arange(len(moving))
    distance = distances(primitives, moving)[rows % len(primitives), rows]
    (slope,) = torch.autograd.grad(distance.sum(), moving)
    points[: count // 2] -= (distance.unsqueeze(-1) * slope).detach()
    return points


def masks(primitives: list[Primitive], points: torch.Tensor) -> Masks:
    """Which points are inside each primitive."""
    return dict(zip(primitives, distances(primitives, points) <= 0))


def tree_occupancy(node: Tree | Primitive | Constant, inside: Masks) -> torch.Tensor:
    """The definition of a tree."""
    if isinstance(node, Constant):
        return torch.full_like(next(iter(inside.values())), node is Constant.EVERYTHING)
    if not isinstance(node, Tree):
        return inside[node]
    left, right = tree_occupancy(node.left, inside), tree_occupancy(node.right, inside)
    return {"+": left | right, "*": left & right, "-": left & ~right}[node.operation.symbol]


def stump_occupancy(stump: Stump, inside: Masks) -> torch.Tensor:
    """The definition of a stump, with loops for min and max."""
    rows = [inside[primitive] ^ outside for primitive, outside in zip(stump.primitives, stump.complement)]
    union = torch.zeros_like(rows[0])
    for column, united in zip(stump.intersection.T.tolist(), stump.union.tolist()):
        if united:
            node = torch.ones_like(rows[0])
            for row, selected in zip(rows, column):
                node &= row if selected else True
            union |= node
    return union
