"""Random valid programs: all five statements, up to three levels. For tests and demonstrations, not for realism."""

from collections import deque
from collections.abc import Iterator

import numpy as np

from .executing import execute
from .program import AXES, BBOX, Attach, Block, Cuboid, Program, Reflect, Squeeze, Statement, Translate

DEEPEST = 3  # levels of blocks
_ROOM = 1.5  # how far, in units of the root box, a sampled shape may reach
_BULKY = 0.15  # a cuboid is filled by a block only if every side is at least this share of its bbox's


def sample(rng: np.random.Generator) -> Program:
    """A random program: grounded, executable, and not reaching far out of its root box."""
    while True:
        program = _draw(rng)
        low, high = execute(program).bounds().tolist()
        half = [side / 2 * _ROOM for side in program.blocks[0].statements[0].numbers]
        if all(-h <= a and b <= h for a, b, h in zip(low, high, half)):
            return program


def _draw(rng: np.random.Generator) -> Program:
    waiting = deque([("Program_0", tuple(_rounded(rng.uniform(0.5, 2.0, 3))), 1)])
    names = (f"Program_{number}" for number in range(1, 10_000))
    blocks = []
    while waiting:
        name, size, level = waiting.popleft()
        block, filled = _block(rng, name, size, names if level < DEEPEST else iter(()))
        blocks.append(block)
        waiting.extend((cuboid.name, cuboid.numbers, level + 1) for cuboid in filled)
    return Program(tuple(blocks))


def _block(
    rng: np.random.Generator, name: str, size: tuple, names: Iterator[str]
) -> tuple[Block, list[Cuboid]]:
    """A block of a given size, and those of its cuboids that other blocks must fill."""
    cuboids, filled = [], []
    for number in range(rng.integers(1, 5)):
        share = rng.uniform(0.06, 0.55, 3)
        fill = next(names, None) if share.min() > _BULKY and rng.random() < 0.5 else None
        dims = tuple(max(0.01, n) for n in _rounded(share * size))
        cuboids.append(Cuboid(fill or f"cube{number}", dims, bool(rng.random() < 0.75)))
        if fill:
            filled.append(cuboids[-1])
    grounded, building = [BBOX], []
    for cuboid in cuboids:
        building += _connections(rng, cuboid, grounded)
        grounded.append(cuboid.name)
    copying = [copy for cuboid in cuboids if rng.random() < 0.4 for copy in [_copy(rng, cuboid.name)]]
    return Block(name, (Cuboid(BBOX, size, True), *cuboids, *building, *copying)), filled


def _connections(rng: np.random.Generator, cuboid: Cuboid, grounded: list[str]) -> list[Statement]:
    """One squeeze, or one or two attaches, between a new cuboid and those that stand already."""
    first, second = rng.choice(grounded, 2)
    if rng.random() < 0.35:
        face = str(
            rng.choice(["top", "bot", "left", "right", "front", "back"], p=[0.5, 0.2, 0.1, 0.1, 0.05, 0.05])
        )
        return [Squeeze(cuboid.name, str(first), str(second), face, _numbers(rng, 2, 0.1, 0.9))]
    start, end = (0.5, 0.0, 0.5), (0.5, 1.0, 0.5)
    base = 0.0 if first == BBOX else 1.0
    attaches = [Attach(cuboid.name, str(first), (*start, *_over(rng, base)))]
    if second != first and rng.random() < 0.5:
        attaches.append(Attach(cuboid.name, str(second), (*end, *_over(rng, float(second == BBOX)))))
    return attaches


def _copy(rng: np.random.Generator, source: str) -> Statement:
    axis = str(rng.choice(AXES))
    if rng.random() < 0.6:
        return Reflect(source, axis)
    return Translate(source, axis, int(rng.integers(1, 4)), _numbers(rng, 1, 0.1, 0.5))


def _over(rng: np.random.Generator, height: float) -> tuple[float, float, float]:
    x, z = _numbers(rng, 2, 0.1, 0.9)
    return (x, height, z)


def _numbers(rng: np.random.Generator, count: int, low: float, high: float) -> tuple[float, ...]:
    return tuple(_rounded(rng.uniform(low, high, count)))


def _rounded(numbers: np.ndarray) -> list[float]:
    return np.round(numbers, 3).tolist()
