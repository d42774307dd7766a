"""Many programs as one table of lines, and batches of it by level of the hierarchy.

A *node* is one block of one program: the root block, or a block that fills a cuboid. Level 0 has the roots, level 1 the
blocks inside them, and so on. All nodes of a level are read, and written, side by side: sorted by length and stored
step by step (what torch calls a packed sequence), so that step t of every node that is still running is one matrix.

    node a   start a1 a2 a3 end        step 0: start start | 1: a1 b1 | 2: a2 b2 | 3: a3 end | 4: end
    node b   start b1 b2 end
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ..interpreters.shapeassembly import Block, Cuboid, Program
from ..interpreters.shapeassembly.program import BBOX
from .program_lines import COMMAND, FIELD, WIDTH, block_lines, statement_of

ROOT = "Program_0"


@dataclass(frozen=True)
class ProgramTable:
    """The lines of many programs, block by block, blocks breadth-first, programs in order.

    lines    (lines, 63) float32, without start and end
    first    (nodes + 1,) the first line of each node, then the number of lines
    parent   (nodes,) the Cuboid line that the node fills, -1 for a root
    program  (nodes,) which program the node belongs to
    level    (nodes,) 0 for a root
    """

    lines: np.ndarray
    first: np.ndarray
    parent: np.ndarray
    program: np.ndarray
    level: np.ndarray

    def __len__(self) -> int:
        """Number of programs."""
        return int(self.program[-1]) + 1 if len(self.program) else 0

    @classmethod
    def of(cls, programs: Sequence[Program]) -> "ProgramTable":
        """The table of `programs`. Raises ProgramError for a block with more than ten cuboids and a bbox."""
        lines, first, parent, program, level = [], [0], [], [], []
        for number, each in enumerate(programs):
            blocks = {block.name: block for block in each.blocks}
            waiting = [(each.blocks[0], -1, 0)]
            for block, at, depth in waiting:  # grows while it is walked: breadth-first
                for offset, statement in enumerate(block.statements):
                    if isinstance(statement, Cuboid) and statement.name in blocks:
                        waiting.append((blocks[statement.name], len(lines) + offset, depth + 1))
                lines += block_lines(block)
                first.append(len(lines))
                parent.append(at)
                program.append(number)
                level.append(depth)
        return cls(
            np.array(lines, dtype=np.float32).reshape(-1, WIDTH),
            *(np.array(column, dtype=np.int64) for column in (first, parent, program, level)),
        )

    def programs(self) -> list[Program]:
        """The programs again, checked; cuboids are named cube0, cube1, …, blocks Program_0, Program_1, …"""
        return [Program(blocks) for blocks in self.blocks()]

    def blocks(self) -> list[tuple[Block, ...]]:
        """The blocks of each program, unchecked: what a network wrote need not make sense."""
        found: list[list[Block]] = [[] for _ in range(len(self))]
        name_of: dict[int, str] = {-1: ROOT}  # Cuboid line that is filled -> the name of what fills it
        count = np.zeros(len(self), dtype=np.int64)
        for node in range(len(self.program)):
            program = self.program[node]
            if self.parent[node] >= 0:
                name_of[int(self.parent[node])] = f"Program_{count[program]}"
            count[program] += 1
        for node, program in enumerate(self.program):
            start, stop = self.first[node : node + 2].tolist()
            found[program].append(self._block(name_of[int(self.parent[node])], start, stop, name_of))
        return [tuple(blocks) for blocks in found]

    def _block(self, name: str, start: int, stop: int, name_of: dict[int, str]) -> Block:
        lines = self.lines[start:stop]
        declared = np.flatnonzero(lines[:, FIELD["command"]][:, COMMAND["Cuboid"]])
        names = [BBOX] + [
            name_of.get(int(start + line), f"cube{index}") for index, line in enumerate(declared[1:])
        ]
        return Block(name, tuple(statement_of(line, names) for line in lines.tolist()))


@dataclass(frozen=True)
class Level:
    """All nodes of one level of a batch of programs, packed.

    lines     (rows, 63) start, the node's lines, end; step by step, the longest node first
    steps     (longest,) how many nodes are still running at each step
    node      (rows,) which node of the level a row belongs to
    size      (nodes, 3) the bounding box of each node, world units
    depth     the level's number
    program   (nodes,) which program of the batch
    filled    (nodes,) the row of the level above that declares the cuboid a node fills; empty for roots
    inputs    (rows - nodes,) rows that are read while the next line is predicted: all but the ends
    """

    lines: Float[Tensor, "rows 63"]
    steps: Int[Tensor, " longest"]
    node: Int[Tensor, " rows"]
    size: Float[Tensor, "nodes 3"]
    depth: int
    program: Int[Tensor, " nodes"]
    filled: Int[Tensor, " filled"]
    inputs: Int[Tensor, " inputs"]

    @property
    def targets(self) -> Float[Tensor, "inputs 63"]:
        """The line after each of `inputs`, in the same order."""
        return self.lines[len(self.size) :]

    def to(self, device) -> "Level":
        """The same on another device; `steps` stays, as torch wants it."""
        moved = {
            name: value.to(device) if isinstance(value, Tensor) and name != "steps" else value
            for name, value in vars(self).items()
        }
        return Level(**moved)


def batch_of(table: ProgramTable, picks: Sequence[int]) -> list[Level]:
    """The levels of some programs of the table, roots first.

    Raises ValueError for no programs, one that is picked twice, and numbers that the table does not have.
    """
    numbers = sorted(int(pick) for pick in picks)
    if not numbers or numbers[0] < 0 or numbers[-1] >= len(table) or len(set(numbers)) < len(numbers):
        raise ValueError(f"found picks {numbers}; expected different programs from 0 to {len(table) - 1}")
    order = np.full(len(table), -1, dtype=np.int64)
    order[np.asarray(picks, dtype=np.int64)] = np.arange(len(picks))
    chosen = np.flatnonzero(order[table.program] >= 0)
    levels: list[Level] = []
    row_of = np.empty(0, dtype=np.int64)  # line of the table -> row of the level above
    for depth in range(int(table.level[chosen].max()) + 1):
        nodes = chosen[table.level[chosen] == depth]
        level, row_of = _level(table, nodes, depth, order, row_of)
        levels.append(level)
    return levels


def _level(
    table: ProgramTable, nodes: np.ndarray, depth: int, order: np.ndarray, above: np.ndarray
) -> tuple[Level, np.ndarray]:
    length = table.first[nodes + 1] - table.first[nodes] + 2  # with start and end
    by_length = np.lexsort((nodes, order[table.program[nodes]], -length))
    nodes, length = nodes[by_length], length[by_length]
    steps = (length[:, None] > np.arange(length.max())).sum(0)
    node = np.concatenate([np.arange(running) for running in steps])
    step = np.repeat(np.arange(len(steps)), steps)
    source = table.first[nodes][node] + step - 1  # the line of the table in each row
    start, end = step == 0, step == length[node] - 1
    lines = np.zeros((len(node), WIDTH), dtype=np.float32)
    inner = ~(start | end)
    lines[inner] = table.lines[source[inner]]
    lines[start, FIELD["command"].start + COMMAND["start"]] = 1
    lines[end, FIELD["command"].start + COMMAND["end"]] = 1
    row_of = np.full(len(table.lines), -1, dtype=np.int64)
    row_of[source[inner]] = np.flatnonzero(inner)
    filled = above[table.parent[nodes]] if depth else np.empty(0, dtype=np.int64)
    level = Level(
        lines=torch.from_numpy(lines),
        steps=torch.from_numpy(steps),
        node=torch.from_numpy(node),
        size=torch.from_numpy(table.lines[table.first[nodes], FIELD["size"]].copy()),
        depth=depth,
        program=torch.from_numpy(order[table.program[nodes]]),
        filled=torch.from_numpy(filled),
        inputs=torch.from_numpy(np.flatnonzero(~end)),
    )
    return level, row_of
