"""The furniture maker's bench: pieces of wood, how they are mirrored, repeated, tilted, and at last numbered as parts.

Furniture is made in metres, feet on the floor y = 0, the middle at x = 0, its front towards +z, and scaled at the end.
Every piece is cut a little wrong (`Workshop.block`), as in PartNet: joints overlap or miss by a few millimetres.
A mirrored or repeated piece is a copy of the wrongly cut one, with a far smaller error of its own.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
import torch

from lib.extractor.partgraph import Part, PartGraph
from lib.interpreters.cuboids import Cuboids

SIZE_ERROR, PLACE_ERROR = 0.004, 0.0012  # of a piece: standard deviation, relative and in metres
COPY_ERROR = 0.0008  # of a copy against its original, both relative and in metres
DIAGONALS = 1.55, 1.95  # of finished furniture, in the units of a part graph
THINNEST = 0.016  # of a leaf, in part graph units: readers of such files drop parts thinner than 0.01
SHUFFLED = 0.4  # share of the graphs whose siblings are in no particular order, as in many files
UPRIGHT = np.eye(3)
UPRIGHT.setflags(write=False)


@dataclass
class Piece:
    """A part in the making. A leaf has a box; a group has children, and axes in which its box will be tight."""

    label: str
    children: list["Piece"] = field(default_factory=list)
    axes: np.ndarray = field(default_factory=lambda: UPRIGHT)  # (3, 3) rows right, top, front
    center: np.ndarray | None = None  # (3,) metres
    size: np.ndarray | None = None  # (3,) metres

    def corners(self) -> np.ndarray:
        """(8, 3) corners of the box."""
        return self.center + SIGNS * self.size @ self.axes

    def fit(self) -> np.ndarray:
        """Fit the boxes of this group and the groups below to their leaves; returns the leaves' corners, (n, 3)."""
        if not self.children:
            return self.corners()
        corners = np.concatenate([child.fit() for child in self.children])
        local = corners @ self.axes.T
        low, high = local.min(axis=0), local.max(axis=0)
        self.center, self.size = (low + high) / 2 @ self.axes, high - low
        return corners

    def walk(self) -> Iterable["Piece"]:
        """This piece and all below it, parents first."""
        yield self
        for child in self.children:
            yield from child.walk()


SIGNS = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (1, -1)]) / 2


class Workshop:
    """One random generator, and everything that is made with it."""

    def __init__(self, rng: np.random.Generator):
        self.rng = rng

    def between(self, low: float, high: float) -> float:
        """A number, uniform between two bounds."""
        return low + (high - low) * self.rng.random()

    def chance(self, probability: float) -> bool:
        return self.rng.random() < probability

    def pick(self, *choices):
        """One of the choices, all equally likely."""
        return choices[int(self.rng.random() * len(choices))]

    def weighted(self, weights: dict):
        """One of the keys; their values say how likely they are, relative to each other."""
        cumulative = np.cumsum(list(weights.values()))
        number = np.searchsorted(cumulative, self.rng.random() * cumulative[-1], side="right")
        return list(weights)[int(number)]

    def block(self, label: str, x: tuple, y: tuple, z: tuple) -> Piece:
        """An upright box between the two coordinates of each axis (in any order)."""
        low, high = np.sort(np.array([x, y, z], dtype=float), axis=1).T
        return self._cut(Piece(label, center=(low + high) / 2, size=high - low))

    def crossbar(self, label: str, reach: float, y: float, z: float, thick: float) -> Piece:
        """A square bar from x = -reach to x = reach whose middle line is at (y, z)."""
        half = thick / 2
        return self.block(label, (-reach, reach), (y - half, y + half), (z - half, z + half))

    def beam(self, label: str, start, end, thickness: tuple[float, float], along: int = 1) -> Piece:
        """A box whose axis number `along` runs from one point to another.

        `thickness` is that of the two other axes, in order. The box is turned from upright by the smallest rotation.
        """
        start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        run = end - start
        length = float(np.sqrt(run @ run))
        size = np.insert(np.array(thickness, dtype=float), along, length)
        return self._cut(Piece(label, [], smallest_turn(along, run / length), (start + end) / 2, size))

    def _cut(self, piece: Piece) -> Piece:
        errors = np.clip(self.rng.standard_normal(6), -2, 2)
        piece.size = piece.size * (1 + SIZE_ERROR * errors[:3])
        piece.center = piece.center + PLACE_ERROR * errors[3:]
        return piece

    def both(self, *pieces: Piece) -> list[Piece]:
        """The pieces and their mirror images, left for right."""
        return [each for piece in pieces for each in (piece, self.copy(piece, mirrored=True))]

    def row(self, piece: Piece, step: tuple[float, float, float], count: int) -> list[Piece]:
        """The piece and copies of it, each one `step` (metres) further."""
        return [self.copy(piece, np.multiply(step, k)) if k else piece for k in range(count)]

    def copy(self, piece: Piece, move=(0.0, 0.0, 0.0), mirrored: bool = False) -> Piece:
        """A copy, moved, or mirrored at the plane x = 0."""
        axes = piece.axes * MIRRORED_AXES if mirrored else piece.axes
        if piece.children:
            children = [self.copy(child, move, mirrored) for child in piece.children]
            return replace(piece, children=children, axes=axes)
        errors = np.clip(self.rng.standard_normal(6), -2, 2) * COPY_ERROR
        center = piece.center * MIRROR_X if mirrored else piece.center
        return replace(
            piece, axes=axes, center=center + move + errors[3:], size=piece.size * (1 + errors[:3])
        )


MIRROR_X = np.array([-1.0, 1.0, 1.0])
# Reflecting all three axes would make them left-handed, so the right axis is turned back.
MIRRORED_AXES = np.array([[1.0, -1.0, -1.0], [-1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]])


def group(label: str, *pieces: Piece) -> Piece:
    """A node with these children."""
    return Piece(label, list(pieces))


def smallest_turn(axis: int, direction: np.ndarray) -> np.ndarray:
    """(3, 3) axes: the upright ones turned so that number `axis` points along the unit `direction`."""
    upright = UPRIGHT[axis]
    cosine = float(direction @ upright)
    if cosine > 1 - 1e-12:
        return UPRIGHT
    x, y, z = np.cross(upright, direction)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return (np.eye(3) + skew + skew @ skew / (1 + cosine)).T  # Rodrigues' formula; rows are the turned axes


def tilt(piece: Piece, angle: float, pivot: tuple[float, float]) -> Piece:
    """Lean a piece and all in it backwards by `angle` (radians) about the horizontal line through pivot (y, z).

    Thin bars that run from side to side keep their upright section: they are mounted so, and move only.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])  # row vectors: v @ turn
    origin = np.array([0.0, *pivot])
    for each in piece.walk():
        if each.center is not None:
            each.center = (each.center - origin) @ turn + origin
        if each.children or not _is_thin_crossbar(each.size):
            each.axes = each.axes @ turn
    return piece


def _is_thin_crossbar(size: np.ndarray) -> bool:
    thick = max(size[1], size[2])
    return bool(thick < 0.06 and size[0] > 3 * thick)


def finish(root: Piece, workshop: Workshop, category: str, name: str) -> PartGraph:
    """The finished part graph: scaled, its root box centred at the origin, its parts numbered."""
    root.fit()
    scale = workshop.between(*DIAGONALS) / float(np.linalg.norm(root.size))
    if workshop.chance(SHUFFLED):
        for piece in root.walk():
            workshop.rng.shuffle(piece.children)
    pieces = list(root.walk())
    for piece in pieces:
        if not piece.children:
            piece.size = np.maximum(piece.size, THINNEST / scale)
    root.fit()
    boxes = Cuboids(
        torch.from_numpy(np.stack([piece.size for piece in pieces]) * scale),
        torch.from_numpy((np.stack([piece.center for piece in pieces]) - root.center) * scale),
        torch.from_numpy(np.stack([piece.axes for piece in pieces])),
    )
    numbers = iter(range(len(pieces)))

    def part(piece: Piece) -> Part:
        number = next(numbers)  # parents first, as in `pieces`
        return Part(piece.label, boxes[number], tuple(part(child) for child in piece.children), number)

    return PartGraph(part(root), category, name)
