"""One line for each of many blocks: the most likely choices that `writing_rules` allow, numbers put into their ranges.

The line is decided head by head: the command, then its cuboids, then their numbers, each head told of what was decided
before. Ranges, from the paper's Appendix D:

    Cuboid     sides from 0.01 to those of the bounding box
    attach     points from 0 to 1; on the bbox the height is at most 0.05 from the bottom or the top face
    squeeze    u and v from 0 to 1
    translate  distance from 0 to 1, copies from 1 (ours: to 50)
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import one_hot

from .program_lines import COMMAND, COMMANDS, FIELD, MAX_CUBOIDS, WIDTH, WIDTHS
from .program_vae import LineDecoder
from .writing_rules import BlockStates, Rules, best

SMALLEST = 0.01  # side of a cuboid, world units


@dataclass
class Choice:
    """What is known of n blocks that write the same command next, and the lines that are being filled in.

    state   (n, hidden) of the GRU;  logits  (n, 3, 11) of the three cuboids;  sizes  (n, 3) bounding boxes
    """

    lines: Float[Tensor, "n 63"]
    state: Float[Tensor, "n hidden"]
    logits: Float[Tensor, "n 3 11"]
    states: BlockStates
    sizes: Float[Tensor, "n 3"]

    def mark(self, name: str, index: Tensor) -> Tensor:
        """Set a one-hot field, and return it."""
        self.lines[:, FIELD[name]] = one_hot(index, WIDTHS[name]).to(self.lines)
        return self.lines[:, FIELD[name]]

    def mark_cuboids(self, numbers: Tensor) -> Tensor:
        """Set the first, second and third cuboid, as far as there are numbers (n, k); (n, 3, 11) one-hots."""
        for name, number in zip(("first", "second", "third"), numbers.unbind(1)):
            self.mark(name, number)
        return torch.stack([self.lines[:, FIELD[name]] for name in ("first", "second", "third")], 1)


@dataclass(frozen=True)
class LineWriter:
    """heads: of the network; rules: their tolerances; free: enforce none of them.

    temperature  0: the most likely choices. Above, choices are drawn, with probabilities that grow with
                 exp(logit / temperature), by adding Gumbel noise of that scale to the logits
    noise        what they are drawn from
    """

    heads: LineDecoder
    rules: Rules
    free: bool = False
    temperature: float = 0.0
    noise: torch.Generator | None = None

    def write(
        self, state: Float[Tensor, "n hidden"], states: BlockStates, sizes: Float[Tensor, "n 3"]
    ) -> Float[Tensor, "n 63"]:
        """The next line of each block, given the GRU's state, the block so far, and its bounding box."""
        lines = state.new_zeros(len(state), WIDTH)
        command = self._pick(self.heads.command(state), states.commands())[:, 0]
        lines[:, FIELD["command"]] = one_hot(command, len(COMMANDS)).to(lines)
        logits = self.heads.cuboids(state, lines[:, FIELD["command"]])
        for name, fill in _FILL.items():
            at = (command == COMMAND[name]).nonzero().squeeze(-1)
            if len(at):
                choice = Choice(lines[at], state[at], logits[at], states[at], sizes[at])
                fill(self, choice)
                lines[at] = choice.lines
        return lines

    def _cuboid(self, choice: Choice) -> None:
        choice.mark("first", choice.states.declared.clamp(max=MAX_CUBOIDS - 1))
        size, aligned = self.heads.size(choice.state, choice.sizes)
        choice.lines[:, FIELD["size"]] = size.clamp(min=SMALLEST).minimum(choice.sizes)
        choice.lines[:, FIELD["aligned"]] = (aligned > 0).to(size)[:, None]

    def _attach(self, choice: Choice) -> None:
        scores = choice.logits[:, 0, :, None] + choice.logits[:, 1, None, :]
        pair = self._pick(scores, choice.states.pairs())
        found = self.heads.attach(choice.state, choice.mark_cuboids(pair)).clamp(0, 1)
        if not self.free:
            found[:, 4] = torch.where(
                pair[:, 1] == 0, self._at_a_side(choice, pair, found[:, 4]), found[:, 4]
            )
        choice.lines[:, FIELD["point"]], choice.lines[:, FIELD["place"]] = found[:, :3], found[:, 3:]

    def _at_a_side(self, choice: Choice, pair: Tensor, height: Tensor) -> Tensor:
        """The nearest height on the bbox at which the cuboid may be attached."""
        low, high = choice.states.sides()[torch.arange(len(pair)), pair[:, 0]].unbind(-1)
        bottom, top = height.clamp(max=self.rules.near), height.clamp(min=1 - self.rules.near)
        return torch.where(low & ((height <= 0.5) | ~high), bottom, top)

    def _squeeze(self, choice: Choice) -> None:
        first, second, third = choice.logits.unbind(1)
        scores = first[:, :, None, None] + second[:, None, :, None] + third[:, None, None, :]
        triple = self._pick(scores, choice.states.triples())
        face, uv = self.heads.squeeze(choice.state, choice.mark_cuboids(triple))
        choice.mark("face", self._pick(face, choice.states.faces(triple))[:, 0])
        choice.lines[:, FIELD["uv"]] = uv.clamp(0, 1)

    def _reflect(self, choice: Choice) -> None:
        allowed = self._allowed(choice.states.reflections())
        source = self._pick(choice.logits[:, 0], allowed.any(-1))
        axis, _, _ = self.heads.symmetry(choice.state, choice.mark_cuboids(source), choice.sizes)
        choice.mark("axis", self._pick(axis, allowed[torch.arange(len(source)), source[:, 0]])[:, 0])

    def _translate(self, choice: Choice) -> None:
        source = self._pick(choice.logits[:, 0], choice.states.sources())
        axis, count, distance = self.heads.symmetry(choice.state, choice.mark_cuboids(source), choice.sizes)
        choice.mark("axis", axis.argmax(-1))
        choice.lines[:, FIELD["count"]] = count.round().clamp(1, self.rules.most)[:, None]
        choice.lines[:, FIELD["distance"]] = distance.clamp(0, 1)[:, None]

    def _pick(self, logits: Tensor, allowed: Tensor) -> Tensor:
        """The choice of each row, as indices."""
        if self.temperature:
            uniform = torch.rand(logits.shape, generator=self.noise).clamp(1e-9, 1 - 1e-7)
            logits = logits - self.temperature * (-uniform.log()).log()
        return best(logits, self._allowed(allowed))

    def _allowed(self, allowed: Bool[Tensor, "n *choices"]) -> Bool[Tensor, "n *choices"]:
        return torch.ones_like(allowed) if self.free else allowed


_FILL = {
    "Cuboid": LineWriter._cuboid, "attach": LineWriter._attach, "squeeze": LineWriter._squeeze,
    "reflect": LineWriter._reflect, "translate": LineWriter._translate,
}  # fmt: skip
