"""Does a shape stay upright under gravity and a push? (ShapeAssembly paper, section 7.1 and Appendix E)

The shape stands on the ground as rigid bodies, one for each connected component (`bodies`). At the start each component
is pushed (`Trial`): it jumps up, turns on the way, and lands. When all has come to rest, the shape is stable if no
component's center of mass is higher or lower than at the start by more than 10 % of the component's height. A shape
that is not rooted is not stable. A program's unit of length is read as a meter, so the answer depends on the scale.

The paper gives no numbers for its push; the authors' program does, for PyBullet: in one step of 1/240 s a force of
1000 v upwards and torques of 4 v about both horizontal axes and 80 v about the vertical one, where v is the volume
times the smaller horizontal extent. What counts is force times time. With that momentum, a chair 0.86 m wide jumps
0.65 m high. There are two trials:

    AUTHORS_TRIAL   that push, and masses as they come out in that program: as if all parts were at one point. Its
                    shares of stable real shapes are close to the paper's.
    TRIAL           the default: mass, center of mass and inertia are those of the boxes. Thrown as high as above, half
                    of the real chairs topple when they land, in MuJoCo and in PyBullet, and how many depends on the
                    friction and on the contacts' softness. So the upward momentum is half as large, which is a quarter
                    of the height; the angular momentum is the authors'.

In both, the 10 % are the paper's; the authors' program has 2.5 %.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ..interpreters.cuboids import Cuboids
from ..interpreters.shapeassembly import Shape
from .bodies import THINNEST, parts, world_of
from .rootedness import Links, boxes_of

HEIGHT_CHANGE = 0.10  # of a component's height: the paper's; the authors' program has 0.025
STILL = 0.01  # m/s and rad/s: what is slower than this for a while rests
LOOK_EVERY, LOOKS = 0.1, 3  # s from one look to the next, and how many in a row have to find everything still
LONGEST = 20.0  # s of simulated time


@dataclass(frozen=True)
class Trial:
    """What a component starts with, for each kilogram of mass and each meter of w, its smaller horizontal extent.

    jump    upward momentum, kg m/s: it leaves the ground at jump * w meters a second
    turn    angular momentum, kg m²/s, about x, y (upwards) and z through the center of mass
    lumped  masses as in the authors' program instead of the boxes' own, see `bodies.world_of`
    """

    jump: float
    turn: tuple[float, float, float]
    lumped: bool = False


AUTHORS_TRIAL = Trial(jump=1000 / 240, turn=(4 / 240, 80 / 240, 4 / 240), lumped=True)
TRIAL = Trial(jump=500 / 240, turn=AUTHORS_TRIAL.turn)


def stable(cuboids: Cuboids, height_change: float = HEIGHT_CHANGE, trial: Trial = TRIAL) -> bool:
    """Is the shape rooted, and as high after a push as before it? No boxes: True."""
    return bool(stable_many([cuboids], height_change, trial)[0])


def stable_many(
    shapes: Sequence[Shape | Cuboids], height_change: float = HEIGHT_CHANGE, trial: Trial = TRIAL
) -> Bool[np.ndarray, " shapes"]:
    """`stable` of each shape. The mean of this, in percent, is the paper's "% stable"."""
    return height_changes(shapes, trial) <= height_change


def height_changes(shapes: Sequence[Shape | Cuboids], trial: Trial = TRIAL) -> Float[np.ndarray, " shapes"]:
    """How much higher or lower a push leaves each shape: |end - start| of a component's center of mass over the
    component's height, the largest of its components. Infinite for a shape that is not rooted, and for one
    too large to be simulated; 0 for one without boxes.
    """
    links = Links.of(shapes)
    rooted = [bool(part.all()) for part in links.split(links.grounded())]
    return np.array(
        [
            _height_change(boxes_of(shape), component, trial) if stands else np.inf
            for shape, component, stands in zip(shapes, links.components(), rooted)
        ]
    )


def _height_change(boxes: Cuboids, component: Int[np.ndarray, " n"], trial: Trial) -> float:
    """Of one shape that is rooted, whose boxes belong to these components."""
    if not len(boxes):
        return 0.0
    world = world_of(boxes, component, trial.lumped)
    state = mujoco.MjData(world)
    extent = np.stack([np.ptp(part.bounds().numpy(), axis=0) for part in parts(boxes, component)])
    extent = extent.clip(min=THINNEST)
    start = _heights(state)
    push(trial, world, state, extent)
    let_settle(world, state)
    if broke_down(state):
        return np.inf
    return float((np.abs(_heights(state) - start) / extent[:, 1]).max())


def _heights(state: mujoco.MjData) -> Float[np.ndarray, " components"]:
    """Of the components' centers of mass, m."""
    return state.qpos.reshape(-1, 7)[:, 1].copy()  # of each: position, then quaternion


def push(
    trial: Trial, world: mujoco.MjModel, state: mujoco.MjData, extent: Float[np.ndarray, "components 3"]
) -> None:
    """Give each component its momenta. extent: how long the components are along x, y and z, m."""
    mujoco.mj_forward(world, state)
    amount = world.body_mass[1:] * extent[:, [0, 2]].min(1)  # body 0 is the ground
    momentum = amount[:, None] * np.array([0, trial.jump, 0, *trial.turn])
    velocity = np.zeros((1, world.nv))
    mujoco.mj_solveM(world, state, velocity, momentum.reshape(1, -1))
    state.qvel[:] = velocity[0]


def let_settle(world: mujoco.MjModel, state: mujoco.MjData) -> None:
    """Simulate until everything has been still for a while; for LONGEST at most."""
    steps, still = round(LOOK_EVERY / world.opt.timestep), 0
    while still < LOOKS and state.time < LONGEST and not broke_down(state):
        mujoco.mj_step(world, state, steps)
        still = still + 1 if np.abs(state.qvel).max() < STILL else 0


def broke_down(state: mujoco.MjData) -> bool:
    """Did the numbers get too large, as for boxes of 1e9 m? MuJoCo then begins anew at time 0, again and again."""
    bad = (
        mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL,
        mujoco.mjtWarning.mjWARN_BADQACC,
    )
    return any(state.warning[kind].number > 0 for kind in bad)
