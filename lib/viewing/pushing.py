"""The push of `lib.metrics.stability` as a strip of film: where the boxes of a shape are after so many seconds."""

from collections.abc import Sequence

import mujoco
import numpy as np
import torch
from matplotlib.figure import Figure

from lib.interpreters.cuboids import Cuboids
from lib.metrics.bodies import THINNEST, parts, world_of
from lib.metrics.rootedness import Links, boxes_of
from lib.metrics.stability import TRIAL, Trial, push
from lib.viewing.figure import film_strip


def pushed(shape, times: Sequence[float], trial: Trial = TRIAL) -> list[Cuboids]:
    """The boxes of a Shape, or Cuboids, at each of these times, s after the push, in rising order; time 0 is before it.

    Each connected component moves as one body, as in `stability.stable`. World units, read as meters.
    """
    boxes = boxes_of(shape)
    component = Links.of([boxes]).components()[0]
    world = world_of(boxes, component, trial.lumped)
    state = mujoco.MjData(world)
    start = state.qpos.reshape(-1, 7)[:, :3].copy()  # of each body: position, then quaternion
    extent = np.stack([np.ptp(part.bounds().numpy(), axis=0) for part in parts(boxes, component)])
    push(trial, world, state, extent.clip(min=THINNEST))
    found = []
    for time in times:
        while state.time < time - world.opt.timestep / 2:
            mujoco.mj_step(world, state)
        found.append(_moved(boxes, component, start, state.qpos.reshape(-1, 7)))
    return found


def _moved(boxes: Cuboids, component: np.ndarray, start: np.ndarray, poses: np.ndarray) -> Cuboids:
    """Boxes that went along with their components, from `start` (bodies, 3) to `poses` (bodies, 7)."""
    turns = np.zeros((len(poses), 9))
    for turn, pose in zip(turns, poses):
        mujoco.mju_quat2Mat(turn, pose[3:])
    turn = torch.from_numpy(turns.reshape(-1, 3, 3))[component].mT  # rows are turned by the transpose
    offset = (boxes.center - torch.from_numpy(start)[component]).unsqueeze(1) @ turn
    center = torch.from_numpy(poses[:, :3].copy())[component] + offset.squeeze(1)
    return Cuboids(boxes.size, center, boxes.axes @ turn)


def push_film(shape, times: Sequence[float], trial: Trial = TRIAL, size: float = 2.0) -> Figure:
    """One frame a time, seen by one camera."""
    return film_strip(
        pushed(shape, times, trial), [f"{time:.2f} s" for time in times], columns=len(times), size=size
    )
