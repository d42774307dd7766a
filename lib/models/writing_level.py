"""One level of blocks while they are written: a line a step, for all blocks side by side (paper, Appendix D).

GRU state -> the best line within the rules (`writing_line`) -> run by the interpreter

The interpreter is the judge: a line is valid if every cuboid stays within its bounding box, 10 % of its sides allowed.
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from ..interpreters.shapeassembly import Attach, Block, Program, Squeeze, execute_many
from ..interpreters.shapeassembly.program import Statement
from .program_lines import COMMAND, FIELD, WIDTH, statement_of
from .program_table import ROOT
from .program_vae import ProgramVAE
from .writing_line import LineWriter
from .writing_rules import BlockStates
from .written_blocks import NAMES, Node

MAX_STEPS = 100  # lines of a block, those that are left out included
MAX_SKIPS = 10  # in a row; then the bad line is read instead of the last good one


class LevelWriter:
    """Writes the statements of `nodes`, and the codes of what is to fill their cuboids.

    codes    (nodes, hidden) of the blocks;  sizes  (nodes, 3) their bounding boxes, world units;  depth  of the level
    mode     "reject", "skip" or "none", see `writing`
    writer   decides each line
    reasons  why each program is given up, or ""; noted here
    """

    def __init__(
        self,
        network: ProgramVAE,
        nodes: Sequence[Node],
        codes: Float[Tensor, "nodes hidden"],
        sizes: Float[Tensor, "nodes 3"],
        depth: int,
        mode: str,
        writer: LineWriter,
        reasons: list[str],
    ):
        self.network, self.nodes, self.depth = network, list(nodes), depth
        self.codes, self.sizes = codes, sizes
        self.mode, self.writer, self.reasons = mode, writer, reasons
        n = len(self.nodes)
        self.states = BlockStates.new(n, writer.rules.same_side)
        self.hidden = codes.clone()
        self.line = codes.new_zeros(n, WIDTH)  # what each block reads next
        self.skips = torch.zeros(n, dtype=torch.long)
        self.rows = torch.arange(n)[~self._given_up(range(n))]  # blocks that are still being written

    def run(self) -> None:
        """Write until every block has ended, or is given up."""
        self._begin()
        for _ in range(MAX_STEPS):
            if not len(self.rows):
                return
            state = self._step()
            lines = self.writer.write(state, self.states[self.rows], self.sizes[self.rows])
            self._settle(lines, state)
        if self.mode == "reject":
            self._give_up(self.rows, f"a block of more than {MAX_STEPS} lines")

    def _begin(self) -> None:
        """The bbox lines, which are known already: the network learnt to write them, so one step goes by."""
        self.line[:, FIELD["command"].start + COMMAND["start"]] = 1
        self._step()
        self.line[:] = 0
        self.line[:, FIELD["command"].start + COMMAND["Cuboid"]] = 1
        self.line[:, FIELD["first"].start] = 1
        self.line[:, FIELD["size"]] = self.sizes
        self.line[:, FIELD["aligned"]] = 1
        for node, line in zip(self.nodes, self.line.tolist()):
            node.statements.append(statement_of(line, NAMES))

    def _step(self) -> Tensor:
        """Read the last line of every running block: its new GRU state."""
        read = self.network.read_previous(self.line[self.rows], self.sizes[self.rows], self.depth)
        state, _ = self.network.writer(read[None], self.hidden[self.rows][None])
        self.hidden[self.rows] = state[0]
        return state[0]

    def _settle(self, lines: Tensor, state: Tensor) -> None:
        """Add the lines that are valid; reject or skip where they are not; stop blocks that end."""
        command = lines[:, FIELD["command"]].argmax(-1)
        ended = (command == COMMAND["end"]) | (command == COMMAND["start"])
        finite = lines.isfinite().all(-1)
        statements = [
            statement_of(line, NAMES) if says else None
            for line, says in zip(lines.tolist(), (finite & ~ended).tolist())
        ]
        valid = finite if self.mode == "none" else finite & self._within(statements)
        self._note_codes(lines, state, valid & (command == COMMAND["Cuboid"]))
        self._append(lines, statements, valid & ~ended)
        if self.mode == "skip":
            self._skip(self.rows[~valid], lines[~valid])
        else:
            self._give_up(self.rows[~finite], "a number that is not finite")
            self._give_up(self.rows[finite & ~valid], "cuboids leave their bounding box")
        self.rows = self.rows[~(ended | self._given_up(self.rows.tolist()))]

    def _append(self, lines: Tensor, statements: list[Statement | None], good: Tensor) -> None:
        for at in good.nonzero().flatten().tolist():
            self.nodes[self.rows[at]].statements.append(statements[at])
        rows = self.rows[good]
        self.line[rows] = lines[good]
        self.skips[rows] = 0
        self.states.add(rows, lines[good])

    def _note_codes(self, lines: Tensor, state: Tensor, cuboids: Tensor) -> None:
        """Codes of the cuboids that the network wants filled."""
        at = cuboids.nonzero().squeeze(-1)
        at = at[self.network.line.leaf(state[at], self.codes[self.rows[at]]) < 0]
        rows = self.rows[at]
        codes = self.network.line.child(state[at], self.codes[rows])
        numbers = lines[at][:, FIELD["first"]].argmax(-1)
        for row, number, code, size in zip(
            rows.tolist(), numbers.tolist(), codes, lines[at][:, FIELD["size"]]
        ):
            self.nodes[row].fillings[number] = (code, size)

    def _within(self, statements: list[Statement | None]) -> Tensor:
        """(running,) Do the cuboids stay within bounds with these statements? Notes where they come to stand."""
        within = torch.ones(len(statements), dtype=torch.bool)
        at = [i for i, statement in enumerate(statements) if statement and statement.command != "Cuboid"]
        if not at:
            return within
        rows = self.rows[at]
        # All that was written so far: where an attach leads depends on every attach its cuboid took part in.
        tried = [(*self.nodes[row].statements, statements[i]) for row, i in zip(rows.tolist(), at)]
        shapes = execute_many([Program.unchecked((Block(ROOT, lines),)) for lines in tried])
        cuboids, count = shapes.cuboids, torch.tensor(shapes.count)
        owner = torch.arange(len(at)).repeat_interleave(count)
        limit = (1 + self.writer.rules.outside) / 2 * self.sizes[rows].to(cuboids.size)
        inside = (cuboids.corners().abs() < limit[owner, None]).flatten(1).all(1)  # not so for nan
        within[torch.tensor(at)[owner[~inside]]] = False
        valid = [statements[i] if within[i] else None for i in at]
        self._note_centers(rows, valid, cuboids.center, (count.cumsum(0) - count).tolist())
        return within

    def _note_centers(
        self, rows: Tensor, statements: list[Statement | None], center: Tensor, first: list[int]
    ) -> None:
        """Where the cuboids that valid attaches moved are now; `first` has the first cuboid of each block."""
        for row, statement, start in zip(rows.tolist(), statements, first):
            if isinstance(statement, Attach | Squeeze):
                moved = NAMES.index(statement.moved)
                self.states.center[row, moved] = center[start + moved - 1].to(self.states.center)

    def _skip(self, rows: Tensor, lines: Tensor) -> None:
        self.skips[rows] += 1
        often = self.skips[rows] >= MAX_SKIPS
        self.line[rows[often]] = lines[often]
        self.skips[rows[often]] = 0

    def _give_up(self, rows: Tensor, reason: str) -> None:
        for row in rows.tolist():
            self.reasons[self.nodes[row].program] = reason

    def _given_up(self, rows: Sequence[int]) -> Tensor:
        return torch.tensor([self.reasons[self.nodes[row].program] != "" for row in rows], dtype=torch.bool)
