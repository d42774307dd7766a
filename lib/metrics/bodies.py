"""A shape as rigid bodies on the ground, in MuJoCo.

Boxes that are connected (see `rootedness`) are glued together: each connected component is one free body, made of box
geoms of density 1. MuJoCo sums up their masses and inertias, about the true center of mass; where boxes overlap, both
count. The ground is a plane at the shape's lowest point. Components touch the ground, never one another.

World axes as everywhere here: x right, y up, z to the front. Units are meters, kilograms and seconds; a program's unit
of length is read as a meter.
"""

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ..interpreters.cuboids import Cuboids

DENSITY = 1.0  # kg/m³; another one would give the same motion, as every force here grows with the mass
GRAVITY = 9.8  # m/s², downwards
FRICTION = 0.5  # Coulomb's coefficient: wood on a floor
TIME_STEP = 0.002  # s
# m: boxes without volume have no inertia to compute with; real programs have none below 0.008
THINNEST = 0.002
# MuJoCo's solref: a contact settles within 5 ms, critically damped, so that hardly anything bounces.
CONTACT = [0.005, 1.0]
# MuJoCo's solimp: stiff; what rests sinks in by less than a tenth of a millimeter.
HARDNESS = [0.99, 0.999, 0.001, 0.5, 2.0]
UP_IS_Y = [0.5**0.5, -(0.5**0.5), 0.0, 0.0]  # quaternion that turns a plane's normal from z to y


def world_of(boxes: Cuboids, component: Int[np.ndarray, " n"], lumped: bool = False) -> mujoco.MjModel:
    """The ground and a free body for each component: body i + 1 is component i.

    component   for each box the number, from 0, of its component
    lumped      masses as they come out in the authors' PyBullet program, see `_lump`
    At the start a body's frame is at its center of mass, parallel to the world's axes.
    """
    spec, bodies = _ground(float(boxes.bounds()[0, 1])), parts(boxes, component)
    middles = [center_of_area(part) if lumped else center_of_mass(part) for part in bodies]
    for part, middle in zip(bodies, middles):
        body = spec.worldbody.add_body(pos=middle)
        body.add_freejoint()
        for half, center, axes in zip(_sides(part) / 2, part.center.numpy() - middle, part.axes.numpy()):
            _add_box(body, half, center, axes)
    world = spec.compile()
    if lumped:
        _lump(world, bodies)
    return world


def parts(boxes: Cuboids, component: Int[np.ndarray, " n"]) -> list[Cuboids]:
    """The boxes of component 0, of component 1, …"""
    return [boxes[np.flatnonzero(component == i)] for i in range(component.max() + 1)]


def center_of_mass(boxes: Cuboids) -> Float[np.ndarray, "3"]:
    """Of boxes of equal density, as thick as they are simulated, m."""
    mass = _sides(boxes).prod(-1)
    return mass @ boxes.center.numpy() / mass.sum()


def center_of_area(boxes: Cuboids) -> Float[np.ndarray, "3"]:
    """Of the faces of all boxes, m."""
    length, height, width = _sides(boxes).T
    area = length * height + height * width + width * length
    return area @ boxes.center.numpy() / area.sum()


def _sides(boxes: Cuboids) -> Float[np.ndarray, "n 3"]:
    """Sizes as they are simulated, m."""
    return boxes.size.abs().clamp(min=THINNEST).numpy()


def _lump(world: mujoco.MjModel, bodies: list[Cuboids]) -> None:
    """Masses as the authors' PyBullet program has them: every part's center of mass is at the origin of its body's
    frame, so that there are no terms for being far from it, and its inertia is that of its bounds along the world's
    axes. (The file that program writes says 1 kg m²; PyBullet, as it is called, computes its own.)"""
    for number, part in enumerate(bodies, start=1):
        mass, corners = _sides(part).prod(-1), part.corners().numpy()
        squared = np.ptp(corners, axis=1) ** 2
        world.body_inertia[number] = mass @ (squared.sum(-1, keepdims=True) - squared) / 12
        world.body_ipos[number], world.body_iquat[number] = 0, [1, 0, 0, 0]
    mujoco.mj_setConst(world, mujoco.MjData(world))


def _ground(height: float) -> mujoco.MjSpec:
    """A world with nothing but the ground, which collides with every part."""
    spec = mujoco.MjSpec()
    spec.option.timestep = TIME_STEP
    spec.option.gravity = [0, -GRAVITY, 0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # friction equally strong in every direction
    # Of a box of 1e6 by 1e-6, rounding leaves inertias that no body can have.
    spec.compiler.balanceinertia = True
    spec.option.impratio = 10  # and stiff: what stands on a slant does not creep
    plane = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], quat=UP_IS_Y)
    plane.pos = [0, height, 0]
    _touches(plane, kind=0, others=1)
    return spec


def _add_box(body, half: np.ndarray, center: np.ndarray, axes: np.ndarray) -> None:
    """One box of a body: half its sides, and its center and axes (rows) in the body's frame."""
    turn = np.zeros(4)
    mujoco.mju_mat2Quat(turn, np.ascontiguousarray(_right_handed(axes).T).ravel())
    box = body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=center, quat=turn, density=DENSITY)
    _touches(box, kind=1, others=0)


def _right_handed(axes: np.ndarray) -> np.ndarray:
    """A mirrored box is the same box: one of its axes may be turned around to make a rotation of them."""
    return axes if np.linalg.det(axes) > 0 else axes * [[-1], [1], [1]]


def _touches(geom, kind: int, others: int) -> None:
    """Two geoms collide if the kind of one is among the others of the other: parts and the ground, not parts."""
    geom.contype, geom.conaffinity = kind, others
    geom.friction[0] = FRICTION
    geom.solref, geom.solimp = CONTACT, HARDNESS
