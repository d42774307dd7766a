"""Samples of solids: on the surface, in and out as the solid says, at the right size and place."""

import numpy as np
import pytest
import torch
import trimesh

from lib.datasets import DataError, example, solid
from lib.datasets.solid_sampling import by_winding, sample_solid
from lib.interpreters.shapeassembly import execute
from lib.interpreters.stump import Stump
from lib.interpreters.stump import execute as execute_stump


def box(extents, center=(0, 0, 0)) -> trimesh.Trimesh:
    return trimesh.creation.box(extents, trimesh.transformations.translation_matrix(center))


def in_box(extents, center=(0, 0, 0)):
    half = np.array(extents) / 2
    return lambda points: (np.abs(points - np.array(center)) <= half).all(1)


def test_a_box_by_hand():
    """Sides 2, 4, 4 and diagonal 6: a third, two thirds, two thirds afterwards, about the origin."""
    made = sample_solid(box((2, 4, 4), (5, 6, 7)), in_box((2, 4, 4), (5, 6, 7)), 3000, 4000)
    half = np.array([1, 2, 2]) / 6
    on = np.abs(made.points) / half
    assert np.allclose(on.max(1), 1) and np.allclose(np.abs(made.normals).max(1), 1)
    axis = on.argmax(1)
    rows = np.arange(3000)
    assert (np.sign(made.points[rows, axis]) == made.normals[rows, axis]).all()  # outwards
    assert np.bincount(axis) / 3000 == pytest.approx([16 / 32, 8 / 32, 8 / 32], abs=0.03)  # by area
    inside = (np.abs(made.queries) <= half + 1e-12).all(1)
    assert inside[:2000].all() and not inside[2000:].any()
    assert (np.abs(made.queries) < half * 1.1 + 0.15).all()


def test_faces_inside_other_parts_are_left_out():
    """A rod through a plate: nothing of it shows where the plate is."""
    parts = [((4, 4, 1), (0, 0, 0)), ((1, 1, 6), (0, 0, 0))]
    mesh = trimesh.util.concatenate([box(*part) for part in parts])
    made = sample_solid(mesh, lambda p: in_box(*parts[0])(p) | in_box(*parts[1])(p), 4000, 100)
    diagonal = np.sqrt(16 + 16 + 36)
    points = made.points * diagonal
    hidden = (np.abs(points[:, :2]) <= 0.5 + 1e-6).all(1) & (np.abs(points[:, 2]) <= 0.5 + 1e-6)
    assert not hidden.any()
    rod = np.abs(points[:, 2]) > 0.5 + 1e-6
    assert rod.mean() == pytest.approx(22 / (22 + 2 * 15 + 16), abs=0.03)


@pytest.mark.parametrize("name", ["chair", "mug"])
def test_shapes_of_the_languages(name):
    shape = (
        execute(example("dining_chair")) if name == "chair" else execute_stump(Stump.from_tree(solid("mug")))
    )
    mesh = shape.mesh()
    made = sample_solid(mesh, by_winding(mesh), 500, 600)
    low, high = mesh.bounds
    scale, middle = np.linalg.norm(high - low), (low + high) / 2
    inside = shape.occupancy(torch.from_numpy(made.queries * scale + middle))
    assert (
        inside[:300].float().mean() > 0.99 and inside[300:].float().mean() < 0.01
    )  # flat faces for round ones
    near = [made.points + side * 2e-3 * made.normals for side in (-1, 1)]
    inner, outer = (shape.occupancy(torch.from_numpy(p * scale + middle)).float().mean() for p in near)
    assert inner > 0.97 and outer < 0.03
    assert np.linalg.norm(np.ptp(made.points, axis=0)) == pytest.approx(1, abs=0.02)


def test_faces_turned_inwards_and_gaps():
    """A box with some faces turned the wrong way round as a whole, and one without its lid."""
    whole = box((2, 2, 2))
    inside_out = trimesh.Trimesh(whole.vertices, whole.faces[:, ::-1], process=False)
    open_box = trimesh.Trimesh(whole.vertices, whole.faces[whole.face_normals[:, 2] < 0.5], process=False)
    middle, corner, beside = np.array([[0, 0, 0], [0.9, 0.9, -0.9], [1.1, 0, 0]])
    for mesh in (whole, inside_out, open_box):
        assert by_winding(mesh)(np.stack([middle, corner, beside])).tolist() == [True, True, False]
    made = sample_solid(inside_out, by_winding(inside_out), 300, 20)
    assert ((made.points * made.normals).sum(1) > 0).all()  # outwards all the same


def test_the_seed_decides():
    first, same, other = (sample_solid(box((1, 1, 2)), in_box((1, 1, 2)), 50, 60, seed) for seed in (0, 0, 1))
    assert np.array_equal(first.points, same.points) and np.array_equal(first.queries, same.queries)
    assert not np.array_equal(first.points, other.points)


@pytest.mark.parametrize(
    "mesh, contains, told",
    [
        (trimesh.Trimesh(), in_box((1, 1, 1)), "mesh of 0 faces"),
        (trimesh.Trimesh([[0, 0, 0]] * 3, [[0, 1, 2]], process=False), in_box((1, 1, 1)), "without extent"),
        (box((1, 1, 1)), lambda p: np.zeros(len(p), bool), "found 0 points on the surface; expected"),
        (box((1, 1, 1)), lambda p: np.ones(len(p), bool), "found 0 points on the surface; expected"),
    ],
)
def test_what_is_no_solid_is_told(mesh, contains, told):
    with pytest.raises(DataError, match=told):
        sample_solid(mesh, contains, 10, 20)
