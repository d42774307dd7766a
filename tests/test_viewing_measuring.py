"""The film of a push shows the simulation, and the arrows of two clouds go to the nearest point."""

import pytest
import torch

from lib.exercises.measuring import boxes
from lib.metrics.bodies import GRAVITY
from lib.metrics.stability import AUTHORS_TRIAL, TRIAL
from lib.viewing.cloud_figures import nearest_arrows
from lib.viewing.pushing import push_film, pushed

BLOCK = (0.8, 0.4, 0.8, 0.3, 0.2, -0.1)
APART = boxes(BLOCK, (0.5, 0.3, 0.5, 3.0, 0.15, 0.0))  # two components


@pytest.mark.parametrize("trial", [TRIAL, AUTHORS_TRIAL])
def test_the_film_begins_where_the_shape_stands_and_rises_as_by_hand(trial):
    speed = trial.jump * torch.tensor([0.8, 0.5]).double()
    time = 0.05  # both are still on their way up
    start, later = pushed(APART, [0, time], trial)
    assert torch.allclose(start.corners(), APART.corners(), atol=1e-12)
    rise = later.center[:, 1] - APART.center[:, 1]
    # 2 mm steps of time, and the small turn moves nothing: each body is one box, its center that of mass
    assert torch.allclose(rise, speed * time - GRAVITY * time**2 / 2, atol=1e-3)


def test_boxes_stay_rigid():
    several = boxes(BLOCK, (0.2, 0.6, 0.2, 0.5, 0.7, -0.1))
    (later,) = pushed(several, [0.15])
    assert torch.allclose(later.axes @ later.axes.mT, torch.eye(3).double().expand(2, 3, 3), atol=1e-9)
    gap = [torch.cdist(*[c.corners().flatten(0, 1)] * 2) for c in (several, later)]
    # turned, and yet all distances between corners are the same; 1e-6: cdist's own rounding
    assert torch.allclose(gap[0], gap[1], atol=1e-6) and (later.axes - several.axes).abs().max() > 1e-3


def test_a_film_has_a_frame_a_time():
    assert len(push_film(APART, [0, 0.1, 0.2], size=1.0).axes) == 3


def test_arrows():
    a = torch.tensor([[0.0, 0, 0], [2, 0, 0]]).double()
    b = torch.tensor([[0.0, 1, 0]]).double()
    left, right = nearest_arrows(a, b).axes
    assert [t.get_text() for t in left.texts if t.get_text()] == ["1.00", "2.24"]
    assert [t.get_text() for t in right.texts if t.get_text()] == ["1.00"]
    assert "from a to b: mean 1.618" in left.get_title()
