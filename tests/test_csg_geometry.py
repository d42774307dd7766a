"""The exact geometry of CSG: the law that ties it to the pixels, laws of areas and volumes, meshes, points, files."""

import io
import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import torch
import trimesh

from lib.interpreters.csg import KINDS, ProgramError, execute, execute_many, parse, vocabulary_of
from lib.interpreters.csg.primitives import Primitive
from lib.interpreters.csg.program import Operation, Program
from lib.interpreters.rings import shoelace

SEGMENTS = 64  # of meshes and outlines unless told otherwise
# How far a polygon or polyhedron with 64 segments is from the true circle or sphere, as a share of the radius (the
# functions below compare with it); the largest radius is 64, so nothing is farther off than these many pixels.
CIRCLE, SPHERE = 1 / 1200, 1 / 500
EMPTY = "c(32,32,16)c(32,32,16)-", "cu(32,32,32,16)cu(32,32,32,16)-"


def any_primitive(rng: np.random.Generator, dimensions: int, kind: str | None = None) -> Primitive:
    """Any numbers at all, most of them not in the vocabulary."""
    letters = kind or rng.choice([k.letters for k in KINDS.values() if k.dimensions == dimensions])
    fields = KINDS[letters].fields
    return Primitive(str(letters), tuple(int(rng.integers(64) + (f not in "xyz")) for f in fields))


def any_program(rng: np.random.Generator, dimensions: int, any_numbers: bool, most: int = 7) -> Program:
    """Up to `most` primitives, of the vocabulary or with any numbers."""
    left, depth, statements = int(rng.integers(1, most + 1)), 0, []
    words = vocabulary_of(dimensions).primitives
    while left or depth > 1:
        if depth < 2 or (left and rng.random() < 0.5):
            word = words[rng.integers(len(words))]
            statements.append(any_primitive(rng, dimensions) if any_numbers else word)
            left, depth = left - 1, depth + 1
        else:
            statements.append(Operation("+*-"[rng.choice(3, p=(0.45, 0.15, 0.4))]))
            depth -= 1
    return Program(tuple(statements))


def both(rng: np.random.Generator, dimensions: int, many: int, **more) -> list[Program]:
    return [any_program(rng, dimensions, any_numbers=bool(i % 2), **more) for i in range(many)]


def combined(a: Program, b: Program, symbol: str):
    return execute(Program((*a.statements, *b.statements, Operation(symbol))))


def centers(dimensions: int) -> torch.Tensor:
    """The centers of all pixels x, y, in the order of an image's pixels; of all voxels in the order of a grid's."""
    k = torch.arange(64)
    axes = torch.meshgrid(*[k] * dimensions, indexing="ij")
    return torch.stack(axes if dimensions == 3 else axes[::-1], -1).reshape(-1, dimensions)


def assert_is_its_pixels(shapes, dimensions: int) -> None:
    points = centers(dimensions)
    for shape in shapes:
        pixels = shape.image if dimensions == 2 else shape.grid
        assert torch.equal(shape.occupancy(points).view(pixels.shape), pixels), shape


# The law: at the centers of pixels the exact shape is the picture.


def test_every_primitive_of_the_plane_is_its_pixels(unchecked_shapes):
    rng = np.random.default_rng(0)
    primitives = [*vocabulary_of(2).primitives, *(any_primitive(rng, 2) for _ in range(2000))]
    assert_is_its_pixels(execute_many([Program((p,)) for p in primitives]), 2)


def test_primitives_of_space_are_their_voxels(unchecked_shapes):
    rng = np.random.default_rng(1)
    words = [vocabulary_of(3).primitives[i] for i in rng.integers(6631, size=40)]
    others = [any_primitive(rng, 3, kind) for kind in ("sp", "cu", "cy") for _ in range(54)]
    assert_is_its_pixels([execute(Program((p,))) for p in [*words, *others]], 3)


@pytest.mark.parametrize(
    "text", ["sp(5,6,7,1)", "cy(5,6,7,1,1)", "cu(0,63,5,1)", "c(0,0,1)", "t(0,0,1)", "s(0,3,1)"]
)
def test_the_smallest_primitives_are_their_pixels_and_have_an_inside(text):
    shape = execute(parse(text))
    assert_is_its_pixels([shape], shape.dimensions)
    assert shape.mesh().volume > 0.4  # the ball of radius 1/2 is the smallest


@pytest.mark.parametrize("dimensions", [2, 3])
def test_programs_are_their_pixels(unchecked_shapes, dimensions):
    programs = both(np.random.default_rng(2), dimensions, 200)
    assert_is_its_pixels([execute(p) for p in programs], dimensions)


@pytest.mark.parametrize("text", ["c(30,32,16)t(20,40,20)-", "cy(30,20,32,12,40)sp(32,32,20,9)+"])
def test_voxels_are_samples_at_the_centers_of_cells(text):
    shape = execute(parse(text))
    assert torch.equal(shape.voxels(64), shape.image if shape.dimensions == 2 else shape.grid)
    fine = shape.voxels(128)  # a pixel's center is the corner of four or eight finer cells
    k = (torch.arange(128, dtype=torch.float64) + 0.5) / 2 - 0.5
    axes = torch.meshgrid(*[k] * shape.dimensions, indexing="ij")
    points = torch.stack(axes if shape.dimensions == 3 else axes[::-1], -1).view(-1, shape.dimensions)
    assert torch.equal(shape.occupancy(points), fine.flatten())
    assert shape.voxels(1).shape == (1,) * shape.dimensions


def test_points_come_in_any_form_and_the_canvas_does_not_cut():
    shape = execute(parse("c(2,32,20)"))
    points = [[2, 32], [-17, 32], [-18, 32], [22, 32], [float("nan"), 32], [float("inf"), 32]]
    expected = [True, True, False, False, False, False]  # the rim is not inside
    for made in (points, np.array(points), torch.tensor(points)):
        assert shape.occupancy(made).tolist() == expected
    assert shape.occupancy(torch.zeros(0, 2)).shape == (0,)
    many = torch.rand(300_000, 2, generator=torch.Generator().manual_seed(0)) * 64  # more than one step takes
    assert shape.occupancy(np.array(points)[::-1]).tolist() == expected[::-1]
    assert shape.occupancy(np.array(points, dtype=">f8")).tolist() == expected  # another machine's byte order
    assert torch.equal(shape.occupancy(many), (many.double() - torch.tensor([2, 32])).norm(dim=1) < 20)


def test_operations_act_on_points(unchecked_shapes):
    rng = np.random.default_rng(3)
    for dimensions in (2, 3):
        points = torch.rand(2000, dimensions, generator=torch.Generator().manual_seed(1)) * 64
        for a, b in zip(both(rng, dimensions, 20, most=3), both(rng, dimensions, 20, most=3)):
            in_a, in_b = execute(a).occupancy(points), execute(b).occupancy(points)
            assert torch.equal(combined(a, b, "+").occupancy(points), in_a | in_b)
            assert torch.equal(combined(a, b, "*").occupancy(points), in_a & in_b)
            assert torch.equal(combined(a, b, "-").occupancy(points), in_a & ~in_b)


# Areas.


def test_areas_of_primitives():
    assert execute(parse("c(32,32,20)")).area == pytest.approx(400 * math.pi)
    square = execute(parse("s(32,32,20)"))
    assert square.area == pytest.approx(square.on)
    # A triangle drawn from row 12 to 42 and column 14 to 49: half a pixel more on all four sides makes a trapezoid
    # of 31 rows, on average 1 + 35 / 2 wide.
    assert execute(parse("t(32,32,20)")).area == pytest.approx(31 * (1 + 35 / 2))


def test_the_area_of_a_lens():
    lens = 2 * 20**2 * math.acos(16 / 40) - 16 / 2 * math.sqrt(4 * 20**2 - 16**2)
    assert execute(parse("c(32,32,20)c(16,32,20)*")).area == pytest.approx(lens)


def test_areas_obey_inclusion_and_exclusion(unchecked_shapes):
    rng = np.random.default_rng(4)
    for a, b in zip(both(rng, 2, 60, most=4), both(rng, 2, 60, most=4)):
        union, common, rest = (combined(a, b, symbol).area for symbol in "+*-")
        # 1e-8: sums of some hundred terms of 64^2 square pixels, each exact to 16 digits
        assert union + common == pytest.approx(execute(a).area + execute(b).area, abs=1e-8)
        assert rest + common == pytest.approx(execute(a).area, abs=1e-8)


def test_areas_agree_with_outlines_and_with_samples():
    rng = np.random.default_rng(5)
    for program in both(rng, 2, 60):
        shape = execute(program)
        rings = shape.outline()
        length = sum(np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).sum() for ring in rings)
        # A polygon is within CIRCLE * 64 of the circle, along all of its length.
        assert sum(map(shoelace, rings)) == pytest.approx(shape.area, abs=1e-6 + CIRCLE * 64 * length)
        if all(r[:, :2].min() >= -0.5 and r[:, :2].max() <= 63.5 for r in rings):
            sampled = float(shape.voxels(512).sum()) / 64
            # A cell is 1/8 wide; only those that the outline passes through can be wrong,
            # by half their width if all erred the same way; half of that is allowed. Measured: 0.01 of the length.
            assert sampled == pytest.approx(shape.area, abs=1e-6 + length / 32)


# Outlines and plates.


def test_holes_run_the_other_way():
    rings = execute(parse("s(32,32,28)c(32,32,8)-")).outline()
    areas = sorted(map(shoelace, rings))
    assert areas == [pytest.approx(-64 * math.pi), pytest.approx(execute(parse("s(32,32,28)")).on)]
    assert all(ring.dtype == np.float64 and ring.shape[1] == 2 for ring in rings)


def test_a_plate_is_the_picture_seen_from_above():
    shape = execute(parse("t(32,40,28)s(32,48,8)-"))
    plate = shape.mesh(height=5)
    assert plate.is_volume and plate.bounds[:, 2].tolist() == [0, 5]
    assert plate.volume == pytest.approx(5 * shape.area)
    apex = plate.vertices[plate.vertices[:, 1].argmax()]
    assert apex[1] == 63 - 11.5  # the apex is drawn in row 12, counted from above
    assert apex[0] == pytest.approx(32, abs=1)


@pytest.mark.parametrize("height", [1e-6, 1e-3, 1.0, 1e6])
def test_plates_of_any_height_keep_their_shape(height):
    shape = execute(parse("t(32,40,28)s(32,48,8)-c(4,4,2)+"))
    plate = shape.mesh(height)
    assert plate.is_watertight and plate.bounds[:, 2].tolist() == [0, height]
    assert plate.volume == pytest.approx(height * shape.area, rel=1e-4)


def test_whole_numbers_of_numpy_and_torch_count(unchecked_shapes):
    for text in ("c(32,32,16)", "sp(32,32,32,16)"):
        shape = execute(parse(text))
        for eight in (np.int64(8), np.uint8(8), torch.tensor(8)):
            assert torch.equal(shape.voxels(eight), shape.voxels(8))
            assert shape.mesh(segments=eight).volume == shape.mesh(segments=8).volume
            assert torch.equal(shape.surface_points(eight), shape.surface_points(8))


@pytest.mark.parametrize("text", ["s(16,16,8)s(27,27,8)+", "c(24,32,8)c(40,32,8)+", "s(32,32,28)c(32,32,8)-"])
def test_plates_of_shapes_that_touch_are_closed(text):
    shape = execute(parse(text))
    # 1e-3: the polygons of two circles that touch overlap in a sliver, as their corners are outside the circles
    assert shape.mesh().is_watertight and shape.mesh().volume == pytest.approx(8 * shape.area, rel=1e-3)


# Meshes of solids.


def volume(shape) -> float:
    """Of a text or a shape; trimesh warns when asked for the volume of nothing."""
    mesh = (execute(parse(shape)) if isinstance(shape, str) else shape).mesh()
    return 0.0 if mesh.is_empty else mesh.volume


def test_cubes_by_hand():
    assert volume("cu(32,32,32,9)") == pytest.approx(9**3)
    assert volume("cu(32,32,32,8)") == pytest.approx(7**3)  # an even side draws one voxel less
    a, b = "cu(20,20,20,11)", "cu(24,23,20,11)"  # they share 7 x 8 x 11
    assert volume(a + b + "+") == pytest.approx(2 * 11**3 - 7 * 8 * 11)
    assert volume(a + b + "*") == pytest.approx(7 * 8 * 11)
    assert volume(a + b + "-") == pytest.approx(11**3 - 7 * 8 * 11)
    assert volume("cu(20,20,20,11)cu(31,20,20,11)+") == pytest.approx(2 * 11**3)  # face on face
    assert volume("cu(20,20,20,11)cu(31,31,20,11)+") == pytest.approx(2 * 11**3)  # edge on edge
    assert volume("cu(32,32,32,21)cu(32,32,32,5)-") == pytest.approx(21**3 - 5**3)  # a cavity


def test_round_primitives_have_their_true_volume():
    assert volume("sp(32,32,32,17)") == pytest.approx(4 / 3 * math.pi * 16**3)
    assert volume("cy(32,32,32,17,21)") == pytest.approx(math.pi * 16**2 * 21)
    apart = "sp(12,12,12,9)", "sp(50,50,50,9)"
    assert volume(apart[0] + apart[1] + "+") == pytest.approx(volume(apart[0]) + volume(apart[1]))


@pytest.mark.parametrize("segments", [4, 16, SEGMENTS])
def test_corners_of_round_meshes(segments):
    for text, limit in (("sp(32,32,32,17)", SPHERE), ("cy(32,32,32,17,21)", CIRCLE)):
        mesh = execute(parse(text)).mesh(segments)
        across = mesh.vertices - 32 if text.startswith("sp") else mesh.vertices[:, :2] - 32
        radius = np.linalg.norm(across, axis=1)
        assert mesh.is_volume and radius.min() >= 16 - 1e-9
        if segments == SEGMENTS:
            assert radius.max() <= 16 * (1 + limit)


def test_meshes_are_closed_and_as_large_as_their_voxels(unchecked_shapes):
    rng = np.random.default_rng(6)
    deviations = []
    for program in both(rng, 3, 200):
        shape = execute(program)
        mesh = shape.mesh()
        assert mesh.is_empty or mesh.is_volume, program  # closed, faces outwards
        # Where nothing is cut off:
        if not mesh.is_empty and mesh.bounds.min() >= -0.5 and mesh.bounds.max() <= 63.5:
            deviations.append(abs(shape.on - mesh.volume) / mesh.area)
    # Voxels differ from the volume where the surface passes through them: each by half, if all erred the same way (and
    # thin slivers may do that); mostly they cancel. Measured on 486 programs: median 0.022, largest 0.29.
    assert max(deviations) < 0.5 and np.median(deviations) < 0.05


def test_meshes_agree_with_fine_samples():
    rng = np.random.default_rng(7)
    steps = (torch.arange(96, dtype=torch.float64) + 0.5) / 96
    for program in both(rng, 3, 20):
        shape = execute(program)
        mesh = shape.mesh()
        if mesh.is_empty:
            assert not shape.voxels(96).any(), program
            continue
        low, high = torch.tensor(mesh.bounds)
        axes = torch.meshgrid(*(low[i] + steps * (high - low)[i] for i in range(3)), indexing="ij")
        inside = shape.occupancy(torch.stack(axes, -1).view(-1, 3)).double().mean()
        cell = float((high - low).max()) / 96
        # A cell can be wrong only where the surface passes through it, by half of it if all erred the same way; the
        # polyhedron adds its distance.
        sampled, tolerance = float(inside * (high - low).prod()), (cell / 2 + SPHERE * 64) * mesh.area
        assert sampled == pytest.approx(mesh.volume, abs=tolerance), program


def test_meshes_obey_inclusion_and_exclusion(unchecked_shapes):
    rng = np.random.default_rng(8)
    for a, b in zip(both(rng, 3, 25, most=3), both(rng, 3, 25, most=3)):
        union, common, rest = (volume(combined(a, b, symbol)) for symbol in "+*-")
        # 1e-7: corners move by about 1e-12 of the size, over ten thousand square voxels. Measured: 5e-10.
        assert union + common == pytest.approx(volume(execute(a)) + volume(execute(b)), abs=1e-7)
        assert rest + common == pytest.approx(volume(execute(a)), abs=1e-7)


def test_what_takes_away_itself_is_empty():
    rng = np.random.default_rng(9)
    for program in [*both(rng, 3, 10), *both(rng, 2, 20)]:
        nothing = combined(program, program, "-")
        assert nothing.mesh().is_empty and nothing.on == 0
        if program.dimensions == 2:
            assert nothing.outline() == [] and nothing.area == 0


def test_the_longest_program_has_a_mesh():
    one = "cu(8,8,8,7)"
    cubes = "".join(f"cu({8 * (i % 8)},{8 * (i // 8 % 8)},{8 * (i // 64)},7)" for i in range(512))
    assert execute(parse(cubes + "+" * 511)).mesh().volume == pytest.approx(512 * volume(one))


# Points on surfaces.


def test_surface_points_of_solids_lie_on_the_true_surface():
    shape = execute(parse("cu(32,32,32,33)sp(32,32,48,13)-cy(32,32,32,9,60)+"))
    points = shape.surface_points(4000, seed=3)
    assert points.shape == (4000, 3) and torch.equal(points, shape.surface_points(4000, seed=3))
    assert not torch.equal(points, shape.surface_points(4000, seed=4))
    assert_on_the_rim(shape, points, SPHERE * 13)  # the largest round part has radius 12; the others are flat


def test_surface_points_of_pictures_lie_on_the_true_outline():
    shape = execute(parse("s(32,32,28)c(40,32,12)-"))
    points = shape.surface_points(4000, seed=3)
    assert points.shape == (4000, 2) and torch.equal(points, shape.surface_points(4000, seed=3))
    assert_on_the_rim(shape, points, CIRCLE * 12)


def assert_on_the_rim(shape, points: torch.Tensor, distance: float) -> None:
    """A step a little longer than `distance` leads inside in some direction and outside in another."""
    steps = torch.cartesian_prod(*[torch.tensor([-1.0, 0.0, 1.0])] * points.shape[1])
    # Steps along one axis or a diagonal go at least 0.57 of their length along any normal: so twice the distance. And
    # 1e-5, as the points have single precision.
    met = torch.stack([shape.occupancy(points + step * (2 * distance + 1e-5)) for step in steps])
    assert (met.any(0) & ~met.all(0)).all()


def test_points_are_uniform_over_the_surface():
    cube = execute(parse("cu(32,32,32,11)")).surface_points(6000).double()
    top = ((cube[:, 2] - 37.5).abs() < 1e-4).double().mean()
    assert float(top) == pytest.approx(1 / 6, abs=0.02)  # four standard deviations of 6,000 draws
    assert cube[:, 0].mean() == pytest.approx(32, abs=0.25)  # likewise: the deviation of x is about 4.5
    square = execute(parse("s(32,32,16)")).surface_points(6000)
    left = (square[:, 0] == square[:, 0].min()).double().mean()
    assert float(left) == pytest.approx(1 / 4, abs=0.0225)


# Files.


def test_svg():
    shape = execute(parse("s(32,32,28)c(36,32,12)-c(8,8,4)+"))
    picture = ElementTree.fromstring(shape.to_svg("rgb(10, 20, 30)"))
    assert picture.attrib["viewBox"] == "-0.5 -0.5 64 64"
    (path,) = picture
    assert path.attrib["fill"] == "rgb(10, 20, 30)" and path.attrib["fill-rule"] == "evenodd"
    rings = []
    for text in path.attrib["d"].strip().removesuffix("Z").split("Z"):
        assert text.strip().startswith("M")
        rings.append(np.array([pair.split(",") for pair in text.strip()[1:].split()], dtype=float))
    assert len(rings) == 3
    # Three decimals, over some 200 pixels of outline; the polygons' own difference is below 2 * CIRCLE * area.
    assert sum(map(shoelace, rings)) == pytest.approx(shape.area, abs=0.2)
    drawn = even_odd(rings, centers(2).double().numpy()).reshape(64, 64)
    # The tips of both circles, four each, lie on the true rim, which is not inside, but within the polygon.
    assert (drawn != shape.image.numpy()).sum() <= 8


def even_odd(rings: list[np.ndarray], points: np.ndarray) -> np.ndarray:
    """How an SVG viewer fills: a ray to the right of the point meets an odd number of edges."""
    x, y = points[:, :1], points[:, 1:]
    start = np.concatenate(rings)
    stop = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    (ax, ay), (bx, by) = start.T, stop.T
    with np.errstate(divide="ignore", invalid="ignore"):
        meets = ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / (by - ay))
    return meets.sum(1) % 2 == 1


@pytest.mark.parametrize(
    "text", ["s(32,32,28)c(40,32,12)-", "cu(32,32,32,33)sp(32,32,48,13)-cy(32,32,32,9,60)+"]
)
def test_files_load_back(text):
    shape = execute(parse(text))
    mesh = shape.mesh()
    loaded = trimesh.load_mesh(io.BytesIO(shape.to_stl()), file_type="stl")
    assert loaded.is_volume and loaded.volume == pytest.approx(mesh.volume, rel=1e-5)  # single precision
    assert np.allclose(loaded.bounds, mesh.bounds, atol=1e-5)
    scene = trimesh.load_scene(io.BytesIO(shape.to_glb()), file_type="glb")
    assert scene.to_mesh().volume == pytest.approx(mesh.volume, rel=1e-5)


def test_in_glb_y_is_up():
    pillar = trimesh.load_scene(io.BytesIO(execute(parse("cy(10,20,30,5,41)")).to_glb()), file_type="glb")
    assert np.allclose(pillar.bounds.mean(0), [10, 30, -20]) and pillar.extents[1] == pytest.approx(41)
    plate = trimesh.load_scene(io.BytesIO(execute(parse("s(10,20,8)")).to_glb()), file_type="glb")
    assert plate.extents[2] == pytest.approx(8) and plate.bounds.mean(0)[1] == pytest.approx(63 - 19.5)


# Messages.


@pytest.mark.parametrize("text", EMPTY)
def test_a_shape_without_an_inside_says_so(text):
    shape = execute(parse(text))
    asks = [shape.to_stl, shape.to_glb, lambda: shape.surface_points(5)]
    for ask in asks + ([shape.to_svg] if shape.dimensions == 2 else []):
        with pytest.raises(ProgramError, match="the shape has no inside"):
            ask()
    assert shape.mesh().is_empty and not shape.voxels(8).any()


@pytest.mark.parametrize(
    "ask, message",
    [
        (
            lambda p, s: p.occupancy(torch.zeros(5, 3)),
            r"points of shape \(5, 3\); expected \(n, 2\) numbers: x, y",
        ),
        (
            lambda p, s: s.occupancy(np.zeros(3)),
            r"points of shape \(3,\); expected \(n, 3\) numbers: x, y, z",
        ),
        (lambda p, s: p.occupancy(None), r"a NoneType; expected points \(n, 2\) numbers: x, y"),
        (lambda p, s: p.occupancy([[1, "2"]]), r"a list; expected points \(n, 2\) numbers"),
        (lambda p, s: p.occupancy(np.array([["1", "2"]])), "an array of <U1; expected points"),
        (lambda p, s: s.occupancy(np.ones((4, 3)) * 1j), r"complex points; expected \(n, 3\) numbers"),
        (lambda p, s: p.occupancy([[1j, 2]]), r"complex points; expected \(n, 2\) numbers"),
        (lambda p, s: p.voxels(0), "a resolution of 0; expected a whole number, at least 1"),
        (lambda p, s: s.voxels(8.0), "a resolution of 8.0"),
        (lambda p, s: s.voxels(True), "a resolution of True"),
        (lambda p, s: s.mesh(6), "6 segments; expected a multiple of 4 from 4 to 1024"),
        (lambda p, s: s.mesh(2048), "2048 segments"),
        (lambda p, s: p.outline(0), "0 segments"),
        (lambda p, s: p.outline(64.0), "64.0 segments"),
        (lambda p, s: p.mesh(0.0), r"a height of 0.0; expected 1e-06 to 1e\+06 pixels"),
        (lambda p, s: p.mesh(1e-9), "a height of 1e-09; expected 1e-06"),
        (lambda p, s: p.mesh(-8.0), "a height of -8.0"),
        (lambda p, s: p.mesh(math.inf), "a height of inf"),
        (lambda p, s: p.mesh(math.nan), "a height of nan"),
        (lambda p, s: p.surface_points(-1), "-1 points; expected a whole number, at least 0"),
        (lambda p, s: s.surface_points(-1), "-1 points"),
        (lambda p, s: s.surface_points(2.5), "2.5 points"),
        (lambda p, s: p.to_svg('"/><script>'), "expected a colour such as '#5e8bba' or 'black'"),
    ],
)
def test_messages(unchecked_shapes, ask, message):
    with pytest.raises(ValueError, match=message):
        ask(execute(parse("c(32,32,16)")), execute(parse("sp(32,32,32,16)")))
