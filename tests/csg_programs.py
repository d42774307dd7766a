"""Random CSG programs, and a second way to execute them: pixel by pixel, with a stack of numpy arrays."""

from functools import cache

import numpy as np
import torch

from lib.interpreters.csg import KINDS, Operation, Primitive, Program, Vocabulary, vocabulary_of

SIDE = 64
OFF = {2: np.zeros((SIDE, SIDE), bool), 3: np.zeros((SIDE, SIDE, SIDE), bool)}


def random_tokens(
    rng: np.random.Generator, count: int, length: int, vocabulary: Vocabulary, end: int | None = None
) -> torch.Tensor:
    """(count, end or length): valid programs of `length` tokens; wherever both may come next, a coin decides between
    primitive and operation."""
    primitives = len(vocabulary) - 4
    tokens = np.full((count, end or length), vocabulary.stop)
    depth = np.zeros(count, int)
    for place in range(length):
        after = length - place - 1  # tokens still to come: each can take away one shape
        draw = (depth <= after) & ((depth < 2) | (rng.random(count) < 0.5))
        operation = primitives + rng.integers(3, size=count)
        tokens[:, place] = np.where(draw, rng.integers(primitives, size=count), operation)
        depth += np.where(draw, 1, -1)
    return torch.from_numpy(tokens)


def random_mixture(
    rng: np.random.Generator, lengths: tuple[int, ...], each: int, vocabulary: Vocabulary
) -> torch.Tensor:
    """Equally many programs of every length, in any order, padded with `$`."""
    tokens = torch.cat([random_tokens(rng, each, n, vocabulary, end=max(lengths)) for n in lengths])
    return tokens[torch.from_numpy(rng.permutation(len(tokens)))]


def random_primitive(rng: np.random.Generator, dimensions: int) -> Primitive:
    """Any numbers that are allowed, not only those of the networks' vocabulary."""
    kinds = [kind for kind in KINDS.values() if kind.dimensions == dimensions]
    kind = kinds[rng.integers(len(kinds))]
    numbers = (rng.integers(0, 64) if field in "xyz" else rng.integers(1, 65) for field in kind.fields)
    return Primitive(kind.letters, tuple(map(int, numbers)))


def random_program(rng: np.random.Generator, dimensions: int, length: int) -> Program:
    """A program with any primitives."""
    tokens = random_tokens(rng, 1, length, vocabulary_of(dimensions))[0]
    symbols = vocabulary_of(dimensions).texts
    return Program(
        tuple(
            Operation(symbols[token]) if symbols[token] in "+*-" else random_primitive(rng, dimensions)
            for token in tokens
        )
    )


def chain(length: int, side: str, primitive: str = "c(32,32,16)", operations: str = "+*-") -> str:
    """The text of a program as deeply nested as its length allows, in its left or in its right operands."""
    count = length // 2
    symbols = [operations[k % len(operations)] for k in range(count)]
    if side == "left":
        return primitive + "".join(primitive + symbol for symbol in symbols)
    return primitive * (count + 1) + "".join(symbols)


@cache
def mask(primitive: Primitive) -> np.ndarray:
    """The pixels [row y, column x] or voxels [x, y, z] of a primitive, each asked whether it is inside."""
    numbers = dict(zip(KINDS[primitive.kind].fields, primitive.numbers))
    if primitive.dimensions == 2:
        row, column = np.indices((SIDE, SIDE))
        return _plane(primitive.kind, column, row, **numbers)
    offsets = np.indices((SIDE, SIDE, SIDE)) - np.reshape(primitive.numbers[:3], (3, 1, 1, 1))
    dx, dy, dz = offsets
    if primitive.kind == "sp":
        return dx**2 + dy**2 + dz**2 <= (numbers["r"] - 1) ** 2
    if primitive.kind == "cu":
        return (abs(offsets) <= (numbers["s"] - 1) // 2).all(0)
    return (dx**2 + dy**2 <= (numbers["r"] - 1) ** 2) & (abs(dz) <= (numbers["h"] - 1) // 2)


def _plane(kind: str, column: np.ndarray, row: np.ndarray, x: int, y: int, r: int) -> np.ndarray:
    if kind == "c":
        return (column - x) ** 2 + (row - y) ** 2 < r**2
    if kind == "s":
        half = 1.412 * r / 2
        across = (int(x - half) <= column) & (column <= int(x + half))
        return across & (int(y - half) <= row) & (row <= int(y + half))
    side = 1.732 * r
    apex, base = int(y - side / 1.732), int(y + side / (2 * 1.732))
    left, right = int(x - side / 2), int(x + side / 2)
    # The edges go from (x, apex) to (left, base) and from (right, base) to (x, apex); halves are rounded up on the way.
    from_apex, from_base = (row - apex) / (base - apex), (base - row) / (base - apex)
    first, last = x - np.floor((x - left) * from_apex + 0.5), right - np.floor((right - x) * from_base + 0.5)
    return (apex <= row) & (row <= base) & (first <= column) & (column <= last)


def by_stack(tokens: list[int], vocabulary: Vocabulary) -> tuple[np.ndarray, bool]:
    """(pixels, valid) of the program that tokens spell: the language's definition, word for word."""
    stack = []
    for token in tokens:
        word = vocabulary.texts[token]
        if word == "$":
            break
        if word not in "+*-":
            stack.append(mask(vocabulary.primitives[token]))
            continue
        if len(stack) < 2:
            return OFF[vocabulary.dimensions], False
        b, a = stack.pop(), stack.pop()
        stack.append({"+": a | b, "*": a & b, "-": a & ~b}[word])
    if len(stack) != 1:
        return OFF[vocabulary.dimensions], False
    return stack[0], True


def pixels_of(program: Program) -> np.ndarray:
    """The pixels of a program with any primitives."""
    vocabulary = Vocabulary(dict.fromkeys(program.primitives))
    pixels, valid = by_stack(program.tokens(vocabulary).tolist(), vocabulary)
    assert valid
    return pixels
