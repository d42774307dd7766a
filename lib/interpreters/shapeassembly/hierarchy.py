"""From blocks, each in its own frame, to placed shapes: which boxes a program has, and where they stand.

A cuboid that a block fills is that block's box: its contents are scaled to it, turned with it and moved to it.
Which boxes there are depends on the text alone; `Layout` holds that. `place` then works through all programs of a
batch at once, one level of the hierarchies at a time.
"""

from dataclasses import dataclass, field

import torch
from torch import Tensor

from ..cuboids import Cuboids, concatenate
from .compiling import Expansion
from .program import Program

NO_FLIP = -1


@dataclass
class Layout:
    """The boxes of a batch of programs, program by program, breadth-first: the root box, then its contents, …

    Lists with an entry per box. `row` is the cuboid's row in the machine, `bbox` that of its block's bbox line;
    `flip` the axis about which its block is mirrored (-1: not).
    """

    name: list[str] = field(default_factory=list)
    parent: list[int] = field(default_factory=list)  # box it lies in; -1 for a root
    row: list[int] = field(default_factory=list)
    bbox: list[int] = field(default_factory=list)
    flip: list[int] = field(default_factory=list)
    level: list[int] = field(default_factory=list)
    part: list[int] = field(default_factory=list)  # statement row it stems from: clones share their source's
    leaf: list[bool] = field(default_factory=list)
    start: list[int] = field(default_factory=lambda: [0])  # first box of each program, and the end

    def add(self, program: Program, expansions: dict[str, Expansion]) -> None:
        """Append the boxes of one program, given where its blocks' cuboids stand in the machine."""
        root = expansions[program.blocks[0].name]
        waiting = [(len(self.name), program.blocks[0].name, NO_FLIP, 1)]
        self._box(program.blocks[0].name, -1, root.rows["bbox"], root.rows["bbox"], NO_FLIP, 0, 0, False)
        for parent, block, flip, level in waiting:  # grows while it is walked: a queue
            expansion = expansions[block]
            for name, row in list(expansion.rows.items())[1:]:
                source = expansion.source.get(name, name)
                inner = source in expansions
                if inner:
                    waiting.append((len(self.name), source, expansion.flip.get(name, NO_FLIP), level + 1))
                part = expansion.rows[source]
                self._box(name, parent, row, expansion.rows["bbox"], flip, level, part, not inner)
        self.start.append(len(self.name))

    def _box(self, name, parent, row, bbox, flip, level, part, leaf) -> None:
        self.name.append(name)
        self.parent.append(parent)
        self.row.append(row)
        self.bbox.append(bbox)
        self.flip.append(flip)
        self.level.append(level)
        self.part.append(part)
        self.leaf.append(leaf)

    def path(self, box: int) -> str:
        """Full name such as `Program_0/Program_1/cube0`."""
        names = []
        while box >= 0:
            names.append(self.name[box])
            box = self.parent[box]
        return "/".join(reversed(names))


def place(layout: Layout, state: Cuboids) -> Cuboids:
    """World boxes (variants, boxes) of a layout, from the machine's cuboids (variants, rows).

    Quirk: contents are scaled in size, componentwise and in their own axes, but their positions are not: it shows
    when attachments changed the size of a filled box.
    """
    if not layout.name:
        return state[:, :0]
    device = state.size.device
    row, parent, bbox, flip, level = (
        torch.tensor(numbers, device=device)
        for numbers in (layout.row, layout.parent, layout.bbox, layout.flip, layout.level)
    )
    order = level.argsort(stable=True)
    position = order.argsort()  # where a box stands once sorted by level
    levels: list[Cuboids] = []
    placed = 0  # boxes on all levels above the one above
    for boxes in order.split(level.bincount().tolist()):
        own = _mirrored(state[:, row[boxes]], flip[boxes])
        if levels:
            within = levels[-1][:, position[parent[boxes]] - placed]
            own = _inside(own, state.size[:, bbox[boxes]], within)
            placed += levels[-1].size.shape[1]
        levels.append(own)
    return concatenate(levels, dim=1)[:, position]


def _mirrored(cuboids: Cuboids, flip: Tensor) -> Cuboids:
    """Mirror images about the plane through the block's center, where `flip` names an axis.

    Axes are negated twice over, so that they stay right-handed; a cuboid looks the same. Quirk: a filled box in a
    mirrored block is turned by that, but what is inside it is not mirrored.
    """
    flipped = (flip >= 0)[:, None]
    mirror = 1 - 2 * (torch.nn.functional.one_hot(flip.clamp(min=0), 3) * flipped).to(cuboids.size)
    turn = torch.where(flipped, -mirror, 1.0)
    return Cuboids(cuboids.size, cuboids.center * mirror, cuboids.axes * turn.unsqueeze(-2))


def _inside(cuboids: Cuboids, written: Tensor, box: Cuboids) -> Cuboids:
    """Cuboids of a block whose bbox is `written` in size, put into the box that the block fills."""
    center = (cuboids.center.unsqueeze(-2) @ box.axes).squeeze(-2) + box.center
    return Cuboids(cuboids.size * (box.size / written), center, cuboids.axes @ box.axes)
