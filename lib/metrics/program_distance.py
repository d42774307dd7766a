"""How many edits turn one program into another: the distance by which Figure 7 finds a program's nearest neighbour.

The ShapeAssembly paper calls it the string edit distance of a tokenized version of a hierarchical program, and says no
more. Here a token is a word of the program that is no continuous parameter:

    Cuboid     "Cuboid", then "aligned" or "free"; if a block fills it, "{", that block's tokens, "}"
    attach     "attach", moved, still                 squeeze   "squeeze", moved, first, second, face
    reflect    "reflect", source, axis                translate "translate", source, axis, count

A cuboid is called by its place in its block ("cube0" is the first after bbox), whatever its name, so names do not
count. A block's bbox line says nothing but numbers and has no token. Continuous parameters (sizes, points, u, v,
distance) are left out: a network never writes the same one twice, so each would be an edit, however small the change,
and they would drown the structure; the paper's steps of 1 to 3 edits between programs whose sizes all change a
little (Table 6) leave no room for them. So the distance is 0 exactly if two programs have the same structure.

The distance is Levenshtein's: the least number of tokens inserted, deleted or replaced.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Int
from rapidfuzz.distance import Levenshtein
from rapidfuzz.process import cdist
from torch import Tensor

from ..interpreters.shapeassembly import Attach, Block, Cuboid, Program, Reflect, Squeeze, Translate

BBOX = "bbox"
WORKERS = 2  # threads


@dataclass(frozen=True)
class NearestProgram:
    """For each query: which of the others is nearest (the first of several equally near), and how many edits away."""

    index: Int[Tensor, " queries"]
    distance: Int[Tensor, " queries"]


def tokens(program: Program) -> tuple[str, ...]:
    """The words of a program without its continuous parameters and names, outer blocks around inner ones."""
    blocks = {block.name: block for block in program.blocks}
    return tuple(_words(program.blocks[0], blocks, inside=True))


def block_tokens(program: Program) -> list[tuple[str, ...]]:
    """The words of each block by itself, in text order; a cuboid that a block fills is marked, what fills it is not."""
    blocks = {block.name: block for block in program.blocks}
    return [tuple(_words(block, blocks, inside=False)) for block in program.blocks]


def program_distance(a: Program, b: Program) -> int:
    """Number of tokens to insert, delete or replace to make one program of the other."""
    return Levenshtein.distance(tokens(a), tokens(b))


def program_distances(
    queries: Sequence[Program], others: Sequence[Program], workers: int = WORKERS
) -> Int[Tensor, "queries others"]:
    """`program_distance` of every pair; `workers` threads share the work."""
    one, other = _as_strings(queries, others)
    distances = cdist(one, other, scorer=Levenshtein.distance, dtype=np.int32, workers=workers)
    return torch.from_numpy(distances).long()


def nearest_programs(
    queries: Sequence[Program], others: Sequence[Program] | None = None, workers: int = WORKERS
) -> NearestProgram:
    """For each query the nearest of `others`, or without these the nearest other query.

    Raises ValueError where there is no other program to be nearest.
    """
    found = program_distances(queries, queries if others is None else others, workers)
    if found.shape[1] < 1 + (others is None):
        raise ValueError(f"found {found.shape[1]} programs; expected another one that can be the nearest")
    if others is None:
        found.fill_diagonal_(torch.iinfo(found.dtype).max)
    distance, index = (
        found.numpy().min(1),
        found.numpy().argmin(1),
    )  # torch does not promise the first of equals
    return NearestProgram(torch.from_numpy(index), torch.from_numpy(distance))


def _words(block: Block, blocks: dict[str, Block], inside: bool) -> Iterator[str]:
    """Tokens of a block; `inside` says whether to write out the blocks that fill its cuboids."""
    cuboids = [s.name for s in block.statements if isinstance(s, Cuboid) and s.name != BBOX]
    place = {BBOX: BBOX} | {name: f"cube{number}" for number, name in enumerate(cuboids)}
    for statement in block.statements:
        if not isinstance(statement, Cuboid):
            yield from _call(statement, place)
        elif statement.name != BBOX:
            yield from ("Cuboid", "aligned" if statement.aligned else "free")
            if statement.name in blocks:
                yield "{"
                if inside:
                    yield from _words(blocks[statement.name], blocks, inside)
                yield "}"


def _call(statement: Attach | Squeeze | Reflect | Translate, place: dict[str, str]) -> tuple[str, ...]:
    """The command, the cuboids it speaks of by their places, and its other words."""
    match statement:
        case Attach(moved, still):
            return "attach", place[moved], place[still]
        case Squeeze(moved, first, second, face):
            return "squeeze", place[moved], place[first], place[second], face
        case Reflect(source, axis):
            return "reflect", place[source], axis
        case Translate(source, axis, count):
            return "translate", place[source], axis, str(count)


def _as_strings(*sets: Sequence[Program]) -> list[list[str]]:
    """Programs as strings with one letter a token, the same letters in all sets: what RapidFuzz compares fastest."""
    letters: dict[str, str] = {}
    return [
        [
            "".join(letters.setdefault(token, chr(len(letters))) for token in tokens(program))
            for program in programs
        ]
        for programs in sets
    ]
