"""Letting the decoder write programs: a batch of latent codes -> as many programs (paper, section 6.2, Appendix D).

Blocks are written level by level, all blocks of a level side by side, one line a step:

    state -> the best line that `writing_rules` allow -> numbers put into their ranges -> run by the interpreter

A line whose cuboids leave their bounding box is not valid. What happens then is the *mode*:

    reject  the whole program is given up (sampling); so are programs with a block of more than 100 lines
    skip    the line is left out, and the line before it read once more (reconstruction, interpolation)
    none    no rule is enforced, nothing is run: what the network says, which need not be a program

Choices are the most likely ones, so that all chance lies in the latent code, or are drawn at a temperature. A cuboid is
filled by a block of its own where the network says so, the bbox never; cuboids that stand on nothing in the end are
left out, a block without cuboids is none, and a program has at most 11 blocks, the outer ones first.
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import torch
from jaxtyping import Float
from torch import Tensor

from ..interpreters.shapeassembly import Program, ProgramError, execute_many
from .code_distribution import CodeDistribution, encoded
from .program_vae import ProgramVAE
from .writing_level import LevelWriter
from .writing_line import SMALLEST, LineWriter
from .writing_rules import Rules
from .written_blocks import NAMES, Node, blocks_of

MODES = ("reject", "skip", "none")
MAX_BLOCKS = 11  # of a program
CODES_AT_ONCE = 256
MOST_REJECTED = 1000  # codes for each program


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
    temperature: float = 0.0,
    seed: int = 0,
) -> Written:
    """Programs of latent codes. Every program returned is checked, executes, and stands on its bounding box.

    temperature  0: the most likely choice of command, cuboids, axis and face, as the authors do; up to 1: choices are
                 drawn with the probabilities that the network gives them, from `seed`

    All work is done on the CPU, where the interpreter is the judge of every line; the network may be elsewhere.
    Raises ValueError for an unknown mode, for codes that are not (programs, hidden), and a temperature below 0.
    """
    if mode not in MODES:
        raise ValueError(f"unknown mode {mode!r}: choose one of {', '.join(MODES)}")
    if not 0 <= temperature < math.inf:
        raise ValueError(f"a temperature of {temperature}; expected 0 or more")
    if latent.ndim != 2 or latent.shape[1] != network.config.hidden:
        expected = f"(programs, {network.config.hidden})"
        raise ValueError(f"latent codes of shape {tuple(latent.shape)}; expected {expected}")
    network = _on_cpu(network)
    noise = torch.Generator().manual_seed(seed)
    line = LineWriter(network.line, rules or Rules(), mode == "none", temperature, noise)
    return _Writer(network, mode, line).write(latent.detach().float().cpu())


@dataclass(frozen=True)
class Sampled:
    """programs that were written, and how many latent codes were rejected on the way."""

    programs: list[Program]
    rejected: int

    @property
    def rejection_rate(self) -> float:
        """Share of the codes that were rejected."""
        return self.rejected / max(1, self.rejected + len(self.programs))


def sample(
    network: ProgramVAE,
    count: int,
    seed: int = 0,
    mode: str = "reject",
    rules: Rules | None = None,
    spread: float = 1.0,
    temperature: float = 0.0,
    codes: CodeDistribution | None = None,
) -> Sampled:
    """`count` programs from random latent codes; codes that give none are replaced by further ones.

    spread       standard deviation of the codes: below 1, shapes nearer to the usual ones
    temperature  of the choices, see `write`; all chance comes from `seed`
    codes        what codes are drawn from; default: the standard normal distribution, as in the paper
    The first programs are the same for every `count`. Raises RuntimeError where hardly any code gives a program, and
    ValueError for a count or a spread below 0, and for codes of another length than the network's.
    """
    if count < 0 or not 0 <= spread < math.inf:
        raise ValueError(f"a count of {count}, a spread of {spread}; expected 0 or more, both finite")
    if codes is not None and len(codes.mean) != network.config.hidden:
        raise ValueError(
            f"codes of {len(codes.mean)} numbers; expected {network.config.hidden}, as the network has"
        )
    noise = torch.Generator().manual_seed(seed)
    network = _on_cpu(network)
    programs: list[Program] = []
    rejected = 0
    while len(programs) < count:
        latent = spread * torch.randn(CODES_AT_ONCE, network.config.hidden, generator=noise)
        latent = latent if codes is None else codes.at(latent)
        drawn = int(torch.randint(2**31, (), generator=noise))
        for program in write(network, latent, mode, rules, temperature, drawn).programs:
            if len(programs) == count:
                break
            if program is None:
                rejected += 1
            else:
                programs.append(program)
        if rejected > MOST_REJECTED * (len(programs) + 1):
            raise RuntimeError(
                f"{rejected} codes rejected, {len(programs)} programs found; expected a trained network"
            )
    return Sampled(programs, rejected)


def reconstruct(network: ProgramVAE, programs: Sequence[Program], rules: Rules | None = None) -> Written:
    """Programs through the encoder and back; lines that break a rule are left out."""
    return write(network, encoded(network, programs).mean, "skip", rules)


def _on_cpu(network: ProgramVAE) -> ProgramVAE:
    """The network itself where it is there already, else a copy."""
    return network if network.first_state.device.type == "cpu" else copy.deepcopy(network).cpu()


@dataclass
class _Writer:
    network: ProgramVAE
    mode: str
    line: LineWriter
    reasons: list[str] = field(default_factory=list)
    count: list[int] = field(default_factory=list)  # blocks of each program

    def write(self, latent: Tensor) -> Written:
        """The programs of some codes, level by level."""
        sizes = self.network.root_size(latent).clamp(min=SMALLEST)
        finite = (latent.isfinite() & sizes.isfinite().all(-1, keepdim=True)).all(-1)
        self.reasons = ["" if good else "its bounding box is not finite" for good in finite.tolist()]
        self.count = [1] * len(latent)
        roots = [Node(program) for program in range(len(latent))]
        nodes, codes, depth = roots, latent, 0
        while nodes:
            level = (nodes, codes, sizes, depth)
            LevelWriter(self.network, *level, self.mode, self.line, self.reasons).run()
            nodes, fillings = self._children(nodes)
            codes, sizes = (torch.stack(parts) for parts in zip(*fillings)) if nodes else (None, None)
            depth += 1
        programs = [self._program(root) for root in roots]
        self._execute(programs)
        return Written(programs, self.reasons)

    def _children(self, nodes: list[Node]) -> tuple[list[Node], list[tuple[Tensor, Tensor]]]:
        """The blocks of the next level, and the code and the bounding box of each."""
        children, fillings = [], []
        for node in nodes:
            standing = {NAMES.index(name) for name in node.standing()}
            for cuboid in sorted(standing & node.fillings.keys()):
                if self.reasons[node.program] or self.count[node.program] >= MAX_BLOCKS:
                    continue
                self.count[node.program] += 1
                node.children[cuboid] = Node(node.program)
                children.append(node.children[cuboid])
                fillings.append(node.fillings[cuboid])
        return children, fillings

    def _program(self, root: Node) -> Program | None:
        """The program of a tree of blocks; notes the reason where there is none."""
        if self.reasons[root.program]:
            return None
        try:
            blocks = blocks_of(root)
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
