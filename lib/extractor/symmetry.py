"""Stage 8: which parts of a block are copies of one another (paper, section 5.1 "Symmetry" and Appendix C).

Parts form a group if (i) they touch the same parts, (ii) one is the mirror image of the other, or all are evenly
spaced, along the x, y or z axis of the block's box, and (iii) so are the places where they touch. Only the first
member of a group is written down; `reflect` or `translate` makes the others.

The longest rows (three and more members) are taken first, then mirrored pairs about X, Y, Z, then rows of two. Inner
parts are compared with all that is in them, as the language would copy it.

Condition (i) of the paper keeps copies from going where they hold something that would fall without them. We ask for
exactly that, and so find more groups: members must touch at least one part in common, at corresponding places (the
source is then held by such parts only, since its copies will be too), and without the copies everything else must
still lead to the bounding box and be held as well as before. The first slat of a row may touch the seat, and the
last one the head.
"""

from collections.abc import Sequence
from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..interpreters.cuboids import Cuboids
from ..interpreters.shapeassembly.program import AXES
from .contacts import BOTTOM, TOP, Contact
from .errors import RejectedError
from .facts import BlockFacts, Group
from .ordering import grounded_order
from .partgraph import Part, stack
from .placing import Way, bounding_box

ALIKE = 0.015  # share of the block's longest side: how far corners of a copy may lie from where they should
ALIKE_IF_MANY = 0.03  # the same for shapes that would need too many cuboids otherwise: regular before exact
UNEVEN = 0.1  # share of the spacing of a row: how far a member may be from its place (the authors' program)
SAME_POINT = (
    0.1  # share of the block's longest side, for the places where copies touch other parts (the authors: 0.1)
)


def find_groups(facts: BlockFacts, alike: float = ALIKE) -> list[Group]:
    """Groups of a block's parts; `facts.ways` are all ways to hold them. No part is in two groups.

    Raises RejectedError ("disconnected") when the parts do not hang together even without groups.
    """
    parts, boxes, size = facts.parts, facts.boxes, facts.size
    rows = find_rows(parts, boxes, size, alike)
    candidates = sorted((row for row in rows if len(row.members) > 2), key=lambda row: -len(row.members))
    mirrored = mirror_images(parts, boxes, size, alike).nonzero().tolist()
    candidates += [Group("reflect", AXES[axis], (i, j)) for axis, i, j in mirrored]
    candidates += [row for row in rows if len(row.members) == 2]
    touched = touched_parts(len(parts), facts.contacts)
    alone = grounded_order(facts.written, facts.open_ways, facts.label)
    grouped = replace(facts, groups=())
    for group in candidates:
        if any(not set(group.members).isdisjoint(other.members) for other in grouped.groups):
            continue
        holds = frozenset(common_holds(group, touched, facts))
        more = replace(grouped, groups=(*grouped.groups, replace(group, holds=holds)))
        if holds and not loses(more, alone):
            grouped = more
    return list(grouped.groups)


def loses(facts: BlockFacts, alone: list[Way]) -> bool:
    """Would parts fall, or fit worse, if of each group only the source were written down?

    alone   how the parts are held when all are written down
    """
    try:
        order = grounded_order(facts.written, facts.open_ways)
    except RejectedError:
        return True
    before = {way.cuboid: way.preference[0] for way in alone}
    return sum(way.preference[0] - before[way.cuboid] for way in order) > 0


def touched_parts(count: int, contacts: tuple[Contact, ...]) -> list[dict[int, Tensor]]:
    """For each part the parts (or BOTTOM, TOP) that it touches, and where."""
    touched: list[dict[int, Tensor]] = [{} for _ in range(count)]
    for contact in contacts:
        place = torch.tensor(contact.point, dtype=torch.float64)
        for cuboid in (contact.first, contact.second):
            if contact.firm and cuboid not in (BOTTOM, TOP):
                touched[cuboid][contact.partner(cuboid)] = place
    return touched


def common_holds(group: Group, touched: list[dict[int, Tensor]], facts: BlockFacts) -> set[int]:
    """The parts outside the group that all its members touch, at corresponding places that lie in them."""
    source, axis, longest = group.members[0], AXES.index(group.axis), float(facts.size.max())
    common = touched[source].keys() - set(group.members)
    for member in group.members[1:]:
        shift = facts.boxes.center[member, axis] - facts.boxes.center[source, axis]
        for partner in list(common):
            image = touched[source][partner].clone()
            image[axis] = -image[axis] if group.kind == "reflect" else image[axis] + shift
            there = touched[member].get(partner)
            if there is None or float((image - there).norm()) > SAME_POINT * longest:
                common.discard(partner)
            elif float((image - into(facts, partner, image)).norm()) > ALIKE * longest:
                common.discard(partner)
    return common


def into(facts: BlockFacts, partner: int, place: Float[Tensor, "3"]) -> Float[Tensor, "3"]:
    """Where a copy is attached to a partner: the place itself, or the point of the partner's box nearest to it."""
    box = facts.boxes[partner] if partner not in (BOTTOM, TOP) else bounding_box(facts.size)
    return box.world(box.local(place).clamp(0, 1))


def mirror_images(
    parts: Sequence[Part], boxes: Cuboids, size: Float[Tensor, "3"], alike: float = ALIKE
) -> Bool[Tensor, "3 n n"]:
    """[axis, i, j]: part j is what `reflect` makes of part i, and i is the one on the lower side."""
    tolerance = alike * float(size.max())
    corners, mirrors = boxes.corners(), 1 - 2 * torch.eye(3, dtype=torch.float64)
    images = corner_gap(corners * mirrors.view(3, 1, 1, 3), corners.expand(3, -1, -1, -1)) <= tolerance
    place = boxes.center.mT
    images &= (place[:, :, None] < -tolerance / 2) & (place[:, None] > tolerance / 2)
    for axis, i, j in images.nonzero().tolist():
        images[axis, i, j] = is_image(parts[i], parts[j], axis, tolerance)
    return images


def is_image(first: Part, second: Part, axis: int, tolerance: float) -> bool:
    """Does `second` hold what `reflect` would make of what is in `first`?"""
    mirror = torch.ones(3, dtype=torch.float64)
    mirror[axis] = -1
    return same_inside(first, second, lambda corners: corners * mirror, tolerance, turned=True)


def find_rows(
    parts: Sequence[Part], boxes: Cuboids, size: Float[Tensor, "3"], alike: float = ALIKE
) -> list[Group]:
    """Evenly spaced rows of at least two equal parts along x, y and z."""
    tolerance, along = alike * float(size.max()), torch.eye(3, dtype=torch.float64)
    # All moved to the middle of the axis: (axis, n, 8, 3)
    corners = boxes.corners() - (boxes.center * along.unsqueeze(1)).unsqueeze(2)
    equal = (corner_gap(corners, corners) <= tolerance).tolist()
    rows = []
    for axis, position in enumerate(boxes.center.mT.tolist()):
        left = sorted(range(len(parts)), key=lambda part: position[part])  # noqa: B023, used at once
        while left:
            first = left[0]
            row = [
                part
                for part in left
                if equal[axis][first][part] and _shifted(parts[first], parts[part], along[axis], tolerance)
            ]
            for run in even_runs(row, position, tolerance):
                distance = (position[run[-1]] - position[run[0]]) / float(size[axis])
                rows.append(Group("translate", AXES[axis], tuple(run), distance))
            left = [part for part in left if part not in row]
    return rows


def _shifted(first: Part, second: Part, along: Float[Tensor, "3"], tolerance: float) -> bool:
    """Does `second` hold what `first` holds, moved along the axis?"""
    step = (second.box.center - first.box.center) * along
    return same_inside(first, second, lambda corners: corners + step, tolerance)


def even_runs(row: list[int], position: list[float], tolerance: float) -> list[list[int]]:
    """A row of parts cut into evenly spaced runs of at least two, from low to high."""
    runs, start = [], 0
    while start < len(row) - 1:
        stop = start + 2
        while stop < len(row) and _even([position[part] for part in row[start : stop + 1]], tolerance):
            stop += 1
        if position[row[start + 1]] - position[row[start]] > tolerance / 100:  # two at one place are no row
            runs.append(row[start:stop])
        start = stop
    return runs


def _even(places: list[float], tolerance: float) -> bool:
    step = (places[-1] - places[0]) / (len(places) - 1)
    allowed = min(tolerance, UNEVEN * step)
    return max(abs(place - places[0] - k * step) for k, place in enumerate(places)) <= allowed


def corner_gap(
    a: Float[Tensor, "*axes n 8 3"], b: Float[Tensor, "*axes m 8 3"]
) -> Float[Tensor, "*axes n m"]:
    """How far the farthest corner of box i of a is from the nearest of box j of b; names of axes do not matter."""
    gaps = torch.cdist(a.flatten(-3, -2), b.flatten(-3, -2))  # (*axes, n * 8, m * 8)
    return gaps.unflatten(-1, (-1, 8)).amin(-1).unflatten(-2, (-1, 8)).amax(-2)


def same_inside(first: Part, second: Part, image, tolerance: float, turned: bool = False) -> bool:
    """Is what lies inside `second` the `image` of what lies inside `first`, leaf by leaf? Leaves: always."""
    if first.is_leaf or second.is_leaf:
        return first.is_leaf and second.is_leaf
    copied = stack(first.leaves())
    if turned:
        copied = Cuboids(copied.size, torch.stack(_copied_centers(first)), copied.axes)
    theirs = stack(second.leaves())
    if len(copied) != len(theirs):
        return False
    alike = corner_gap(image(copied.corners()), theirs.corners()) <= tolerance
    return bool(alike.any(0).all() and alike.any(1).all())


def _copied_centers(part: Part) -> list[Tensor]:
    """Centers of the leaves as the language mirrors them, before mirroring.

    Only a block's own cuboids are mirrored. A filled cuboid in a mirrored block is turned by half a turn instead, so
    what lies deeper comes out as if it had been reflected through that cuboid's center.
    """
    centers = []
    for child in part.children:
        for leaf in child.leaves():
            centers.append(leaf.box.center if child.is_leaf else 2 * child.box.center - leaf.box.center)
    return centers
