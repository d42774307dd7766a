"""Surfaces of CSG-Stumps: exact solids, marching cubes with the right half voxel, outlines, and their files."""

import io
import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import torch
import trimesh

from lib.interpreters.rings import shoelace
from lib.interpreters.stump import (
    Box,
    Circle,
    Cone,
    Cylinder,
    HalfPlane,
    ProgramError,
    Sphere,
    Square,
    Stump,
    Triangle,
    execute,
)
from lib.interpreters.stump.surface import field
from tests.random_stumps import boxes, random_stump

TURN = (0.3, 0.5, 0.2, 0.9)
UNIT = [[-0.5] * 3, [0.5] * 3]


def nodes(*columns, window=None):
    """The union of intersections of primitives; ("not", primitive) is a complement."""
    rows = [entry for column in columns for entry in column]
    primitives = [entry[1] if isinstance(entry, tuple) else entry for entry in rows]
    complement = [isinstance(entry, tuple) for entry in rows]
    intersection, row = np.zeros((len(rows), len(columns)), dtype=bool), 0
    for c, column in enumerate(columns):
        intersection[row : row + len(column), c] = True
        row += len(column)
    return execute(Stump(primitives, complement, intersection, np.ones(len(columns))), window)


def outside(primitive):
    return "not", primitive


EVERYTHING = Stump([Sphere(0.3)], [0], [[0]], [1])
NOTHING = Stump([Sphere(0.3)], [0], [[1]], [0])


def assert_closed(mesh) -> None:
    """Two triangles at each edge, which run opposite ways, and facing outwards."""
    if not mesh.is_empty:
        assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0


# Exact solids.


def test_volumes_by_hand():
    plate, disc = Box((0.5, 0.4, 0.1)), math.pi * 0.04
    ball = 4 / 3 * math.pi * 0.3**3
    by_hand = {
        nodes([plate]): 0.16,
        nodes([plate, outside(Cylinder(0.2))]): 0.16 - disc * 0.2,
        nodes([plate, outside(Cylinder(0.2, 0.2))]): 0.16 - disc * 0.2,  # its ends lie in the plate's faces
        nodes([plate, Cylinder(0.2)]): disc * 0.2,
        nodes([Sphere(-0.3)]): ball,
        nodes([Sphere(0.3)], [Sphere(0.3, (1.0, 0.0, 0.0))]): 2 * ball,
        nodes([outside(Sphere(0.3))]): 1 - ball,  # within the window
        nodes([Cylinder(0.2)]): disc,
        nodes([Cylinder(0.2)], window=[[-1, -1, -3], [1, 1, 1]]): 4 * disc,
        nodes([Cylinder(0.2, 0.5, rotation=TURN)]): disc * 0.5,
        nodes([Cone(0.5)]): math.pi * 0.25**2 * 0.5 / 3,
        nodes([Cone(0.5, 0.6, (0.1, 0.2, 0.3), TURN)]): math.pi * 0.3**2 * 0.6 / 3,
        nodes([Box((0.1, 0.1, 0.1))], [Box((0.1, 0.1, 0.1), (0.2, 0.0, 0.0))]): 0.016,  # face on face
        nodes([Box((0.1, 0.1, 0.1))], [Box((0.1, 0.1, 0.1), (0.2, 0.2, 0.0))]): 0.016,  # edge on edge
        nodes([Box((0.3, 0.3, 0.3)), outside(Box((0.1, 0.1, 0.1)))]): 0.216 - 0.008,  # a cavity
        nodes([Sphere(0.3)], window=[[0, -1, -1], [1, 1, 1]]): ball / 2,
        execute(EVERYTHING): 1,
    }
    for shape, volume in by_hand.items():
        mesh = shape.mesh()
        assert mesh.is_volume
        # 1e-12; cut at a coordinate plane, a polyhedron keeps its share of the volume by symmetry
        assert mesh.volume == pytest.approx(volume, rel=1e-9), shape.program.to_text()


def test_hand_known_bodies_stay_whole():
    turned = nodes([Box((0.5, 0.4, 0.1), rotation=TURN), outside(Cylinder(0.2, 0.2, rotation=TURN))]).mesh()
    assert turned.body_count == 1 and turned.euler_number == 0  # one hole
    assert turned.volume == pytest.approx(0.16 - math.pi * 0.04 * 0.2)


@pytest.mark.parametrize("scale", [1e-50, 1e-12, 1e-4, 1.0, 1e4, 1e12, 1e50])
def test_solids_of_any_size(scale):
    shape = nodes([Box((0.5 * scale, 0.4 * scale, 0.1 * scale)), outside(Cylinder(0.2 * scale))])
    for mesh, near in ((shape.mesh(), 1e-9), (shape.marching_cubes(64), 0.03)):
        assert_closed(mesh)
        assert mesh.volume == pytest.approx((0.16 - math.pi * 0.04 * 0.2) * scale**3, rel=near)


@pytest.mark.parametrize("scale", [1e-200, 1e-70, 1e70, 1e160])
def test_sizes_out_of_range_are_named(scale):
    solid, picture = nodes([Sphere(scale)]), nodes([Circle(scale)])
    for ask in (solid.mesh, solid.marching_cubes, picture.mesh, lambda: picture.area):
        with pytest.raises(ProgramError, match=r"has sides of 2e.*; expected sizes from 1e-60 to 1e\+60"):
            ask()


def test_primitives_without_a_volume_make_none():
    flat = Box((0.5, 0.5, 0.0)), Sphere(0.0), Cylinder(0.0), Cylinder(0.1, 0.0), Cone(0.0), Cone(0.5, 0.0)
    for primitive in flat:
        assert nodes([primitive]).mesh().is_empty
        assert nodes([Box((0.1, 0.1, 0.1)), outside(primitive)]).mesh().volume == pytest.approx(0.008)


def test_solids_are_closed_and_have_the_volume_of_their_points(unchecked_shapes):
    rng = np.random.default_rng(0)
    full = 0
    for _ in range(60):
        shape = execute(random_stump(rng, 3))
        mesh = shape.mesh()
        assert mesh.is_empty or mesh.is_volume
        cells = shape.voxels(48)
        low, high = shape.window
        cell = float((high - low).max()) / 48
        centers = shape.voxel_centers(48)
        seen = ((centers >= low) & (centers <= high)).all(-1)
        sampled = float((cells & seen).sum()) * cell**3
        if mesh.is_empty:
            assert sampled < 20 * cell**3
            continue
        full += 1
        # Cells can be wrong only where the surface passes through them. Half of each if all erred the same way.
        assert mesh.volume == pytest.approx(sampled, abs=0.5 * mesh.area * cell + 1e-9)
        # Polyhedra are within r/500 of round surfaces; those reach no farther than 1.5 times the window.
        reach = 1e-9 + 1.5 * cell * 48 / 500
        assert (mesh.bounds[0] >= low.numpy() - reach).all() and (
            mesh.bounds[1] <= high.numpy() + reach
        ).all()
    assert full > 30


def test_solids_are_their_points(unchecked_shapes):
    """A ray-free test: a little inside each triangle the shape is met, a little outside it is not."""
    rng = np.random.default_rng(1)
    checked = 0
    for _ in range(60):
        shape = execute(random_stump(rng, 3, forms=("box",)), UNIT)  # flat ones: no rounding to polyhedra
        mesh = shape.mesh()
        if mesh.is_empty:
            continue
        keep = mesh.area_faces > 1e-6
        middle, normal = mesh.triangles_center[keep], mesh.face_normals[keep]
        inside = shape.occupancy(middle - 1e-7 * normal)
        beyond = shape.occupancy(middle + 1e-7 * normal) & torch.tensor(np.abs(middle).max(1) < 0.5 - 1e-6)
        assert inside.double().mean() > 0.999 and beyond.double().mean() < 0.001
        checked += len(middle)
    assert checked > 1000


# Marching cubes.


def test_marching_cubes_lie_where_the_shape_is():
    shape, cells = nodes([Sphere(0.3)], window=UNIT), 128
    mesh = shape.marching_cubes(cells)
    assert_closed(mesh)
    assert np.abs(mesh.center_mass * cells).max() < 1e-3
    # Linear interpolation of a sphere's field, and no sample nearer than 1e-3 cells: measured 0.0033 cells.
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 0.3).max() * cells < 0.01
    assert mesh.volume == pytest.approx(4 / 3 * math.pi * 0.3**3, rel=1e-3)


def test_half_a_cell_the_wrong_way_is_one_cell_off():
    """The authors' program takes half a cell away from the index of a sample where it must be added."""
    cells = 64
    mesh = nodes([Sphere(0.3)], window=UNIT).marching_cubes(cells)
    index = (mesh.vertices + 0.5) * cells - 0.5  # of cells, 0 is the first one
    theirs = trimesh.Trimesh((index - 0.5) / cells - 0.5, mesh.faces, process=False)
    assert theirs.center_mass * cells == pytest.approx([-1, -1, -1], abs=1e-3)


def test_the_window_s_place_and_size_do_not_matter():
    at_home = nodes([Sphere(0.3)], window=UNIT).marching_cubes(32)
    moved = nodes([Sphere(3.0, (100.0, 20.0, 0.0))], window=[[95, 15, -5], [105, 25, 5]]).marching_cubes(32)
    assert np.allclose(moved.vertices, at_home.vertices * 10 + (100, 20, 0), atol=1e-4)
    assert np.array_equal(moved.faces, at_home.faces)


def touching(*offsets):
    return [[Box((0.125, 0.125, 0.125), tuple(0.25 * k for k in offset))] for offset in offsets]


ALIGNED = {  # window UNIT: faces lie on samples, or halfway between them, depending on the resolution
    "box": [[Box((0.25, 0.25, 0.25))]],
    "box as large as the window": [[Box((0.5, 0.5, 0.5))]],
    "box larger than the window": [[Box((1.0, 1.0, 1.0))]],
    "face on face": touching((0, 0, 0), (1, 0, 0)),
    "edge on edge": touching((0, 0, 0), (1, 1, 0)),
    "corner on corner": touching((0, 0, 0), (1, 1, 1)),
    "chessboard": touching((0, 0, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1), (-1, -1, 0), (-1, 0, -1), (-1, 1, 1)),
    "boxes outside": [
        [outside(Box((0.25, 0.25, 0.25))), outside(Box((0.25, 0.25, 0.125), (0.25, 0.25, 0.0)))]
    ],
    "cavity": [[Box((0.375, 0.375, 0.375)), outside(Box((0.25, 0.25, 0.25)))]],
    "plate through the window": [[Box((0.5, 0.5, 0.125))]],
    "cylinder": [[Cylinder(0.25)]],
    "cone": [[Cone(1.0)]],
    "two cones": [[Cone(1.0)], [Cone(1.0, rotation=(0.0, 1.0, 0.0, 0.0))]],
    "half of space": [[Box((1.0, 1.0, 1.0), (1.0, 0.0, 0.0))]],
    "same twice": [[Box((0.25, 0.25, 0.25))], [Box((0.25, 0.25, 0.25))]],
    "cancelled": [[Box((0.25, 0.25, 0.25)), outside(Box((0.25, 0.25, 0.25)))]],
}


@pytest.mark.parametrize("resolution", [8, 12, 15, 16, 32])
@pytest.mark.parametrize("name", ALIGNED)
def test_marching_cubes_close_where_samples_lie_on_the_surface(name, resolution):
    shape = nodes(*ALIGNED[name], window=UNIT)
    mesh, exact = shape.marching_cubes(resolution), shape.mesh()
    assert_closed(mesh)
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)  # so merging them would not open it
    if exact.is_empty:
        assert mesh.volume < 0.01 if not mesh.is_empty else True
    else:
        assert mesh.volume == pytest.approx(exact.volume, abs=0.6 * exact.area / resolution)


def test_marching_cubes_of_everything_and_nothing():
    everything = execute(EVERYTHING).marching_cubes(32)
    assert_closed(everything)
    assert np.allclose(everything.bounds, UNIT, atol=1e-4)  # a thousandth of a cell
    assert everything.volume == pytest.approx(1, abs=0.01)  # edges and corners are cut off
    assert execute(NOTHING).marching_cubes(32).is_empty
    assert nodes([Sphere(0.0)]).marching_cubes(8).is_empty  # a window without a size
    assert nodes([Sphere(0.3)]).marching_cubes(1).volume > 0


def test_marching_cubes_of_random_stumps_are_closed_and_near_the_surface(unchecked_shapes):
    rng = np.random.default_rng(2)
    full = 0
    for _ in range(80):
        stump = random_stump(rng, 3)
        shape, cells = execute(stump), 40
        mesh = shape.marching_cubes(cells)
        assert_closed(mesh)
        if mesh.is_empty:
            continue
        full += 1
        cell = float((shape.window[1] - shape.window[0]).max()) / cells
        corners = torch.tensor(mesh.vertices)
        steps = torch.tensor(list(np.ndindex(3, 3, 3))).double() - 1
        around = torch.stack([shape.occupancy(corners + step * cell) for step in steps])
        at_window = ((corners - shape.window[:, None]).abs() < 2 * cell).any(-1).any(0)
        assert (around.any(0) & (~around.all(0) | at_window)).all()
    assert full > 40


def test_the_field_is_the_largest_and_the_smallest_of_the_distances(unchecked_shapes):
    """Everywhere by its sign, and by its value near the surface, where blocks are not skipped."""
    rng = np.random.default_rng(3)
    for _ in range(30):
        stump = random_stump(rng, 3, forms=("box", "sphere", "cylinder", "capped cylinder", "capped cone"))
        shape, cells = execute(stump, UNIT), 21
        distances = stump.distances(shape.voxel_centers(cells).flatten(0, 2))
        distances[stump.complement] *= -1
        expected = torch.full_like(distances[0], torch.inf)
        for column in stump.intersection[:, stump.union].T:
            expected = torch.minimum(expected, distances[column].amax(0))
        within = Box((0.5, 0.5, 0.5)).distance(shape.voxel_centers(cells).flatten(0, 2))
        expected = torch.maximum(expected, within).view(cells, cells, cells) * cells
        found = field(stump, shape.window, cells)[1:-1, 1:-1, 1:-1].double()
        clear = expected.abs() > 1e-3
        assert torch.equal((found < 0)[clear], (expected < 0)[clear])
        near = expected.abs() < 1
        assert torch.allclose(found[near], expected[near], atol=2e-3)  # 1e-3 twice: see _NEAR and _UNLIKE


def test_a_large_stump():
    stump = boxes()
    mesh = execute(stump, UNIT).marching_cubes(48)
    assert_closed(mesh)
    assert len(stump.pruned().primitives) == 64
    assert mesh.volume == pytest.approx(float(execute(stump, UNIT).voxels(48).double().mean()), rel=0.02)


# The plane.


def test_areas_by_hand():
    plate, disc = Square((0.5, 0.25)), math.pi * 0.01
    by_hand = {
        nodes([plate]): 0.5,
        nodes([plate, outside(Circle(0.1))]): 0.5 - disc,
        nodes([Circle(0.1)], [Circle(0.1, (1.0, 0.0))]): 2 * disc,
        nodes([Triangle(0.2, 0.3, 0.5, (1.0, 2.0), 0.4)]): 0.125,
        nodes([HalfPlane(rotation=0.3)]): 0.5,  # the lower half of the window
        nodes([plate, HalfPlane(rotation=0.3)]): 0.25,
        nodes([outside(plate)], window=[[-1, -1], [1, 1]]): 3.5,
        execute(Stump([Circle(0.3)], [0], [[0]], [1])): 1,
        execute(Stump([Circle(0.3)], [0], [[1]], [0])): 0,
    }
    for shape, area in by_hand.items():
        assert shape.area == pytest.approx(area, abs=1e-8)  # coordinates have 8 decimals
        plate = shape.mesh(0.25)
        assert (plate.is_empty and not area) or plate.is_volume
        assert not area or plate.volume == pytest.approx(0.25 * area, rel=1e-6)


@pytest.mark.parametrize("scale", [1e-50, 1e-6, 1.0, 1e6, 1e50])
def test_pictures_of_any_size(scale):
    shape = nodes([Square((0.5 * scale, 0.25 * scale)), outside(Circle(0.1 * scale))])
    assert shape.area == pytest.approx((0.5 - math.pi * 0.01) * scale**2, rel=1e-8)
    assert shape.mesh().is_volume and shape.mesh().extents[2] == pytest.approx(scale / 8)
    assert len(shape.outline()) == 2 and 'd="\nM' in shape.to_svg()


def test_outlines_run_counter_clockwise_and_holes_clockwise():
    rings = nodes([Square((0.5, 0.25)), outside(Circle(0.1))]).outline()
    assert sorted(map(shoelace, rings)) == pytest.approx([-math.pi * 0.01, 0.5])


def test_areas_are_those_of_images(unchecked_shapes):
    rng = np.random.default_rng(4)
    for _ in range(60):
        shape = execute(random_stump(rng, 2))
        (low, high), cells = shape.window, 256
        centers = shape.voxel_centers(cells)
        seen = ((centers >= low) & (centers <= high)).all(-1)
        cell = float((high - low).max()) / cells
        sampled = float((shape.voxels(cells) & seen).sum()) * cell**2
        length = sum(np.linalg.norm(np.roll(ring, -1, 0) - ring, axis=1).sum() for ring in shape.outline())
        # Cells that the outline passes through can be wrong, by half of their width if all erred the same way.
        assert shape.area == pytest.approx(sampled, abs=1e-6 + 0.5 * cell * length)


def test_points_lie_on_the_surface():
    solid = nodes([Box((0.5, 0.4, 0.1)), outside(Cylinder(0.2))])
    points = solid.surface_points(500, seed=3)
    assert points.shape == (500, 3) and torch.equal(points, solid.surface_points(500, seed=3))
    distances = solid.program.distances(points)
    assert (distances.abs().amin(0) < 0.2 / 500).all()
    picture = nodes([Square((0.5, 0.25)), outside(Circle(0.1))])
    assert (picture.program.distances(picture.surface_points(500)).abs().amin(0) < 1e-3).all()
    assert solid.surface_points(0).shape == (0, 3)


# Files.


def test_svg_shows_the_window_with_y_up():
    shape = nodes([Triangle(0.5, 0.5, 1.0)], window=[[-0.5, 0], [0.5, 1]])
    picture = ElementTree.fromstring(shape.to_svg("rgb(10, 20, 30)"))
    assert picture.attrib["viewBox"] == "-32 -32 64 64"
    (path,) = picture
    corners = np.array([pair.split(",") for pair in path.attrib["d"].strip(" MZ").split()], dtype=float)
    assert sorted(map(tuple, corners)) == [(-32, 32), (0, -32), (32, 32)]  # the apex is at the top


@pytest.mark.parametrize(
    "shape",
    [
        nodes([Box((0.5, 0.4, 0.1)), outside(Cylinder(0.2))]),
        nodes([Square((0.5, 0.25)), outside(Circle(0.1))]),
    ],
    ids=["solid", "picture"],
)
def test_files_load_back(shape):
    mesh = shape.mesh()
    loaded = trimesh.load_mesh(io.BytesIO(shape.to_stl()), file_type="stl")
    assert loaded.is_volume and loaded.volume == pytest.approx(mesh.volume, rel=1e-5)  # single precision
    scene = trimesh.load_scene(io.BytesIO(shape.to_glb()), file_type="glb")
    assert scene.to_mesh().volume == pytest.approx(mesh.volume, rel=1e-5)
    # In GLB y is up: a solid is turned, a plate stands.
    turned = mesh.extents[[0, 2, 1]] if shape.dimensions == 3 else mesh.extents
    assert np.allclose(scene.extents, turned, atol=1e-6)


@pytest.mark.parametrize("shape", [execute(NOTHING), nodes([Circle(0.0)])], ids=["solid", "picture"])
def test_a_shape_without_an_inside_says_so(shape):
    asks = [shape.to_stl, shape.to_glb, lambda: shape.surface_points(5)]
    for ask in asks + ([shape.to_svg] if shape.dimensions == 2 else []):
        with pytest.raises(ProgramError, match="the shape has no inside"):
            ask()
    assert shape.mesh().is_empty
