"""The primitives: a kind, its sizes, and a pose. One object may hold a whole batch of one kind.

    in space      Box(half)   Sphere(radius)   Cylinder(radius, height)   Cone(slope, height)
    in the plane  Square(half)   Circle(radius)   Triangle(left, right, height)   HalfPlane()

Each also takes translation= and rotation= (see `poses`). A cylinder lies around its z axis, its middle at the
translation; a cone's apex is at the translation and it opens to +z, slope = radius / height. Without a height both go
on for ever, as the paper's do. Sizes count without their sign (`distances` has the formulas).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Float
from torch import Tensor

from . import distances as formulas
from .errors import ProgramError
from .given import Numbers, as_field, as_numbers, model, shared_batch
from .poses import ANGLES, matrices, unturned

POSE = ("translation", "rotation")


@dataclass(frozen=True, eq=False)
class Primitive:
    """What all kinds share. Every field is a tensor: (*n) or, for `half` and the pose, (*n, numbers).

    Leading dimensions *n make a batch; a field without them is shared by all. All have the type and the device of the
    first floating tensor given; without one they are float64. Raises ProgramError for other numbers, for batches that
    do not broadcast, and for a size left out, unless it is a height in space.
    """

    name: ClassVar[str] = ""  # as written in a program
    dimensions: ClassVar[int] = 3
    counts: ClassVar[dict[str, int]] = {}  # numbers of each size; 1: a scalar

    def __post_init__(self):
        given, batches = {}, {}
        for key, width in self.widths.items():
            if (value := getattr(self, key)) is not None:
                what = f"{key} of a {self.name}"
                given[key], batches[key] = as_field(what, value, width, key == "rotation", batches)
            elif not is_optional(type(self), key):
                raise ProgramError(f"a {self.name} has no {key}", expected="numbers")
        batch = shared_batch(self.name, batches)
        like = model([getattr(self, key) for key in given])
        for key, numbers in zip(POSE, ([0.0] * self.dimensions, unturned(self.dimensions))):
            if key not in given:
                given[key], batches[key] = like.new_tensor(numbers), ()
        for key, value in given.items():
            if batches[key] != batch:
                value = value.expand(*batch, *value.shape[len(batches[key]) :])
            object.__setattr__(self, key, value.to(like))

    @property
    def widths(self) -> dict[str, int]:
        """Numbers of each field, as written: sizes, translation, rotation."""
        return {**self.counts, "translation": self.dimensions, "rotation": ANGLES[self.dimensions]}

    @property
    def written(self) -> list[str]:
        """Names of the fields that have numbers (no height: none), in text order."""
        return [key for key in self.widths if getattr(self, key) is not None]

    @property
    def form(self) -> tuple:
        """Primitives of equal form can be stacked into one batch."""
        return type(self), len(self.written)

    @property
    def sizes(self) -> Float[Tensor, "*n s"]:
        """The sizes side by side."""
        sizes = [self._wide(key) for key in self.written if key not in POSE]
        return torch.cat(sizes, -1) if sizes else self.translation[..., :0]

    @property
    def numbers(self) -> Float[Tensor, "*n k"]:
        """All numbers in text order: sizes, translation, rotation."""
        return torch.cat([self._wide(key) for key in self.written], -1)

    def _wide(self, key: str) -> Float[Tensor, "*n k"]:
        value = getattr(self, key)
        return value.unsqueeze(-1) if self.widths[key] == 1 and key != "rotation" else value

    def with_numbers(self, numbers: Float[Tensor, "*n k"]) -> "Primitive":
        """The same kind with other numbers, in text order. Raises ProgramError for too few or too many."""
        return self._cut(numbers, {key: self.widths[key] for key in self.written})

    @classmethod
    def from_paper(cls, numbers: Float[Tensor, "*n k"]) -> "Primitive":
        """From the order of the paper's program: rotation, translation, sizes; without a height, that is None.

        Raises ProgramError for too few or too many.
        """
        widths = {"rotation": ANGLES[cls.dimensions], "translation": cls.dimensions, **cls.counts}
        numbers = as_numbers(numbers)
        if is_optional(cls, "height") and numbers.shape[-1:] == (sum(widths.values()) - 1,):
            widths.pop("height", None)
        return cls._cut(numbers, widths)

    @classmethod
    def _cut(cls, numbers: Float[Tensor, "*n k"], widths: dict[str, int]) -> "Primitive":
        """From fields of these widths side by side."""
        numbers, count = as_numbers(numbers), sum(widths.values())
        if numbers.shape[-1:] != (count,):
            found = f"numbers of shape {tuple(numbers.shape)} for a {cls.name}"
            raise ProgramError(found, expected=f"{count}: {', '.join(widths)}")
        parts = dict(zip(widths, numbers.split(list(widths.values()), -1)))
        return cls(**{key: p.squeeze(-1) if cls.counts.get(key) == 1 else p for key, p in parts.items()})

    def to(self, *args) -> "Primitive":
        """The same with another dtype or on another device, as `Tensor.to`."""
        return type(self)(**{key: getattr(self, key).to(*args) for key in self.written})

    def __getitem__(self, rows) -> "Primitive":
        """Some of a batch."""
        return type(self)(**{key: getattr(self, key)[rows] for key in self.written})

    def local(self, points: Float[Tensor, "*#n m d"]) -> Float[Tensor, "*n m d"]:
        """World points in the primitive's own coordinates."""
        # In memory all x come before all y: long rows make the formulas' sums and maxima five times faster.
        moved = points.to(self.translation).mT - self.translation.unsqueeze(-1)
        return (matrices(self.rotation) @ moved).mT

    def distance(self, points: Float[Tensor, "*#n m d"]) -> Float[Tensor, "*n m"]:
        """Signed distance of m points to each primitive: negative inside. Differentiable."""
        return self._formula()(self.local(points), self.sizes)

    def _formula(self) -> Callable[[Tensor, Tensor], Tensor]:
        endless = "height" in self.counts and self.height is None
        return (formulas.ENDLESS if endless else formulas.WHOLE)[self.name]

    def __eq__(self, other) -> bool:
        """The same kind with the same numbers."""
        if not isinstance(other, Primitive) or self.form != other.form:
            return False
        return self.translation.shape == other.translation.shape and bool(
            (self.numbers.double() == other.numbers.double()).all()
        )

    def __hash__(self) -> int:
        return hash((self.form, tuple(self.numbers.flatten().tolist())))


@dataclass(frozen=True, eq=False)
class Box(Primitive):
    """A box with its center at the translation; half: half of its sides along x, y, z."""

    half: Numbers
    translation: Numbers = None
    rotation: Numbers = None
    name = "box"
    counts = {"half": 3}


@dataclass(frozen=True, eq=False)
class Sphere(Primitive):
    """A ball around the translation. Its rotation has no effect, and is there because the paper's has one."""

    radius: Numbers
    translation: Numbers = None
    rotation: Numbers = None
    name = "sphere"
    counts = {"radius": 1}


@dataclass(frozen=True, eq=False)
class Cylinder(Primitive):
    """Around its z axis; with a height from z = -height/2 to height/2, else for ever."""

    radius: Numbers
    height: Numbers = None
    translation: Numbers = None
    rotation: Numbers = None
    name = "cylinder"
    counts = {"radius": 1, "height": 1}


@dataclass(frozen=True, eq=False)
class Cone(Primitive):
    """Its apex at the translation, opening to +z; slope: radius over height; with a height it ends there."""

    slope: Numbers
    height: Numbers = None
    translation: Numbers = None
    rotation: Numbers = None
    name = "cone"
    counts = {"slope": 1, "height": 1}


@dataclass(frozen=True, eq=False)
class Square(Primitive):
    """A square, or a rectangle; half: half of its sides along x and y."""

    half: Numbers
    translation: Numbers = None
    rotation: Numbers = None
    name = "square"
    dimensions = 2
    counts = {"half": 2}


@dataclass(frozen=True, eq=False)
class Circle(Primitive):
    """A disc around the translation. Its rotation has no effect."""

    radius: Numbers
    translation: Numbers = None
    rotation: Numbers = None
    name = "circle"
    dimensions = 2
    counts = {"radius": 1}


@dataclass(frozen=True, eq=False)
class Triangle(Primitive):
    """Base from (-left, 0) to (right, 0), apex at (0, height)."""

    left: Numbers
    right: Numbers
    height: Numbers
    translation: Numbers = None
    rotation: Numbers = None
    name = "triangle"
    dimensions = 2
    counts = {"left": 1, "right": 1, "height": 1}


@dataclass(frozen=True, eq=False)
class HalfPlane(Primitive):
    """What lies below its own line y = 0."""

    translation: Numbers = None
    rotation: Numbers = None
    name = "halfplane"
    dimensions = 2


KINDS = {kind.name: kind for kind in (Box, Sphere, Cylinder, Cone, Square, Circle, Triangle, HalfPlane)}


def is_optional(kind: type[Primitive], key: str) -> bool:
    """May this field be left out?"""
    return key in POSE or (key == "height" and kind.dimensions == 3)


def stack(primitives: Sequence[Primitive]) -> Primitive:
    """One batch (n) of single primitives of equal form."""
    first = primitives[0]
    return type(first)(**{key: torch.stack([getattr(p, key) for p in primitives]) for key in first.written})


class Batches:
    """Single primitives, those of equal form stacked once and for all: for many calls with a few points each."""

    def __init__(self, primitives: Sequence[Primitive]):
        places: dict[tuple, list[int]] = {}
        for place, primitive in enumerate(primitives):
            places.setdefault(primitive.form, []).append(place)
        self.stacked = [stack([primitives[i] for i in group]) for group in places.values()]
        order = [i for group in places.values() for i in group]
        self._order = torch.tensor(order, device=primitives[0].translation.device).argsort()
        self._sorted = order == sorted(order)

    def distances(self, points: Float[Tensor, "m d"]) -> Float[Tensor, "k m"]:
        """Signed distances of all points to each primitive, in the order in which they were given."""
        rows = torch.cat([batch.distance(points) for batch in self.stacked])
        return rows if self._sorted else rows[self._order]


def distances(primitives: Sequence[Primitive], points: Float[Tensor, "m d"]) -> Float[Tensor, "k m"]:
    """Signed distances of all points to each single primitive, in order; kinds are computed batch by batch."""
    return Batches(primitives).distances(points)
