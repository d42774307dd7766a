"""A part graph: the labelled, oriented boxes of a shape, as a tree (PartNet and StructureNet's hierarchies).

    chair                     every part has a label, a box and perhaps children
    ├── chair_back            the leaves are what is seen
    │   ├── back_surface      an inner part's box encloses its children
    │   …
World axes as everywhere here: x right, y up, z to the front; any unit of length.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import torch

from ..interpreters.cuboids import Cuboids
from ..interpreters.shapeassembly import Shape
from .errors import PartGraphError

CATEGORIES = ("chair", "table", "storage")
UNLABELLED = "other"  # the label of parts nobody named; every category knows it


@dataclass(frozen=True, eq=False)
class Part:
    """One node. `box` is a single cuboid: size (3,), center (3,), axes (3, 3) with rows right, top, front."""

    label: str
    box: Cuboids
    children: tuple["Part", ...] = ()
    id: int = 0
    edges: tuple[dict, ...] = ()  # relations between children as the file had them; kept, not used

    def __repr__(self) -> str:
        return f"<Part {self.label}: {len(self.children)} children>"

    @property
    def is_leaf(self) -> bool:
        return not self.children

    def walk(self) -> Iterator["Part"]:
        """This part and everything below it, parents before children, siblings in order."""
        yield self
        for child in self.children:
            yield from child.walk()

    def leaves(self) -> list["Part"]:
        return [part for part in self.walk() if part.is_leaf]

    def map_leaves(self, change: Callable[["Part"], "Part"]) -> "Part":
        """The same tree with `change` applied to every leaf."""
        if self.is_leaf:
            return change(self)
        return replace(self, children=tuple(child.map_leaves(change) for child in self.children))


@dataclass(frozen=True, eq=False)
class PartGraph:
    """A whole shape. `category` is "chair", "table", "storage" or "" where nobody knows."""

    root: Part
    category: str = ""
    name: str = ""

    def __repr__(self) -> str:
        name, category = self.name or "without a name", self.category or "any category"
        return f"<PartGraph {name}: {category}, {len(self.root.leaves())} leaves>"

    @classmethod
    def from_shape(cls, shape: Shape, category: str = "", name: str = "") -> "PartGraph":
        """The boxes and the hierarchy of an executed program; its parts are labelled "other".

        Inner boxes are the placed boxes of the blocks. Raises PartGraphError for a shape without leaves.
        """
        if not len(shape.cuboids):
            raise PartGraphError("the shape has no cuboids", "at least one leaf", file=name)
        boxes = unstack(shape.boxes.detach().to("cpu", torch.float64))
        parents, drawn = shape.parents, shape.is_leaf
        below: dict[int, list[int]] = {}
        for number, parent in enumerate(parents):
            below.setdefault(parent, []).append(number)

        def part(number: int) -> Part | None:
            children = tuple(filter(None, map(part, below.get(number, ()))))
            if not children and not drawn[number]:
                return None  # a block without cuboids: nothing of it is seen
            return Part(UNLABELLED, boxes[number], children, number)

        return cls(part(0), category, name)

    @classmethod
    def read(cls, path: str | os.PathLike, category: str = "") -> "PartGraph":
        """The part graph in a JSON file. Raises PartGraphError; a PartGraphWarning tells of repairs and odd labels."""
        from .files import read  # here and below: those modules build on this one

        return read(path, category)

    @classmethod
    def from_json(cls, source: str | bytes | dict, category: str = "", file: str = "") -> "PartGraph":
        """The part graph that a JSON text, or the object in it, describes; `file` is named in errors. As `read`."""
        from .parsing import parse

        return parse(source, category, file)

    def to_json(self) -> str:
        """StructureNet's JSON on one line, which `from_json` reads again. Raises PartGraphError."""
        from .parsing import to_json

        return to_json(self)

    def write(self, path: str | os.PathLike) -> None:
        """Write that line to a file, whole or not at all. Raises PartGraphError."""
        from .files import write

        write(self, path)

    @property
    def leaves(self) -> Cuboids:
        """The leaves' boxes, in the order of the walk: what is seen, and what a program has to make."""
        return stack(self.root.leaves())

    @property
    def labels(self) -> list[str]:
        """The leaves' labels, in the same order."""
        return [part.label for part in self.root.leaves()]

    def with_root(self, root: Part) -> "PartGraph":
        return replace(self, root=root)

    def mesh(self):
        """A trimesh.Trimesh of the leaves; parts of one label have one colour."""
        from ..interpreters.shapeassembly.meshing import boxes_mesh
        from ..interpreters.shapeassembly.shape import PALETTE

        number = {label: k for k, label in enumerate(dict.fromkeys(self.labels))}
        colors = [PALETTE[number[label] % len(PALETTE)] for label in self.labels]
        return boxes_mesh(self.leaves, torch.tensor(colors, dtype=torch.uint8).numpy())


def stack(parts: list[Part] | tuple[Part, ...]) -> Cuboids:
    """The boxes of several parts as one batch, (n,)."""
    return stack_boxes([part.box for part in parts])


def unstack(boxes: Cuboids) -> list[Cuboids]:
    """A batch of boxes, (n,), one by one, each with memory of its own: pickled, a view takes the whole batch along."""
    rows = zip(*(tensor.unbind() for tensor in (boxes.size, boxes.center, boxes.axes)))
    return [Cuboids(*(tensor.clone() for tensor in row)) for row in rows]


def stack_boxes(boxes: list[Cuboids]) -> Cuboids:
    """Several single boxes as one batch, (n,)."""
    if not boxes:
        return Cuboids(torch.zeros(0, 3).double(), torch.zeros(0, 3).double(), torch.zeros(0, 3, 3).double())
    return Cuboids(
        torch.stack([box.size for box in boxes]),
        torch.stack([box.center for box in boxes]),
        torch.stack([box.axes for box in boxes]),
    )
