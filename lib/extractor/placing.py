"""Stage 9: every way to hold a cuboid in place by one or two of its contacts, and how well each does it.

A way is a squeeze, two attaches, or one. Each is tried with the language's own rules (lib.interpreters): the cuboid
starts upright at the origin, as a program declares it, its partners stand where they belong, and the ways of all
cuboids of a block are one batch. `misfit` is how far the cuboid's corners end up from where they should be.

A squeeze (paper, section 4) needs contacts at the centers of two opposite faces, at the same place (u, v) of the two
partners. Its first attach decides where the cuboid stands; (u, v) of the second may differ a little.
"""

from dataclasses import dataclass
from itertools import permutations

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..interpreters.cuboids import Cuboids, concatenate
from ..interpreters.shapeassembly.attaching import move, stretch_and_turn
from ..interpreters.shapeassembly.growing import grow
from ..interpreters.shapeassembly.program import FACES
from .contacts import BOTTOM, MIDDLE, TOP, Contact
from .snapping import turning_axis

DIGITS = 3  # decimals of local coordinates in the text, as in the authors' data set
AT_CENTER = (
    0.05  # how far (L1, local) a contact may be from a face's center for a squeeze (the authors' program)
)
SAME_PLACE = (
    0.15  # how far (L1, local) the (u, v) of a squeeze's two partners may differ (the authors' program)
)
APART = 0.1  # how far apart (L1, local) two contacts must be on a cuboid to be two (the authors' program)

# face name -> (axis, side) in local coordinates
_FACE_SIDE = dict(zip(FACES, [(0, 1), (0, 0), (1, 1), (1, 0), (2, 1), (2, 0)]))
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Way:
    """One way to hold `cuboid`: the partners in order, and for each the local points (on it, on the partner)."""

    cuboid: int
    partners: tuple[int, ...]  # cuboids of the block, or BOTTOM or TOP of its box
    points: tuple[tuple[Point, Point], ...]
    kinds: tuple[int, ...] = ()  # of the contacts
    face: str = ""  # of a squeeze
    misfit: float = 0.0  # block units

    def steps(self, tolerance: float) -> int:
        """The misfit in whole steps of `tolerance`: ways with as many are as good as each other."""
        return int(min(self.misfit / tolerance, 1e6))


def ways_to_place(
    cuboid: int,
    contacts: list[Contact],
    boxes: Cuboids,
    size: Float[Tensor, "3"],
    tilted: bool,
    squeezes: bool = True,
) -> list[Way]:
    """Every way to hold `cuboid` by its contacts, not yet judged.

    A tilted cuboid is turned by its second attach, by as little as possible; only a line of contacts that is normal
    to the axis of its turn turns it right. So for such a cuboid the second place is also moved onto that normal.
    """
    ends = [
        (c.partner(cuboid), _rounded(c.at(cuboid)), _rounded(c.at(c.partner(cuboid))), c.kind)
        for c in contacts
        if cuboid in (c.first, c.second)
    ]
    ways = [Way(cuboid, (p,), ((q, r),), (kind,)) for p, q, r, kind in ends]
    turn = turning_axis(boxes.axes[cuboid]) if tilted else None
    for (p1, q1, r1, kind1), (p2, q2, r2, kind2) in permutations(ends, 2):
        if _distance(q1, q2) < APART:
            continue
        ways.append(Way(cuboid, (p1, p2), ((q1, r1), (q2, r2)), (kind1, kind2)))
        if squeezes and (face := _squeezed_face((p1, q1, r1), (p2, q2, r2))):
            ways.append(Way(cuboid, (p1, p2), squeeze_points(face, p1, p2, r1), (kind1, kind2), face))
        if turn is not None:
            partner = boxes[p2] if p2 >= 0 else bounding_box(size)
            ways.append(
                Way(
                    cuboid,
                    (p1, p2),
                    ((q1, r1), _aimed(boxes[cuboid], partner, q1, q2, turn)),
                    (kind1, MIDDLE),
                )
            )
    return ways


def _aimed(box: Cuboids, partner: Cuboids, first: Point, second: Point, turn: Tensor) -> tuple[Point, Point]:
    """The second place of contact moved along the axis of the turn, until the line from the first is normal to it."""
    points = torch.tensor([first, second], dtype=torch.float64)
    start, end = box.world_many(points)
    place = end - turn * ((end - start) @ turn)
    inside = box.world(box.local(place).clamp(0, 1))
    return tuple(_rounded(b.local(inside).clamp(0, 1).tolist()) for b in (box, partner))


def bounding_box(size: Float[Tensor, "3"]) -> Cuboids:
    """The block's own box (single), in its own frame."""
    return Cuboids(size, torch.zeros(3, dtype=torch.float64), torch.eye(3, dtype=torch.float64))


def _rounded(point: Point) -> Point:
    return tuple(round(x, DIGITS) + 0.0 for x in point)


def _distance(p, q) -> float:
    return sum(abs(a - b) for a, b in zip(p, q))


def _squeezed_face(first: tuple, second: tuple) -> str:
    """The face that a squeeze between two ends (partner, point on the cuboid, point on the partner) would name."""
    (p1, q1, r1), (p2, q2, r2) = first, second
    for face, (axis, side) in _FACE_SIDE.items():
        (want1, on1), (want2, on2) = squeeze_points(face, p1, p2, r1)
        across = [k for k in range(3) if k != axis]
        if (
            _distance(q1, want1) < AT_CENTER
            and _distance(q2, want2) < AT_CENTER
            and abs(r1[axis] - on1[axis]) < SAME_PLACE
            and abs(r2[axis] - on2[axis]) < SAME_PLACE
            and _distance([r1[k] for k in across], [r2[k] for k in across]) < SAME_PLACE
            and _right_end(face, p1) and _right_end(face, p2, opposite=True)
        ):  # fmt: skip
            return face
    return ""


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
