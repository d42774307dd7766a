"""What one can ask of a shape: mesh, files, occupancy, voxels, surface points, bounds."""

import io

import numpy as np
import pytest
import torch
import trimesh

from lib.interpreters.cuboids import Cuboids
from lib.interpreters.shapeassembly import ProgramError, Shape, execute, parse
from tests.programs import block_text, run

# Three separate boxes: a turned post and two slabs.
APART = [
    "cube0 = Cuboid(0.2, 1, 0.3, False)",
    "cube1 = Cuboid(0.5, 0.1, 0.6, True)",
    "attach(cube0, bbox, 0.5, 0.0, 0.5, 0.2, 0.1, 0.3)",
    "attach(cube0, bbox, 0.5, 1.0, 0.5, 0.4, 0.5, 0.6)",
    "attach(cube1, bbox, 0.5, 0.5, 0.5, 0.8, 0.8, 0.5)",
    "translate(cube1, Y, 1, 0.1)",
]
NEGATIVE = [  # see test_shapeassembly_attach: its front side comes out as -0.26
    "cube0 = Cuboid(1.2, 1, 0.5, False)",
    "attach(cube0, bbox, 0.0, 0.0, 0.5, 0.5, 0.0, 0.5)",
    "attach(cube0, bbox, 1.0, 1.0, 0.5, 0.5, 0.25, 0.5)",
]


@pytest.fixture(scope="module")
def apart() -> Shape:
    return run(*APART)


@pytest.fixture(scope="module")
def shapes(programs) -> list[Shape]:
    return [execute(program) for program in programs]


@pytest.fixture(scope="module")
def empty() -> Shape:
    return execute(parse(block_text()))


def inside(box: Cuboids, points: np.ndarray) -> np.ndarray:
    """Worked out a second time, with numpy: how far along each axis from the center?"""
    along = (points - box.center.numpy()) @ box.axes.numpy().T
    return (abs(along) <= abs(box.size.numpy()) / 2).all(1)


# Mesh


@pytest.mark.parametrize("lines", [APART, NEGATIVE], ids=["apart", "negative side"])
def test_mesh_has_one_closed_body_a_part(lines):
    shape = run(*lines)
    mesh, leaves = shape.mesh(), shape.cuboids
    assert mesh.vertices.shape == (8 * len(leaves), 3) and mesh.faces.shape == (12 * len(leaves), 3)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.body_count == len(leaves)
    for i, corners in enumerate(leaves.corners().numpy()):
        np.testing.assert_array_equal(mesh.vertices[8 * i : 8 * i + 8], corners)
        body = trimesh.Trimesh(corners, mesh.faces[12 * i : 12 * i + 12] - 8 * i, process=False)
        assert body.volume == pytest.approx(
            abs(leaves.size[i].prod().item())
        )  # positive: normals point outwards
        outwards = ((body.triangles_center - corners.mean(0)) * body.face_normals).sum(1)
        assert (outwards > 0).all()


def test_negative_really_has_a_negative_side():
    assert (run(*NEGATIVE).cuboids.size < 0).sum() == 1


def test_parts_have_colours_and_copies_their_sources():
    shape = run(
        "cube0 = Cuboid(0.1, 0.1, 0.1, True)",
        *APART[1:2],
        "attach(cube0, bbox, 0, 0, 0, 0, 0, 0)",
        *APART[4:],
    )
    colors = shape.colors
    assert colors.shape == (3, 3) and colors.dtype == np.uint8
    assert (colors[0] != colors[1]).any() and (colors[1] == colors[2]).all()
    np.testing.assert_array_equal(shape.mesh().visual.face_colors[:, :3], np.repeat(colors, 12, axis=0))


def test_meshes_of_random_shapes_have_the_volume_of_their_boxes(shapes):
    for shape in shapes:
        mesh = shape.mesh()
        assert mesh.volume == pytest.approx(shape.cuboids.volume().sum().item())
        np.testing.assert_allclose(mesh.bounds, shape.bounds().numpy(), rtol=0, atol=1e-12)


# Files


def test_glb_comes_back_with_names_places_and_colours(shapes):
    for shape in shapes[::6]:
        scene = trimesh.load(io.BytesIO(shape.to_glb()), file_type="glb")
        assert sorted(scene.graph.nodes_geometry) == sorted(shape.names)
        for i, name in enumerate(shape.names):
            transform, geometry = scene.graph[name]
            part = scene.geometry[geometry].copy().apply_transform(transform)
            corners = shape.cuboids[i].corners()
            wanted = torch.stack([corners.amin(0), corners.amax(0)]).numpy()
            np.testing.assert_allclose(part.bounds, wanted, rtol=1e-6, atol=1e-6)  # GLB keeps float32
            np.testing.assert_array_equal(part.visual.material.baseColorFactor[:3], shape.colors[i])


def test_obj_comes_back_with_names_and_places(shapes):
    for shape in shapes[::6]:
        text = shape.to_obj()
        assert [line[2:] for line in text.splitlines() if line.startswith("o ")] == shape.names
        mesh = trimesh.load(io.StringIO(text), file_type="obj", process=False, force="mesh")
        assert mesh.volume == pytest.approx(
            shape.cuboids.volume().sum().item(), rel=1e-3, abs=1e-6
        )  # 6 decimals
        np.testing.assert_allclose(mesh.bounds, shape.bounds().numpy(), rtol=0, atol=1e-6)


def test_files_keep_small_shapes():
    """A shape a millionth in size is still a shape: relative precision, as a program's units are its own."""
    tiny = run("cube0 = Cuboid(1e-6, 1e-6, 1e-6, True)", "attach(cube0, bbox, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)")
    mesh = trimesh.load(io.StringIO(tiny.to_obj()), file_type="obj", process=False, force="mesh")
    np.testing.assert_allclose(mesh.extents, 1e-6, rtol=1e-3)


# Occupancy and voxels


def test_occupancy_is_that_of_the_boxes(shapes):
    rng = np.random.default_rng(0)
    seen = set()
    for shape in [*shapes, run(*NEGATIVE)]:
        low, high = shape.bounds().numpy()
        points = rng.uniform(low - 0.05, high + 0.05, (500, 3))
        found = shape.occupancy(torch.tensor(points)).numpy()
        wanted = np.any([inside(shape.cuboids[i], points) for i in range(len(shape.cuboids))], axis=0)
        np.testing.assert_array_equal(found, wanted)
        seen |= set(found.tolist())
    assert seen == {True, False}


def test_the_surface_is_occupied(apart):
    assert apart.occupancy(apart.cuboids[1:].center).all()
    slab = apart.cuboids[1]
    corners = slab.corners()
    assert apart.occupancy(slab.center + (corners - slab.center) * (1 - 1e-9)).all()
    assert not apart.occupancy(slab.center + (corners - slab.center) * (1 + 1e-9)).any()


@pytest.mark.parametrize("resolution", [1, 8, 9])
def test_voxels_are_the_occupancy_of_a_cubic_grid(apart, resolution):
    centers, voxels = apart.voxel_centers(resolution), apart.voxels(resolution)
    assert voxels.shape == (resolution,) * 3 and voxels.dtype == torch.bool
    assert (voxels == apart.occupancy(centers.reshape(-1, 3)).reshape(voxels.shape)).all()
    low, high = apart.bounds()
    longest = (high - low).max().item()
    middle = (centers[0, 0, 0] + centers[-1, -1, -1]) / 2
    torch.testing.assert_close(middle, (low + high) / 2)
    if resolution > 1:  # [x, y, z]: only the first index moves x
        step = torch.tensor([longest / resolution, 0, 0], dtype=torch.float64)
        torch.testing.assert_close(centers[1, 3, 5] - centers[0, 3, 5], step)


def test_voxels_approach_the_volume(apart):
    """The boxes are apart, so their volumes add up. 5%: the slabs are 5 voxels thick, give or take half a rim."""
    resolution = 96
    low, high = apart.bounds()
    voxel = ((high - low).max().item() / resolution) ** 3
    volume = apart.cuboids.volume().sum().item()
    assert apart.voxels(resolution).sum().item() * voxel == pytest.approx(volume, rel=0.05)


# Surface points


def test_surface_points_lie_on_the_faces(shapes):
    for shape in [*shapes[::5], run(*NEGATIVE)]:
        points = shape.surface_points(200, seed=1)
        q = torch.stack([shape.cuboids[i].local_many(points) for i in range(len(shape.cuboids))])
        from_face = ((q - 0.5).abs().amax(-1) - 0.5).abs()  # 0 where a point lies on a face of that box
        assert (from_face.amin(0) < 1e-9).all()


def test_surface_points_are_uniform_by_area(apart):
    """Counts on each face are binomial, places on it uniform: five standard deviations miss once in two million."""
    n = 20_000
    points = apart.surface_points(n, seed=2)
    total = 0.0
    shares = []
    for i in range(len(apart.cuboids)):
        x, y, z = apart.cuboids.size[i].tolist()
        q = apart.cuboids[i].local_many(points)
        within = ((q > -1e-9) & (q < 1 + 1e-9)).all(-1)
        for axis, area in enumerate((y * z, x * z, x * y)):
            for side in (0, 1):
                on = within & ((q[:, axis] - side).abs() < 1e-9)
                shares.append((area, on.sum().item(), np.delete(q[on].mean(0).numpy(), axis)))
                total += area
    assert sum(count for _, count, _ in shares) == n
    for area, count, mean in shares:
        share = area / total
        assert abs(count - n * share) < 5 * np.sqrt(n * share * (1 - share))
        assert (abs(mean - 0.5) < 5 / np.sqrt(12 * count)).all()  # uniform along both sides of the face


def test_surface_points_are_seeded(apart):
    assert (apart.surface_points(50, seed=3) == apart.surface_points(50, seed=3)).all()
    assert (apart.surface_points(50, seed=3) != apart.surface_points(50, seed=4)).any()


def test_surface_points_move_with_the_program():
    """Which face and where on it stay the same: moving the parameters a little moves each point by the gradient."""
    program = parse(block_text(*APART))
    numbers = program.parameters().requires_grad_()
    points = execute(program, numbers).surface_points(40, seed=5)
    direction = torch.randn(len(numbers), generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    step = 1e-6
    moved = execute(program, numbers.detach() + step * direction).surface_points(40, seed=5)
    weights = torch.randn(40, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    (gradient,) = torch.autograd.grad((weights * points).sum(), numbers)
    change = (weights * (moved - points)).sum().item() / step
    # The draw follows the areas, which moved by 1e-6: a point may pass to the next face once in some 1e4 tries.
    assert change == pytest.approx((gradient @ direction).item(), rel=1e-4)


def test_surface_points_of_a_batch_are_each_shapes_own(apart):
    leaves = apart.cuboids
    batch = Cuboids(*(torch.stack([part, part * 1]) for part in (leaves.size, leaves.center, leaves.axes)))
    points = batch.surface_points(30, seed=6)
    assert points.shape == (2, 30, 3)
    for variant in points:
        q = torch.stack([leaves[i].local_many(variant) for i in range(len(leaves))])
        assert (((q - 0.5).abs().amax(-1) - 0.5).abs().amin(0) < 1e-9).all()


# Nothing to draw


def test_an_empty_shape_has_nothing(empty):
    assert len(empty.cuboids) == 0 and empty.names == [] and empty.colors.shape == (0, 3)
    assert not empty.occupancy(torch.zeros(3, 3)).any()
    assert len(empty.mesh().faces) == 0
    assert "v " not in empty.to_obj()


@pytest.mark.parametrize("ask", ["bounds", "to_glb", "voxels", "surface_points"])
def test_an_empty_shape_answers_or_says_why_not(empty, ask):
    """No IndexError from the depths of a library."""
    try:
        getattr(empty, ask)(*{"voxels": [4], "surface_points": [5]}.get(ask, []))
    except ProgramError as error:
        assert "cuboid" in str(error)
