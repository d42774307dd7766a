"""Directions that are nearly parallel or at right angles are made so, where the points do not mind.

The surface with the most points keeps its direction; each later one is turned, about the middle of its points, to be
parallel to one that is known already, or else at right angles to it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from .surfaces import Surface

NEARLY = np.sin(np.radians(6))
WORSE = 1.2  # times the distance that points had before


def aligned(surfaces: Sequence[Surface], points: Float[np.ndarray, "n 3"], tolerance: float) -> list[Surface]:
    """The same surfaces, some of them turned by a few degrees."""
    known: list[np.ndarray] = []
    made = []
    for surface in surfaces:
        if surface.kind != "sphere":
            surface = _turned(surface, known, points, tolerance)
            if not any(abs(surface.axis @ axis) > 1 - 1e-9 for axis in known):
                known.append(surface.axis)
        made.append(surface)
    return made


def _turned(surface: Surface, known: list[np.ndarray], points: np.ndarray, tolerance: float) -> Surface:
    """Along the first known axis that suits it, else across the first one, or two, that do."""
    axis = surface.axis
    for other in known:
        if np.linalg.norm(np.cross(axis, other)) < NEARLY:
            turned = _about_middle(surface, other * np.sign(axis @ other), points)
            if _suits(turned, surface, points, tolerance):
                return turned
    for other in known:
        if 1e-9 < abs(surface.axis @ other) < NEARLY:
            across = surface.axis - (surface.axis @ other) * other
            turned = _about_middle(surface, across / np.linalg.norm(across), points)
            if _suits(turned, surface, points, tolerance):
                surface = turned
    return surface


def _about_middle(surface: Surface, axis: np.ndarray, points: np.ndarray) -> Surface:
    """With another axis; the turn that leads there moves what is away from the middle of the points."""
    middle = points[surface.members].mean(0)
    turn = _turn(surface.axis, axis)
    return replace(
        surface,
        numbers=np.concatenate([axis, middle + turn @ (surface.place - middle), surface.numbers[6:]]),
    )


def _turn(one: np.ndarray, other: np.ndarray) -> Float[np.ndarray, "3 3"]:
    """The shortest turn of one unit vector into another, not its opposite (Rodrigues)."""
    x, y, z = np.cross(one, other)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + cross + cross @ cross / (1 + one @ other)


def _suits(turned: Surface, before: Surface, points: np.ndarray, tolerance: float) -> bool:
    own = points[before.members]
    return _off(turned, own) <= WORSE * _off(before, own) + 0.01 * tolerance


def _off(surface: Surface, points: np.ndarray) -> float:
    return float(np.sqrt((surface.distance(points) ** 2).mean()))
