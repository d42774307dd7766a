"""Drawings to begin with: silhouettes of things that circles, squares and triangles can be fitted to."""

from functools import cache

import numpy as np
from jaxtyping import Bool

SIDE = 64

# What is drawn, one after another: boxes (left, top, right, bottom), discs (x, y, radius), triangles (x of the apex,
# top, half of the base, bottom); with "-" before it, what is erased. Pixels: the right and the lower end count not.
_STROKES = {
    "chair": "box 15 6 21 60, box 15 32 49 39, box 43 39 49 60",
    "table": "box 6 16 58 23, box 10 23 16 56, box 48 23 54 56",
    "house": "triangle 32 5 27 30, box 11 30 53 58, -box 27 40 37 58",
    "lamp": "triangle 32 4 20 30, box 30 30 34 52, box 19 52 45 58",
    "mug": "disc 44 34 14, -disc 44 34 8, box 10 14 44 56",
    "moon": "disc 30 32 26, -disc 42 28 22",
}


@cache
def example_drawings() -> dict[str, Bool[np.ndarray, "64 64"]]:
    """image[y, x] of each, by name. Shared: do not change them."""
    return {name: _drawn(strokes) for name, strokes in _STROKES.items()}


def _drawn(strokes: str) -> Bool[np.ndarray, "64 64"]:
    image = np.zeros((SIDE, SIDE), dtype=bool)
    for stroke in strokes.split(", "):
        word, *numbers = stroke.split()
        inside = _FORMS[word.removeprefix("-")](*map(int, numbers))
        image = image & ~inside if word.startswith("-") else image | inside
    return image


_Y, _X = np.mgrid[:SIDE, :SIDE] + 0.5  # the centers of the pixels


def _box(left: int, top: int, right: int, bottom: int):
    return (left < _X) & (_X < right) & (top < _Y) & (_Y < bottom)


def _disc(x: int, y: int, radius: int):
    return (_X - x) ** 2 + (_Y - y) ** 2 < radius**2


def _triangle(x: int, top: int, half: int, bottom: int):
    return (top < _Y) & (_Y < bottom) & (abs(_X - x) * (bottom - top) < half * (_Y - top))


_FORMS = {"box": _box, "disc": _disc, "triangle": _triangle}
