"""Clouds: what is refused, and what the made ones are like."""

import numpy as np
import pytest
import torch
import trimesh

from lib.finding import CloudError, PointCloud, probes, sample_cloud
from lib.finding.probing import areas, spread, tilt, winding_numbers

BALL = trimesh.creation.icosphere(subdivisions=4, radius=0.5)
RNG = np.random.default_rng(3)
POINTS, NORMALS = RNG.random((200, 3)), RNG.normal(size=(200, 3))


def spoilt(table, place, value):
    table = table.copy()
    table[place] = value
    return table


@pytest.mark.parametrize(
    "points, normals, found",
    [
        (np.empty((0, 3)), np.empty((0, 3)), "the cloud has no points"),
        ([], [], "the cloud has no points"),
        ("abc", NORMALS, "points are a str"),
        (POINTS[:, :2], NORMALS, r"points have the shape \(200, 2\)"),
        (spoilt(POINTS, (7, 1), np.nan), NORMALS, r"points\[7\] is .*nan"),
        (spoilt(POINTS, (8, 1), np.inf), NORMALS, r"points\[8\] is .*inf"),
        (POINTS[:99], NORMALS[:99], "the cloud has 99 points; expected at least 100"),
        (POINTS * [1, 1, 0], NORMALS, "all points of the cloud lie in a plane"),
        (POINTS * [1, 0, 0] + 5, NORMALS, "all points of the cloud lie on a line"),
        (POINTS * 0 + 5, NORMALS, "all points of the cloud are one"),
        (POINTS + 1j, NORMALS, "points are complex"),
        (np.tile(POINTS[:20], (10, 1)), NORMALS, "the cloud has 20 different points; expected at least 100"),
        (POINTS, None, "the cloud has no normals; expected one outward normal a point: sample_cloud"),
        (POINTS, NORMALS[:150], "200 points and 150 normals"),
        (POINTS, spoilt(NORMALS, 9, 0), "the normal of point 9 is zero"),
        (POINTS, spoilt(NORMALS, (9, 0), np.nan), r"normals\[9\] is"),
    ],
)
def test_a_bad_cloud_says_what_is_wrong(points, normals, found, unchecked_shapes):
    with pytest.raises(CloudError, match=found):
        PointCloud(points, normals)


def test_normals_get_length_one_and_lists_will_do(unchecked_shapes):
    cloud = PointCloud(POINTS.tolist(), (5 * NORMALS).tolist())
    assert np.linalg.norm(cloud.normals, axis=1) == pytest.approx(1)
    assert len(cloud[:120]) == 120
    assert len(PointCloud(torch.tensor(POINTS, requires_grad=True), NORMALS)) == 200


def test_points_that_come_again_count_once_in_their_order():
    cloud = PointCloud(np.repeat(POINTS, 20, axis=0), np.repeat(NORMALS, 20, axis=0))
    assert np.array_equal(cloud.points, POINTS) and (areas(cloud) > 0).all()


def test_a_made_cloud_lies_on_its_mesh_and_comes_again():
    cloud, again = sample_cloud(BALL, 500, seed=1), sample_cloud(BALL, 500, seed=1)
    assert np.array_equal(cloud.points, again.points)
    assert not np.array_equal(cloud.points, sample_cloud(BALL, 500, seed=2).points)
    # 0.002: how far the middle of a face is below the ball
    assert np.linalg.norm(cloud.points, axis=1) == pytest.approx(0.5, abs=0.002)
    assert (cloud.points * cloud.normals).sum(1) == pytest.approx(0.5, abs=0.002)


def test_noise_and_outliers_are_as_large_as_was_asked_for_and_are_measured_so():
    noise = 0.005  # of a diagonal of sqrt(3)
    cloud = sample_cloud(BALL, 8000, seed=1, noise=noise, outliers=0.05)
    off = np.abs(np.linalg.norm(cloud.points, axis=1) - 0.5)
    assert 0.035 < (off > 5 * noise * np.sqrt(3)).mean() < 0.05  # some outliers lie near the ball
    assert off[off < 0.04].std() > 0
    assert spread(cloud) == pytest.approx(noise * np.sqrt(3), rel=0.35)  # told at the flatter places
    assert tilt(cloud) == pytest.approx(np.radians(2.9), rel=0.5)
    assert spread(sample_cloud(BALL, 8000)) < 0.001


@pytest.mark.parametrize("noise, outliers", [(-1, 0), (np.nan, 0), (0, 1.5), (0, -0.1)])
def test_noise_out_of_range_is_refused(noise, outliers):
    with pytest.raises(CloudError, match="expected noise 0 or more, outliers 0 to 1"):
        sample_cloud(BALL, 100, noise=noise, outliers=outliers)


@pytest.mark.parametrize(
    "bad, found",
    [
        ({"n": -1}, "n is -1"), ({"n": 1.5}, "n is 1.5"), ({"n": "a"}, "n is 'a'"), ({"seed": -1}, "seed is -1"),
        ({"noise": "a"}, "noise a"), ({"outliers": None}, "outliers None"), ({"mesh": None}, "the mesh is a NoneType"),
    ],
)  # fmt: skip
def test_what_no_cloud_is_made_of(bad, found, unchecked_shapes):
    with pytest.raises(CloudError, match=found):
        sample_cloud(**{"mesh": BALL} | bad)


def test_a_mesh_without_a_face_is_refused():
    with pytest.raises(CloudError, match="a mesh of 0 faces"):
        sample_cloud(trimesh.Trimesh())


@pytest.mark.parametrize("scale, shift", [(1, 0), (1000, 5e6), (1e-4, 1)])
def test_winding_numbers_tell_in_from_out_at_any_scale(scale, shift):
    cloud = sample_cloud(BALL, 4000)
    cloud = PointCloud(scale * cloud.points + shift, cloud.normals)
    points = np.array([[0, 0, 0], [0.3, 0.2, 0.1], [0.6, 0, 0], [3, 3, 3]])
    # 3 %: areas that are told from twelve neighbours, averaged
    assert winding_numbers(cloud, scale * points + shift) == pytest.approx([1, 1, 0, 0], abs=0.03)
    assert areas(cloud).sum() == pytest.approx(np.pi * scale**2, rel=0.05)


def test_probes_are_labelled_as_the_ball_is():
    tests = probes(sample_cloud(BALL, 4000), 4000, seed=0, step=0.03)
    radius = np.linalg.norm(tests.points, axis=1)
    sure = np.abs(radius - 0.5) > 0.01
    assert ((radius < 0.5) == tests.inside)[sure].all()
    assert len(radius) > 3800 and radius.max() > 0.8


def test_labels_of_a_large_cloud_are_told_from_some_of_its_points(monkeypatch):
    monkeypatch.setattr("lib.finding.probing.MOST", 1000)
    cloud, looked = sample_cloud(BALL, 4000), []
    monkeypatch.setattr("lib.finding.probing.areas", lambda some: looked.append(len(some)) or areas(some))
    tests = probes(cloud, 2000, seed=0, step=0.05)
    sure = np.abs(np.linalg.norm(tests.points, axis=1) - 0.5) > 0.02
    assert ((np.linalg.norm(tests.points, axis=1) < 0.5) == tests.inside)[sure].all() and looked == [1000]


def test_normals_that_point_inwards_are_noticed():
    cloud = sample_cloud(BALL, 1000)
    with pytest.raises(CloudError, match="point into the solid; expected outward ones"):
        probes(PointCloud(cloud.points, -cloud.normals), 500, seed=0, step=0.03)


def test_a_sheet_has_no_inside():
    plan = RNG.random((2000, 2))
    points = np.column_stack([plan, 0.01 * np.sin(9 * plan[:, 0])])
    sheet = PointCloud(points, np.tile([0.0, 0, 1], (2000, 1)))
    with pytest.raises(CloudError, match="the cloud has no inside"):
        probes(sheet, 500, seed=0, step=0.2)
