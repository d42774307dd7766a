"""Sets of solids as point clouds: what is embedded, what is read back, and what is told of damaged files."""

import numpy as np
import pytest
import torch

from lib.datasets import CATEGORIES, SOLIDS, DataError, solid
from lib.datasets.images import SPLITS
from lib.datasets.solid_clouds import ARRAYS, TEXTS, gathered, joined, read, solid_clouds
from lib.datasets.solid_sampling import SolidSample
from lib.furniture import make
from lib.interpreters.stump import Stump, execute


def few(count: int, points: int, queries: int, seed: int = 0, source: str = "csg"):
    rng = np.random.default_rng(seed)
    rows = [
        (f"s{k}", SPLITS[k % 3], "odd" if k % 2 else "even",
         SolidSample(*(rng.uniform(-0.5, 0.5, (n, 3)) for n in (points, points, queries))))
        for k in range(count)
    ]  # fmt: skip
    return gathered(rows, source)


def write(path, clouds, **changed):
    arrays = {name: getattr(clouds, name).numpy() for name in ARRAYS}
    arrays |= {name: np.array(getattr(clouds, name)) for name in TEXTS}
    np.savez(path, **{name: array for name, array in (arrays | changed).items() if array is not None})


@pytest.fixture
def made(tmp_path, monkeypatch):
    """A data folder with one source."""
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path))
    (tmp_path / "solids").mkdir()
    write(tmp_path / "solids" / "csg.npz", few(6, 5, 8))
    return tmp_path / "solids"


def test_what_is_embedded(monkeypatch, tmp_path):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "none"))
    clouds = solid_clouds()
    assert clouds.source == "embedded" and len(clouds) == 40 * len(CATEGORIES) + len(SOLIDS)
    assert clouds.describe().startswith("130 solids as point clouds (")
    assert {split: len(solid_clouds(split=split)) > 15 for split in SPLITS} == dict.fromkeys(SPLITS, True)
    assert set(clouds.select(category="everyday").splits) == {"test"}
    extent = clouds.points.float().amax(1) - clouds.points.float().amin(1)
    assert (extent.norm(dim=1) - 1).abs().max() < 0.06
    assert (clouds.normals.float().norm(dim=2) - 1).abs().max() < 2e-3
    # Inside and outside, told by the shapes themselves.
    mug = execute(Stump.from_tree(solid("mug")))
    low, high = mug.mesh().bounds
    chair = make("chair", 0)
    low_chair, high_chair = chair.mesh().bounds
    cases = {
        "mug": (mug.occupancy, low, high),
        "chair-000000": (chair.leaves.contains, low_chair, high_chair),
    }
    for name, (occupancy, low, high) in cases.items():
        queries = clouds[clouds.ids.index(name)].queries * np.linalg.norm(high - low) + (low + high) / 2
        assert occupancy(torch.from_numpy(queries)).tolist() == [True] * 1024 + [False] * 1024


def test_what_was_made_is_read_back(made):
    clouds = solid_clouds()
    assert clouds.source == "csg" and clouds.ids == ("s0", "s1", "s2", "s3", "s4", "s5")
    assert torch.equal(clouds.queries, few(6, 5, 8).queries)
    assert clouds.inside.tolist() == [1, 1, 1, 1, 0, 0, 0, 0]
    assert solid_clouds("csg", "val").ids == ("s1", "s4")
    assert clouds.select(split="train", category="odd").ids == ("s3",)
    assert clouds[1:3].ids == ("s1", "s2") and np.array_equal(clouds[2].points, clouds.points[2].double())
    with pytest.raises(
        DataError, match="there is no .*furniture.npz; make it: .*make_solids --source furniture"
    ):
        solid_clouds("furniture")


def test_joined_sets_have_equally_many_points(made):
    write(made / "furniture.npz", few(3, 7, 6, seed=1, source="furniture"))
    clouds = solid_clouds()
    assert clouds.source == "furniture + csg" and len(clouds) == 9
    assert clouds.points.shape == (9, 5, 3) and clouds.queries.shape == (9, 6, 3)
    assert torch.equal(clouds.queries[3:], few(6, 5, 8).queries[:, [0, 1, 2, 4, 5, 6]])
    assert joined([clouds]) is clouds


@pytest.mark.parametrize(
    "changed, told",
    [
        ({"points": np.zeros((6, 5, 3))}, "found points float64 .*; expected float16"),
        ({"queries": np.zeros((6, 5, 2), np.float16)}, "found queries float16"),
        ({"normals": np.full((6, 5, 3), np.nan, np.float16)}, "found normals that are not finite"),
        (
            {"points": np.full((6, 5, 3), 3e4, np.float16)},
            "found points up to 30000 from the origin; expected shapes",
        ),
        ({"points": np.zeros((6, 5, 3), np.float16)}, "found points up to 0 from the origin"),
        ({"ids": np.arange(6)}, "found ids int64"),
        ({"ids": np.array("s0")}, r"found ids <U2 \(\)"),
        ({"normals": np.zeros((6, 4, 3), np.float16)}, "found 5 points, 4 normals and 8 queries"),
        ({"queries": np.zeros((6, 7, 3), np.float16)}, "and 7 queries of each; expected .* an even number"),
        ({"queries": np.zeros((6, 0, 3), np.float16)}, "and 0 queries of each"),
        ({"splits": np.array(["all"] * 6)}, "found the split 'all'; expected train, val, test"),
        ({"categories": None}, "it has no clouds as the data script writes them"),
    ],
)
def test_damaged_files_are_told(made, changed, told):
    write(made / "csg.npz", few(6, 5, 8), **changed)
    with pytest.raises(
        DataError, match=told + ".*make it again: python -m data_scripts.make_solids --source csg"
    ):
        solid_clouds("csg")


def test_files_that_are_none(made):
    (made / "csg.npz").write_bytes(b"mine")
    with pytest.raises(DataError, match="cannot be read, or is damaged"):
        read(made / "csg.npz", "csg")


@pytest.mark.parametrize("given", [{"source": "shapenet"}, {"split": "all"}])
def test_what_there_is_not(given):
    with pytest.raises(DataError, match="unknown (source|split)"):
        solid_clouds(**given)
