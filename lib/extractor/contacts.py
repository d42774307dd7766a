"""Stage 7: which cuboids of a block touch, and where (paper, section 5.1 "Attachment" and Appendix C).

Two boxes touch if the boxes grown by half of `reach` on every side share a volume; reach is 2 % of the longest side
of the two. Whether they do, and the polytope they share, follow from geometry: 15 separating directions, then the
corners of the polytope, which are corners of one box inside the other and edges of one cut by faces of the other.

    where they touch, in this order:   the center of a face that lies against the opposite face of the other
                                       the center of a face that lies in the other
                                       the middle of the shared polytope
    of several, the one nearest to that middle; of equally near ones, one of the first cuboid's

The block's bounding box takes part as two more boxes, its top and its bottom face. (The authors sample 20^3 points a
cuboid, join points nearer than 5 % of the longest side, and average up to 50^3 more.)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from ..interpreters.cuboids import Cuboids, concatenate, cross
from .snapping import UPRIGHT, is_upright

REACH = 0.02  # share of the longest side of the two boxes: how far apart they may be
TILTED_REACH = 4  # times farther for tilted cuboids: they need two holds to be turned, and seldom end flush
BBOX_REACH = 0.05  # share of the block's height: how far from its top or bottom a cuboid may end
WIDER = (1, 2, 4)  # times the reach, tried in turn while a block falls apart
AS_NEAR = (
    0.1  # share of the reach by which a preferred place may miss the other box more than the middle does
)
BOTTOM, TOP = -2, -1  # the bounding box's faces, as partners
INSIDE = -3  # the bounding box as partner of what touches neither: see `placing`

# local coordinates of the centers of the faces left, right, bottom, top, back, front
FACE_CENTERS = torch.full((6, 3), 0.5, dtype=torch.float64)
FACE_CENTERS[torch.arange(6), torch.arange(6) // 2] = (torch.arange(6) % 2).double()
# corner numbers (order of `Cuboids.corners`) of the two ends of each of the twelve edges
_EDGES = torch.tensor([[i, j] for i in range(8) for j in range(i + 1, 8) if (i ^ j) in (1, 2, 4)])
FACE_TO_FACE, IN_FACE, MIDDLE = 0, 1, 2  # the better a place, the lower


@dataclass(frozen=True)
class Contact:
    """Cuboids `first` and `second` touch; `second` may be BOTTOM or TOP. Points are local, in [0, 1]^3.

    kind   FACE_TO_FACE, IN_FACE (a face center of one lies in the other) or MIDDLE (of what they share)
    point  the same place in the block's frame
    firm   False if the boxes of inner parts touch, but nothing that is in them does
    """

    first: int
    second: int
    at_first: tuple[float, float, float]
    at_second: tuple[float, float, float]
    kind: int
    point: tuple[float, float, float]
    firm: bool = True

    def partner(self, cuboid: int) -> int:
        return self.second if cuboid == self.first else self.first

    def at(self, cuboid: int) -> tuple[float, float, float]:
        """The contact in the local coordinates of one of the two."""
        return self.at_first if cuboid == self.first else self.at_second


def connecting_contacts(boxes: Cuboids, size: Float[Tensor, "3"]) -> list[Contact]:
    """The contacts of a block; where they leave parts without a hold, those within a wider reach.

    A block is a part of something: its own parts may hang together only through what is around it, such as four legs
    of slightly different length. What floats in the end is found when the whole shape is validated.
    """
    for wider in WIDER:
        contacts = find_contacts(boxes, size, wider * REACH, wider * BBOX_REACH)
        if wider == WIDER[-1] or not floating(len(boxes), contacts):
            return contacts


def floating(count: int, contacts: Sequence[Contact]) -> set[int]:
    """The cuboids that no chain of contacts joins to the bounding box."""
    standing, found = {BOTTOM, TOP}, True
    while found:
        found = {i for c in contacts for i in (c.first, c.second) if c.partner(i) in standing} - standing
        standing |= found
    return set(range(count)) - standing


def find_contacts(
    boxes: Cuboids, size: Float[Tensor, "3"], reach: float = REACH, bbox_reach: float = BBOX_REACH
) -> list[Contact]:
    """All contacts between the cuboids (n) of a block, and with the top and bottom of its box of that size."""
    count = len(boxes)
    all_boxes = concatenate([boxes, _bbox_faces(size)])
    first, second = torch.triu_indices(count + 2, count + 2, 1)
    first, second = first[first < count], second[first < count]
    longest = torch.maximum(all_boxes.size[first], all_boxes.size[second]).amax(-1)
    farther = torch.where(is_upright(boxes), 1, TILTED_REACH)[first]
    grow = torch.where(second < count, reach * longest, bbox_reach * farther * size[1]) / 2
    near = meet(grown(all_boxes[first], grow), grown(all_boxes[second], grow))
    first, second, grow = first[near], second[near], grow[near]
    if not len(first):
        return []
    a, b = all_boxes[first], all_boxes[second]
    point, kind = _touching_points(a, b, grow)
    at_a, at_b = a.local(point).clamp(0, 1), b.local(point).clamp(0, 1)
    bbox = Cuboids(
        size.expand(len(first), 3), torch.zeros_like(a.center), torch.eye(3).double().expand_as(a.axes)
    )
    at_b = torch.where((second >= count)[:, None], bbox.local(point).clamp(0, 1), at_b)
    partner = torch.where(second >= count, second - count - 2, second)
    rows = zip(first.tolist(), partner.tolist(), at_a.tolist(), at_b.tolist(), kind.tolist(), point.tolist())
    return [Contact(i, j, tuple(p), tuple(q), k, tuple(w)) for i, j, p, q, k, w in rows]


def mark_firm(contacts: list[Contact], leaves: list[Cuboids], reach: float = REACH) -> list[Contact]:
    """The contacts, those marked that are made by boxes only; `leaves` are the leaf boxes in each cuboid."""
    inner = [c for c in contacts if c.second >= 0 and len(leaves[c.first]) + len(leaves[c.second]) > 2]
    if not inner:
        return contacts
    start = torch.tensor([0, *(len(own) for own in leaves)]).cumsum(0).tolist()
    pairs = [
        (start[c.first] + i, start[c.second] + j, number)
        for number, c in enumerate(inner)
        for i in range(len(leaves[c.first]))
        for j in range(len(leaves[c.second]))
    ]
    first, second, number = torch.tensor(pairs).unbind(1)
    boxes = concatenate(leaves)
    longest = torch.maximum(boxes.size[first], boxes.size[second]).amax(-1)
    touching = meet(grown(boxes[first], reach * longest / 2), grown(boxes[second], reach * longest / 2))
    firm = set(number[touching].tolist())
    loose = {id(c) for number, c in enumerate(inner) if number not in firm}
    return [replace(c, firm=False) if id(c) in loose else c for c in contacts]


def _bbox_faces(size: Float[Tensor, "3"]) -> Cuboids:
    """The bottom and the top face of a block's box, as two flat boxes (2)."""
    half = size[1] / 2
    flat = torch.stack([size[0], size[1] * 1e-6, size[2]]).expand(2, 3)
    center = torch.tensor([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]], dtype=torch.float64) * half
    return Cuboids(flat, center, torch.eye(3, dtype=torch.float64).expand(2, 3, 3))


def grown(boxes: Cuboids, by: Float[Tensor, " n"]) -> Cuboids:
    """Boxes larger by `by` on every side."""
    return Cuboids(boxes.size + 2 * by.unsqueeze(-1), boxes.center, boxes.axes)


def meet(a: Cuboids, b: Cuboids) -> Bool[Tensor, " n"]:
    """Which pairs of boxes share a volume: no plane separates them (face normals, and edge by edge)."""
    between = b.center - a.center
    edges = cross(a.axes.unsqueeze(2), b.axes.unsqueeze(1)).flatten(1, 2)
    directions = torch.cat([a.axes, b.axes, edges], 1)  # (n, 15, 3)
    half_a = ((directions @ a.axes.mT).abs() @ a.size.unsqueeze(-1)).squeeze(-1) / 2
    half_b = ((directions @ b.axes.mT).abs() @ b.size.unsqueeze(-1)).squeeze(-1) / 2
    apart = (directions @ between.unsqueeze(-1)).squeeze(-1).abs() - half_a - half_b
    length = directions.norm(dim=-1)  # parallel edges give no direction
    return ~((apart > 1e-12) & (length > 1e-6)).any(-1)


def _touching_points(a: Cuboids, b: Cuboids, grow: Float[Tensor, " n"]) -> tuple[Tensor, Tensor]:
    """For each touching pair the place (n, 3) in the block's frame, and its kind (n)."""
    middle = shared_middle(grown(a, grow), grown(b, grow))
    points = torch.cat(
        [a.world_many(FACE_CENTERS), b.world_many(FACE_CENTERS), middle.unsqueeze(1)], 1
    )  # (n, 13, 3)
    kind = torch.cat(
        [_face_to(a, b, 2 * grow), _face_to(b, a, 2 * grow), torch.full((len(grow), 1), MIDDLE)], 1
    )
    # Where boxes miss each other every place moves a little when it is brought into both; none should move more.
    moves = (_into(a, points) - _into(b, points)).norm(dim=-1)
    kind = torch.where(moves <= moves[:, -1:] + AS_NEAR * 2 * grow.unsqueeze(-1), kind, 9)
    away = (points - middle.unsqueeze(1)).norm(dim=-1) / (a.size + b.size).sum(-1, keepdim=True)  # below 1
    best = (kind + away.round(decimals=6)).argmin(-1)
    rows = torch.arange(len(best))
    return points[rows, best], kind[rows, best]


def _into(boxes: Cuboids, points: Float[Tensor, "n m 3"]) -> Float[Tensor, "n m 3"]:
    """The nearest points in the boxes."""
    return boxes.world_many(boxes.local_many(points).clamp(0, 1))


def _face_to(a: Cuboids, b: Cuboids, reach: Float[Tensor, " n"]) -> Int[Tensor, "n 6"]:
    """For each of a's faces: would it be on a face of b that looks at it (FACE_TO_FACE) or elsewhere in b (IN_FACE)?"""
    centers, axis = a.world_many(FACE_CENTERS), torch.arange(6) // 2
    normals = a.axes[:, axis] * (2 * (torch.arange(6) % 2) - 1).view(1, 6, 1)
    offset = (centers - b.center.unsqueeze(1)) @ b.axes.mT  # (n, 6, 3), along b's axes
    facing = normals @ b.axes.mT  # cosines between a's face and b's axes
    on_face = (offset + facing.sign() * b.size.unsqueeze(1) / 2).abs() <= reach.view(-1, 1, 1)
    return torch.where((on_face & (facing.abs() >= UPRIGHT)).any(-1), FACE_TO_FACE, IN_FACE)


def shared_middle(a: Cuboids, b: Cuboids) -> Float[Tensor, "n 3"]:
    """The middle of the polytope that two boxes share: halfway between its bounds along x, y and z."""
    corners_a, inside_a = _vertices(a, b)
    corners_b, inside_b = _vertices(b, a)
    corners, inside = torch.cat([corners_a, corners_b], 1), torch.cat([inside_a, inside_b], 1).unsqueeze(-1)
    low = torch.where(inside, corners, torch.inf).amin(1)
    high = torch.where(inside, corners, -torch.inf).amax(1)
    nearest = b.world(b.local(a.center).clamp(0, 1))  # where rounding left no corner inside
    return torch.where(inside.any(1), (low + high) / 2, nearest)


def _vertices(a: Cuboids, b: Cuboids) -> tuple[Float[Tensor, "n 80 3"], Bool[Tensor, "n 80"]]:
    """Corners of the shared polytope that stem from a's corners and edges, and which of the candidates are real."""
    corners = a.corners()
    start, end = corners[:, _EDGES[:, 0]], corners[:, _EDGES[:, 1]]
    q, along = b.local_many(start) - 0.5, (end - start) @ b.axes.mT / b.size.unsqueeze(1)
    side = torch.tensor([-0.5, 0.5], dtype=torch.float64).view(1, 1, 2, 1)
    # (n, 12 edges, 2 sides, 3 axes): how far along the edge it crosses the plane of each face of b
    at = (side - q.unsqueeze(2)) / torch.where(along == 0, torch.nan, along).unsqueeze(2)
    crossing = start.unsqueeze(2).unsqueeze(2) + at.unsqueeze(-1) * (end - start).unsqueeze(2).unsqueeze(2)
    crossing = torch.where((at >= 0) & (at <= 1), at, torch.nan).unsqueeze(-1) * 0 + crossing
    candidates = torch.cat([corners, crossing.flatten(1, 3)], 1)
    inside = ((b.local_many(candidates) - 0.5).abs() <= 0.5 + 1e-9).all(-1)  # NaN is outside
    return candidates, inside
