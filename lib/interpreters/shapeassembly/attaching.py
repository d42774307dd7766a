"""What one attach does: a plain function for each case, over a batch of rows (paper, section 4 and Appendix A).

    attach(moved, still, q1, q2)       brings local point q1 of `moved` to target = world position of q2 on `still`

Which case applies is known before anything runs: it depends on how often the moved cuboid took part in an
attachment before, and on its `aligned` flag. Rows of one call are independent of each other.

    no earlier attachment              `move`                translate
    aligned, some earlier              `growing.grow`        grow until the boxes meet
    one earlier                        `stretch_and_turn`    scale one axis, then rotate about the fixed point
    two or more earlier                `orient_and_extend`   rotate about the line through them, then maybe grow
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ..cuboids import Cuboids, cross, skew

CLOSE_ENOUGH = 1e-4  # one earlier attachment: nearer than this counts as attached
ON_TARGET = 0.01  # two or more: nearer than this counts as attached, on a line, or turned the right way
FACING = 0.9  # cosine below which a face does not look at the target: 25.8 degrees (the paper says 25)
NEARLY_ZERO = 1e-6  # a point this near to the hinge lies on it: the TINY divisors leave about 1e-8
TINY = 1e-8  # added to divisors, as the data set's own interpreter does
LARGEST_CHANGE = 1e8  # a solution for a size that is larger than this counts as none
_SIZE_ORDER = (1, 2, 0)  # height, width, length: the order in which axes are tried; the first of equals wins

Points = Float[Tensor, "rows 3"]


def move(cuboid: Cuboids, point: Points, target: Points) -> Cuboids:
    """No earlier attachment: translate until the two points meet."""
    return Cuboids(cuboid.size, cuboid.center + target - cuboid.world(point), cuboid.axes)


def stretch_and_turn(
    cuboid: Cuboids, point: Points, target: Points, fixed_point: Points, fixed: Points
) -> Cuboids:
    """One earlier attachment, at local `fixed_point`, world `fixed`: scale along one axis, then rotate.

    Scaling gives the line from the fixed point to the source point the right length; of the axes that can, the
    one whose size changes least is taken. The minimal rotation about the fixed point then brings the source
    point to the target. A side may come out negative: nothing in the language forbids it.
    """
    there = _length(cuboid.world(point) - target) < CLOSE_ENOUGH
    stretched = _pin(
        Cuboids(_stretch(cuboid, point, target, fixed_point, fixed), cuboid.center, cuboid.axes),
        fixed_point,
        fixed,
    )
    now, wanted = stretched.world(point) - fixed, target - fixed
    still = (_length(now) == 0) | (_length(wanted) == 0) | (_length(now - wanted) < CLOSE_ENOUGH)
    axes = stretched.axes @ minimal_rotation(now, wanted).mT
    turned = _pin(Cuboids(stretched.size, stretched.center, axes), fixed_point, fixed)
    return choose(there, cuboid, choose(still, stretched, turned))


def _stretch(cuboid: Cuboids, point: Points, target: Points, fixed_point: Points, fixed: Points) -> Points:
    """New sizes that put the source point at the target's distance from the fixed point, where possible."""
    lever = (point - 0.5).unsqueeze(
        -1
    ) * cuboid.axes  # (rows, axis, 3): how the source point moves with each size
    fixed_lever = (fixed_point - 0.5).unsqueeze(-1) * cuboid.axes
    offset, distance = cuboid.world(point) - fixed, _square(target - fixed)
    change, possible = _reach(lever - fixed_lever, offset.unsqueeze(-2), distance.unsqueeze(-1))
    matters = lever.abs().sum(-1) + fixed_lever.abs().sum(-1) >= CLOSE_ENOUGH
    usable = possible & matters & (change.abs() < LARGEST_CHANGE)
    order = torch.tensor(_SIZE_ORDER, device=change.device)
    cost = torch.where(usable, change.abs(), torch.inf).detach()[:, order]
    best = torch.nn.functional.one_hot(order[cost.argmin(-1)], 3).bool()
    # No single axis can do it: then all three sizes change by the same amount, where that can.
    together, possible = _reach((lever - fixed_lever).sum(-2), offset, distance)
    together = torch.where(possible, together, 0.0).unsqueeze(-1).expand_as(change)
    alone = torch.where(best & usable, change, 0.0)
    return cuboid.size + torch.where(usable.any(-1, keepdim=True), alone, together)


def _reach(
    v: Float[Tensor, "*n 3"], u: Float[Tensor, "*#n 3"], square: Float[Tensor, "*#n"]
) -> tuple[Tensor, Tensor]:
    """Larger root s of |u + s v|^2 = square, and whether there are two different ones."""
    a, b, c = _square(v), 2 * (u * v).sum(-1), _square(u) - square
    discriminant = b * b - 4 * a * c
    possible = discriminant > 0
    root = torch.where(possible, discriminant, 1.0).sqrt()
    return (root - b) / (2 * a + TINY), possible


def minimal_rotation(start: Points, end: Points) -> Float[Tensor, "rows 3 3"]:
    """The rotation by the smallest angle that turns the direction of `start` into that of `end`.

    Quirk, kept because the data set was made with it: for exactly parallel *or* opposite directions it is a half
    turn about (x, -z, y), (z, y, -x) or (-y, x, z) of the start direction (x, y, z), the first that is not normal
    to it. For a start along a coordinate axis that is a half turn about itself.
    """
    u, v = _unit(start), _unit(end)
    normal, cosine = cross(u, v), (u * v).sum(-1)[:, None, None]
    parallel = (normal == 0).all(-1)[:, None, None]
    sine_square = torch.where(parallel, 1.0, _square(normal)[:, None, None])
    # (1 - cos) / sin^2, written so that neither end of the range divides by almost nothing.
    factor = torch.where(cosine > 0, 1 / (1 + cosine.clamp(min=0)), (1 - cosine) / sine_square)
    turn = skew(normal)
    return torch.where(parallel, _half_turn(u), _eye(u) + turn + turn @ turn * factor)


def _half_turn(u: Points) -> Float[Tensor, "rows 3 3"]:
    x, y, z = u.unbind(-1)
    first, second, third = (
        torch.stack([x, -z, y], -1),
        torch.stack([z, y, -x], -1),
        torch.stack([-y, x, z], -1),
    )
    axis = torch.where((x != 0)[:, None], first, torch.where((y != 0)[:, None], second, third))
    axis = _unit(axis)
    return 2 * axis.unsqueeze(-1) * axis.unsqueeze(-2) - _eye(u)


def orient_and_extend(
    cuboid: Cuboids,
    point: Points,
    target: Points,
    fixed_points: Float[Tensor, "rows earlier 3"],
    fixed: Float[Tensor, "rows earlier 3"],
    known: Bool[Tensor, "rows earlier"],
) -> Cuboids:
    """Two or more earlier attachments (`known` marks the real ones): rotate about their line, then maybe grow.

    If all earlier points lie on one line, the cuboid turns about it until the source point faces the target.
    Then, if a face that holds the source point looks at the target, the cuboid grows along that face's normal.
    """
    oriented = choose(_on_a_line(fixed, known), _orient(cuboid, point, target, fixed_points, fixed), cuboid)
    return _extend(oriented, point, target, fixed_points, fixed, known)


def _on_a_line(
    fixed: Float[Tensor, "rows earlier 3"], known: Bool[Tensor, "rows earlier"]
) -> Bool[Tensor, " rows"]:
    line = (fixed[:, 1] - fixed[:, 0]).unsqueeze(1)
    away = cross(fixed - fixed[:, :1], line.expand_as(fixed)).norm(dim=-1)
    return ~((away > ON_TARGET) & known)[:, 2:].any(-1)


def _orient(cuboid: Cuboids, point: Points, target: Points, fixed_points: Tensor, fixed: Tensor) -> Cuboids:
    """Turn about the line through the first two fixed points until the source point faces the target.

    Quirk: when those two points coincide there is no line, and the "rotation" is cos(angle) times identity, which
    shrinks the axes.
    """
    between = fixed[:, 0] - fixed[:, 1]
    line = between / (_length(between).unsqueeze(-1) + TINY)
    source = cuboid.world(point)
    pivot = _project(fixed[:, 0], source, line)
    now, wanted = source - pivot, _project(target, source, line) - pivot
    scale, _ = _reach(now, now, _square(wanted))  # compare directions only: give both the same length
    now = now * (1 + scale).unsqueeze(-1)
    nothing = (_length(now) < NEARLY_ZERO) | (_length(wanted) < NEARLY_ZERO)
    still = nothing | (_length(now - wanted) < ON_TARGET)
    u, v = _unit(now), _unit(wanted)
    turn = _turn_about(line, u, v)
    missed = _length((turn @ u.unsqueeze(-1)).squeeze(-1) - v) > ON_TARGET
    turn = torch.where(missed[:, None, None], _turn_about(-line, u, v), turn)
    turned = Cuboids(cuboid.size, cuboid.center, cuboid.axes @ turn.mT)
    return choose(still, cuboid, _pin(turned, fixed_points[:, 0], fixed[:, 0]))


def _project(points: Points, origin: Points, normal: Points) -> Points:
    """Points moved along `normal` onto the plane through `origin`."""
    height = ((points - origin) * normal).sum(-1) / (_square(normal) + TINY)
    return points - normal * height.unsqueeze(-1)


def _turn_about(axis: Points, u: Points, v: Points) -> Float[Tensor, "rows 3 3"]:
    """Rotation about `axis` by the (unsigned) angle between the unit vectors u and v."""
    cosine = (u * v).sum(-1).clamp(-1, 1)[:, None, None]
    sine = _length(cross(u, v))[:, None, None]
    return cosine * _eye(axis) + sine * skew(axis) + (1 - cosine) * axis.unsqueeze(-1) * axis.unsqueeze(-2)


def _extend(
    cuboid: Cuboids, point: Points, target: Points, fixed_points: Tensor, fixed: Tensor, known: Tensor
) -> Cuboids:
    """Grow along the face normal that looks at the target, if the fixed points allow it. Never shrinks.

    Quirk: when the source point has the same coordinate along that axis as the first fixed point, growing cannot
    bring it nearer; the division by almost nothing then makes the cuboid huge.
    """
    source = cuboid.world(point)
    gap = target - source
    lever = (point - 0.5).unsqueeze(-1) * cuboid.axes  # (rows, axis, 3)
    normal = lever / (_length(lever).unsqueeze(-1) + TINY)
    spread = (fixed_points - fixed_points[:, :1]).abs() * _length(cuboid.axes).unsqueeze(
        1
    )  # (rows, earlier, axis)
    free = ((spread <= ON_TARGET) | ~known.unsqueeze(-1)).all(1)
    facing = (normal * _unit(gap).unsqueeze(-2)).sum(-1) > FACING
    usable = free & facing & (_length(gap) >= ON_TARGET).unsqueeze(-1)
    chosen = torch.zeros_like(usable)
    for axis in _SIZE_ORDER:  # the last one wins
        chosen = torch.where(
            usable[:, axis, None], torch.eye(3, dtype=torch.bool, device=usable.device)[axis], chosen
        )
    fixed_lever = (fixed_points[:, 0] - 0.5).unsqueeze(-1) * cuboid.axes
    amount = (normal * gap.unsqueeze(-2)).sum(-1).abs() / (_length(lever - fixed_lever) + TINY)
    grown = Cuboids(cuboid.size + torch.where(chosen, amount, 0.0), cuboid.center, cuboid.axes)
    return choose(chosen.any(-1), _pin(grown, fixed_points[:, 0], fixed[:, 0]), cuboid)


def _pin(cuboid: Cuboids, point: Points, place: Points) -> Cuboids:
    """Translate until the local point sits at `place` again."""
    return move(cuboid, point, place)


def choose(condition: Bool[Tensor, " rows"], yes: Cuboids, no: Cuboids) -> Cuboids:
    """Row by row: `yes` where the condition holds, else `no`."""
    mask = condition[:, None]
    return Cuboids(
        torch.where(mask, yes.size, no.size),
        torch.where(mask, yes.center, no.center),
        torch.where(mask[..., None], yes.axes, no.axes),
    )


def _square(v: Tensor) -> Tensor:
    return (v * v).sum(-1)


def _length(v: Tensor) -> Tensor:
    return torch.linalg.vector_norm(v, dim=-1)  # its gradient at zero is zero, not NaN


def _unit(v: Tensor) -> Tensor:
    length = _length(v).unsqueeze(-1)
    return v / torch.where(length > 0, length, 1.0)


def _eye(like: Tensor) -> Tensor:
    return torch.eye(3, dtype=like.dtype, device=like.device)
