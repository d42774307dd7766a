"""Points on many shapes at once: the same as one shape at a time."""

import pytest
import torch

from lib.interpreters.cuboids import Cuboids
from lib.interpreters.shapeassembly import execute_many, parse
from lib.metrics import clouds
from lib.metrics.clouds import SEEDS_APART, surface_points_many


def box(length, height, width):
    """One leaf that fills its bounding box."""
    sizes = f"{length}, {height}, {width}"
    return parse(
        f"Assembly Program_0 {{\nbbox = Cuboid({sizes}, True)\ncube0 = Cuboid({sizes}, True)\n"
        "attach(cube0, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5)\n}\n"
    )


@pytest.mark.parametrize("at_once", [1, 7, 1000])
def test_each_shape_gets_the_points_of_its_own_seed(programs, monkeypatch, at_once):
    monkeypatch.setattr(clouds, "AT_ONCE", at_once)
    shapes = execute_many(programs[:20])
    many = surface_points_many(shapes, 50, seed=3)
    assert many.shape == (20, 50, 3) and many.dtype == torch.float64
    for i, shape in enumerate(shapes):
        torch.testing.assert_close(many[i], shape.surface_points(50, 3 * SEEDS_APART + i), rtol=0, atol=1e-12)


def test_neighbours_do_not_matter(programs):
    alone = surface_points_many(execute_many(programs[:1]), 40)
    torch.testing.assert_close(
        surface_points_many(execute_many(programs[:9]), 40)[:1], alone, rtol=0, atol=1e-12
    )


def test_a_list_of_shapes_is_as_good(programs):
    shapes = execute_many(programs[:5])
    assert torch.equal(surface_points_many(list(shapes), 30), surface_points_many(shapes, 30))


def test_other_seeds_give_other_points(programs):
    shapes = execute_many(programs[:2])
    a, b = surface_points_many(shapes, 30, seed=0), surface_points_many(shapes, 30, seed=1)
    assert not torch.isclose(a, b).all(-1).any()


def test_points_lie_on_the_box_and_as_many_on_a_face_as_its_area_says():
    points = surface_points_many(execute_many([box(2, 1, 1)]), 20_000)[0]
    distance = (points.abs() - torch.tensor([1, 0.5, 0.5])).abs().amin(-1)
    assert distance.max() < 1e-9 and (points.abs() <= torch.tensor([1, 0.5, 0.5]) + 1e-9).all()
    ends = (points[:, 0].abs() - 1).abs() < 1e-9  # 2 of 10 units of area
    assert ends.double().mean() == pytest.approx(0.2, abs=0.012)  # 4 standard deviations


def test_no_shapes_have_no_points():
    assert surface_points_many([], 5).shape == (0, 5, 3)
    assert surface_points_many(execute_many([]), 5).shape == (0, 5, 3)


def test_a_shape_without_a_surface_is_named():
    programs = [box(1, 1, 1), parse("Assembly Program_0 {\nbbox = Cuboid(1, 1, 1, True)\n}\n")]
    with pytest.raises(ValueError, match="shape 1 has no surface: 0 boxes"):
        surface_points_many(execute_many(programs), 5)
    with pytest.raises(ValueError, match="found 0 points"):
        surface_points_many(execute_many(programs[:1]), 0)


def test_numbers_that_are_not_finite_are_named(monkeypatch):
    shapes = execute_many([box(1, 1, 1), box(1, 2, 1)])
    broken = Cuboids(
        torch.ones(2, 3), torch.tensor([[0.0] * 3, [torch.nan] * 3]), torch.eye(3).repeat(2, 1, 1)
    )
    monkeypatch.setattr(clouds, "_leaves", lambda _: (broken, [1, 1]))
    with pytest.raises(ValueError, match="shape 1 has boxes whose numbers are not finite"):
        surface_points_many(shapes, 5)
