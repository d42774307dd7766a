"""Stability of shapes whose fate is known by hand."""

import mujoco
import numpy as np
import pytest
import torch

from lib.interpreters.cuboids import Cuboids
from lib.interpreters.shapeassembly import execute_many, parse
from lib.metrics.bodies import THINNEST, center_of_area, center_of_mass, parts, world_of
from lib.metrics.stability import AUTHORS_TRIAL, TRIAL, Trial, height_changes, push, stable, stable_many

NO_PUSH = Trial(jump=0, turn=(0, 0, 0))


def boxes(*rows: tuple) -> Cuboids:
    """Axis-aligned boxes from (center, size) pairs."""
    center, size = (torch.tensor(column, dtype=torch.float64) for column in zip(*rows))
    return Cuboids(size, center, torch.eye(3, dtype=torch.float64).repeat(len(rows), 1, 1))


def moved(cuboids: Cuboids, way: tuple) -> Cuboids:
    return Cuboids(cuboids.size, cuboids.center + torch.tensor(way).double(), cuboids.axes)


TOP = ((0, 0.725, 0), (1.4, 0.05, 0.8))
TABLE = boxes(TOP, *(((0.65 * x, 0.35, 0.35 * z), (0.08, 0.7, 0.08)) for x in (-1, 1) for z in (-1, 1)))
CUBE = boxes(((0, 0.5, 0), (1, 1, 1)))
# A heavy top on a foot 4 cm wide: it balances, but not for long.
MUSHROOM = boxes(((0, 0.5, 0), (0.04, 1, 0.04)), ((0, 1.2, 0), (0.8, 0.4, 0.8)))
# A post at the end of a long arm: the center of mass is 0.4 beside the post.
GALLOWS = boxes(((0, 0.5, 0), (0.1, 1, 0.1)), ((0.6, 1.05, 0), (1.3, 0.1, 0.3)))
FLOATING = boxes(TOP, ((0, 0.01, 0), (0.1, 0.02, 0.1)))
TOWER = boxes(((0, 1, 0), (0.3, 2, 0.3)))


@pytest.mark.parametrize("trial", [TRIAL, AUTHORS_TRIAL, NO_PUSH])
@pytest.mark.parametrize("shape", [TABLE, CUBE], ids=["table", "cube"])
def test_what_stands_on_a_broad_base_stays_upright(shape, trial):
    assert stable(shape, 0.001, trial)  # as high as before to a thousandth of its height


def test_a_heavy_top_on_a_small_foot_falls_when_pushed():
    assert stable(MUSHROOM, trial=NO_PUSH)
    assert not stable(MUSHROOM) and not stable(MUSHROOM, trial=AUTHORS_TRIAL)


@pytest.mark.parametrize("trial", [TRIAL, NO_PUSH])
def test_a_center_of_mass_beside_the_base_falls_unpushed(trial):
    assert not stable(GALLOWS, trial=trial)


def test_what_is_not_rooted_is_not_stable():
    assert height_changes([FLOATING]).tolist() == [np.inf] and not stable(FLOATING)


def test_a_tower_thrown_over_ends_on_its_side():
    """Its center of mass was at 1 m and comes to lie at 0.15 m: a change of 0.85 m, of 2 m of height."""
    over = Trial(jump=0, turn=(0, 0, 3.0))
    assert height_changes([TOWER], over)[0] == pytest.approx(0.85 / 2, abs=1e-3)  # contacts give way a little
    assert stable(TOWER, 0.43, over) and not stable(TOWER, 0.42, over)


def test_the_limit_is_a_share_of_the_height():
    """A cube 3 cm above the ground, which is near enough to be rooted: it drops that far and stands."""
    gap = 0.03
    raised = boxes(((0, 0.5 + gap, 0), (1, 1, 1)), ((3, 0.02, 0), (0.1, 0.04, 0.1)))
    change = height_changes([raised], NO_PUSH)[0]
    assert change == pytest.approx(gap, abs=1e-3)
    assert stable(raised, trial=NO_PUSH) and not stable(raised, 0.025, NO_PUSH)


def test_a_cube_starts_with_the_momenta_by_hand():
    """Mass 8 kg, w 2 m, moment of inertia mass * side² / 6."""
    world = world_of(moved(boxes(((0, 0, 0), (2, 2, 2))), (3, 4, 5)), np.array([0]))
    state = mujoco.MjData(world)
    push(TRIAL, world, state, np.full((1, 3), 2.0))
    assert state.qvel[:3] == pytest.approx([0, 2 * 500 / 240, 0])
    assert state.qvel[3:] == pytest.approx([6 / 4 * 2 * turn for turn in TRIAL.turn])


def test_the_authors_force_lasts_one_step():
    """A force of 1000 v for 1/240 s, with v the volume times w; here per volume and w."""
    assert AUTHORS_TRIAL.jump * 240 == pytest.approx(1000)
    assert [240 * turn for turn in AUTHORS_TRIAL.turn] == pytest.approx([4, 80, 4])


def test_the_masses_of_a_dumbbell_by_hand():
    """Cubes of 1 and 8 m³: together 9 kg, 4 m apart, so 4 * 8 / 9 m from the small one's center to the middle."""
    dumbbell = boxes(((0, 0, 0), (1, 1, 1)), ((4, 0, 0), (2, 2, 2)))
    together = np.array([0, 0])
    own = 1 / 6 + 8 * 4 / 6  # of each cube about its own center, any axis
    world = world_of(dumbbell, together)
    assert world.body_pos[1] == pytest.approx([32 / 9, 0, 0]) and world.body_mass[1] == pytest.approx(9)
    assert sorted(world.body_inertia[1]) == pytest.approx([own, own + 8 / 9 * 16, own + 8 / 9 * 16])
    lumped = world_of(dumbbell, together, lumped=True)
    assert lumped.body_pos[1] == pytest.approx([4 * 24 / 30, 0, 0])  # 6 and 24 m² of faces
    assert lumped.body_inertia[1] == pytest.approx(own)
    assert center_of_mass(dumbbell)[0] == pytest.approx(32 / 9) and center_of_area(dumbbell)[0] == 3.2


def test_each_component_is_a_body():
    pair = boxes(((0, 0.5, 0), (1, 1, 1)), ((5, 0.5, 0), (1, 1, 1)))
    world = world_of(pair, np.array([0, 1]))
    assert world.nbody == 3 and world.body_geomnum.tolist() == [1, 1, 1]
    assert [part.center[0, 0].item() for part in parts(pair, np.array([0, 1]))] == [0, 5]
    assert stable(pair)


def test_the_worst_component_counts():
    away = moved(GALLOWS, (5, 0, 0))
    both = Cuboids(*(torch.cat(each) for each in zip(*(vars(x).values() for x in (TABLE, away)))))
    assert height_changes([both], NO_PUSH)[0] == pytest.approx(height_changes([away], NO_PUSH)[0], rel=0.01)


def test_components_touch_the_ground_and_never_one_another():
    """Two geoms collide in MuJoCo if the type of one is in the affinity of the other. Geom 0 is the ground."""
    world = world_of(boxes(((0, 0.5, 0), (1, 1, 1)), ((5, 0.5, 0), (1, 1, 1))), np.array([0, 1]))
    meets = (world.geom_contype[:, None] & world.geom_conaffinity) > 0
    assert (meets | meets.T).tolist() == [[False, True, True], [True, False, False], [True, False, False]]


def test_a_shape_stands_anywhere():
    """The ground is at the shape's lowest point, wherever that is."""
    ways = [(0.0, 0.0, 0.0), (0.0, 7.0, 0.0), (3.0, -2.0, 5.0)]
    assert stable_many([moved(TABLE, way) for way in ways]).all()
    assert not stable_many([moved(GALLOWS, way) for way in ways]).any()


def test_a_mirrored_box_is_the_same_box():
    mirrored = Cuboids(TABLE.size, TABLE.center, TABLE.axes * torch.tensor([1.0, 1, -1]).double()[:, None])
    assert height_changes([mirrored], NO_PUSH) == pytest.approx(height_changes([TABLE], NO_PUSH), abs=1e-6)


def test_the_same_answer_every_time_and_in_any_company():
    alone = [height_changes([shape])[0] for shape in (TABLE, MUSHROOM, GALLOWS)]
    assert height_changes([GALLOWS, TABLE, MUSHROOM]).tolist() == [alone[2], alone[0], alone[1]]


def test_boxes_without_volume_are_simulated_too():
    sheet = boxes(((0, 0, 0), (1, 0, 1)))
    assert world_of(sheet, np.array([0])).body_mass[1] == pytest.approx(THINNEST)
    assert np.isfinite(height_changes([sheet, boxes(((0, 0, 0), (0, 0, 0)))])).all()
    assert not stable(boxes(((0, 0, 0), (1e6, 1e-6, 1))))  # rounding spoils its inertia; MuJoCo balances it


def test_numbers_that_are_none_do_not_stand():
    assert not stable(boxes(((0, np.nan, 0), (1, 1, 1))))


def test_nothing_is_stable():
    assert stable(CUBE[:0]) and stable_many([]).tolist() == []


def test_most_real_chairs_stand(real_texts, unchecked_shapes):
    """Of 496, 84 % do; of the first hundred, with four standard errors to spare, 70 to 98 %."""
    texts = real_texts["chair"]
    shapes = execute_many([parse(texts[name]) for name in sorted(texts)[:100]])
    assert 0.70 <= stable_many(shapes).mean() <= 0.98


@pytest.mark.parametrize("length", [1e9, 1e200])
@pytest.mark.filterwarnings("ignore:overflow")
def test_a_shape_too_large_to_simulate_is_not_stable_and_ends(length, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings to a file where it runs
    sides = torch.tensor([[length, 1.0, 1.0]], dtype=torch.float64)
    giant = Cuboids(sides, sides / 2, torch.eye(3, dtype=torch.float64)[None])
    assert not stable(giant)
