"""For each point cloud, the nearest of many others by Chamfer distance, without measuring every pair.

One pair of 1,024-point clouds takes a millisecond, so 1,000 shapes against 5,762 would take an hour and a half. A
coarse grid makes a cheap estimate of all pairs first. Each cloud is turned into two vectors over the grid's nodes:

    field   distance from the node to the cloud's nearest point, at most REACH cells
    share   what part of the cloud's points lies at the node (each point is divided among the eight nodes around it)

The mean distance from the points of a to the cloud b is then about share_a · field_b, the field interpolated at the
points, and one matrix product gives it for all pairs. The grid stands askew: surfaces of furniture are parallel to the
axes and would lie in its cells all alike, well or badly for the interpolation. For each query the candidates are
measured exactly in the order of their estimates, until the next one would have to beat its estimate by SAFETY
standard errors to be the nearest.

That is a margin, not a proof; the distance reported is always the exact one of the cloud reported. For 416 real
validation shapes against all training shapes of their categories (150 chairs, 150 tables, 116 storage) the answer was
in every case that of measuring every pair, after 14 to 24 exact distances a query. A few candidates are all measured.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.spatial import cKDTree
from torch import Tensor

NODES = 20  # grid nodes an axis
REACH = (
    2.5  # cells: a candidate farther away than this is no neighbour, and its exact distance does not matter
)
ASKEW = 12  # degrees about each axis
FIRST = (
    0,
    1,
    2,
    3,
    4,
    8,
    16,
    32,
)  # candidates of each query, by estimate, whose errors tell how good estimates are
SAFETY = 3  # standard errors of an estimate
STICKING_OUT = 0.005  # share of the clouds whose bounds the grid may cut on each side
AT_ONCE = 256  # clouds: 8 MB of vectors each way, whatever the number of clouds
WORKERS = 2  # threads; SciPy's search trees let others run meanwhile


@dataclass(frozen=True)
class Nearest:
    """For each query: which of the others is nearest, and its Chamfer distance, world units."""

    index: Int[Tensor, " queries"]
    distance: Float[Tensor, " queries"]


def nearest_clouds(
    queries: Float[Tensor, "queries n 3"],
    others: Float[Tensor, "others m 3"] | None = None,
    workers: int = WORKERS,
) -> Nearest:
    """For each query the nearest of `others`, or without these the nearest other query.

    workers   threads; the answer does not depend on it
    Distances as `points.chamfer_distance`. Deterministic; without gradient.
    Raises ValueError for clouds that are empty or not finite, and where there is no other to be nearest.
    """
    mine = _Clouds(queries, "queries")
    theirs = mine if others is None else _Clouds(others, "others")
    if not len(mine):
        raise ValueError("found no queries; expected at least one cloud")
    if len(theirs) < 1 + (others is None):
        raise ValueError(f"found {len(theirs)} clouds; expected another one that can be the nearest")
    with ThreadPoolExecutor(workers) as pool:
        estimate = _estimates(mine, theirs, pool)
        if others is None:
            np.fill_diagonal(estimate, np.inf)  # nobody is its own neighbour
        return _search(mine, theirs, estimate, pool)


def paired_distances(
    a: Float[Tensor, "pairs n 3"], b: Float[Tensor, "pairs m 3"], workers: int = WORKERS
) -> Float[Tensor, " pairs"]:
    """Chamfer distance of each pair, world units: `points.chamfer_distance` without gradient, and faster.

    Raises ValueError for another number of clouds in b than in a, and for clouds that are empty or not finite.
    """
    if len(a) != len(b):
        raise ValueError(f"found {len(a)} and {len(b)} clouds; expected pairs")
    one, other = _Clouds(a, "a"), _Clouds(b, "b")
    with ThreadPoolExecutor(workers) as pool:
        return torch.tensor(list(pool.map(_chamfer, one.trees, other.trees)), dtype=torch.float64)


class _Clouds:
    """Clouds with a search tree each. Points are sorted as their tree is: neighbours in turn, which the cache likes."""

    def __init__(self, points: Float[Tensor, "clouds n 3"], name: str):
        if points.ndim != 3 or points.shape[-1] != 3 or not points.shape[1]:
            raise ValueError(f"{name}: found an array {tuple(points.shape)}; expected (clouds, points, 3)")
        if not points.isfinite().all():
            raise ValueError(f"{name}: found points that are not finite")
        # A plain tree is built fastest, and for points spread over surfaces it answers as fast as a balanced one.
        tree = partial(cKDTree, balanced_tree=False, compact_nodes=False)
        self.points = points.detach().cpu().double()
        self.trees = [tree(cloud[tree(cloud).indices]) for cloud in self.points.numpy()]

    def __len__(self) -> int:
        return len(self.trees)


def _chamfer(a: cKDTree, b: cKDTree) -> float:
    return a.query(b.data)[0].mean() + b.query(a.data)[0].mean()


@dataclass(frozen=True)
class _Grid:
    """NODES³ nodes in a box that stands askew in space; numbered with the last axis running fastest."""

    low: Float[Tensor, "3"]
    step: Float[Tensor, "3"]
    turn: Float[Tensor, "3 3"]  # points @ turn are in the grid's own axes

    @classmethod
    def around(cls, *sets: _Clouds) -> "_Grid":
        """Around nearly all clouds. What sticks out counts at the border: one giant must not make the cells large."""
        turn = _turn_about_all_axes(ASKEW)
        turned = [clouds.points @ turn for clouds in sets]
        low = torch.cat([points.amin(1) for points in turned]).quantile(STICKING_OUT, 0)
        high = torch.cat([points.amax(1) for points in turned]).quantile(1 - STICKING_OUT, 0)
        step = (high - low).clamp(min=0) / (NODES - 1)
        thinnest = 1e-9 * float(step.max()) or 1.0  # clouds can be flat, or one point
        return cls(low, step.clamp(min=thinnest), turn)

    def nodes(self) -> Float[np.ndarray, "nodes 3"]:
        steps = torch.cartesian_prod(*3 * [torch.arange(NODES, dtype=torch.float64)])
        return ((self.low + steps * self.step) @ self.turn.T).numpy()

    def shares(self, points: Float[Tensor, "clouds n 3"]) -> Float[Tensor, "clouds nodes"]:
        """What part of each cloud's points lies at each node; they sum to 1."""
        cells = ((points @ self.turn - self.low) / self.step).clamp(0, NODES - 1)
        corner = cells.long().clamp(0, NODES - 2)
        shares = torch.zeros(len(points), NODES**3)
        for offset in torch.cartesian_prod(*3 * [torch.arange(2)]):
            node = corner + offset
            weight = (1 - (cells - node).abs()).prod(-1)
            number = (node[..., 0] * NODES + node[..., 1]) * NODES + node[..., 2]
            shares.scatter_add_(1, number, weight.float())
        return shares / points.shape[1]

    def fields(self, trees: list[cKDTree], pool: ThreadPoolExecutor) -> Float[Tensor, "clouds nodes"]:
        """Distance from each node to each cloud, world units, at most REACH cells."""
        nodes, reach = self.nodes(), REACH * float(self.step.max())

        def field(tree: cKDTree) -> np.ndarray:
            distance, _ = tree.query(nodes, distance_upper_bound=reach)  # infinite beyond
            return np.minimum(distance, reach).astype(np.float32)

        return torch.from_numpy(np.stack([*pool.map(field, trees)]))


def _turn_about_all_axes(degrees: float) -> Float[Tensor, "3 3"]:
    """One turn about each axis, one after the other."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return torch.tensor(
        np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    )


def _estimates(
    queries: _Clouds, others: _Clouds, pool: ThreadPoolExecutor
) -> Float[np.ndarray, "queries others"]:
    """About the Chamfer distance of every pair, world units."""
    grid = _Grid.around(queries, others)
    shares, fields = (torch.cat(parts) for parts in zip(*_vectors(grid, queries, pool)))
    if others is queries:
        there = shares @ fields.T
        return (there + there.T).double().numpy()
    parts = [
        shares @ their_fields.T + fields @ their_shares.T
        for their_shares, their_fields in _vectors(grid, others, pool)
    ]
    return torch.cat(parts, 1).double().numpy()


def _vectors(grid: _Grid, clouds: _Clouds, pool: ThreadPoolExecutor) -> Iterator[tuple[Tensor, Tensor]]:
    """Shares and fields, AT_ONCE clouds at a time."""
    for first in range(0, len(clouds), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        yield grid.shares(clouds.points[some]), grid.fields(clouds.trees[some], pool)


def _search(
    queries: _Clouds, others: _Clouds, estimate: Float[np.ndarray, "queries others"], pool: ThreadPoolExecutor
) -> Nearest:
    """The nearest by exact distances, candidates in the order of their estimates."""
    order = estimate.argsort(1, kind="stable")
    candidates = int(np.isfinite(estimate[0]).sum())
    ranks = FIRST if candidates > FIRST[-1] else range(candidates)  # few are all measured
    first = order[:, list(ranks)]

    def measured(query: int, several: np.ndarray) -> list[float]:
        return [_chamfer(queries.trees[query], others.trees[other]) for other in several]

    exact = np.array([*pool.map(measured, range(len(queries)), first)])
    error = exact - np.take_along_axis(estimate, first, 1)
    usual = error.mean(1, keepdims=True)  # most of it belongs to the query: how its points are spread
    variance = ((error - usual) ** 2).mean(1, keepdims=True) * len(ranks) / max(1, len(ranks) - 1)
    spread = np.sqrt(np.maximum(variance, np.median(variance)))  # its own, but never trust eight lucky ones
    hardly_below = estimate + usual - SAFETY * spread

    def best(query: int) -> tuple[int, float]:
        at = int(exact[query].argmin())
        index, distance = first[query, at], exact[query, at]
        for other in np.delete(order[query], list(ranks)):
            if hardly_below[query, other] >= distance:
                break
            if (found := _chamfer(queries.trees[query], others.trees[other])) < distance:
                index, distance = other, found
        return int(index), float(distance)

    index, distance = zip(*pool.map(best, range(len(queries))))
    return Nearest(torch.tensor(index), torch.tensor(distance, dtype=torch.float64))
