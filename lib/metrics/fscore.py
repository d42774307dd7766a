"""How much of two shapes' surfaces coincides: the F-score of Knapitsch et al. 2017, in percent.

    precision   share of the result's surface that lies near the target's
    recall      share of the target's surface that lies near the result's
    F           their harmonic mean, 2 precision recall / (precision + recall)

Surfaces are the faces of all boxes, inner faces included, sampled uniformly by area. "Near" is what the authors of
ShapeAssembly use: the spacing of the target's own cloud, the distance that 90 % of its points have to their nearest
other point. Because of that, two clouds drawn from one surface score only about 90 (`cloud_f_score`): a point and its
neighbour in the other cloud are as far apart as neighbours are. `f_score` keeps clouds and threshold but measures
from each point to the other surface itself, exactly, so that a shape compared with itself scores 100.
"""

import numpy as np
import torch
from jaxtyping import Float
from scipy.spatial import cKDTree
from torch import Tensor

from ..interpreters.cuboids import Cuboids

POINTS = 10_000  # on each surface, as in the authors' evaluation
SHARE = 0.9  # of the target's points that have a neighbour within the threshold
BOXES_AT_ONCE = 8  # so that the work for 10,000 points stays in the cache


def f_score(result: Cuboids, target: Cuboids, points: int = POINTS, seed: int = 0) -> float:
    """F-score in percent between two batches of boxes: 100 for the same surface, 0 for shapes far apart.

    Distances are exact, from each sampled point to the nearest face of the other shape; what is left of chance is
    which points were drawn from `seed`: 0.1 to 0.3 from one seed to another. The target alone sets the threshold
    (`spacing`). No gradient.
    Raises ValueError for boxes that have no area together or are not finite, and for fewer than two points.
    """
    _check("result", result)
    _check("target", target)
    from_result, from_target = (shape.detach().surface_points(points, seed) for shape in (result, target))
    threshold = spacing(from_target)
    return _harmonic(share_near(from_result, target, threshold), share_near(from_target, result, threshold))


def cloud_f_score(
    result_points: Float[Tensor, "n 3"], target_points: Float[Tensor, "m 3"], threshold: float
) -> float:
    """F-score in percent between two clouds, as the authors measure it: a point is near when another point is.

    threshold   world units, usually `spacing(target_points)`
    Two clouds of one surface score about 90 then. Raises ValueError for a cloud without points.
    """
    a, b = (_array(points, least=1) for points in (result_points, target_points))
    to_b, to_a = cKDTree(b).query(a)[0], cKDTree(a).query(b)[0]
    return _harmonic((to_b <= threshold).mean(), (to_a <= threshold).mean())


def spacing(points: Float[Tensor, "n 3"], share: float = SHARE) -> float:
    """The distance, world units, within which `share` of the points have their nearest other point ("2-NN" distance).

    The square root of that quantile of the squared distances. Raises ValueError for fewer than two points.
    """
    cloud = _array(points, least=2)
    tree = cKDTree(
        cloud, balanced_tree=False, compact_nodes=False
    )  # quickest to build for points on surfaces
    nearest = tree.query(cloud[tree.indices], k=[2])[0]  # neighbours one after another: the cache likes it
    return float(np.sqrt(np.quantile(nearest**2, share)))


def share_near(points: Float[Tensor, "n 3"], cuboids: Cuboids, distance: float) -> float:
    """Share, 0 to 1, of the points that are no farther than `distance` (world units) from a face of any box.

    Exact but for rounding. Raises ValueError for no points or no boxes.
    """
    if not len(points) or not len(cuboids):
        raise ValueError(f"points and boxes are needed, got {len(points)} points and {len(cuboids)} boxes")
    left, axes, center, half = _in_own_axes(points, cuboids, distance)
    for first in range(0, len(axes), BOXES_AT_ONCE):
        some = slice(first, first + BOXES_AT_ONCE)
        left = left[:, ~_near(left, axes[some], center[some], half[some], distance)]  # found: not asked again
    return 1 - left.shape[1] / len(points)


def _in_own_axes(points: Tensor, cuboids: Cuboids, distance: float) -> tuple[np.ndarray, ...]:
    """Arrays for `_near`: points (3, n); axes (boxes, 3, 3); centers along these axes and half sizes (boxes, 3, 1)."""
    cuboids = cuboids.detach().to("cpu", torch.float64)
    origin = cuboids.center.mean(0)
    points = points.detach().to("cpu", torch.float64) - origin
    length, height, width = cuboids.size.abs().unbind(-1)
    area = length * height + height * width + width * length
    boxes = cuboids[area.argsort(descending=True)]  # large boxes settle many points early
    center = boxes.axes @ (boxes.center - origin).unsqueeze(-1)
    half = boxes.size.abs().unsqueeze(-1) / 2
    extent = max(points.abs().max(), center.abs().max(), half.max())
    precision = (
        np.float32 if distance > 1e-4 * extent else np.float64
    )  # rounding stays far below the distance
    return tuple(np.ascontiguousarray(x, precision) for x in (points.T, boxes.axes, center, half))


def _near(
    points: np.ndarray, axes: np.ndarray, center: np.ndarray, half: np.ndarray, distance: float
) -> np.ndarray:
    """(n,) bool: is the point within `distance` of a face of any of these boxes?

    With u = |local position| - half size, a point outside lies |max(u, 0)| from the faces, one inside -max(u).
    """
    u = (axes.reshape(-1, 3) @ points).reshape(len(axes), 3, -1)  # (boxes, 3, n)
    u -= center
    np.abs(u, out=u)
    u -= half
    farthest = u.max(1)  # along one axis; negative inside
    box, point = np.nonzero(
        np.abs(farthest) <= distance
    )  # the few pairs for which the corner has to be looked at
    outside = u[box, :, point].clip(min=0)
    near = np.zeros(points.shape[1], bool)
    near[point[np.einsum("nk,nk->n", outside, outside) <= distance**2]] = True
    return near


def _check(name: str, cuboids: Cuboids) -> None:
    if not len(cuboids):
        raise ValueError(f"the {name} has no boxes")
    if not all(x.isfinite().all() for x in (cuboids.size, cuboids.center, cuboids.axes)):
        raise ValueError(f"the {name} has boxes whose numbers are not finite")
    if ((cuboids.size != 0).sum(-1) < 2).all():
        raise ValueError(f"the {name} has no surface: each of its {len(cuboids)} boxes has two sizes of 0")


def _array(points: Tensor, least: int) -> np.ndarray:
    if len(points) < least:
        raise ValueError(f"a cloud of {least} or more points is needed, got {len(points)}")
    return points.detach().cpu().numpy()


def _harmonic(precision: float, recall: float) -> float:
    return float(200 * (precision * recall) / (precision + recall)) if precision + recall else 0.0
