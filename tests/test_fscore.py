"""The F-score on shapes whose answer is known by hand."""

import math

import numpy as np
import pytest
import torch

from lib.interpreters.cuboids import Cuboids, concatenate
from lib.metrics.fscore import cloud_f_score, f_score, share_near, spacing

POINTS = 2000  # enough for shares to half a percent or so, and quick


def boxes(*rows: tuple) -> Cuboids:
    """Axis-aligned boxes from (center, size) pairs."""
    center, size = (torch.tensor(column, dtype=torch.float64) for column in zip(*rows))
    return Cuboids(size, center, torch.eye(3, dtype=torch.float64).expand(len(rows), 3, 3))


def random_boxes(count: int, seed: int = 0) -> Cuboids:
    rng = np.random.default_rng(seed)
    turned, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    return Cuboids(*map(torch.tensor, (rng.uniform(0.1, 1, (count, 3)), rng.normal(size=(count, 3)), turned)))


def moved(cuboids: Cuboids, by: tuple) -> Cuboids:
    return Cuboids(cuboids.size, cuboids.center + torch.tensor(by).double(), cuboids.axes)


CUBE = boxes(((0, 0, 0), (1, 1, 1)))
TWO = boxes(((0, 0, 0), (1, 1, 1)), ((5, 0, 0), (1, 1, 1)))


@pytest.mark.parametrize("shape", [CUBE, TWO, random_boxes(15)], ids=["cube", "two cubes", "random"])
def test_a_shape_agrees_with_itself(shape):
    assert f_score(shape, shape, POINTS) == 100
    assert f_score(concatenate([shape, shape]), shape, POINTS) == 100, "a box twice is the same surface"


def test_far_apart_is_nothing():
    assert f_score(moved(CUBE, (3, 0, 0)), CUBE, POINTS) == 0
    assert f_score(boxes(((0, 0, 0), (0.5, 0.5, 0.5))), CUBE, POINTS) == 0, "inside is not on the surface"


def test_half_of_the_target_missing():
    """Precision 1 and recall 1/2, or the other way round: F = 2/3 of 100."""
    one_of_two = f_score(TWO[:1], TWO), f_score(TWO, TWO[:1])
    assert one_of_two == pytest.approx((200 / 3, 200 / 3), abs=1)  # which points are drawn: 0.5 % of 10,000


@pytest.mark.parametrize("share, expected", [(0.9, 100), (1.1, 100 * 4 / 6)])
def test_a_cube_shifted_by_about_the_threshold(share, expected):
    """Along x, four of the six faces slide in themselves; the other two stay near, or leave."""
    threshold = spacing(CUBE.surface_points(10_000))
    found = f_score(moved(CUBE, (share * threshold, 0, 0)), CUBE)
    assert found == pytest.approx(
        expected, abs=3 if share > 1 else 0
    )  # 3: the rims of the two faces stay near


def test_precision_and_recall_change_places():
    cloud, other = CUBE.surface_points(500, 1), TWO.surface_points(700, 2)
    assert cloud_f_score(cloud, other, 0.1) == cloud_f_score(other, cloud, 0.1)
    a = random_boxes(6)
    b = moved(a, (0.1, 0, 0))  # the target alone sets the threshold: here the same one
    assert 20 < f_score(a, b) < 80 and f_score(a, b) == pytest.approx(f_score(b, a), abs=0.1)


def test_the_order_of_the_boxes_does_not_matter():
    a, b = random_boxes(20, 1), random_boxes(20, 2)
    points = a.surface_points(POINTS)
    assert share_near(points, b, 0.2) == share_near(points, b[torch.randperm(20)], 0.2)
    assert 0.1 < share_near(points, b, 0.2) < 0.9


@pytest.mark.parametrize("place, scale", [(0, 1), (1000, 1), (0, 1e-4), (0, 1e4)])
def test_distance_agrees_with_the_nearest_of_many_points(place, scale):
    """At any place and scale: a point is near exactly when a dense cloud of the surface comes near it."""
    shape = Cuboids(*(x * s for x, s in zip(vars(random_boxes(5)).values(), (scale, scale, 1))))
    shape = moved(shape, (place, place, place))
    rng = np.random.default_rng(0)
    asked = shape.center.mean(0) + scale * torch.tensor(rng.normal(size=(500, 3)))
    dense = shape.surface_points(60_000)
    nearest = torch.cdist(asked, dense).amin(1) / scale
    gap = 0.02  # between points of the dense cloud
    near = [bool(share_near(point[None], shape, 0.3 * scale)) for point in asked]
    for found, sampled in zip(near, nearest.tolist()):
        assert found if sampled <= 0.3 else (not found or sampled < 0.3 + gap)


def test_share_near_a_face_an_edge_a_corner_and_the_middle():
    points = torch.tensor([[0.6, 0, 0], [0.6, 0.6, 0], [0.6, 0.6, 0.6], [0.4, 0, 0], [0, 0, 0]]).double()
    distances = [0.1, 0.1 * 2**0.5, 0.1 * 3**0.5, 0.1, 0.5]
    for point, distance in zip(points, distances):
        assert share_near(point[None], CUBE, distance * 1.001) == 1
        assert share_near(point[None], CUBE, distance * 0.999) == 0


def test_two_clouds_of_one_surface_score_about_ninety():
    shape = random_boxes(15)
    result, target = shape.surface_points(10_000, 1), shape.surface_points(10_000, 2)
    assert cloud_f_score(result, target, spacing(target)) == pytest.approx(90, abs=1.5)
    assert cloud_f_score(target, target, 0.0) == 100


def test_clouds_and_faces_tell_the_same_story():
    """The cloud version lies about a tenth below the exact one, whatever the shapes share."""
    target = random_boxes(12)
    for kept in (12, 9, 6):
        exact = f_score(target[:kept], target)
        result, cloud = target[:kept].surface_points(10_000, 1), target.surface_points(10_000, 0)
        assert cloud_f_score(result, cloud, spacing(cloud)) == pytest.approx(0.9 * exact, abs=4)


def test_spacing_of_points_on_a_grid():
    grid = torch.cartesian_prod(*[torch.arange(5.0)] * 3)
    assert spacing(grid) == 1 and spacing(3 * grid, 0.5) == 3
    outlier = torch.cat([grid, torch.tensor([[100.0, 0, 0]])])
    assert spacing(outlier) == 1 and spacing(outlier, 1.0) == 96


def test_thin_and_flat_boxes_have_a_surface():
    flat = boxes(((0, 0, 0), (1, 0, 1)))
    assert f_score(flat, flat, POINTS) == 100
    needle = boxes(((0, 0, 0), (1, 1e-9, 1e-9)))
    assert f_score(needle, needle, POINTS) == 100
    mirrored = Cuboids(-CUBE.size, CUBE.center, CUBE.axes)
    assert f_score(mirrored, CUBE, POINTS) == 100


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: f_score(CUBE[:0], CUBE), "result has no boxes"),
        (lambda: f_score(CUBE, CUBE[:0]), "target has no boxes"),
        (lambda: f_score(moved(CUBE, (math.nan, 0, 0)), CUBE), "result .* not finite"),
        (lambda: f_score(CUBE, boxes(((0, 0, 0), (1, 0, 0)))), "target has no surface"),
        (lambda: f_score(CUBE, CUBE, points=1), "2 or more points is needed, got 1"),
        (lambda: spacing(torch.zeros(1, 3)), "2 or more points is needed, got 1"),
        (lambda: cloud_f_score(torch.zeros(0, 3), torch.zeros(4, 3), 1.0), "got 0"),
        (lambda: share_near(torch.zeros(0, 3), CUBE, 1.0), "0 points and 1 boxes"),
        (lambda: share_near(torch.zeros(4, 3), CUBE[:0], 1.0), "4 points and 0 boxes"),
    ],
)
def test_what_cannot_be_compared_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()
