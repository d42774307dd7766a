"""Random stumps for tests and benchmarks."""

import numpy as np
import torch

from lib.interpreters.stump import (
    Box,
    Circle,
    Cone,
    Cylinder,
    HalfPlane,
    Primitive,
    Sphere,
    Square,
    Stump,
    Triangle,
)

SOLID = ("box", "sphere", "cylinder", "capped cylinder", "cone", "capped cone")
PLANE = ("square", "circle", "triangle", "half-plane")
FINITE = ("box", "sphere", "capped cylinder", "capped cone", "square", "circle", "triangle")


def random_primitive(
    rng: np.random.Generator, form: str, batch: tuple = (), dtype=torch.float64
) -> Primitive:
    """One of SOLID or PLANE within about 1 of the origin, or a batch of them."""

    def numbers(low, high, *count):
        return torch.tensor(rng.uniform(low, high, (*batch, *count))).to(dtype)

    if form in PLANE:
        pose = {"translation": numbers(-0.5, 0.5, 2), "rotation": numbers(-3, 3, 1)}
    else:
        pose = {
            "translation": numbers(-0.5, 0.5, 3),
            "rotation": torch.tensor(rng.normal(size=(*batch, 4))).to(dtype),
        }
    sizes = {
        "box": lambda: Box(numbers(0.05, 0.4, 3), **pose),
        "sphere": lambda: Sphere(numbers(0.05, 0.4), **pose),
        "cylinder": lambda: Cylinder(numbers(0.05, 0.3), **pose),
        "capped cylinder": lambda: Cylinder(numbers(0.05, 0.3), numbers(0.1, 0.8), **pose),
        "cone": lambda: Cone(numbers(0.2, 1.5), **pose),
        "capped cone": lambda: Cone(numbers(0.2, 1.5), numbers(0.1, 0.6), **pose),
        "square": lambda: Square(numbers(0.05, 0.4, 2), **pose),
        "circle": lambda: Circle(numbers(0.05, 0.4), **pose),
        "triangle": lambda: Triangle(numbers(0.05, 0.4), numbers(0.05, 0.4), numbers(0.1, 0.6), **pose),
        "half-plane": lambda: HalfPlane(**pose),
    }
    return sizes[form]()


def random_stump(rng: np.random.Generator, dimensions: int, most: int = 7, forms: tuple = ()) -> Stump:
    """Up to `most` primitives and 4 nodes of 1 to 3 primitives each, some complemented, some nodes not united."""
    forms = forms or (SOLID if dimensions == 3 else PLANE)
    count, nodes = int(rng.integers(1, most + 1)), int(rng.integers(1, 5))
    primitives = [random_primitive(rng, forms[rng.integers(len(forms))]) for _ in range(count)]
    intersection = np.zeros((count, nodes), dtype=bool)
    for c in range(nodes):
        intersection[rng.permutation(count)[: rng.integers(1, 4)], c] = True
    return Stump(primitives, rng.random(count) < 0.3, intersection, rng.random(nodes) < 0.8)


def boxes(count: int = 64, nodes: int = 20, seed: int = 0) -> Stump:
    """Boxes in random poses, all of them used: the first ones each lose some of the others, which are complemented."""
    rng = np.random.default_rng(seed)
    intersection = np.zeros((count, nodes), dtype=bool)
    intersection[np.arange(count), np.arange(count) % nodes] = True
    primitives = [random_primitive(rng, "box") for _ in range(count)]
    return Stump(primitives, np.arange(count) >= nodes, intersection, np.ones(nodes, dtype=bool))
