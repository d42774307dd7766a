"""Surfaces: through points, fitted, detected in clouds, aligned."""

import numpy as np
import pytest
import trimesh

from lib.datasets import solid
from lib.finding import CloudError, PointCloud, Surface, detect, sample_cloud
from lib.finding.aligning import aligned
from lib.finding.detecting import Options, snapped, tolerance_of
from lib.finding.surfaces import measure, through
from lib.interpreters.stump import Stump, execute

RNG = np.random.default_rng(5)
AXIS = np.array([1.0, 2.0, 2.0]) / 3
TRUE = {
    "plane": [*AXIS, 0.1, 0.2, 0.3],
    "sphere": [0.1, 0.2, 0.3, 0.4],
    "cylinder": [*AXIS, 0.1, 0.2, 0.3, 0.4],
    "cone": [*AXIS, 0.1, 0.2, 0.3, 0.5],
}


def on(kind: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points on the surface, and its normals there: random points, moved along the gradient until they lie on it."""
    points = np.array([0.1, 0.2, 0.3]) + RNG.normal(size=(20 * count, 3)) + 2 * AXIS
    for _ in range(60):
        distance, direction = measure(kind, np.array([TRUE[kind]]), points)
        points = points - distance[0][:, None] * direction[0]
    distance, direction = measure(kind, np.array([TRUE[kind]]), points)
    there = np.abs(distance[0]) < 1e-9
    return points[there][:count], direction[0][there][:count]


@pytest.mark.parametrize("kind", TRUE)
def test_the_surface_through_three_of_its_points_is_itself(kind):
    points, normals = on(kind, 30)
    numbers = through(kind, points.reshape(10, 3, 3), normals.reshape(10, 3, 3))
    more, _ = on(kind, 50)
    assert np.abs(measure(kind, numbers, more)[0]) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("kind", TRUE)
def test_directions_are_the_gradient_of_the_distance(kind):
    points, numbers, step = RNG.normal(size=(20, 3)) + 2 * AXIS, np.array([TRUE[kind]]), 1e-6
    distance, direction = measure(kind, numbers, points)
    slopes = [(measure(kind, numbers, points + step * e)[0] - distance)[0] / step for e in np.eye(3)]
    # 1e-4: a finite difference of 1e-6 on numbers of about 1
    assert np.stack(slopes, 1) == pytest.approx(direction[0], abs=1e-4)


@pytest.mark.parametrize("kind", TRUE)
@pytest.mark.parametrize("scale, shift", [(1.0, 0.0), (1000.0, 1e5)])
def test_a_fit_finds_back_what_was_shaken(kind, scale, shift):
    points = scale * on(kind, 200)[0] + shift
    numbers = np.array(TRUE[kind])
    place = slice(0, 3) if kind == "sphere" else slice(3, 6)
    numbers[place] = scale * numbers[place] + shift
    numbers[-1] *= scale if kind in ("sphere", "cylinder") else 1
    shaken = numbers.copy()
    shaken[place] += scale * 0.05 * RNG.normal(size=3)
    surface = Surface(kind, shaken, False, np.arange(len(points))).fitted(points)
    assert np.abs(surface.distance(points)).max() < 1e-4 * scale


def test_a_fit_is_not_drawn_off_by_a_few_points_that_are_far_away():
    points = np.concatenate([on("cylinder", 300)[0], [[3.0, 3, 3]] * 6])
    surface = Surface("cylinder", np.array(TRUE["cylinder"]), False, np.arange(306)).fitted(points)
    assert surface.size == pytest.approx(0.4, abs=0.002)


def test_normals_of_a_hole_point_into_it():
    hole = Surface("cylinder", np.array([0.0, 0, 1, 0, 0, 0, 0.5]), True, np.arange(3))
    point = np.array([[0.5, 0.0, 2.0]])
    assert hole.normals(point) == pytest.approx(np.array([[-1.0, 0, 0]]))
    assert hole.distance(np.zeros((1, 3))) == pytest.approx(-0.5)


def cloud_of(name: str, **bad) -> PointCloud:
    return sample_cloud(execute(Stump.from_tree(solid(name))).mesh(), 4000, seed=0, **bad)


def summary(surfaces) -> list[tuple]:
    return sorted((s.kind, s.turned) for s in surfaces)


MUG = [("cylinder", False)] * 2 + [("cylinder", True)] * 2 + [("plane", False)] * 5


@pytest.mark.parametrize("bad", [{}, {"noise": 0.005, "outliers": 0.05}], ids=["clean", "bad"])
def test_the_surfaces_of_a_mug_are_its_walls_and_no_others(bad, unchecked_shapes):
    cloud = cloud_of("mug", **bad)
    surfaces = detect(cloud, seed=0)
    assert summary(surfaces) == MUG
    members = np.concatenate([surface.members for surface in surfaces])
    assert len(members) == len({*members.tolist()}) >= 0.9 * len(cloud)  # no point lies on two
    outer = surfaces[0]
    assert outer.size == pytest.approx(6 * 0.0388, rel=0.02)  # the mug is about 25.8 units across


def test_the_same_seed_finds_the_same_surfaces(unchecked_shapes):
    cloud = cloud_of("bolt")
    one, again = detect(cloud, seed=4), detect(cloud, seed=4)
    assert len(one) == len(again)
    assert all(np.array_equal(a.numbers, b.numbers) for a, b in zip(one, again))


def test_a_snapped_cloud_has_neither_noise_nor_outliers(unchecked_shapes):
    cloud = cloud_of("bolt", noise=0.005, outliers=0.05)
    clean = snapped(cloud, detect(cloud, seed=0))
    assert clean.diagonal < cloud.diagonal
    truth = execute(Stump.from_tree(solid("bolt"))).mesh()
    off = np.abs(clean.points[:, None] - truth.bounds.mean(0)).max(1) <= 0.51
    assert off.all() and len(clean) > 0.85 * len(cloud)


def test_nothing_is_detected_where_there_is_no_surface(unchecked_shapes):
    normals = RNG.normal(size=(1500, 3))
    assert detect(PointCloud(RNG.random((1500, 3)), normals), seed=0) == []


def test_options_bound_the_tolerance():
    cloud = sample_cloud(execute(Stump.from_tree(solid("bolt"))).mesh(), 1000)
    assert tolerance_of(cloud, Options(tolerance=0.02)) == pytest.approx(0.02 * cloud.diagonal)
    assert tolerance_of(cloud, Options()) >= 0.004 * cloud.diagonal


@pytest.mark.parametrize(
    "bad",
    [
        {"tolerance": -1}, {"tolerance": np.nan}, {"angle": 91}, {"fewest": 0}, {"fewest": None}, {"trials": 0},
        {"trials": 1.5}, {"patience": "long"}, {"most": 0},
    ],
    ids=str,
)  # fmt: skip
def test_options_out_of_range_are_refused(bad, unchecked_shapes):
    with pytest.raises(CloudError, match=f"{next(iter(bad))} is "):
        Options(**bad)


def test_detection_ends_with_the_most_surfaces_that_are_wanted(unchecked_shapes):
    ring = sample_cloud(trimesh.creation.torus(1, 0.3), 1500)
    assert len(detect(ring, 0, Options(most=3, trials=100))) <= 3
    assert len(detect(ring, 0, Options(trials=100))) > 3


@pytest.mark.parametrize("kind", TRUE)
def test_directions_know_no_unit(kind):
    points, numbers = RNG.normal(size=(20, 3)), np.array(TRUE[kind])
    small = numbers.copy()
    small[slice(0, 3) if kind == "sphere" else slice(3, 6)] *= 1e-14
    small[-1] *= 1e-14 if kind in ("sphere", "cylinder") else 1
    distance, direction = measure(kind, numbers[None], points)
    other, same = measure(kind, small[None], 1e-14 * points)
    assert same == pytest.approx(direction) and 1e14 * other == pytest.approx(distance)


def flat(normal, middle=(0.0, 0.0, 0.0), tilt=0.0, noise=0.0) -> np.ndarray:
    """Points of a square across a direction, turned about x by some radians."""
    u = np.linalg.svd(np.array([normal]))[2][1:]
    points = RNG.uniform(-0.5, 0.5, (200, 2)) @ u + RNG.normal(size=(200, 3)) * noise
    c, s = np.cos(tilt), np.sin(tilt)
    return points @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T + middle


def test_nearly_parallel_planes_become_parallel_where_their_points_do_not_mind():
    noisy = [flat([0, 0, 1.0], noise=0.01), flat([0, 0, 1.0], (0, 0, 1), tilt=0.01, noise=0.01)]
    sharp = [flat([0, 0, 1.0]), flat([0, 0, 1.0], (0, 0, 1), tilt=0.03)]
    for parts, parallel in ((noisy, True), (sharp, False)):
        points = np.concatenate(parts)
        rows = np.arange(400).reshape(2, 200)
        start = np.array([0, 0, 1.0, 0, 0, 0])
        planes = [Surface("plane", start, False, own).fitted(points) for own in rows]
        one, other = aligned(planes, points, tolerance=0.01)
        assert (abs(one.axis @ other.axis) > 1 - 1e-12) == parallel
