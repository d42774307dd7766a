"""A person's own file: meshes and clouds of every kind, what is cleaned away, and what is told of bad ones."""

import os

import numpy as np
import pytest
import torch
import trimesh

from lib.datasets import DataError
from lib.datasets.own_clouds import cleaned, read_cloud
from tests.conftest import unchecked


@pytest.fixture
def box() -> trimesh.Trimesh:
    """Sides 2, 4, 4 about (10, 0, 0): diagonal 6."""
    return trimesh.creation.box((2, 4, 4), trimesh.transformations.translation_matrix((10, 0, 0)))


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "off", "glb"])
def test_meshes(box, tmp_path, kind):
    path = tmp_path / f"box.{kind}"
    box.export(path)
    cloud = read_cloud(path, 500)
    assert cloud.points.shape == (500, 3) and cloud.points.dtype == torch.float32
    half = torch.tensor([1, 2, 2]) / 6
    assert torch.allclose((cloud.points.abs() / half).amax(1), torch.ones(500), atol=0.03)
    assert cloud.scale == pytest.approx(1 / 6, rel=0.005)
    assert (cloud.back(cloud.points)[:, 0] - 10).abs().max() < 1.01
    assert "12 triangles, a closed surface" in cloud.told and "has diagonal 1 now" in cloud.told


def test_a_text_with_a_heading_and_more_columns(tmp_path):
    points = np.random.default_rng(0).normal(size=(400, 3))
    lines = ["x,y,z,red", *(f"{x},{y},{z},7" for x, y, z in points), "# the end", ""]
    (tmp_path / "cloud.csv").write_text("\n".join(lines))
    cloud = read_cloud(tmp_path / "cloud.csv", 100)
    assert "A cloud of 400 points." in cloud.told
    back = cloud.back(cloud.points.double()).numpy()
    assert np.abs(back[:, None] - points[None]).max(2).min(1).max() < 1e-5  # they are some of these


@pytest.mark.parametrize(
    "start, apart, comma",
    [
        ("\ufeff", " ", "."),
        ("", "; ", ","),
        ("", " ", ","),
        ("", ", ", "."),
        ("", ",", "."),
        ("", ", ", ","),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_how_a_text_may_be_written(tmp_path, start, apart, comma, encoding):
    """Byte order marks, and decimal commas, as spreadsheets write them."""
    points = np.random.default_rng(0).integers(-9, 9, size=(60, 3)) / 4
    lines = [apart.join(f"{x:g}".replace(".", comma) for x in row) for row in points]
    (tmp_path / "cloud.txt").write_text(start + "\n".join(lines), encoding=encoding)
    cloud = read_cloud(tmp_path / "cloud.txt", 100)
    assert "A cloud of 60 points." in cloud.told
    back = cloud.back(cloud.points.double()).numpy()
    assert np.abs(back[:, None] - points[None]).max(2).min(1).max() < 1e-5


def test_a_byte_order_mark_hides_no_corner(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 5 0\nv 0 0 9\nf 1 2 3\n"
    for name, encoding in (("with", "utf-8-sig"), ("without", "utf-8")):
        (tmp_path / f"{name}.obj").write_text(text, encoding=encoding)
    marked, plain = (read_cloud(tmp_path / f"{name}.obj", 50) for name in ("with", "without"))
    assert torch.equal(marked.points, plain.points) and marked.points[:, 2].abs().max() == 0


def test_few_points_of_a_mesh(box, tmp_path):
    box.export(tmp_path / "box.off")
    assert read_cloud(tmp_path / "box.off", 1).points.shape == (1, 3)


def test_a_cloud_in_a_scene(tmp_path):
    points = np.random.default_rng(0).uniform(size=(60, 3))
    trimesh.Scene([trimesh.PointCloud(points)]).export(tmp_path / "cloud.glb")
    assert "A cloud of 60 points." in read_cloud(tmp_path / "cloud.glb", 100).told


def test_a_cloud_without_faces(tmp_path):
    points = np.random.default_rng(0).uniform(size=(60, 3))
    trimesh.PointCloud(points).export(tmp_path / "cloud.ply")
    cloud = read_cloud(tmp_path / "cloud.ply", 100)
    assert len(cloud.points) == len(cloud.points.unique(dim=0)) == len(cleaned(points)[0]) > 55
    assert f"Left are {len(cloud.points)} points, fewer than 100." in cloud.told


def test_what_is_cleaned_away():
    rng = np.random.default_rng(0)
    shape = rng.uniform(size=(300, 3))
    dirt = np.array([[np.nan, 0, 0], [np.inf, 1, 1], shape[0], shape[1], shape[2], [50, 50, 50]])
    kept, told = cleaned(np.concatenate([shape, dirt]))
    assert told == "2 not finite, 3 repeated, 1 far from all others"
    assert np.array_equal(kept, np.unique(shape, axis=0))
    assert cleaned(shape)[1] == ""


def test_the_seed_decides(box, tmp_path):
    box.export(tmp_path / "box.stl")
    first, same, other = (read_cloud(tmp_path / "box.stl", 50, seed).points for seed in (0, 0, 1))
    assert torch.equal(first, same) and not torch.equal(first, other)


@pytest.mark.parametrize(
    "name, content, told",
    [
        ("a.step", "x", "found a file .step; expected .obj, .ply"),
        ("a", "x", "found a file without an ending"),
        ("a.obj", "", "found neither triangles nor points; expected a whole file of the kind obj"),
        ("a.stl", "x" * 400, "expected a whole file"),
        ("a.off", "", "cannot be read as off .*; expected a whole file of that kind"),
        ("a.obj", "v 1 2\nv 2 3\nv 3 3\nf 1 2 3\n", "cannot be read as obj"),
        ("a.xyz", "", "found no line that begins with three numbers"),
        ("a.csv", '"1","2","3"\n' * 50, "found no line that begins with three numbers"),
        ("a.xyz", "".join(f"{k}e300 1 {k % 7}\n" for k in range(50)), "expected a shape between 1e-30 and"),
        ("a.xyz", "".join(f"{k}e-300 0 {k % 7}e-300\n" for k in range(50)), "expected a shape between 1e-30"),
        ("a.ply", "ply nonsense", "cannot be read as ply"),
        ("a.stl", "solid", "a.stl: "),
        ("a.xyz", "1 2 3\n4 five 6\n", "line 2: found '4 five 6'; expected numbers"),
        ("a.xyz", "1 2 3\n4 5\n", "line 2: found 2 numbers; expected x y z"),
        ("a.csv", "x,y,z\n1,2,3\n1,,3,4\n", "line 3: found '1,,3,4'; expected numbers x y z"),
        ("a.csv", "1,,3,4\n" * 50, "line 1: found '1,,3,4'"),
        ("a.txt", "1;;3;4\n" * 50, "line 1: found '1;;3;4'"),
        ("a.csv", "id,x,y,z\n1,2,3,4\n", "line 1: found 'id,x,y,z'; expected numbers x y z, the first"),
        ("a.csv", ",x,y,z\n0,2,3,4\n", "line 1: found ',x,y,z'"),
        ("a.xyz", "1 2 3\n" * 50, "found 1 points that differ"),
        ("a.xyz", "nan nan nan\n" * 50, "found 0 points"),
        ("a.obj", "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "found 1 triangles of area 0"),
        ("a.obj", "v nan 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n", "found 1 triangles of area nan"),
        ("a.obj", "v 1e200 0 0\nv 0 1e200 0\nv 0 0 1\nf 1 2 3\n", "found 1 triangles of area inf"),
    ],
)
def test_files_that_show_no_shape(tmp_path, name, content, told):
    (tmp_path / name).write_text(content)
    with pytest.raises(DataError, match=told):
        read_cloud(tmp_path / name)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(DataError, match="cannot be read as obj"):
        read_cloud(tmp_path / "none.obj")
    with pytest.raises(DataError, match="found a count of 0"):
        read_cloud(tmp_path / "none.obj", 0)
    with pytest.raises(
        DataError, match="found a count of 1000000000000; expected a whole number from 1 to 1048576"
    ):
        read_cloud(tmp_path / "none.obj", 10**12)
    for count in (50.0, "50", True, None):
        with unchecked(), pytest.raises(DataError, match=f"found a count of {count!r}; expected a whole"):
            read_cloud(tmp_path / "none.obj", count)
    for seed in (-1, 1.5):
        with unchecked(), pytest.raises(DataError, match=f"found a seed of {seed}"):
            read_cloud(tmp_path / "none.obj", seed=seed)
    (tmp_path / "folder.xyz").mkdir()
    with pytest.raises(DataError, match="found a folder, a device"):
        read_cloud(tmp_path / "folder.xyz")


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.obj")
    with pytest.raises(DataError, match="found a folder, a device"):
        read_cloud(tmp_path / "pipe.obj")
