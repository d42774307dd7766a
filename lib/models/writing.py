"""Letting the decoder write programs: a batch of latent codes -> as many programs (paper, section 6.2, Appendix D).

Blocks are written level by level, all blocks of a level side by side, one line a step:

    state -> the best line that `writing_rules` allow -> numbers put into their ranges -> run by the interpreter

A line whose cuboids leave their bounding box is not valid. What happens then is the *mode*:

    reject  the whole program is given up (sampling)
    skip    the line is left out, and the line before it read once more (reconstruction, interpolation)
    none    no rule is enforced, nothing is run: what the network says, which need not be a program

Choices are the most likely ones; all chance lies in the latent code.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import one_hot

from ..interpreters.shapeassembly import Attach, Block, Cuboid, Program, ProgramError, Squeeze, execute_many
from ..interpreters.shapeassembly.program import BBOX, Statement
from .program_lines import COMMAND, COMMANDS, FIELD, MAX_CUBOIDS, WIDTH, WIDTHS, statement_of
from .program_table import ROOT, ProgramTable, batch_of
from .program_vae import ProgramVAE
from .writing_rules import BlockStates, Rules, best

MODES = ("reject", "skip", "none")
MAX_STEPS = 100  # lines of a block
MAX_BLOCKS = 11  # of a program
MAX_SKIPS = 10  # in a row; then the bad line is read instead of the last good one
CODES_AT_ONCE = 256
MOST_REJECTED = 1000  # codes for each program
SMALLEST = 0.01  # side of a cuboid, world units
_NAMES = [BBOX, *(f"cube{i}" for i in range(MAX_CUBOIDS - 1))]
_ROLES = ("name", "moved", "still", "first", "second", "source")  # fields of statements that name cuboids
_MOVING = torch.tensor([name in ("attach", "squeeze", "reflect", "translate") for name in COMMANDS])


@dataclass
class Node:
    """A block as it was written, all its cuboids named cube0, cube1, … for the time being.

    program     which program of the batch it belongs to
    statements  without start and end, the bbox line first
    codes       cuboid -> code of the block that is to fill it
    sizes       cuboid -> (3,) its written size, for the same cuboids
    children    cuboid -> the block that fills it
    """

    program: int
    statements: list[Statement] = field(default_factory=list)
    codes: dict[int, Tensor] = field(default_factory=dict)
    sizes: dict[int, Tensor] = field(default_factory=dict)
    children: dict[int, "Node"] = field(default_factory=dict)


@dataclass(frozen=True)
class Written:
    """programs: one for each latent code, None where there is none; reasons: why there is none, or ""."""

    programs: list[Program | None]
    reasons: list[str]

    @property
    def accepted(self) -> list[Program]:
        """Those that there are."""
        return [program for program in self.programs if program is not None]


@torch.no_grad()
def write(
    network: ProgramVAE,
    latent: Float[Tensor, "programs latent"],
    mode: str = "reject",
    rules: Rules | None = None,
) -> Written:
    """Programs of latent codes. Every program returned is checked, executes, and stands on its bounding box.

    Raises ValueError for an unknown mode.
    """
    if mode not in MODES:
        raise ValueError(f"unknown mode {mode!r}: choose one of {', '.join(MODES)}")
    return _Writer(network, mode, rules or Rules()).write(latent)


@dataclass(frozen=True)
class Sampled:
    """programs that were written, and how many latent codes were rejected on the way."""

    programs: list[Program]
    rejected: int

    @property
    def rejection_rate(self) -> float:
        """Share of the codes that were rejected."""
        return self.rejected / (self.rejected + len(self.programs))


def sample(
    network: ProgramVAE,
    count: int,
    seed: int = 0,
    mode: str = "reject",
    rules: Rules | None = None,
    spread: float = 1.0,
) -> Sampled:
    """`count` programs from random latent codes; codes that give none are replaced by further ones.

    spread  standard deviation of the codes: below 1, shapes nearer to the usual ones
    The first programs are the same for every `count`. Raises RuntimeError where hardly any code gives a program.
    """
    noise = torch.Generator().manual_seed(seed)
    device = network.first_state.device
    programs: list[Program] = []
    rejected = 0
    while len(programs) < count:
        codes = spread * torch.randn(CODES_AT_ONCE, network.config.hidden, generator=noise)
        for program in write(network, codes.to(device), mode, rules).programs:
            if len(programs) < count:
                programs.append(program) if program is not None else None
                rejected += program is None
        if rejected > MOST_REJECTED * (len(programs) + 1):
            raise RuntimeError(
                f"{rejected} codes rejected, {len(programs)} programs found; expected a trained network"
            )
    return Sampled(programs, rejected)


def reconstruct(network: ProgramVAE, programs: Sequence[Program], rules: Rules | None = None) -> Written:
    """Programs through the encoder and back; lines that break a rule are left out."""
    table = ProgramTable.of(programs)
    with torch.no_grad():
        latent = network.encode(batch_of(table, range(len(table)))).mean
    return write(network, latent, "skip", rules)


@dataclass
class _Writer:
    network: ProgramVAE
    mode: str
    rules: Rules
    reasons: list[str] = field(default_factory=list)
    count: list[int] = field(default_factory=list)  # blocks of each program

    def write(self, latent: Tensor) -> Written:
        self.reasons, self.count = [""] * len(latent), [1] * len(latent)
        roots = [Node(program) for program in range(len(latent))]
        nodes, codes = roots, latent
        sizes = self.network.root_size(latent).clamp(min=SMALLEST)
        depth = 0
        while nodes:
            _Level(self, nodes, codes, sizes, depth).run()
            nodes, codes, sizes = self._children(nodes)
            depth += 1
        programs = [self._program(root) for root in roots]
        self._execute(programs)
        return Written(programs, self.reasons)

    def _children(self, nodes: list[Node]) -> tuple[list[Node], Tensor | None, Tensor | None]:
        children, codes, sizes = [], [], []
        for node in nodes:
            for cuboid, code in node.codes.items():
                if self.reasons[node.program] or self.count[node.program] >= MAX_BLOCKS:
                    continue
                self.count[node.program] += 1
                child = Node(node.program)
                node.children[cuboid] = child
                children.append(child)
                codes.append(code)
                sizes.append(node.sizes[cuboid])
        if not children:
            return [], None, None
        return children, torch.stack(codes), torch.stack(sizes)

    def _program(self, root: Node) -> Program | None:
        """The program of a tree of blocks; notes the reason where there is none."""
        if self.reasons[root.program]:
            return None
        try:
            blocks = _blocks(root)
            if len(blocks[0].statements) == 1:
                raise ProgramError("no cuboid stands on the bounding box", expected="at least one")
            return Program(blocks)
        except ProgramError as error:
            self.reasons[root.program] = str(error)
            return None

    def _execute(self, programs: list[Program | None]) -> None:
        """Gives up programs whose geometry is not finite."""
        at = [number for number, program in enumerate(programs) if program is not None]
        for number, valid in zip(at, execute_many([programs[i] for i in at]).valid.tolist() if at else []):
            if not valid:
                programs[number], self.reasons[number] = None, "its geometry is not finite"


class _Level:
    """All blocks of one level while they are written."""

    def __init__(self, writer: _Writer, nodes: Sequence[Node], codes: Tensor, sizes: Tensor, depth: int):
        self.writer, self.network, self.nodes = writer, writer.network, list(nodes)
        self.codes, self.sizes, self.depth = codes, sizes, depth
        n = len(self.nodes)
        self.states = BlockStates.new(n)
        self.hidden = codes
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
        states, free = self.states[self.rows], self.writer.mode == "none"
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
        near = self.writer.rules.near
        snapped = torch.where(height <= 0.5, height.clamp(max=near), height.clamp(min=1 - near))
        if self.writer.mode != "none":
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
        lines[:, FIELD["count"]] = count.round().clamp(1, self.writer.rules.most)[:, None]
        lines[:, FIELD["distance"]] = distance.clamp(0, 1)[:, None]
        return lines

    def _symmetry(self, lines, state, source, sizes) -> tuple[Tensor, Tensor, Tensor]:
        first = _mark(lines, "first", source)
        return self.network.line.symmetry(state, first[:, None].expand(-1, 3, -1), sizes)

    def _allowed(self, allowed: Bool[Tensor, "n *choices"]) -> Bool[Tensor, "n *choices"]:
        return torch.ones_like(allowed) if self.writer.mode == "none" else allowed

    def _settle(self, lines: Tensor, state: Tensor) -> None:
        """Add the lines that are valid; reject or skip where they are not; stop blocks that end."""
        command = lines[:, FIELD["command"]].argmax(-1)
        ended = command == COMMAND["end"]
        if self.writer.mode == "none":
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
        rejected = torch.tensor(
            [bool(self.writer.reasons[self.nodes[row].program]) for row in self.rows.tolist()]
        )
        self.rows = self.rows[~(ended | rejected)]

    def _append(self, rows: Tensor, lines: Tensor) -> None:
        for row, line in zip(rows.tolist(), lines.tolist()):
            self.nodes[row].statements.append(statement_of(line, _NAMES))
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
        limit = (1 + self.writer.rules.outside) * self.sizes[self.rows[owner]] / 2
        outside = ~(cuboids.corners().abs() < limit[:, None].to(cuboids.size)).all(-1).all(-1)
        valid[owner[outside]] = False
        first = torch.tensor([0, *count]).cumsum(0)[:-1]
        for i, start in zip(at, first.tolist()):
            declared = int(self.states.declared[self.rows[i]]) - 1
            centers[i, 1 : declared + 1] = cuboids.center[start : start + declared].float()
        return valid, centers

    def _with(self, row: int, line: Tensor) -> Program:
        """One block and one line more, as a program of its own: what other blocks fill are boxes here."""
        statements = (*self.nodes[row].statements, statement_of(line, _NAMES))
        return Program.unchecked((Block(ROOT, statements),))

    def _skip(self, rows: Tensor, lines: Tensor) -> None:
        for row, line in zip(rows.tolist(), lines):
            self._give_up(row, "cuboids leave their bounding box")
            self.skips[row] += 1
            if self.skips[row] > MAX_SKIPS:
                self.line[row], self.skips[row] = line, 0

    def _give_up(self, row: int, reason: str) -> None:
        if self.writer.mode == "reject":
            self.writer.reasons[self.nodes[row].program] = reason


_CHOICES = {
    "Cuboid": _Level._cuboid, "attach": _Level._attach, "squeeze": _Level._squeeze,
    "reflect": _Level._reflect, "translate": _Level._translate,
}  # fmt: skip


def _mark(lines: Tensor, name: str, index: Tensor) -> Tensor:
    """Set a one-hot field, and return it."""
    lines[:, FIELD[name]] = one_hot(index, WIDTHS[name]).float()
    return lines[:, FIELD[name]]


def _blocks(root: Node) -> tuple[Block, ...]:
    """All blocks of a program, breadth-first; cuboids that stand on nothing are left out, with what is in them."""
    blocks, waiting = [], [(root, ROOT)]
    for node, name in waiting:  # grows while it is walked
        names = {BBOX: BBOX}
        for old in _grounded(node):
            child = node.children.get(_NAMES.index(old))
            filled = child is not None and bool(_grounded(child))
            names[old] = f"Program_{len(waiting)}" if filled else f"cube{len(names) - 1}"
            if filled:
                waiting.append((child, names[old]))
        blocks.append(Block(name, tuple(_renamed(s, names) for s in node.statements if _stays(s, names))))
    return tuple(blocks)


def _grounded(node: Node) -> list[str]:
    """Cuboids that an attach or squeeze connects to the bbox, as they were declared."""
    moved = {s.moved for s in node.statements if isinstance(s, Attach | Squeeze)}
    return [s.name for s in node.statements if isinstance(s, Cuboid) and s.name in moved]


def _stays(statement: Statement, names: dict[str, str]) -> bool:
    """All but the declarations of cuboids that stand on nothing: nothing else can name these."""
    return not isinstance(statement, Cuboid) or statement.name in names


def _renamed(statement: Statement, names: dict[str, str]) -> Statement:
    roles = [role for role in _ROLES if hasattr(statement, role)]
    return replace(statement, **{role: names[getattr(statement, role)] for role in roles})
