"""What is found out about one block, stage by stage, before its text is written."""

from dataclasses import dataclass

from jaxtyping import Bool, Float
from torch import Tensor

from ..interpreters.cuboids import Cuboids
from .contacts import Contact
from .partgraph import Part
from .placing import Way

AS_GOOD = (
    0.004  # misfits that differ by less than this share of the block's diagonal are as good as each other
)


@dataclass(frozen=True)
class Group:
    """Copies of one part: `members[0]` is written down. `kind` is "reflect" or "translate", `axis` X, Y or Z."""

    kind: str
    axis: str
    members: tuple[int, ...]
    distance: float = 0.0  # of the last member of a row from the first, as a share of the block's side
    holds: frozenset[int] = frozenset()  # parts that hold the source, as their images hold the copies


@dataclass(frozen=True, eq=False)
class BlockFacts:
    """All that is known about one node: its parts in their semantic order, seen from its box.

    boxes, aligned  the parts' boxes (n), straightened, and which of them stand upright in the node's box
    size            (3,) of the node's box
    contacts        between all parts;  groups  of copies
    ways            how parts can be held, the best first; in the end, how each written part is, in grounded order
    inner           facts about the written parts that have parts themselves, by index
    """

    parts: tuple[Part, ...]
    boxes: Cuboids
    aligned: Bool[Tensor, " n"]
    size: Float[Tensor, "3"]
    contacts: tuple[Contact, ...] = ()
    groups: tuple[Group, ...] = ()
    ways: tuple[Way, ...] = ()
    inner: "dict[int, BlockFacts] | None" = None

    @property
    def tolerance(self) -> float:
        """Misfits are compared in steps of this size, block units."""
        return AS_GOOD * float(self.size.norm())

    def label(self, part: int) -> str:
        """What a part is called in messages."""
        return self.parts[part].label

    @property
    def copies(self) -> set[int]:
        """Parts that a macro makes."""
        return {member for group in self.groups for member in group.members[1:]}

    @property
    def written(self) -> list[int]:
        """Parts that get a line: all but the copies."""
        return [i for i in range(len(self.parts)) if i not in self.copies]

    @property
    def open_ways(self) -> list[Way]:
        """The ways that are left when copies are not written down, and sources are held as their copies will be."""
        copies, holds = self.copies, {group.members[0]: group.holds for group in self.groups}
        return [
            way
            for way in self.ways
            if way.cuboid not in copies
            and copies.isdisjoint(way.partners)
            and (way.cuboid not in holds or holds[way.cuboid].issuperset(way.partners))
        ]
