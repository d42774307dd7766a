"""One level of blocks while they are written: a line a step, for all blocks side by side (paper, Appendix D).

GRU state -> the best line that `writing_rules` allow -> numbers put into their ranges -> run by the interpreter
"""

from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import one_hot

from ..interpreters.shapeassembly import Block, Program, execute_many
from .program_lines import COMMAND, COMMANDS, FIELD, MAX_CUBOIDS, WIDTH, WIDTHS, statement_of
from .program_table import ROOT
from .program_vae import ProgramVAE
from .writing_rules import BlockStates, Rules, best
from .written_blocks import NAMES, Node

MAX_STEPS = 100  # lines of a block
MAX_SKIPS = 10  # in a row; then the bad line is read instead of the last good one
SMALLEST = 0.01  # side of a cuboid, world units
_MOVING = torch.tensor([name in ("attach", "squeeze", "reflect", "translate") for name in COMMANDS])


class LevelWriter:
    """Writes the statements of `nodes`, and the codes of what is to fill their cuboids.

    codes    (nodes, hidden) of the blocks;  sizes  (nodes, 3) their bounding boxes, world units;  depth  of the level
    mode     "reject", "skip" or "none", see `writing`
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
        rules: Rules,
        reasons: list[str],
    ):
        self.network, self.nodes, self.depth = network, list(nodes), depth
        self.codes, self.sizes = codes, sizes
        self.mode, self.rules, self.reasons = mode, rules, reasons
        n = len(self.nodes)
        self.states = BlockStates.new(n)
        self.hidden = codes.clone()
        self.line = torch.zeros(n, WIDTH)
        self.line[:, FIELD["command"].start + COMMAND["start"]] = 1
        self.skips = torch.zeros(n, dtype=torch.long)
        self.rows = torch.arange(n)  # blocks that are still being written

    def run(self) -> None:
        self._step()  # the network also learnt to write the bbox line; it is known already
        self._append(self.rows, self._bbox_lines())
        for _ in range(MAX_STEPS):
            if not len(self.rows):
                return
            state = self._step()
            lines = self._choose(state)
            self._settle(lines, state)
        for row in self.rows.tolist():
            self._give_up(row, f"a block of more than {MAX_STEPS} lines")

    def _step(self) -> Tensor:
        """Read the last line of every running block: its new GRU state."""
        read = self.network.read_previous(self.line[self.rows], self.sizes[self.rows], self.depth)
        state, _ = self.network.writer(read[None], self.hidden[self.rows][None].contiguous())
        self.hidden[self.rows] = state[0]
        return state[0]

    def _bbox_lines(self) -> Tensor:
        lines = torch.zeros(len(self.nodes), WIDTH)
        lines[:, FIELD["command"].start + COMMAND["Cuboid"]] = 1
        lines[:, FIELD["first"].start] = 1
        lines[:, FIELD["size"]] = self.sizes
        lines[:, FIELD["aligned"]] = 1
        return lines

    def _choose(self, state: Tensor) -> Tensor:
        """(running, 63): the most likely line of each block, within the rules unless there are none."""
        lines = torch.zeros(len(state), WIDTH)
        states, free = self.states[self.rows], self.mode == "none"
        allowed = torch.ones_like(states.commands()) if free else states.commands()
        command = best(self.network.line.command(state), allowed)[:, 0]
        lines[:, FIELD["command"]] = one_hot(command, len(COMMANDS)).float()
        logits = self.network.line.cuboids(state, lines[:, FIELD["command"]])
        for name, choose in _CHOICES.items():
            at = (command == COMMAND[name]).nonzero().squeeze(-1)
            if len(at):
                lines[at] = choose(
                    self, lines[at], state[at], logits[at], states[at], self.sizes[self.rows[at]]
                )
        return lines

    def _cuboid(self, lines, state, logits, states, sizes) -> Tensor:
        _mark(lines, "first", states.declared.clamp(max=MAX_CUBOIDS - 1))
        size, aligned = self.network.line.size(state, sizes)
        lines[:, FIELD["size"]] = size.clamp(min=SMALLEST).minimum(sizes.clamp(min=SMALLEST))
        lines[:, FIELD["aligned"]] = (aligned > 0).float()[:, None]
        return lines

    def _attach(self, lines, state, logits, states, sizes) -> Tensor:
        scores = logits[:, 0, :, None] + logits[:, 1, None, :]
        pair = best(scores, self._allowed(states.pairs()))
        cuboids = _mark(lines, "first", pair[:, 0]), _mark(lines, "second", pair[:, 1])
        zero = torch.zeros_like(cuboids[0])
        found = self.network.line.attach(state, torch.stack([*cuboids, zero], 1)).clamp(0, 1)
        point, place = found.split(3, -1)
        height = place[:, 1]
        near = self.rules.near
        snapped = torch.where(height <= 0.5, height.clamp(max=near), height.clamp(min=1 - near))
        if self.mode != "none":
            place[:, 1] = torch.where(pair[:, 1] == 0, snapped, height)
        lines[:, FIELD["point"]], lines[:, FIELD["place"]] = point, place
        return lines

    def _squeeze(self, lines, state, logits, states, sizes) -> Tensor:
        scores = logits[:, 0, :, None, None] + logits[:, 1, None, :, None] + logits[:, 2, None, None, :]
        triple = best(scores, self._allowed(states.triples()))
        cuboids = [_mark(lines, name, triple[:, i]) for i, name in enumerate(("first", "second", "third"))]
        face, uv = self.network.line.squeeze(state, torch.stack(cuboids, 1))
        _mark(lines, "face", best(face, self._allowed(states.faces(triple)))[:, 0])
        lines[:, FIELD["uv"]] = uv.clamp(0, 1)
        return lines

    def _reflect(self, lines, state, logits, states, sizes) -> Tensor:
        allowed = self._allowed(states.reflections())
        source = best(logits[:, 0], allowed.any(-1))[:, 0]
        axis, _, _ = self._symmetry(lines, state, source, sizes)
        _mark(lines, "axis", best(axis, allowed[torch.arange(len(source)), source])[:, 0])
        return lines

    def _translate(self, lines, state, logits, states, sizes) -> Tensor:
        source = best(logits[:, 0], self._allowed(states.sources()))[:, 0]
        axis, count, distance = self._symmetry(lines, state, source, sizes)
        _mark(lines, "axis", axis.argmax(-1))
        lines[:, FIELD["count"]] = count.round().clamp(1, self.rules.most)[:, None]
        lines[:, FIELD["distance"]] = distance.clamp(0, 1)[:, None]
        return lines

    def _symmetry(self, lines, state, source, sizes) -> tuple[Tensor, Tensor, Tensor]:
        first = _mark(lines, "first", source)
        return self.network.line.symmetry(state, first[:, None].expand(-1, 3, -1), sizes)

    def _allowed(self, allowed: Bool[Tensor, "n *choices"]) -> Bool[Tensor, "n *choices"]:
        return torch.ones_like(allowed) if self.mode == "none" else allowed

    def _settle(self, lines: Tensor, state: Tensor) -> None:
        """Add the lines that are valid; reject or skip where they are not; stop blocks that end."""
        command = lines[:, FIELD["command"]].argmax(-1)
        ended = command == COMMAND["end"]
        if self.mode == "none":
            ended |= command == COMMAND["start"]
            valid, centers = torch.ones_like(ended), None
        else:
            valid, centers = self._judge(lines, _MOVING[command])
        self._note_codes(lines, state, valid & (command == COMMAND["Cuboid"]))
        good = valid & ~ended
        self._append(self.rows[good], lines[good])
        after = self.states[self.rows[good]].after(lines[good])
        if centers is not None:
            after.center = centers[good]
        self.states.put(self.rows[good], after)
        self._skip(self.rows[~valid], lines[~valid])
        rejected = torch.tensor([bool(self.reasons[self.nodes[row].program]) for row in self.rows.tolist()])
        self.rows = self.rows[~(ended | rejected)]

    def _append(self, rows: Tensor, lines: Tensor) -> None:
        for row, line in zip(rows.tolist(), lines.tolist()):
            self.nodes[row].statements.append(statement_of(line, NAMES))
        self.line[rows] = lines
        self.skips[rows] = 0

    def _note_codes(self, lines: Tensor, state: Tensor, cuboids: Tensor) -> None:
        """Codes of the cuboids that the network wants filled."""
        at = cuboids.nonzero().squeeze(-1)
        rows = self.rows[at]
        expand = self.network.line.leaf(state[at], self.codes[rows]) < 0
        at, rows = at[expand], rows[expand]
        codes = self.network.line.child(state[at], self.codes[rows])
        numbers = lines[at][:, FIELD["first"]].argmax(-1)
        for row, number, code, line in zip(rows.tolist(), numbers.tolist(), codes, lines[at]):
            self.nodes[row].codes[number] = code
            self.nodes[row].sizes[number] = line[FIELD["size"]]

    def _judge(self, lines: Tensor, moving: Tensor) -> tuple[Tensor, Tensor]:
        """Which blocks keep within bounds with one line more, and where their cuboids are then."""
        valid = torch.ones(len(lines), dtype=torch.bool)
        centers = self.states.center[self.rows].clone()
        at = moving.nonzero().squeeze(-1).tolist()
        if not at:
            return valid, centers
        shapes = execute_many([self._with(self.rows[i], lines[i]) for i in at])
        cuboids, count = shapes.cuboids, shapes.count
        owner = torch.tensor(at).repeat_interleave(torch.tensor(count))
        limit = (1 + self.rules.outside) * self.sizes[self.rows[owner]] / 2
        outside = ~(cuboids.corners().abs() < limit[:, None].to(cuboids.size)).all(-1).all(-1)
        valid[owner[outside]] = False
        first = torch.tensor([0, *count]).cumsum(0)[:-1]
        for i, start in zip(at, first.tolist()):
            declared = int(self.states.declared[self.rows[i]]) - 1
            centers[i, 1 : declared + 1] = cuboids.center[start : start + declared].float()
        return valid, centers

    def _with(self, row: int, line: Tensor) -> Program:
        """One block and one line more, as a program of its own: what other blocks fill are boxes here."""
        statements = (*self.nodes[row].statements, statement_of(line, NAMES))
        return Program.unchecked((Block(ROOT, statements),))

    def _skip(self, rows: Tensor, lines: Tensor) -> None:
        for row, line in zip(rows.tolist(), lines):
            self._give_up(row, "cuboids leave their bounding box")
            self.skips[row] += 1
            if self.skips[row] > MAX_SKIPS:
                self.line[row], self.skips[row] = line, 0

    def _give_up(self, row: int, reason: str) -> None:
        if self.mode == "reject":
            self.reasons[self.nodes[row].program] = reason


_CHOICES = {
    "Cuboid": LevelWriter._cuboid, "attach": LevelWriter._attach, "squeeze": LevelWriter._squeeze,
    "reflect": LevelWriter._reflect, "translate": LevelWriter._translate,
}  # fmt: skip


def _mark(lines: Tensor, name: str, index: Tensor) -> Tensor:
    """Set a one-hot field, and return it."""
    lines[:, FIELD[name]] = one_hot(index, WIDTHS[name]).float()
    return lines[:, FIELD[name]]
