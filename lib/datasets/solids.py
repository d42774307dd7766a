"""Ten everyday solids as trees of operations: what the finding of stumps is measured on.

    tree = solid("mug")        a Tree with primitives of lib.interpreters.stump at its leaves; SOLIDS has the names

x right, y to the back, z up. Each is written below in a unit that suits it and then scaled to diagonal 1 around the
origin. Every kind of primitive occurs; holes are subtractions, a hexagon is an intersection, some parts are turned.
"""

import functools
import math
from collections.abc import Callable, Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from lib.interpreters.csg import Operation, Tree
from lib.interpreters.stump import Box, Cone, Cylinder, Primitive, Sphere
from lib.interpreters.stump.bounds import primitive_bounds
from lib.interpreters.stump.poses import matrices, quaternion

from .base import DataError

Node = Tree | Primitive
X, Y, Z = 0, 1, 2  # axes


@functools.cache
def solid(name: str) -> Node:
    """One of SOLIDS; the diagonal of its bounds is 1, their middle the origin. Raises DataError for another name."""
    if name not in _MAKERS:
        raise DataError(f"found no solid {name!r:.40}; expected one of {', '.join(SOLIDS)}")
    return fitted(_MAKERS[name]())


def fitted(tree: Node) -> Node:
    """The same solid, scaled to diagonal 1 and moved to the origin."""
    low, high = bounds(tree)
    scale = 1 / (high - low).norm()

    def fit(p: Primitive) -> Primitive:
        lengths = {key: getattr(p, key) * scale for key in p.counts if key in p.written and key != "slope"}
        kept = {"slope": p.slope} if isinstance(p, Cone) else {}
        place = (p.translation - (low + high) / 2) * scale
        return type(p)(**lengths, **kept, translation=place, rotation=p.rotation)

    return _mapped(tree, fit)


def bounds(tree: Node) -> Float[Tensor, "2 3"]:
    """Lowest and highest coordinates; a little wide where a subtraction or an intersection cuts off an end."""
    if isinstance(tree, Primitive):
        return primitive_bounds(tree)
    left, right = bounds(tree.left), bounds(tree.right)
    if tree.operation.name == "union":
        return torch.stack([torch.minimum(left[0], right[0]), torch.maximum(left[1], right[1])])
    if tree.operation.name == "intersect":
        return torch.stack([torch.maximum(left[0], right[0]), torch.minimum(left[1], right[1])])
    return left


def _bracket() -> Node:
    """A shelf bracket: a foot, a wall plate, a rib between them, and holes for screws."""
    rib = _common(_box((3, 16, 16), (0, 2, 10)), _turned(_box((9, 40, 30), (0, 0, -8.5)), X, 45))
    body = _union(_box((22, 24, 3.5), (0, 0, 1.75)), _box((22, 3.5, 24), (0, 10.25, 12)), rib)
    foot = [_rod(2.2, 8, (x, -5, 2)) for x in (-6.5, 6.5)]
    return _without(body, *foot, *[_rod(2.2, 8, (x, 10, 15), Y) for x in (-6.5, 6.5)])


def _bolt() -> Node:
    """A hexagonal head, a shaft, and a blunt end."""
    across = 17 / math.cos(math.pi / 6)  # from corner to corner
    flats = [_turned(_box((across, 17, 7), (0, 0, 15)), Z, degrees) for degrees in (0, 60, 120)]
    shaft = _common(_rod(5, 38, (0, 0, -5)), _cone((0, 0, -27), 1, 50))
    return _union(_common(*flats), shaft)


def _mug() -> Node:
    """A cup with a round handle."""
    handle = _without(_rod(4.5, 2.4, (7.5, 0, 7), Y), _rod(2.7, 4, (7.5, 0, 7), Y))
    return _without(_union(_rod(6, 14, (0, 0, 7)), handle), _rod(5, 14, (0, 0, 8.4)))


def _hinge() -> Node:
    """Two leaves, opened by 120 degrees, on a hollow knuckle; the screws' heads sink into cones."""
    leaf = _box((20, 26, 2.6), (11, 0, 0))
    for y in (-7.5, 7.5):
        leaf = _without(leaf, _rod(1.6, 9, (14, y, 0)), _cone((14, y, -1.8), 1, 5))
    leaves = _union(_turned(leaf, Y, -30), _turned(_turned(leaf, Z, 180), Y, 30))
    return _without(_union(leaves, _rod(4, 26, (0, 0, 0), Y)), _rod(2, 40, (0, 0, 0), Y))


def _table() -> Node:
    """A round top on a frame, and four legs that stand apart."""
    leg = _turned(_rod(1.8, 46, (0, 0, -16)), Y, -10)
    legs = [_turned(_moved(leg, (10, 0, 32)), Z, degrees) for degrees in (45, 135, 225, 315)]
    level = _common(_union(*legs), _box((80, 80, 32), (0, 0, 16)))
    return _union(level, _box((22, 22, 4), (0, 0, 29)), _rod(26, 3, (0, 0, 32.5)))


def _chair() -> Node:
    """Four square legs, a seat, and a back of two posts and two slats that leans."""
    legs = [_box((5, 5, 40), (x, y, 20)) for x in (-18, 18) for y in (-18, 18)]
    back = [_box((5, 4, 48), (x, 0, 22)) for x in (-18, 18)]
    back += [_box((36, 4, 10), (0, 0, z)) for z in (19, 37)]
    back = _moved(_turned(_union(*back), X, -12), (0, 18, 44))
    above = _common(back, _box((60, 60, 60), (0, 20, 72)))
    return _union(*legs, _box((41, 41, 6), (0, 0, 43)), above)


def _flange() -> Node:
    """The end of a pipe: a plate with six holes, a neck that widens, and a bore through all."""
    neck = _common(_cone((0, 0, 34), 0.47, 34, down=True), _box((60, 60, 22), (0, 0, 11)))
    holes = [_turned(_rod(2, 20, (16, 0, 0)), Z, 60 * k) for k in range(6)]
    return _without(_union(_rod(20, 5, (0, 0, 2.5)), neck, _rod(8, 28, (0, 0, 14))), _rod(5, 80), *holes)


def _lamp() -> Node:
    """A table lamp: a foot, a pole, a bulb, and a shade that is open above and below."""
    shade = _without(_cone((0, 0, 62), 0.5, 34, down=True), _cone((0, 0, 58), 0.5, 40, down=True))
    shade = _common(shade, _box((80, 80, 17), (0, 0, 36.5)))
    return _union(_rod(12, 4, (0, 0, 2)), _rod(2, 30, (0, 0, 18)), _ball(6, (0, 0, 36)), shade)


def _birdhouse() -> Node:
    """A hollow house under two boards, with a door and a perch."""
    gable = _turned(_box((28, 20, 28), (0, 0, 0)), Y, 45)
    house = _common(_box((20, 20, 36), (0, 0, 18)), _moved(gable, (0, 0, 9)))
    house = _without(house, _box((15, 15, 15), (0, 0, 10)), _rod(4, 10, (0, -10, 13), Y))
    boards = [_turned(_box((22, 26, 3), (side * 5.5, 0, 15)), Y, side * -45) for side in (-1, 1)]
    return _union(house, *[_moved(board, (0, 0, 9)) for board in boards], _rod(1.4, 9, (0, -13, 6), Y))


def _ice_cream() -> Node:
    """Three scoops in a cone, and a wafer stuck into them."""
    scoops = [_ball(5, (-4, 0, 22)), _ball(5, (4, 0, 22)), _ball(5, (0, 0, 28))]
    wafer = _moved(_turned(_box((4, 2, 16)), Y, 30), (6, 0, 31))
    return _union(_cone((0, 0, 0), 0.4, 20), *scoops, wafer)


_MAKERS: dict[str, Callable[[], Node]] = {
    "bracket": _bracket,
    "bolt": _bolt,
    "mug": _mug,
    "hinge": _hinge,
    "table": _table,
    "chair": _chair,
    "flange": _flange,
    "lamp": _lamp,
    "birdhouse": _birdhouse,
    "ice_cream": _ice_cream,
}
SOLIDS = tuple(_MAKERS)


def _tree(symbol: str, *nodes: Node) -> Node:
    return functools.reduce(functools.partial(Tree, Operation(symbol)), nodes)


_union, _common, _without = (functools.partial(_tree, symbol) for symbol in "+*-")


def _box(sides: Sequence[float], middle: Sequence[float] = (0, 0, 0)) -> Box:
    return Box([side / 2 for side in sides], [float(x) for x in middle])


def _ball(radius: float, middle: Sequence[float]) -> Sphere:
    return Sphere(float(radius), [float(x) for x in middle])


def _rod(radius: float, height: float, middle: Sequence[float] = (0, 0, 0), axis: int = Z) -> Cylinder:
    """A cylinder along the z axis, or the y axis."""
    lying = quaternion(_turn(X, 90)) if axis == Y else None
    return Cylinder(float(radius), float(height), [float(x) for x in middle], lying)


def _cone(apex: Sequence[float], slope: float, height: float, down: bool = False) -> Cone:
    """Its base is above the apex, or below it."""
    over = quaternion(_turn(X, 180)) if down else None
    return Cone(float(slope), float(height), [float(x) for x in apex], over)


def _turn(axis: int, degrees: float) -> Float[Tensor, "3 3"]:
    """Turns points about an axis through the origin, counter-clockwise where the axis points to the eye."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    matrix = torch.eye(3, dtype=torch.float64)
    one, other = (axis + 1) % 3, (axis + 2) % 3
    matrix[one, one] = matrix[other, other] = c
    matrix[one, other], matrix[other, one] = -s, s
    return matrix


def _turned(node: Node, axis: int, degrees: float) -> Node:
    """All of it, turned about an axis through the origin."""
    turn = _turn(axis, degrees)

    def one(p: Primitive) -> Primitive:
        pose = {"translation": turn @ p.translation, "rotation": quaternion(matrices(p.rotation) @ turn.T)}
        return _with_pose(p, pose)

    return _mapped(node, one)


def _moved(node: Node, shift: Sequence[float]) -> Node:
    step = torch.tensor(shift, dtype=torch.float64)
    return _mapped(node, lambda p: _with_pose(p, {"translation": p.translation + step}))


def _with_pose(p: Primitive, pose: dict[str, Tensor]) -> Primitive:
    return type(p)(**({key: getattr(p, key) for key in p.written} | pose))


def _mapped(node: Node, change: Callable[[Primitive], Primitive]) -> Node:
    """The same operations on changed primitives."""
    if isinstance(node, Primitive):
        return change(node)
    return Tree(node.operation, _mapped(node.left, change), _mapped(node.right, change))
