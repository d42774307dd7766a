"""What may be written next: the semantic rules of the ShapeAssembly paper's Appendix D, for many blocks at once.

    order      Cuboid*, then (attach | squeeze)*, then (reflect | translate)*; at most 10 cuboids beside the bbox
    attach     a declared cuboid, to the bbox or to a cuboid that is grounded; the same two cuboids only once, the bbox
               once at its top and once at its bottom; never the bbox itself
    squeeze    likewise for both partners; of the bbox only the top and bottom faces
    reflect    a grounded cuboid, from the negative side of the plane to the positive one (the side is not the paper's
               rule, but its authors' program's; all real programs keep it)
    translate  a grounded cuboid

A choice that breaks a rule is never made: its logit is left out, and the best of those that remain is taken. For the
cuboids of an attach or squeeze that is the best *pair* or *triple*, by the sum of their logits. The authors' program
bans one cuboid after the other instead and may end with none. What numbers may be is for `writing_line`, whether
cuboids stay in their bounding box for `writing_level`.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from ..interpreters.shapeassembly.program import FACES
from .program_lines import COMMAND, COMMANDS, FIELD, MAX_CUBOIDS

DECLARING, ATTACHING, COPYING = range(3)
_MAY_FOLLOW = {  # phase -> commands
    DECLARING: ("Cuboid", "attach", "squeeze", "end"),
    ATTACHING: ("attach", "squeeze", "reflect", "translate", "end"),
    COPYING: ("reflect", "translate", "end"),
}
_ORDER = torch.tensor([[name in _MAY_FOLLOW[phase] for name in COMMANDS] for phase in _MAY_FOLLOW])
_PHASE_AFTER = torch.tensor([{"Cuboid": 0, "attach": 1, "squeeze": 1}.get(name, 2) for name in COMMANDS])
_BOTTOM, _TOP = 0, 1  # of the bbox
_FACE_TOP, _FACE_BOTTOM = FACES.index("top"), FACES.index("bot")
_DIFFERENT = ~torch.eye(MAX_CUBOIDS, dtype=torch.bool)


@dataclass(frozen=True)
class Rules:
    """Tolerances of the rules. The defaults are the paper's; AUTHORS has those of its program, which are looser.

    near       how far from the top or bottom face an attach to the bbox may be, as a share of its height
    outside    how far cuboids may reach beyond the bbox, as a share of its half sides
    same_side  whether a cuboid may be attached to the top of the bbox twice, or to its bottom
    most       copies that one translate may make: not a rule of theirs (36 is the most in real programs)
    """

    near: float = 0.05
    outside: float = 0.1
    same_side: bool = False
    most: int = 50


AUTHORS = Rules(near=0.1, outside=0.5, same_side=True)


@dataclass
class BlockStates:
    """What has been written of n blocks so far, as far as the rules ask.

    declared   (n,) number of cuboids, the bbox included
    grounded   (n, 11) connected to the bbox
    joined     (n, 11, 11) these two were attached to one another, either way
    on_bbox    (n, 11, 2) how often each was attached to the bottom and to the top of the bbox
    center     (n, 11, 3) where each cuboid is; only running the lines tells, so others keep it
    phase      (n,)
    same_side  as in Rules
    """

    declared: Int[Tensor, " n"]
    grounded: Bool[Tensor, "n 11"]
    joined: Bool[Tensor, "n 11 11"]
    on_bbox: Int[Tensor, "n 11 2"]
    center: Float[Tensor, "n 11 3"]
    phase: Int[Tensor, " n"]
    same_side: bool = False

    @classmethod
    def new(cls, n: int, same_side: bool = False) -> "BlockStates":
        """n blocks of which only the bbox line is written."""
        grounded = torch.zeros(n, MAX_CUBOIDS, dtype=torch.bool)
        grounded[:, 0] = True
        return cls(
            torch.ones(n, dtype=torch.long),
            grounded,
            torch.zeros(n, MAX_CUBOIDS, MAX_CUBOIDS, dtype=torch.bool),
            torch.zeros(n, MAX_CUBOIDS, 2, dtype=torch.long),
            torch.zeros(n, MAX_CUBOIDS, 3),
            torch.full((n,), DECLARING),
            same_side,
        )

    def __getitem__(self, rows: Tensor) -> "BlockStates":
        """The states of some blocks, copied."""
        parts = (self.declared, self.grounded, self.joined, self.on_bbox, self.center, self.phase)
        return BlockStates(*(part[rows] for part in parts), self.same_side)

    def movable(self) -> Bool[Tensor, "n 11"]:
        """Cuboids that are declared, but for the bbox."""
        known = torch.arange(MAX_CUBOIDS) < self.declared[:, None]
        known[:, 0] = False
        return known

    def sides(self) -> Bool[Tensor, "n 11 2"]:
        """Whether each cuboid may still be attached to the bottom and to the top of the bbox."""
        once = self.on_bbox.sum(-1, keepdim=True) < 2
        return once & ((self.on_bbox == 0) | self.same_side)

    def pairs(self) -> Bool[Tensor, "n 11 11"]:
        """[moved, still]: attaches that are allowed."""
        allowed = self.movable()[:, :, None] & self.grounded[:, None, :] & ~self.joined & _DIFFERENT
        allowed[:, :, 0] &= self.sides().any(-1)
        return allowed

    def between(self) -> Bool[Tensor, "n 11"]:
        """Cuboids that may be squeezed between the bottom and the top of the bbox, as a post is."""
        return self.movable() & (self.on_bbox == 0).all(-1)

    def triples(self) -> Bool[Tensor, "n 11 11 11"]:
        """[moved, first, second]: squeezes that are allowed."""
        pairs = self.pairs()
        allowed = pairs[:, :, :, None] & pairs[:, :, None, :] & _DIFFERENT
        allowed[:, :, 0, 0] = self.between()
        return allowed

    def sources(self) -> Bool[Tensor, "n 11"]:
        """Cuboids that may be translated."""
        return self.movable() & self.grounded

    def reflections(self) -> Bool[Tensor, "n 11 3"]:
        """[source, axis]: reflects that are allowed."""
        return self.sources()[:, :, None] & (self.center <= 0)

    def commands(self) -> Bool[Tensor, "n 7"]:
        """Commands for which some choice of cuboids is allowed."""
        allowed, pairs = _ORDER[self.phase], self.pairs()
        allowed[:, COMMAND["Cuboid"]] &= self.declared < MAX_CUBOIDS
        allowed[:, COMMAND["attach"]] &= pairs.flatten(1).any(1)
        allowed[:, COMMAND["squeeze"]] &= ((pairs.sum(2) >= 2) | self.between()).any(1)
        allowed[:, COMMAND["reflect"]] &= self.reflections().flatten(1).any(1)
        allowed[:, COMMAND["translate"]] &= self.sources().any(1)
        return allowed

    def faces(self, cuboids: Int[Tensor, "n 3"]) -> Bool[Tensor, "n 6"]:
        """Faces that a squeeze of these cuboids may use: of the bbox, its top or its bottom is what is met."""
        moved, first, second = cuboids[:, 0], cuboids[:, 1] == 0, cuboids[:, 2] == 0
        sides = self.sides()[torch.arange(len(moved)), moved]
        allowed = ~(first | second)[:, None].repeat(1, len(FACES))
        for face, met, opposite in ((_FACE_TOP, _TOP, _BOTTOM), (_FACE_BOTTOM, _BOTTOM, _TOP)):
            allowed[:, face] = (~first | sides[:, met]) & (~second | sides[:, opposite])
        return allowed

    def add(self, rows: Int[Tensor, " k"], lines: Float[Tensor, "k 63"]) -> None:
        """These blocks have one line more. The centers are left as they are."""
        command = lines[:, FIELD["command"]].argmax(-1)
        self.phase[rows] = _PHASE_AFTER[command]
        self.declared[rows] += command == COMMAND["Cuboid"]
        moved, face = lines[:, FIELD["first"]].argmax(-1), lines[:, FIELD["face"]].argmax(-1)
        squeezed = command == COMMAND["squeeze"]
        high = torch.where(squeezed, face == _FACE_TOP, lines[:, FIELD["place"]][:, 1] > 0.5)
        for partner, side in (
            ("second", high),
            ("third", ~high),
        ):  # a squeeze meets its partners from two sides
            cuboids = lines[:, FIELD[partner]]
            at = cuboids.any(-1)
            self._join(rows[at], moved[at], cuboids[at].argmax(-1), side[at].long())

    def _join(self, rows: Tensor, moved: Tensor, still: Tensor, side: Tensor) -> None:
        self.grounded[rows, moved] = True
        bbox = still == 0
        self.on_bbox[rows[bbox], moved[bbox], side[bbox]] += 1
        rows, moved, still = rows[~bbox], moved[~bbox], still[~bbox]
        self.joined[rows, moved, still] = True
        self.joined[rows, still, moved] = True


def best(logits: Float[Tensor, "n *choices"], allowed: Bool[Tensor, "n *choices"]) -> Int[Tensor, "n d"]:
    """Of each row, the allowed choice with the highest logit, as indices into `choices`.

    Logits that are not finite count as very large, very small or (nan) as 0: an allowed choice is always found where
    there is one.
    """
    masked = logits.nan_to_num().masked_fill(~allowed, -torch.inf).flatten(1).argmax(1)
    return torch.stack(torch.unravel_index(masked, logits.shape[1:]), -1)
