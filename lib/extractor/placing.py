"""Stage 9: every way to hold a cuboid in place by one or two of its contacts, and how well each does it.

A way is a squeeze, two attaches, or one. Each is tried with the language's own rules (lib.interpreters): the cuboid
starts upright at the origin, as a program declares it, its partners stand where they belong, and the ways of all
cuboids of a block are one batch. `misfit` is how far the cuboid's corners end up from where they should be.

Where a chair stands on four splayed legs and leans on two slanted posts, every tilted part needs the seat to be turned
right, and the seat needs them. Then the seat may be attached to a point inside the bounding box, which is always there:
the last resort of cuboids that stand upright.

A squeeze (paper, section 4) needs contacts at the centers of two opposite faces, at the same place (u, v) of the two
partners. Its first attach decides where the cuboid stands; (u, v) of the second may differ a little.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..interpreters.cuboids import Cuboids, concatenate
from ..interpreters.shapeassembly.attaching import move, stretch_and_turn
from ..interpreters.shapeassembly.growing import grow
from ..interpreters.shapeassembly.program import FACES
from .contacts import BBOX_REACH, BOTTOM, INSIDE, MIDDLE, TILTED_REACH, TOP, Contact
from .partgraph import stack_boxes
from .snapping import turning_axis

DIGITS = 3  # decimals of local coordinates in the text, as in the authors' data set
AT_CENTER = (
    0.05  # how far (L1, local) a contact may be from a face's center for a squeeze (the authors' program)
)
SAME_PLACE = (
    0.15  # how far (L1, local) the (u, v) of a squeeze's two partners may differ (the authors' program)
)
MOST_ENDS = 16  # contacts that are tried in pairs: a cuboid with more has plenty of good ones among the first
APART = 0.1  # how far apart (L1, local) two contacts must be on a cuboid to be two (the authors' program)

# face name -> (axis, side) in local coordinates
_FACE_SIDE = dict(zip(FACES, [(0, 1), (0, 0), (1, 1), (1, 0), (2, 1), (2, 0)]))
_FACE_CENTER = {
    face: tuple(float(side) if k == axis else 0.5 for k in range(3))
    for face, (axis, side) in _FACE_SIDE.items()
}
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Way:
    """One way to hold `cuboid`: the partners in order, and for each the local points (on it, on the partner)."""

    cuboid: int
    partners: tuple[int, ...]  # cuboids of the block, or BOTTOM, TOP or INSIDE of its box
    points: tuple[tuple[Point, Point], ...]
    kinds: tuple[int, ...] = ()  # of the contacts
    face: str = ""  # of a squeeze
    misfit: float = 0.0  # block units
    preference: tuple = ()  # see `ordering`: the lower, the better


@dataclass(frozen=True)
class End:
    """A contact seen from the cuboid that is to be held: the partner, and where on both."""

    partner: int
    on_cuboid: Point
    on_partner: Point
    kind: int


def ways_to_place(
    cuboid: int,
    contacts: Sequence[Contact],
    boxes: Cuboids,
    size: Float[Tensor, "3"],
    tilted: bool,
    squeezes: bool = True,
) -> list[Way]:
    """Every way to hold `cuboid` by its contacts, not yet judged."""
    ends = _ends(cuboid, contacts)
    ways = [Way(cuboid, (end.partner,), ((end.on_cuboid, end.on_partner),), (end.kind,)) for end in ends]
    if ends and not tilted:
        ways.append(_last_resort(cuboid, boxes, size))
    pairs = list(permutations(ends, 2))
    twice = [_two_attaches(cuboid, first, second) for first, second in pairs]
    if squeezes:
        twice += [_squeeze(cuboid, *pair, face) for pair in pairs if (face := _squeezed_face(*pair))]
    if tilted and pairs:
        twice += [_two_attaches(cuboid, *pair) for pair in _aimed(boxes[cuboid], boxes, size, pairs)]
    return ways + [way for way in twice if _distance(way.points[0][0], way.points[1][0]) >= APART]


def _ends(cuboid: int, contacts: Sequence[Contact]) -> list[End]:
    """The cuboid's contacts: all with the bounding box, and the best of the others."""
    ends = [
        End(c.partner(cuboid), _rounded(c.at(cuboid)), _rounded(c.at(c.partner(cuboid))), c.kind)
        for c in contacts
        if cuboid in (c.first, c.second)
    ]
    by_bbox, by_parts = [end for end in ends if end.partner < 0], [end for end in ends if end.partner >= 0]
    return by_bbox + sorted(by_parts, key=lambda end: end.kind)[:MOST_ENDS]


def _last_resort(cuboid: int, boxes: Cuboids, size: Float[Tensor, "3"]) -> Way:
    """The cuboid's center attached to where it belongs in the bounding box."""
    place = bounding_box(size).local(boxes.center[cuboid]).clamp(0, 1).tolist()
    return Way(cuboid, (INSIDE,), (((0.5, 0.5, 0.5), _rounded(place)),), (MIDDLE,))


def _squeeze(cuboid: int, first: End, second: End, face: str) -> Way:
    points = squeeze_points(face, first.partner, second.partner, first.on_partner)
    return Way(cuboid, (first.partner, second.partner), points, (first.kind, second.kind), face)


def _two_attaches(cuboid: int, first: End, second: End) -> Way:
    points = tuple((end.on_cuboid, end.on_partner) for end in (first, second))
    return Way(cuboid, (first.partner, second.partner), points, (first.kind, second.kind))


def _aimed(
    box: Cuboids, boxes: Cuboids, size: Float[Tensor, "3"], pairs: list[tuple[End, End]]
) -> list[tuple[End, End]]:
    """Pairs of contacts moved within what the boxes share, so that they turn a tilted cuboid the right way.

    The second attach turns a cuboid by as little as possible, and only a line of contacts that is normal to the axis
    of its turn is turned right by that. So the second place moves along that axis, or the first, or both by half.
    """
    turn = turning_axis(box.axes)
    box = Cuboids(*(x.expand(3 * len(pairs), *x.shape) for x in (box.size, box.center, box.axes)))
    first, second = zip(*pairs * 3)
    places = [
        box.world(torch.tensor([end.on_cuboid for end in ends], dtype=torch.float64))
        for ends in (first, second)
    ]
    gap = ((places[1] - places[0]) @ turn).unsqueeze(-1) * turn
    share = torch.tensor([0.0, 1.0, 0.5], dtype=torch.float64).repeat_interleave(len(pairs)).unsqueeze(-1)
    moved = [
        _moved_ends(first, places[0] + share * gap, box, boxes, size),
        _moved_ends(second, places[1] - (1 - share) * gap, box, boxes, size),
    ]
    return list(zip(*moved))


def _moved_ends(ends, places: Float[Tensor, "n 3"], box: Cuboids, boxes: Cuboids, size) -> list[End]:
    """The ends with other places of contact: the nearest that lie in the cuboid and in what it touches."""
    partners = stack_boxes([_region(end.partner, boxes, size) for end in ends])
    places = box.world(box.local(places).clamp(0, 1))
    places = partners.world(partners.local(places).clamp(0, 1))
    frames = stack_boxes([boxes[end.partner] if end.partner >= 0 else bounding_box(size) for end in ends])
    on_cuboid, on_partner = box.local(places).clamp(0, 1).tolist(), frames.local(places).clamp(0, 1).tolist()
    return [
        End(end.partner, _rounded(q), _rounded(r), MIDDLE) for end, q, r in zip(ends, on_cuboid, on_partner)
    ]


def _region(partner: int, boxes: Cuboids, size: Float[Tensor, "3"]) -> Cuboids:
    """Where a tilted cuboid can touch a partner: all of its box, or what counts as the bounding box's top or bottom."""
    if partner >= 0:
        return boxes[partner]
    slab = size * torch.tensor([1.0, TILTED_REACH * BBOX_REACH, 1.0], dtype=torch.float64)
    side = 0.5 if partner == TOP else -0.5
    center = (size - slab) * torch.tensor([0.0, side, 0.0], dtype=torch.float64)
    return Cuboids(slab, center, torch.eye(3, dtype=torch.float64))


def bounding_box(size: Float[Tensor, "3"]) -> Cuboids:
    """The block's own box (single), in its own frame."""
    return Cuboids(size, torch.zeros(3, dtype=torch.float64), torch.eye(3, dtype=torch.float64))


def _rounded(point: Sequence[float]) -> Point:
    return tuple(round(x, DIGITS) + 0.0 for x in point)


def _distance(p, q) -> float:
    return sum(abs(a - b) for a, b in zip(p, q))


def _squeezed_face(first: End, second: End) -> str:
    """The face that a squeeze between two ends would name, "" if it could not hold the cuboid there."""
    face = next(
        (f for f, center in _FACE_CENTER.items() if _distance(first.on_cuboid, center) < AT_CENTER), ""
    )
    if not (face and _right_end(face, first.partner) and _right_end(face, second.partner, opposite=True)):
        return ""
    axis, _ = _FACE_SIDE[face]
    wanted = squeeze_points(face, first.partner, second.partner, first.on_partner)
    fits = (
        _distance(second.on_cuboid, wanted[1][0]) < AT_CENTER
        and all(
            abs(end.on_partner[axis] - on[axis]) < SAME_PLACE for end, (_, on) in zip((first, second), wanted)
        )
        and sum(abs(first.on_partner[k] - second.on_partner[k]) for k in range(3) if k != axis) < SAME_PLACE
    )
    return face if fits else ""


def _right_end(face: str, partner: int, opposite: bool = False) -> bool:
    """The bounding box's top holds what is squeezed against it by its top face, its bottom by the bottom face."""
    axis, side = _FACE_SIDE[face]
    if partner not in (BOTTOM, TOP):
        return True
    return axis == 1 and (partner == TOP) == ((1 - side if opposite else side) == 1)


def squeeze_points(face: str, first: int, second: int, at: Point) -> tuple[tuple[Point, Point], ...]:
    """The two attaches that `squeeze` stands for; `at` is the place on the first partner, of which u, v are taken."""
    axis, side = _FACE_SIDE[face]

    def end(side: int, partner: int) -> tuple[Point, Point]:
        on = side if partner in (BOTTOM, TOP) else 1 - side  # the bounding box holds from outside
        center = tuple(float(side) if k == axis else 0.5 for k in range(3))
        return center, tuple(float(on) if k == axis else at[k] for k in range(3))

    return end(side, first), end(1 - side, second)


def judge(
    ways: list[Way], boxes: Cuboids, aligned: Bool[Tensor, " n"], size: Float[Tensor, "3"]
) -> Float[Tensor, " w"]:
    """How far each way leaves the farthest corner of its cuboid from where it should be, in block units."""
    if not ways:
        return torch.zeros(0, dtype=torch.float64)
    partners = concatenate([boxes, bounding_box(size)[None]])
    cuboid = torch.tensor([way.cuboid for way in ways])
    first = torch.tensor([way.partners[0] for way in ways])
    second = torch.tensor([way.partners[-1] for way in ways])
    points = torch.tensor([way.points[0] + way.points[-1] for way in ways], dtype=torch.float64)  # (w, 4, 3)
    first, second = (torch.where(p < 0, len(boxes), p) for p in (first, second))
    target, straight = boxes[cuboid], aligned[cuboid]
    start = Cuboids(
        target.size, torch.zeros_like(target.center), torch.eye(3).double().expand_as(target.axes)
    )
    fixed = partners[first].world(points[:, 1])
    held = move(start, points[:, 0], fixed)
    twice = torch.tensor([len(way.partners) == 2 for way in ways])
    held = _again(held, twice & straight, lambda cuboids, rows: grow(cuboids, partners[second[rows]]))
    held = _again(
        held,
        twice & ~straight,
        lambda cuboids, rows: stretch_and_turn(
            cuboids,
            points[rows, 2],
            partners[second[rows]].world(points[rows, 3]),
            points[rows, 0],
            fixed[rows],
        ),
    )
    misfit = (held.corners() - target.corners()).norm(dim=-1).amax(-1)
    return torch.where(misfit.isfinite(), misfit, torch.inf)


def _again(cuboids: Cuboids, which: Bool[Tensor, " w"], attach) -> Cuboids:
    """`attach` applied to the rows where `which` is true."""
    rows = which.nonzero().squeeze(-1)
    if not len(rows):
        return cuboids
    changed = attach(cuboids[rows], rows)
    return Cuboids(
        cuboids.size.index_put((rows,), changed.size),
        cuboids.center.index_put((rows,), changed.center),
        cuboids.axes.index_put((rows,), changed.axes),
    )
