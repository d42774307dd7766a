"""CSG-Stump's primitives and points: exact distances, finite gradients, bounds, and who is inside what."""

import math

import numpy as np
import pytest
import torch

from lib.interpreters.stump import (
    Box,
    Circle,
    Cone,
    Cylinder,
    HalfPlane,
    Picture,
    ProgramError,
    Solid,
    Sphere,
    Square,
    Stump,
    Triangle,
    distances,
    execute,
    execute_many,
    parse,
)
from lib.interpreters.stump.bounds import bounds, primitive_bounds, window
from lib.interpreters.stump.primitives import stack
from tests.random_stumps import FINITE, PLANE, SOLID, random_primitive, random_stump

FORMS = (*SOLID, *PLANE)
TURN = (0.3, 0.5, 0.2, 0.9)


def points_of(primitive, count: int, seed: int = 0, reach: float = 1.5) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return (
        (torch.rand(count, primitive.dimensions, generator=generator, dtype=torch.float64) - 0.5) * 2 * reach
    )


def single(*primitives, complement=None, window=None):
    """The shape that is the intersection of some primitives."""
    count = len(primitives)
    stump = Stump(primitives, complement or [0] * count, [[1]] * count, [1])
    return execute(stump, window)


# Distances.


def along(*corners, count: int = 20_000) -> torch.Tensor:
    """Points of the path through the corners, at most 2 / count of its length apart."""
    corners = torch.tensor(corners, dtype=torch.float64)
    share = torch.linspace(0, 1, count // (len(corners) - 1) + 1, dtype=torch.float64)[:, None]
    return torch.cat([a + share * (b - a) for a, b in zip(corners[:-1], corners[1:])])


PATHS = {  # a primitive unturned, its outline in the plane or in (rho, z), a test of its inside there
    "triangle": (
        Triangle(0.3, 0.2, 0.5),
        along((-0.3, 0), (0.2, 0), (0, 0.5), (-0.3, 0)),
        lambda x, y: (y >= 0) & (y <= 0.5 * (1 - torch.where(x < 0, -x / 0.3, x / 0.2))),
    ),
    "capped cylinder": (
        Cylinder(0.3, 0.8),
        along((0, -0.4), (0.3, -0.4), (0.3, 0.4), (0, 0.4)),
        lambda rho, z: (rho <= 0.3) & (z.abs() <= 0.4),
    ),
    "capped cone": (
        Cone(0.5, 0.8),
        along((0, 0), (0.4, 0.8), (0, 0.8)),
        lambda rho, z: (z >= 0) & (z <= 0.8) & (rho <= 0.5 * z),
    ),
    "blunt capped cone": (
        Cone(3.0, 0.2),
        along((0, 0), (0.6, 0.2), (0, 0.2)),
        lambda rho, z: (z >= 0) & (z <= 0.2) & (rho <= 3 * z),
    ),
}


@pytest.mark.parametrize("name", PATHS)
def test_distances_are_those_to_the_nearest_point_of_the_surface(name):
    """Round solids: the nearest point lies in the half-plane through the axis, so a path in it is enough."""
    primitive, path, inside = PATHS[name]
    points = points_of(primitive, 500, reach=1.0)
    section = (
        points if primitive.dimensions == 2 else torch.stack([points[:, :2].norm(dim=1), points[:, 2]], 1)
    )
    nearest = torch.cdist(section, path).amin(1)
    expected = torch.where(inside(*section.T), -nearest, nearest)
    # Samples of the path lie at most 2e-4 apart.
    assert torch.allclose(primitive.distance(points), expected, atol=1e-4, rtol=0)


def test_distances_by_hand():
    point = torch.tensor([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [0.0, 0.0, -2.0], [0.0, 0.0, 2.0]])
    by_hand = {
        Box((1.0, 2.0, 3.0)): [-1, math.hypot(2, 2), -1, -1],
        Sphere(-1.0): [-1, 4, 1, 1],  # sizes count without their sign
        Cylinder(1.0): [-1, 4, -1, -1],
        Cylinder(1.0, 2.0): [-1, 4, 1, 1],
        Cone(1.0): [0, 5 / math.sqrt(2), 2, -math.sqrt(2)],
        Cone(0.75, 2.0): [0, math.hypot(3.5, 2), 2, 0],
    }
    for primitive, expected in by_hand.items():
        assert torch.allclose(primitive.distance(point), torch.tensor(expected, dtype=torch.float64)), (
            primitive
        )


@pytest.mark.parametrize("form", [form for form in FORMS if form != "cone"])
def test_distances_change_no_faster_than_points_move(form, unchecked_shapes):
    rng = np.random.default_rng(0)
    for _ in range(20):
        primitive = random_primitive(rng, form)
        a, far = points_of(primitive, 500, 1), points_of(primitive, 500, 2)
        for b in (far, a + 1e-3 * far):
            change = (primitive.distance(a) - primitive.distance(b)).abs()
            assert (change <= (a - b).norm(dim=1) + 1e-12).all()


def test_the_mantle_has_the_sign_of_the_cone_and_no_jump():
    slope, points = torch.tensor([0.7], dtype=torch.float64), points_of(Cone(0.7), 20_000)
    mantle, cone = distances.mantle(points, slope), distances.cone(points, slope)
    above = points[:, 2] >= 0
    assert torch.equal(mantle[above], cone[above]) and (mantle[~above] > 0).all()
    assert (mantle[~above] <= cone[~above] + 1e-12).all()
    moved = points_of(Cone(0.7), 20_000, 1)
    assert ((mantle - distances.mantle(moved, slope)).abs() <= (points - moved).norm(dim=1) + 1e-12).all()


@pytest.mark.parametrize("form", FORMS)
def test_a_pose_moves_the_primitive(form):
    primitive = random_primitive(np.random.default_rng(1), form)
    at_home = type(primitive)(**{key: getattr(primitive, key) for key in primitive.counts})
    points = points_of(primitive, 200)
    assert torch.allclose(primitive.distance(points), at_home.distance(primitive.local(points)))
    middle = primitive.translation.unsqueeze(0)
    assert torch.equal(primitive.local(middle), torch.zeros_like(middle))
    apart = (primitive.local(points[:100]) - primitive.local(points[100:])).norm(dim=1)
    assert torch.allclose(apart, (points[:100] - points[100:]).norm(dim=1))  # a rotation keeps lengths


@pytest.mark.parametrize("form", FORMS)
def test_batches_are_singles_and_single_precision_is_near(form):
    batch = random_primitive(np.random.default_rng(2), form, (6,))
    points = points_of(batch, 300)
    alone = torch.stack([batch[i].distance(points) for i in range(6)])
    assert torch.allclose(batch.distance(points), alone, atol=1e-14)
    assert torch.allclose(stack([batch[i] for i in range(6)]).distance(points), alone, atol=1e-14)
    own = torch.stack([points + i for i in range(6)])  # each primitive its own points
    assert torch.allclose(batch.distance(own)[3], batch[3].distance(points + 3), atol=1e-14)
    if form == "cone":  # rounding must not carry a point over its jump
        points = points[(batch.local(points)[..., 2].abs() > 1e-5).all(0)]
    rounded = batch.to(torch.float32).distance(points.float()).double()
    assert torch.allclose(rounded, batch.distance(points), atol=1e-5, rtol=0)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_gradients_are_finite_at_centers_axes_edges_and_corners(form, dtype):
    """At whole multiples of half of the sizes from the center, unturned and turned."""
    rng = np.random.default_rng(3)
    for turned in (False, True):
        primitive = random_primitive(rng, form, dtype=dtype)
        numbers = primitive.numbers.clone()
        if not turned:
            angles = primitive.rotation.shape[-1]
            numbers[-angles:] = torch.tensor([1.0, 0, 0, 0] if angles == 4 else [0.0])
        numbers.requires_grad_()
        primitive = primitive.with_numbers(numbers)
        steps = torch.tensor([-1.0, -0.5, 0, 0.5, 1]).to(dtype)
        grid = torch.cartesian_prod(*[steps] * primitive.dimensions)
        parts = [grid * size for size in primitive.sizes.detach().unbind(-1)] or [grid]
        if primitive.sizes.shape[-1] == primitive.dimensions:
            parts.append(grid * primitive.sizes.detach())  # the corners
        points = (torch.cat(parts) + primitive.translation.detach()).requires_grad_()
        primitive.distance(points).sum().backward()
        assert points.grad.isfinite().all() and numbers.grad.isfinite().all()
        assert points.grad.norm(dim=1).max() <= 1 + 1e-5


@pytest.mark.parametrize("form", FORMS)
def test_gradients_are_finite_differences(form):
    primitive = random_primitive(np.random.default_rng(4), form)
    numbers, points = primitive.numbers.clone().requires_grad_(), points_of(primitive, 7, 5).requires_grad_()
    assert torch.autograd.gradcheck(lambda n, p: primitive.with_numbers(n).distance(p), (numbers, points))


# Bounds.


def test_bounds_by_hand():
    def box_of(primitive):
        return primitive_bounds(primitive).flatten().tolist()

    inf = math.inf
    assert box_of(Box((1.0, 2.0, 3.0), (1.0, 0.0, 0.0))) == [0, -2, -3, 2, 2, 3]
    assert box_of(Sphere(-2.0)) == [-2, -2, -2, 2, 2, 2]
    assert box_of(Cylinder(1.0, translation=(5.0, 0.0, 0.0))) == [4, -1, -inf, 6, 1, inf]
    assert box_of(Cylinder(1.0, 3.0)) == [-1, -1, -1.5, 1, 1, 1.5]
    assert box_of(Cone(0.5, 2.0)) == [-1, -1, 0, 1, 1, 2]
    assert box_of(Cone(0.5)) == [-inf] * 3 + [inf] * 3
    assert box_of(HalfPlane()) == [-inf] * 2 + [inf] * 2
    assert box_of(Triangle(1.0, 2.0, 3.0)) == [-1, 0, 2, 3]
    quarter = box_of(Square((1.0, 2.0), rotation=math.pi / 2))
    assert quarter == pytest.approx([-2, -1, 2, 1])
    lying = box_of(Cylinder(1.0, rotation=(1.0, 1.0, 0.0, 0.0)))  # around the y axis, but for rounding
    assert lying == pytest.approx([-1, -inf, -1, 1, inf, 1])
    tilted = box_of(Cylinder(1.0, rotation=TURN))
    assert tilted == [-inf] * 3 + [inf] * 3


@pytest.mark.parametrize("form", FINITE)
def test_bounds_of_primitives_are_the_smallest(form, unchecked_shapes):
    rng = np.random.default_rng(6)
    for seed in range(5):
        primitive = random_primitive(rng, form)
        low, high = primitive_bounds(primitive)
        points = points_of(primitive, 100_000, seed)
        inside = points[primitive.distance(points) <= 0]
        assert (inside >= low - 1e-12).all() and (inside <= high + 1e-12).all()
        for axis in range(primitive.dimensions):  # just within each face there are points of the primitive
            for face in (low, high):
                nearest = low + (points + 1.5) / 3 * (high - low)
                nearest[:, axis] = face[axis] * 0.98 + (low + high)[axis] / 2 * 0.02
                assert (primitive.distance(nearest) <= 0).any(), (primitive, axis)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_all_that_is_inside_lies_within_the_bounds(dimensions, unchecked_shapes):
    rng = np.random.default_rng(7)
    bounded = 0
    for seed in range(150):
        stump = random_stump(rng, dimensions)
        points = points_of(stump, 2000, seed, reach=3)
        inside = points[execute(stump).occupancy(points)]
        low, high = bounds(stump)
        if len(inside):
            assert (inside >= low - 1e-12).all() and (inside <= high + 1e-12).all()
        bounded += bool(low.isfinite().all())
        seen = window(stump)
        assert seen.isfinite().all() and (seen[0] <= seen[1]).all()
    assert 20 < bounded < 150


def test_windows():
    assert window(Stump([Sphere(0.3)], [0], [[1]], [1])).tolist() == [[-0.3] * 3, [0.3] * 3]
    assert window(Stump([Sphere(0.3)], [1], [[1]], [1])).tolist() == [[-0.5] * 3, [0.5] * 3]
    assert window(Stump([Sphere(0.3)], [0], [[0]], [1])).tolist() == [[-0.5] * 3, [0.5] * 3]  # everything
    assert window(Stump([Sphere(0.3)], [0], [[1]], [0])).tolist() == [[-0.5] * 3, [0.5] * 3]  # nothing
    outside = Stump([Sphere(2.0, (1.0, 0.0, 0.0))], [1], [[1]], [1])
    assert window(outside).tolist() == [[-3.75] * 3, [3.75] * 3]  # the hole is seen
    pillar = Stump([Cylinder(0.1, translation=(2.0, 0.0, 0.0))], [0], [[1]], [1])
    assert window(pillar).flatten().tolist() == pytest.approx([1.9, -0.1, -2.625, 2.1, 0.1, 2.625])


# Inside or not.


def test_a_plate_with_a_hole():
    shape = single(Box((0.5, 0.4, 0.1)), Cylinder(0.2), complement=[0, 1])
    points = [[0.3, 0, 0], [0, 0, 0], [0.5, 0.4, 0.1], [0.6, 0, 0], [0.3, 0, math.nan], [math.inf, 0, 0]]
    assert shape.occupancy(points).tolist() == [True, False, True, False, False, False]
    assert isinstance(shape, Solid) and repr(shape) == "Solid(Stump(2 primitives, 1 node, 1 united))"


def test_points_that_are_not_finite_are_in_no_complement():
    shape = single(Sphere(0.3), complement=[1])
    assert shape.occupancy([[math.nan, 0, 0], [math.inf, 0, 0], [9, 0, 0]]).tolist() == [False, False, True]
    assert shape.nodes([[math.nan, 0, 0], [9, 0, 0]]).tolist() == [[False, True]]


def test_everything_and_nothing():
    points = torch.randn(50, 3, generator=torch.Generator().manual_seed(0))
    for united, inside in ((1, True), (0, False)):
        shape = execute(Stump([Sphere(0.3)], [0], [[0]], [united]))
        assert (shape.occupancy(points) == inside).all() and shape.nodes(points).all()


@pytest.mark.parametrize("dimensions", [2, 3])
def test_the_layers_are_the_paper_s_formulas(dimensions, unchecked_shapes):
    rng = np.random.default_rng(8)
    for seed in range(30):
        stump = random_stump(rng, dimensions)
        points = points_of(stump, 300, seed, 0.8)
        inside = torch.stack([primitive.distance(points) <= 0 for primitive in stump.primitives]).double()
        w_c, w_i, w_u = (matrix.double() for matrix in stump.matrices)
        f = w_c[:, None] * (1 - inside) + (1 - w_c[:, None]) * inside
        s = (w_i[:, :, None] * f[:, None] + 1 - w_i[:, :, None]).amin(0)
        shape = execute(stump)
        assert torch.equal(shape.nodes(points), s.bool())
        assert torch.equal(shape.occupancy(points), (w_u[:, None] * s).amax(0).bool())
        assert torch.equal(execute(stump.pruned()).occupancy(points), shape.occupancy(points))


@pytest.mark.parametrize("dimensions", [2, 3])
def test_many_are_as_one(dimensions, unchecked_shapes, monkeypatch):
    rng = np.random.default_rng(9)
    stumps = [random_stump(rng, dimensions) for _ in range(40)]
    shapes, points = execute_many(stumps), points_of(stumps[0], 500, 1, 0.8)
    one_by_one = torch.stack([execute(stump).occupancy(points) for stump in stumps])
    assert torch.equal(shapes.occupancy(points), one_by_one) and one_by_one.any() and not one_by_one.all()
    monkeypatch.setattr("lib.interpreters.stump.executing._CELLS", 100)  # in several batches
    monkeypatch.setattr("lib.interpreters.stump.shape._IN_CACHE", 300)
    assert torch.equal(shapes.occupancy(points), one_by_one)
    assert torch.equal(shapes[3].occupancy(points), one_by_one[3])
    assert torch.equal(shapes[5:9].occupancy(points), one_by_one[5:9])
    assert torch.equal(shapes[torch.tensor([7, 2])].occupancy(points), one_by_one[[7, 2]])
    assert torch.equal(shapes[torch.arange(40) > 30].occupancy(points), one_by_one[31:])
    assert len(shapes) == 40 and shapes[-1].program == stumps[-1] and repr(shapes) == "Shapes(40 stumps)"
    with pytest.raises(IndexError, match="shape 40 of 40"):
        shapes[40]


def test_no_stumps_at_all():
    shapes = execute_many([])
    assert len(shapes) == 0 and shapes.occupancy(torch.zeros(5, 3)).shape == (0, 5)
    assert shapes.occupancy(torch.zeros(5, 2)).shape == (0, 5)


def test_soft_occupancy_tends_to_the_hard_one():
    shape = single(Box((0.5, 0.4, 0.1)), Cylinder(0.2), complement=[0, 1])
    points = points_of(Sphere(1.0), 400, 3, 0.6)
    clear = (shape.program.distances(points).abs() > 1e-2).all(0)
    soft, hard = shape.soft_occupancy(points, sharpness=3000.0), shape.occupancy(points)
    assert torch.allclose(soft[clear], hard[clear].double(), atol=1e-6) and hard.any()


def test_voxels_are_samples_at_the_centers_of_cells(monkeypatch):
    shape = single(Box((0.5, 0.25, 0.1)))
    cells = shape.voxels(8)  # a cube as wide as the window is long
    assert cells.shape == (8, 8, 8) and cells.sum() == 8 * 4 * 2
    assert shape.voxel_centers(2)[0, 0, 1].tolist() == [-0.25, -0.25, 0.25]
    assert torch.equal(shape.occupancy(shape.voxel_centers(8).flatten(0, 2)).view(8, 8, 8), cells)
    monkeypatch.setattr("lib.interpreters.stump.shape._ON_CARD", 64 * 64)  # a slab at a time
    assert torch.equal(shape.voxels(8), cells)


def test_in_an_image_y_points_up():
    shape = single(Triangle(0.5, 0.5, 1.0), window=[[-0.5, 0], [0.5, 1]])
    image = shape.image(64)
    assert isinstance(shape, Picture) and image.shape == (64, 64)
    assert image[-1].sum() > 60 and image[0].sum() < 4  # the base is the last row, the apex in the first
    assert torch.equal(image, shape.voxels(64).T.flip(0))


# Messages.


@pytest.mark.parametrize(
    "ask, message",
    [
        (lambda s, p: execute("F1"), "found a str; expected a Stump, see parse"),
        (
            lambda s, p: execute(s.program, [[0, 0], [1, 1]]),
            r"the window has the shape \(2, 2\); expected lowest",
        ),
        (lambda s, p: execute(s.program, [[0] * 3, [1, 1, 0]]), "the window is .*low < high"),
        (lambda s, p: execute(s.program, [[0] * 3, [1, 1, math.nan]]), "the window is .*finite numbers"),
        (lambda s, p: execute(s.program, "all"), "the window is 'all'; expected lowest and highest"),
        (
            lambda s, p: execute_many(s.program),
            r"found one Stump; expected a sequence of them, or execute\(stump\)",
        ),
        (lambda s, p: execute_many("F1"), "found a str; expected a sequence of Stumps"),
        (lambda s, p: execute_many(7), "found a int; expected a sequence of Stumps"),
        (lambda s, p: execute_many([s.program, 7]), "item 1 is a int; expected a Stump"),
        (lambda s, p: execute_many([s.program, p.program]), "item 1 has 2 dimensions; expected 3"),
        (lambda s, p: execute_many([s.program], [[0, 0], [1, 1]]), "the window has the shape"),
    ],
)
def test_messages_of_execution(unchecked_shapes, ask, message):
    with pytest.raises(ProgramError, match=message):
        ask(single(Sphere(0.3)), single(Circle(0.3)))


@pytest.mark.parametrize(
    "ask, message",
    [
        (
            lambda s, p: s.occupancy(torch.zeros(5, 2)),
            r"points of shape \(5, 2\); expected \(n, 3\) numbers: x, y, z",
        ),
        (lambda s, p: p.occupancy(np.zeros(3)), r"points of shape \(3,\); expected \(n, 2\) numbers: x, y"),
        (lambda s, p: s.nodes(None), "a NoneType; expected points"),
        (lambda s, p: s.soft_occupancy([["1"] * 3]), "a list; expected points"),
        (lambda s, p: execute_many([s.program]).occupancy(np.ones((4, 3)) * 1j), "complex points; expected"),
        (lambda s, p: execute_many([]).occupancy(None), "a NoneType; expected points"),
        (
            lambda s, p: s.soft_occupancy([[0.0] * 3], "a"),
            "a sharpness of 'a'; expected a finite number above 0",
        ),
        (lambda s, p: s.soft_occupancy([[0.0] * 3], math.nan), "a sharpness of nan"),
        (lambda s, p: s.soft_occupancy([[0.0] * 3], -1.0), "a sharpness of -1.0"),
        (lambda s, p: s.voxels(0), "a resolution of 0; expected a whole number, at least 1"),
        (lambda s, p: s.voxel_centers(2.5), "a resolution of 2.5"),
        (lambda s, p: p.image(True), "a resolution of True"),
        (lambda s, p: s.marching_cubes(-3), "a resolution of -3"),
        (lambda s, p: s.mesh(6), "6 segments; expected a multiple of 4 from 4 to 1024"),
        (lambda s, p: p.outline(0), "0 segments"),
        (lambda s, p: p.mesh(-1.0), "a height of -1.0; expected 9.375e-09 to 9375"),
        (lambda s, p: p.mesh(math.nan), "a height of nan"),
        (lambda s, p: s.surface_points(-1), "-1 points; expected a whole number, at least 0"),
        (lambda s, p: p.to_svg('"/><script>'), "expected a colour such as"),
    ],
)
def test_messages_of_shapes(unchecked_shapes, ask, message):
    with pytest.raises(ValueError, match=message):
        ask(single(Sphere(0.3)), single(Circle(0.3)))


def test_parsed_stumps_execute():
    shape = execute(
        parse("F1 = box(half=(0.5, 0.5, 0.1))\nF2 = not cylinder(radius=0.2)\nS1 = F1 & F2\nT = S1")
    )
    assert shape.occupancy([[0, 0, 0], [0.3, 0, 0]]).tolist() == [False, True]
