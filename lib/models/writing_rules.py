"""What may be written next: the semantic rules of the ShapeAssembly paper's Appendix D, for many blocks at once.

    order      Cuboid*, then (attach | squeeze)*, then (reflect | translate)*
    attach     a declared cuboid, to the bbox or to a cuboid that is grounded; the same two cuboids only once, the bbox
               twice (its top and its bottom); never the bbox itself
    squeeze    likewise for both partners; of the bbox only the top and bottom faces
    reflect    a grounded cuboid, from the negative side of the plane to the positive one
    translate  a grounded cuboid

A choice that breaks a rule is never made: its logit is left out, and the best of those that remain is taken. For the
cuboids of an attach or squeeze that is the best *pair* or *triple*, by the sum of their logits. The authors' program
bans one cuboid after the other instead and may end with none.
"""

from dataclasses import dataclass, field

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from .program_lines import COMMAND, COMMANDS, FIELD, MAX_CUBOIDS

DECLARING, ATTACHING, COPYING = range(3)
_MAY_FOLLOW = {  # phase -> commands
    DECLARING: ("Cuboid", "attach", "squeeze", "end"),
    ATTACHING: ("attach", "squeeze", "reflect", "translate", "end"),
    COPYING: ("reflect", "translate", "end"),
}
_ORDER = torch.tensor([[name in _MAY_FOLLOW[phase] for name in COMMANDS] for phase in _MAY_FOLLOW])
_PHASE_AFTER = torch.tensor([{"Cuboid": 0, "attach": 1, "squeeze": 1}.get(name, 2) for name in COMMANDS])
_UPRIGHT_FACES = torch.tensor([False, False, True, True, False, False])  # top and bot among FACES
BBOX_ATTACHES = 2


@dataclass(frozen=True)
class Rules:
    """Tolerances of the rules. The defaults are the paper's; AUTHORS has those of its program, which are looser.

    near     how far from the top or bottom face an attach to the bbox may be, as a share of its height
    outside  how far cuboids may reach beyond the bbox, as a share of its half sides
    most     copies that one translate may make (36 is the most in real programs)
    """

    near: float = 0.05
    outside: float = 0.1
    most: int = 50


AUTHORS = Rules(near=0.1, outside=0.5)


@dataclass
class BlockStates:
    """What has been written of n blocks so far, as far as the rules ask.

    declared  (n,) number of cuboids, the bbox included
    grounded  (n, 11) connected to the bbox
    joined    (n, 11, 11) these two were attached to one another, either way
    on_bbox   (n, 11) how often each was attached to the bbox
    center    (n, 11, 3) where each cuboid is
    phase     (n,)
    """

    declared: Int[Tensor, " n"]
    grounded: Bool[Tensor, "n 11"]
    joined: Bool[Tensor, "n 11 11"]
    on_bbox: Int[Tensor, "n 11"]
    center: Float[Tensor, "n 11 3"]
    phase: Int[Tensor, " n"]
    _rows: Tensor = field(init=False, repr=False)

    @classmethod
    def new(cls, n: int) -> "BlockStates":
        """n blocks of which only the bbox line is written."""
        grounded = torch.zeros(n, MAX_CUBOIDS, dtype=torch.bool)
        grounded[:, 0] = True
        return cls(
            torch.ones(n, dtype=torch.long),
            grounded,
            torch.zeros(n, MAX_CUBOIDS, MAX_CUBOIDS, dtype=torch.bool),
            torch.zeros(n, MAX_CUBOIDS, dtype=torch.long),
            torch.zeros(n, MAX_CUBOIDS, 3),
            torch.full((n,), DECLARING),
        )

    def __post_init__(self) -> None:
        self._rows = torch.arange(len(self.declared))

    def __getitem__(self, rows: Tensor) -> "BlockStates":
        return BlockStates(*(getattr(self, name)[rows] for name in self._names()))

    def put(self, rows: Tensor, states: "BlockStates") -> None:
        """Replace the states of some blocks."""
        for name in self._names():
            getattr(self, name)[rows] = getattr(states, name)

    @staticmethod
    def _names() -> tuple[str, ...]:
        return ("declared", "grounded", "joined", "on_bbox", "center", "phase")

    def pairs(self) -> Bool[Tensor, "n 11 11"]:
        """[moved, still]: attaches that are allowed."""
        known = torch.arange(MAX_CUBOIDS) < self.declared[:, None]
        moved = known.clone()
        moved[:, 0] = False
        allowed = moved[:, :, None] & (known & self.grounded)[:, None, :] & ~self.joined
        allowed[:, :, 0] &= self.on_bbox < BBOX_ATTACHES
        return allowed & ~torch.eye(MAX_CUBOIDS, dtype=torch.bool)

    def triples(self) -> Bool[Tensor, "n 11 11 11"]:
        """[moved, first, second]: squeezes that are allowed."""
        pairs = self.pairs()
        allowed = pairs[:, :, :, None] & pairs[:, :, None, :]
        allowed &= ~torch.eye(MAX_CUBOIDS, dtype=torch.bool)
        between = pairs[:, :, 0] & (self.on_bbox == 0)  # the bbox on both sides, as a leg's and a post's
        allowed[:, :, 0, 0] = between
        return allowed

    def reflections(self) -> Bool[Tensor, "n 11 3"]:
        """[source, axis]: reflects that are allowed."""
        return self.sources()[:, :, None] & (self.center <= 0)

    def sources(self) -> Bool[Tensor, "n 11"]:
        """Cuboids that may be translated."""
        known = torch.arange(MAX_CUBOIDS) < self.declared[:, None]
        known[:, 0] = False
        return known & self.grounded

    def commands(self) -> Bool[Tensor, "n 7"]:
        """Commands for which some choice of cuboids is allowed."""
        allowed = _ORDER[self.phase].clone()
        allowed[:, COMMAND["Cuboid"]] &= self.declared < MAX_CUBOIDS
        allowed[:, COMMAND["attach"]] &= self.pairs().flatten(1).any(1)
        allowed[:, COMMAND["squeeze"]] &= self.triples().flatten(1).any(1)
        allowed[:, COMMAND["reflect"]] &= self.reflections().flatten(1).any(1)
        allowed[:, COMMAND["translate"]] &= self.sources().any(1)
        return allowed

    def faces(self, cuboids: Int[Tensor, "n 3"]) -> Bool[Tensor, "n 6"]:
        """Faces that a squeeze may use: where the bbox is a partner, its top or bottom is what is met."""
        return _UPRIGHT_FACES | (cuboids[:, 1:] != 0).all(1, keepdim=True)

    def after(self, lines: Float[Tensor, "n 63"]) -> "BlockStates":
        """The states when each block has one more line, but for the centers, which only running it tells."""
        state = BlockStates(*(getattr(self, name).clone() for name in self._names()))
        command = lines[:, FIELD["command"]].argmax(-1)
        state.phase = torch.where(command == COMMAND["end"], state.phase, _PHASE_AFTER[command])
        state.declared += command == COMMAND["Cuboid"]
        moved = lines[:, FIELD["first"]].argmax(-1)
        for name in ("second", "third"):
            partner = lines[:, FIELD[name]]
            rows = self._rows[partner.any(-1)]
            state._join(rows, moved[rows], partner[rows].argmax(-1))
        return state

    def _join(self, rows: Tensor, moved: Tensor, still: Tensor) -> None:
        self.grounded[rows, moved] = True
        bbox = still == 0
        self.on_bbox[rows[bbox], moved[bbox]] += 1
        rows, moved, still = rows[~bbox], moved[~bbox], still[~bbox]
        self.joined[rows, moved, still] = True
        self.joined[rows, still, moved] = True


def best(logits: Float[Tensor, "n *choices"], allowed: Bool[Tensor, "n *choices"]) -> Int[Tensor, "n d"]:
    """Of each row, the allowed choice with the highest logit, as indices into `choices`."""
    masked = logits.masked_fill(~allowed, -torch.inf).flatten(1).argmax(1)
    return torch.stack(torch.unravel_index(masked, logits.shape[1:]), -1)
