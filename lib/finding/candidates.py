"""Surfaces into solids: what bounds a piece becomes boxes, cylinders, cones and spheres.

Planes of a piece are paired: two that face each other are a slab, up to three slabs at right angles are a box. A side
that no plane closes is closed beyond the cloud's bounds. Cylinders and cones end at the planes across their axes, or go
on for ever if there is none. Solids that several pieces share are one candidate.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Float

from lib.interpreters.stump import Box, Cone, Cylinder, Primitive, Sphere
from lib.interpreters.stump.poses import quaternion

from .pieces import Piece
from .surfaces import Surface

RIGHT = np.sin(np.radians(8))  # directions so near to parallel, or to a right angle, are taken for that
BEYOND = 0.1  # share: how far behind the bounds an open side is closed

Literal = tuple[int, bool]  # which surface, on its inside


def candidates(
    surfaces: Sequence[Surface], pieces: Sequence[Piece], bounds: Float[np.ndarray, "2 3"]
) -> list[Primitive]:
    """The solids of all pieces. One that is used both ways, its inside here and its outside there, comes twice."""
    found: dict[tuple, Primitive] = {}
    for piece in pieces:
        builder = _Builder(surfaces, piece, bounds)
        builder.build()
        found |= builder.made
    return list(found.values())


def separate(surfaces: Sequence[Surface], bounds: Float[np.ndarray, "2 3"]) -> list[Primitive]:
    """Each surface by itself, its inside and its outside: half-spaces, as boxes, and what goes on for ever. Whatever
    the surfaces can bound is made of these; which of them belong together is left to the matrices."""
    pieces = [frozenset([(place, inside)]) for place in range(len(surfaces)) for inside in (True, False)]
    return candidates(surfaces, pieces, bounds)


@dataclass(frozen=True, eq=False)
class _Half:
    """A half-space: what lies behind a plane, seen along its normal."""

    literal: Literal
    normal: np.ndarray
    place: np.ndarray


@dataclass
class _Builder:
    """The solids of one piece, each by the literals that it is made of."""

    surfaces: Sequence[Surface]
    piece: Piece
    bounds: np.ndarray
    made: dict[tuple, Primitive] = field(default_factory=dict)

    def build(self) -> None:
        halves = [self._half(literal) for literal in sorted(self.piece) if self._kind(literal) == "plane"]
        for literal in sorted(self.piece):
            if self._kind(literal) != "plane":
                halves = self._round(literal, halves)
        while halves:
            halves = self._box(halves)

    def _kind(self, literal: Literal) -> str:
        return self.surfaces[literal[0]].kind

    def _half(self, literal: Literal) -> _Half:
        plane = self.surfaces[literal[0]]
        return _Half(literal, plane.axis if literal[1] else -plane.axis, plane.place)

    def _round(self, literal: Literal, halves: list[_Half]) -> list[_Half]:
        """A sphere, cylinder or cone; what is left of the half-spaces."""
        surface, inside = self.surfaces[literal[0]], literal[1]
        if surface.kind == "sphere":
            self._make([literal], Sphere(surface.size, surface.place.tolist()))
            return halves
        caps = _facing(halves, surface.axis) if inside else (None, None)
        if surface.kind == "cone":
            caps = (None, caps[1])  # beyond the apex there is nothing to end
        ending = [half for half in caps if half]
        self._make([literal, *[half.literal for half in ending]], self._rod(surface, caps))
        return [half for half in halves if half not in ending]

    def _rod(self, surface: Surface, caps: tuple[_Half | None, _Half | None]) -> Primitive:
        axis, place = surface.axis, surface.place
        turn = quaternion(torch.from_numpy(_frame([axis])[[1, 2, 0]]))
        low, high = (None if half is None else float((half.place - place) @ axis) for half in caps)
        if surface.kind == "cone":
            slope = float(np.tan(surface.size))
            return Cone(slope, high, place.tolist(), turn)
        if low is None and high is None:
            return Cylinder(surface.size, None, place.tolist(), turn)
        reach = (_corners(self.bounds) - place) @ axis
        margin = BEYOND * np.linalg.norm(np.ptp(self.bounds, axis=0))
        low = float(reach.min() - margin) if low is None else low
        high = float(reach.max() + margin) if high is None else high
        return Cylinder(surface.size, high - low, (place + (low + high) / 2 * axis).tolist(), turn)

    def _box(self, halves: list[_Half]) -> list[_Half]:
        """The box of the first half-space and those that go with it; the others."""
        axes = [halves[0].normal]
        for half in halves[1:]:
            if len(axes) < 3 and all(abs(half.normal @ axis) < RIGHT for axis in axes):
                axes.append(half.normal)
        frame = _frame(axes)
        sides = [_facing(halves, axis) for axis in frame]
        used = [half for pair in sides for half in pair if half]
        self._make([half.literal for half in used], self._cuboid(frame, sides))
        return [half for half in halves if half not in used]

    def _cuboid(self, frame: np.ndarray, sides: list[tuple]) -> Box:
        corners = _corners(self.bounds) @ frame.T
        margin = BEYOND * np.linalg.norm(np.ptp(self.bounds, axis=0))
        low, high = corners.min(0) - margin, corners.max(0) + margin
        for i, (below, above) in enumerate(sides):
            low[i] = frame[i] @ below.place if below else low[i]
            high[i] = frame[i] @ above.place if above else high[i]
        middle = (low + high) / 2 @ frame
        return Box(((high - low) / 2).tolist(), middle.tolist(), quaternion(torch.from_numpy(frame)))

    def _make(self, literals: list[Literal], primitive: Primitive) -> None:
        self.made[tuple(sorted(literals))] = primitive


def _facing(halves: Sequence[_Half], axis: np.ndarray) -> tuple[_Half | None, _Half | None]:
    """The first half-space against the axis, and the first along it."""
    along = [half for half in halves if np.linalg.norm(np.cross(half.normal, axis)) < RIGHT]
    below = next((half for half in along if half.normal @ axis < 0), None)
    return below, next((half for half in along if half.normal @ axis > 0), None)


def _frame(axes: Sequence[np.ndarray]) -> Float[np.ndarray, "3 3"]:
    """Rows: a right-handed frame, its first axis the first of these, the others as near to the rest as can be."""
    rows: list[np.ndarray] = []
    for axis in (*axes, *np.eye(3)[np.argsort(np.abs(axes[0]))]):
        axis = axis - sum((axis @ row) * row for row in rows)
        if len(rows) < 3 and np.linalg.norm(axis) > 0.1:
            rows.append(axis / np.linalg.norm(axis))
    if np.linalg.det(rows) < 0:
        rows[2] = -rows[2]
    return np.array(rows)


def _corners(bounds: Float[np.ndarray, "2 3"]) -> Float[np.ndarray, "8 3"]:
    return np.array(np.meshgrid(*bounds.T, indexing="ij")).reshape(3, 8).T
