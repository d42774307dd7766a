"""ShapeNet as Occupancy Networks keep it: read, moved and scaled; and what is told of folders that are none."""

import numpy as np
import pytest

from lib.datasets import DataError
from lib.datasets.occnet import read_occnet
from tests.conftest import unchecked

RADIUS, CENTER = 0.3, np.array([1.0, 2.0, 3.0])


@pytest.fixture
def folder(tmp_path):
    """A class of three balls about one point."""
    rng = np.random.default_rng(0)
    for name in ("a", "b", "c"):
        normals = rng.normal(size=(900, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        points = rng.uniform(-0.55, 0.55, (1003, 3))
        inside = np.linalg.norm(points, axis=1) < RADIUS
        (tmp_path / name).mkdir()
        surface = (CENTER + RADIUS * normals).astype(np.float32)
        np.savez(tmp_path / name / "pointcloud.npz", points=surface, normals=normals.astype(np.float16))
        occupancies = np.packbits(inside) if name != "b" else inside
        np.savez(tmp_path / name / "points.npz", points=CENTER + points, occupancies=occupancies)
    for split, names in {"train": "a\nb\n", "val": "c\n", "test": ""}.items():
        (tmp_path / f"{split}.lst").write_text(names)
    return tmp_path


def test_models_are_moved_and_scaled(folder):
    clouds = read_occnet(folder, points=500, queries=200)
    assert clouds.ids == ("a", "b", "c") and clouds.splits == ("train", "train", "val")
    assert set(clouds.categories) == {folder.name} and len(read_occnet(folder, "val")) == 1
    radius = 0.5 / 3**0.5  # of a ball whose bounding box has diagonal 1
    for cloud in clouds:
        assert np.linalg.norm(cloud.points, axis=1) == pytest.approx(radius, abs=0.01)
        assert (cloud.points * cloud.normals).sum(1) == pytest.approx(radius, abs=0.01)
        away = np.linalg.norm(cloud.queries, axis=1)
        assert (away[:100] < radius + 0.01).all() and (away[100:] > radius - 0.01).all()


def test_few_points_come_again(folder):
    cloud = read_occnet(folder, "val", points=2000, queries=4000)[0]
    assert len(cloud.points) == 2000 and len(np.unique(cloud.points, axis=0)) <= 900
    assert len(cloud.queries) == 4000


def test_the_seed_decides(folder):
    first, same, other = (read_occnet(folder, "val", 50, 50, seed)[0].points for seed in (0, 0, 1))
    assert np.array_equal(first, same) and not np.array_equal(first, other)


def broken(folder, how):
    points, surface = folder / "a" / "points.npz", folder / "a" / "pointcloud.npz"
    arrays = dict(np.load(points)), dict(np.load(surface))
    if how == "list":
        (folder / "train.lst").unlink()
    elif how == "model":
        (folder / "train.lst").write_text("z\n")
    elif how == "name":
        np.savez(points, points=arrays[0]["points"])
    elif how == "count":
        np.savez(points, points=arrays[0]["points"][:50], occupancies=np.ones(7))
    elif how == "bytes":
        np.savez(points, points=arrays[0]["points"], occupancies=np.packbits(np.eye(1003, dtype=bool)))
    elif how == "chances":
        np.savez(points, points=arrays[0]["points"], occupancies=np.linspace(0, 1, 1003))
    elif how == "huge":
        np.savez(surface, points=arrays[1]["points"].astype(float) * 1e200, normals=arrays[1]["normals"])
    elif how == "far":
        np.savez(points, points=arrays[0]["points"] * 1e9, occupancies=arrays[0]["occupancies"])
    elif how == "full":
        np.savez(points, points=arrays[0]["points"], occupancies=np.ones(1003, bool))
    elif how == "shape":
        np.savez(surface, points=arrays[1]["points"][:, :2], normals=arrays[1]["normals"])
    elif how == "nan":
        np.savez(surface, points=arrays[1]["points"] * np.nan, normals=arrays[1]["normals"])
    elif how == "fewer":
        np.savez(surface, points=arrays[1]["points"], normals=arrays[1]["normals"][:7])
    elif how == "damaged":
        surface.write_bytes(b"mine")


@pytest.mark.parametrize(
    "how, told",
    [
        ("list", "train.lst: cannot be read .* expected the names of models"),
        ("model", "z/pointcloud.npz: cannot be read"),
        ("name", "points.npz: occupancies is not a file .*; expected points and occupancies"),
        ("count", "found occupancies float64 .*; expected 50, each 0 or 1, or their bits"),
        ("bytes", "found occupancies uint8 .*; expected 1003"),
        ("chances", "found occupancies float64 .*; expected 1003, each 0 or 1"),
        ("huge", "found no solid"),
        ("far", "found points of space, or normals, up to .*e.09; expected at most"),
        ("full", "found no solid; expected points that differ, some inside"),
        ("shape", "found points float32 .*; expected numbers"),
        ("nan", "found points that are not finite"),
        ("fewer", "found different numbers of points and normals"),
        ("damaged", "cannot be read, or is damaged"),
    ],
)
def test_folders_that_are_none(folder, how, told):
    broken(folder, how)
    with pytest.raises(DataError, match=told):
        read_occnet(folder, "train")


def test_bytes_that_are_no_bits(folder):
    """Each a 0 or a 1, as some programs write them."""
    points = dict(np.load(folder / "c" / "points.npz"))
    bits = np.unpackbits(points["occupancies"])[:1003]
    before = read_occnet(folder, "val")
    np.savez(folder / "c" / "points.npz", points=points["points"], occupancies=bits)
    assert np.array_equal(read_occnet(folder, "val").queries, before.queries)


def test_the_folder_one_is_in(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert read_occnet(".", "val").categories == (folder.name,)


@pytest.mark.parametrize(
    "given",
    [
        {"points": 0},
        {"queries": 0},
        {"queries": 7},
        {"seed": -1},
        {"points": 5.5},
        {"queries": "8"},
        {"points": 10**12},
        {"queries": 10**9},
    ],
)
def test_numbers_that_make_no_sense(folder, given):
    with (
        unchecked(),
        pytest.raises(DataError, match="expected whole numbers, from 1, an even one from 2, both to 1048576"),
    ):
        read_occnet(folder, "val", **given)


def test_no_models_and_other_splits(folder):
    with pytest.raises(DataError, match="found no models in its lists"):
        read_occnet(folder, "test")
    with pytest.raises(DataError, match="unknown split"):
        read_occnet(folder, "all")
