"""Pictures say what is there; figures keep their size; the projection agrees with the picture."""

import io
import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
import trimesh
from PIL import Image

from lib.interpreters.cuboids import Cuboids
from lib.viewing.camera import Camera
from lib.viewing.figure import draw, draw_points, film_strip, show
from lib.viewing.picture import render

RED, BLUE = (220, 60, 60), (60, 90, 220)
JS = Path(__file__).parents[1] / "lib" / "viewing" / "js"


def box(size, center, color=RED) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(size)
    mesh.apply_translation(center)
    mesh.visual.face_colors = [*color, 255]
    return mesh


def cuboids(*sizes_and_centers) -> Cuboids:
    size, center = torch.tensor(sizes_and_centers, dtype=torch.float64).unbind(1)
    return Cuboids(size, center, torch.eye(3, dtype=torch.float64).expand(len(size), 3, 3))


def hue_at(image: np.ndarray, camera: Camera, point) -> str:
    """What is seen where a world point falls: "red", "blue", or "nothing"."""
    u, v = camera.project([point])[0]
    left, right, bottom, top = camera.window
    row = int((top - v) / (top - bottom) * len(image))
    pixel = image[row, int((u - left) / (right - left) * len(image))].astype(int)
    return "nothing" if pixel[3] < 128 else "red" if pixel[0] > pixel[2] else "blue"


@pytest.mark.parametrize("azimuth, seen", [(0.0, "red"), (180.0, "blue")])
def test_the_nearer_box_hides_the_other(azimuth, seen):
    both = trimesh.util.concatenate(
        [box((1, 1, 0.2), (0, 0, 0.5), RED), box((1, 1, 0.2), (0, 0, -0.5), BLUE)]
    )
    camera = Camera(azimuth=azimuth, bounds=both.bounds)
    assert hue_at(render(both, camera, 200), camera, (0, 0, 0)) == seen


def test_boxes_that_run_through_one_another_share_the_picture():
    """A red and a blue board crossed like an X seen from above: sorting whole faces could not draw this."""
    boards = [box((2, 0.4, 0.1), (0, 0, 0), color) for color in (RED, BLUE)]
    for board, turn in zip(boards, (30, -30), strict=True):
        board.apply_transform(trimesh.transformations.rotation_matrix(np.radians(turn), (0, 1, 0)))
    both = trimesh.util.concatenate(boards)
    camera = Camera(azimuth=0.0, elevation=0.0, bounds=both.bounds)
    image = render(both, camera, 200)
    assert hue_at(image, camera, (-0.5, 0, 0.2)) != hue_at(image, camera, (0.5, 0, 0.2))


def test_a_projected_point_falls_on_its_own_pixels():
    far_apart = [(-1.0, -0.6, 0.8), (0.9, 0.7, -0.9), (0.3, -0.2, 1.0)]
    camera = Camera(azimuth=50.0, elevation=35.0, bounds=[(-1.1, -1.1, -1.1), (1.1, 1.1, 1.1)])
    left, right, _, top = camera.window
    for point in far_apart:
        image = render(box((0.1, 0.1, 0.1), point), camera, 300, shadow=False)
        row, column = np.argwhere(image[..., 3] > 0).mean(axis=0) + 0.5
        pixel = (right - left) / 300
        found = (left + column * pixel, top - row * pixel)
        assert camera.project([point])[0] == pytest.approx(found, abs=2 * pixel)  # 2: a box is no point


def test_parts_and_creases_have_dark_lines_and_smooth_surfaces_none():
    two = trimesh.util.concatenate([box((1, 1, 1), (-0.5, 0, 0)), box((1, 1, 1), (0.5, 0, 0))])
    front = Camera(azimuth=0.0, elevation=0.0, bounds=two.bounds)
    middle = render(two, front, 201, shadow=False)[100, :, :3].sum(axis=1)  # one row, across both front faces
    assert middle[100] < 0.7 * middle[50]
    ball = trimesh.creation.icosphere(subdivisions=3)
    ball.visual.face_colors = [*RED, 255]
    image = render(ball, Camera(bounds=ball.bounds), 200, shadow=False)
    inside = image[60:140, 60:140, 0].astype(int)
    assert np.abs(np.diff(inside, axis=1)).max() < 40  # a line would be a step of more than 80


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.Trimesh(),
        box((1, 0, 1), (0, 0, 0)),
        box((0, 0, 0), (0, 0, 0)),
        trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]], process=False),
    ],
    ids=["empty", "flat", "a point", "not a number"],
)
def test_strange_meshes_make_a_picture_all_the_same(mesh):
    figure, ax = plt.subplots(figsize=(1, 1))
    draw(ax, mesh)
    plt.close(figure)


def test_a_box_of_negative_size_looks_like_its_positive_twin():
    turned = box((1, 1, 1), (0, 0, 0))
    turned.invert()
    camera = Camera(bounds=turned.bounds)
    image, twin = render(turned, camera, 100), render(box((1, 1, 1), (0, 0, 0)), camera, 100)
    assert np.abs(image.astype(int) - twin).max() <= 1  # rounding


def test_colours_of_the_picture_are_those_of_the_faces():
    camera = Camera(azimuth=0.0, elevation=0.0, bounds=[(-0.5,) * 3, (0.5,) * 3])
    pixel = render(box((1, 1, 1), (0, 0, 0), RED), camera, 100)[50, 50].astype(float)
    assert pixel[3] == 255
    assert pixel[:3] / pixel[0] == pytest.approx(np.array(RED) / RED[0], abs=0.02)  # shaded, not tinted


def test_a_sheet_is_a_closed_figure_of_modest_size():
    shapes = [box((1, 1 + k / 10, 1), (0, 0, 0)) for k in range(12)]
    figure = show(shapes, [f"chair {k}" for k in range(12)], columns=4)
    assert len(figure.axes) == 12 and not plt.get_fignums()
    page = io.BytesIO()
    figure.savefig(page)
    assert page.tell() < 200_000
    assert np.asarray(Image.open(page)).shape[1] == 960


def test_same_scale_makes_sizes_comparable():
    small, large = box((0.5, 0.5, 0.5), (0, 0, 0)), box((1, 1, 1), (0, 0, 0))
    assert len({ax.get_xlim() for ax in show([small, large], same_scale=True).axes}) == 1
    assert len({ax.get_xlim() for ax in show([small, large]).axes}) == 2


def test_a_film_strip_takes_shapes_boxes_and_nothing():
    boxes = cuboids(((1, 1, 1), (0, 0, 0)), ((0.2, 2, 0.2), (1, 0, 0)))
    details = [
        {"labels": {"here": (0, 0, 0)}},
        {"points": [(0, 0, 0)], "arrows": [((0, 1, 0), (0, 0, 0))]},
        {},
    ]
    figure = film_strip([None, boxes[:1], boxes], ["a", "b", "c\nd"], ghost=boxes[:1], details=details)
    assert [ax.get_xlabel() for ax in figure.axes] == ["a", "b", "c\nd"]
    figure.savefig(io.BytesIO())


@pytest.mark.parametrize("wrong", [{"titles": ["one"]}, {"details": [{}] * 3}])
def test_titles_must_be_as_many_as_shapes(wrong):
    with pytest.raises(ValueError, match="for 2 shapes"):
        show([None, None], **wrong)


def test_what_cannot_be_drawn_is_named():
    with pytest.raises(TypeError, match="cannot draw a str"):
        show("chair")


@pytest.mark.parametrize(
    "points", [np.random.default_rng(0).normal(size=(50, 3)), np.empty((0, 3)), torch.zeros(1, 3)]
)
def test_points_are_drawn_far_ones_first(points):
    figure, ax = plt.subplots()
    camera = draw_points(ax, points)
    drawn = np.asarray(ax.collections[0].get_offsets())
    order = np.argsort(-camera.depth(points))
    assert drawn == pytest.approx(camera.project(points)[order])
    plt.close(figure)


def test_the_bundle_loads_nothing_from_elsewhere():
    bundle = (JS / "shape_view.bundle.js").read_text(encoding="utf-8")
    assert not re.search(r"""(import|from)\s*\(?\s*["']https?:""", bundle)
    assert "http" not in (JS / "package-lock.json").read_text(encoding="utf-8")
