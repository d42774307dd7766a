"""Does every part of a shape hang together with the ground? (ShapeAssembly paper, section 7.1 and Appendix E)

Two parts count as connected when they are no farther apart than 2 % of the diagonal of the shape's bounding box. The
ground is the plane at the shape's lowest point. Distances between boxes are exact, not sampled. Many shapes are looked
at together: their boxes lie in one long row, and so do the pairs of boxes that share a shape.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from torch import Tensor

from ..interpreters.cuboids import Cuboids, concatenate, cross
from ..interpreters.shapeassembly import Shape

CONNECTED = 0.02  # share of the bounding box diagonal
PAIRS_AT_ONCE = 1 << 10  # so that the 144 pairs of edges of each stay in the cache

# Corner numbers (order of `Cuboids.corners`) of the two ends of each of the twelve edges.
_EDGES = torch.tensor([[i, j] for i in range(8) for j in range(i + 1, 8) if (i ^ j) in (1, 2, 4)])


def is_rooted(cuboids: Cuboids) -> bool:
    """True if every box is connected, directly or through others, to the ground. No boxes: True."""
    return bool(rooted([cuboids])[0])


def rooted(shapes: Sequence[Shape | Cuboids]) -> Bool[np.ndarray, " shapes"]:
    """For each shape: is every box connected, directly or through others, to the ground? No boxes: True.

    The mean of this, in percent, is the paper's "% rooted".
    """
    links = Links.of(shapes)
    return np.array([bool(part.all()) for part in links.split(links.grounded())], dtype=bool)


def connected_to_ground(cuboids: Cuboids) -> Bool[Tensor, " n"]:
    """For each box: does a chain of connected boxes lead from it to the ground?"""
    return torch.from_numpy(Links.of([cuboids]).grounded())


@dataclass(frozen=True)
class Links:
    """Which boxes of many shapes are connected, and which to the ground; the boxes of all shapes are counted through.

    count       boxes of each shape
    pairs       (2, links) numbers of two boxes of one shape that are connected
    on_ground   for each box: is it itself connected to the ground?
    """

    count: list[int]
    pairs: Int[np.ndarray, "2 links"]
    on_ground: Bool[np.ndarray, " boxes"]

    @classmethod
    def of(cls, shapes: Sequence[Shape | Cuboids]) -> "Links":
        """Of all pairs of boxes that share a shape."""
        every = [boxes_of(shape) for shape in shapes]
        count = [len(boxes) for boxes in every]
        if not sum(count):
            return cls(count, np.zeros((2, 0), dtype=np.int64), np.zeros(0, dtype=bool))
        boxes, size = concatenate(every), torch.tensor(count)
        low, high, corners = *_bounds(boxes, size), boxes.corners()
        reach = CONNECTED * (high - low).norm(dim=-1)
        shape = torch.arange(len(count)).repeat_interleave(size)  # of each box
        pairs = _pairs(size)
        pairs = pairs[:, _gap(corners, *pairs) <= reach[shape[pairs[0]]]]  # spares most the exact distance
        parts = [_connected(boxes, part, reach[shape[part[0]]]) for part in pairs.split(PAIRS_AT_ONCE, 1)]
        on_ground = corners[..., 1].amin(-1) - low[shape, 1] <= reach[shape]
        return cls(count, torch.cat(parts, 1).numpy(), on_ground.numpy())

    def split(self, of_boxes: np.ndarray) -> list[np.ndarray]:
        """What is known of each box, shape by shape."""
        stop = np.cumsum(self.count)
        return [of_boxes[after - count : after] for count, after in zip(self.count, stop)]

    def components(self) -> list[Int[np.ndarray, " n"]]:
        """For each shape, and each of its boxes: the number, from 0, of the component it belongs to. Boxes that are
        connected, directly or through others of the shape, form a component; the ground connects nothing here."""
        return [np.unique(part, return_inverse=True)[1] for part in self.split(self._groups())]

    def grounded(self) -> Bool[np.ndarray, " boxes"]:
        """For each box: does a chain of connected boxes lead from it to the ground?"""
        groups = self._groups()
        return np.isin(groups, groups[self.on_ground])

    def _groups(self) -> Int[np.ndarray, " boxes"]:
        """Of each box, the number of its component among those of all shapes."""
        (one, other), count = self.pairs, len(self.on_ground)
        graph = coo_array((np.ones(len(one), dtype=bool), (one, other)), shape=(count, count))
        return connected_components(graph, directed=False)[1]


def boxes_of(shape: Shape | Cuboids) -> Cuboids:
    """The boxes of a shape, cut off from the gradient, in double precision in the computer's memory."""
    boxes = shape.cuboids if isinstance(shape, Shape) else shape
    return boxes.detach().to("cpu", torch.float64)


def _bounds(boxes: Cuboids, size: Int[Tensor, " shapes"]) -> tuple[Float[Tensor, "shapes 3"], ...]:
    """Smallest and largest coordinates of each shape: the next size[i] boxes are those of shape i."""
    corners = boxes.corners()
    low = torch.segment_reduce(corners.amin(1), "min", lengths=size)
    return low, torch.segment_reduce(corners.amax(1), "max", lengths=size)


def _pairs(size: Int[Tensor, " shapes"]) -> Int[Tensor, "2 pairs"]:
    """All pairs of boxes that share a shape, by their numbers among all boxes."""
    first = size.cumsum(0) - size
    return torch.cat([torch.triu_indices(n, n, 1) + at for n, at in zip(size.tolist(), first.tolist())], 1)


def _connected(
    boxes: Cuboids, pairs: Int[Tensor, "2 n"], reach: Float[Tensor, " n"]
) -> Int[Tensor, "2 links"]:
    """Those of the pairs that are no farther apart than they may be."""
    one, other = pairs
    return pairs[:, box_distance(boxes[one], boxes[other]) <= reach]


def _gap(corners: Float[Tensor, "boxes 8 3"], one: Tensor, other: Tensor) -> Float[Tensor, " n"]:
    """How far apart the bounds of two boxes are along x, y or z: never more than their distance."""
    low, high = corners.amin(1), corners.amax(1)
    return torch.maximum(low[one] - high[other], low[other] - high[one]).amax(-1)


def box_distance(a: Cuboids, b: Cuboids) -> Float[Tensor, " n"]:
    """Exact distance between each two oriented boxes, world units; 0 where they touch or overlap.

    Disjoint boxes are nearest at a corner of one and the other box, or at two edges; a plane that separates them
    (normal to a face of one, or to an edge of each) tells that they are disjoint.
    """
    corner = torch.minimum(_corner_distance(a, b), _corner_distance(b, a))
    return torch.where(_separated(a, b), torch.minimum(corner, _edge_distance(a, b)), 0.0)


def _corner_distance(a: Cuboids, b: Cuboids) -> Float[Tensor, " n"]:
    """From the corners of a to the box b."""
    corners = a.corners()
    nearest = b.world_many(b.local_many(corners).clamp(0, 1))
    return (corners - nearest).norm(dim=-1).amin(-1)


def _edge_distance(a: Cuboids, b: Cuboids) -> Float[Tensor, " n"]:
    """Smallest distance between an edge of a and an edge of b (all 12 x 12 pairs)."""
    ends_a, ends_b = a.corners()[:, _EDGES].unsqueeze(2), b.corners()[:, _EDGES].unsqueeze(1)
    p, u = ends_a[..., 0, :], ends_a[..., 1, :] - ends_a[..., 0, :]
    q, v = ends_b[..., 0, :], ends_b[..., 1, :] - ends_b[..., 0, :]
    w = p - q
    uu, uv, vv, uw, vw = (u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1), (u * w).sum(-1), (v * w).sum(-1)
    determinant = uu * vv - uv * uv
    parallel = determinant < 1e-12 * uu * vv  # then the nearest points include a corner, measured elsewhere
    s = ((uv * vw - vv * uw) / torch.where(parallel, 1.0, determinant)).clamp(0, 1)
    t = ((uv * s + vw) / vv).clamp(0, 1)
    s = ((uv * t - uw) / uu).clamp(0, 1)
    gap = (w + s.unsqueeze(-1) * u - t.unsqueeze(-1) * v).norm(dim=-1)
    return gap.flatten(1).amin(-1)


def _separated(a: Cuboids, b: Cuboids) -> Bool[Tensor, " n"]:
    """Is there a separating plane? The fifteen directions that suffice for two boxes."""
    edges = cross(a.axes.unsqueeze(2), b.axes.unsqueeze(1)).flatten(1, 2)
    directions = torch.cat([a.axes, b.axes, edges], 1).mT  # (n, 3, 15)
    on_a, on_b = a.corners() @ directions, b.corners() @ directions
    apart = torch.maximum(on_a.amin(1) - on_b.amax(1), on_b.amin(1) - on_a.amax(1))
    length = directions.norm(dim=1)  # parallel edges give no direction
    return (apart > 1e-9 * length).logical_and(length > 1e-6).any(-1)
