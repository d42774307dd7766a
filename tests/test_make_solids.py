"""Making point clouds of solids: each source, the same bytes again, what is left out, and nothing half."""

import json
import os

import numpy as np
import pytest

from data_scripts import make_solids, sweethome
from data_scripts.journal import write_whole
from lib.datasets import CATEGORIES, DataError
from lib.datasets.solid_clouds import solid_clouds
from tests.packages import deb, make_zip, stand_in
from tests.test_make_silhouettes import CATALOGUE, MODELS, PROGRAM


@pytest.fixture(autouse=True)
def root(tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "data"))
    monkeypatch.setattr(make_solids, "POINTS", 60)
    monkeypatch.setattr(make_solids, "QUERIES", 80)
    return tmp_path / "data"


def run(root, *arguments):
    return make_solids.main([*map(str, arguments), "--workers", "1", "--out", str(root / "solids")])


def report(root, source):
    return json.loads((root / "solids" / f"{source}.json").read_text())


def test_random_solids_and_furniture(root, capsys):
    assert run(root, "--source", "csg", "--source", "furniture", "--count", 3) == 0
    csg, furniture = solid_clouds("csg"), solid_clouds("furniture")
    assert csg.ids == ("csg-000000", "csg-000001", "csg-000002")
    assert len(furniture) == 9 and furniture.categories == tuple(np.repeat(CATEGORIES, 3))
    for clouds in (csg, furniture):
        assert clouds.points.shape[1:] == (60, 3) and clouds.queries.shape[1:] == (80, 3)
        assert clouds.points.abs().max() <= 0.5 and clouds.queries.abs().max() < 0.65
        told = report(root, clouds.source)
        assert told["solids"] == len(clouds) and sum(told["splits"].values()) == len(clouds)
        assert "MIT" in told["licence"] and told["left_out"] == {}
    assert "csg.npz: 3 solids (" in capsys.readouterr().out


def test_again_does_nothing_and_fewer_replace_more_only_when_told(root, capsys):
    assert run(root, "--source", "csg", "--count", 3) == 0
    path = root / "solids" / "csg.npz"
    before = path.read_bytes()
    capsys.readouterr()
    assert run(root, "--source", "csg", "--count", 3) == 0
    assert "complete and up to date: nothing to do" in capsys.readouterr().out
    assert run(root, "--source", "csg", "--count", 2) == 1
    assert "was made of something else; choose another --out, or --force" in capsys.readouterr().err
    assert path.read_bytes() == before
    assert run(root, "--source", "csg", "--count", 2, "--force") == 0 and len(solid_clouds("csg")) == 2
    assert run(root, "--source", "csg", "--count", 3, "--force") == 0 and path.read_bytes() == before


def test_programs(root, capsys):
    assert run(root, "--source", "shapeassembly") == 1
    assert "python -m data_scripts.fetch_shapeassembly" in capsys.readouterr().err
    for category in CATEGORIES:
        folder = root / "shapeassembly" / category
        folder.mkdir(parents=True)
        (root / "shapeassembly" / "splits" / category).mkdir(parents=True)
        for k in (1, 2):
            (folder / f"{k}.txt").write_text(PROGRAM % f"0.{k}{CATEGORIES.index(category)}")
        (root / "shapeassembly" / "splits" / category / "train.txt").write_text("1\n")
        (root / "shapeassembly" / "splits" / category / "val.txt").write_text("2\n")
    assert run(root, "--source", "shapeassembly") == 0
    clouds = solid_clouds("shapeassembly")
    assert {i for i, split in zip(clouds.ids, clouds.splits) if split == "test"} == {
        f"{category}/2" for category in CATEGORIES
    }
    # One cuboid of 0.10 x 0.5 x 1: on the surface of a box of diagonal 1, and in it.
    half = np.array([0.10, 0.5, 1]) / np.linalg.norm([0.10, 0.5, 1]) / 2
    sample = clouds[clouds.ids.index("chair/1")]
    assert np.allclose((np.abs(sample.points) / half).max(1), 1, atol=0.01)
    inside = (np.abs(sample.queries) <= half * 1.001).all(1)
    assert inside[:40].all() and not inside[40:].any()


def test_models(root, tmp_path, monkeypatch):
    library = make_zip({sweethome.CATALOGUE: CATALOGUE} | MODELS)
    files = {"./a/Test.sh3f": library, "./usr/share/doc/x/copyright": b"whose"}
    package = stand_in(monkeypatch, sweethome, tmp_path / "small.deb", deb(files))
    assert run(root, "--source", "sweethome3d", "--package", package) == 0
    clouds, told = solid_clouds("sweethome3d"), report(root, "sweethome3d")
    assert clouds.ids == ("Test/chair", "Test/lamp") and told["credits"]["Test/chair"]["creator"] == "Zoë"
    assert told["left_out"] == {"Test/empty": "no solid: no triangles"}
    lamp = clouds[1].points
    assert np.ptp(lamp[:, 1]) > 5 * np.ptp(lamp[:, 0])  # it stands, y is up
    assert (root / "solids" / "sweethome3d-copyright.txt").read_text() == "whose"


def test_a_source_without_a_solid(root, capsys, monkeypatch):
    def none(*_):
        raise DataError("flat")

    monkeypatch.setattr(make_solids, "sample_solid", none)
    assert run(root, "--source", "csg", "--count", 1) == 1
    assert "none of 1 shapes of csg is a solid" in capsys.readouterr().err
    assert not (root / "solids").exists()


def test_ctrl_c_leaves_nothing_half(root, capsys, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(make_solids, "sample_solid", interrupted)
    assert run(root, "--source", "csg", "--count", 1) == 130
    assert "interrupted" in capsys.readouterr().err and not (root / "solids").exists()


@pytest.mark.parametrize("kind", ["npz", "json"])
def test_what_is_in_the_way_is_told_before_the_work(root, tmp_path, capsys, kind):
    """A folder, or a link to a device, which must not become a file."""
    (root / "solids" / f"csg.{kind}").mkdir(parents=True)
    assert run(root, "--source", "csg", "--count", 1) == 1
    assert f"csg.{kind} is a folder, a device, or the like" in capsys.readouterr().err
    assert len(list((root / "solids").iterdir())) == 1
    os.mkfifo(tmp_path / "device")
    with pytest.raises(DataError, match="device is a folder, a device"):
        write_whole(tmp_path / "device", b"mine")
    assert (tmp_path / "device").is_fifo()


def test_a_damaged_report_is_made_anew(root):
    (root / "solids").mkdir(parents=True)
    (root / "solids" / "csg.npz").write_bytes(b"")
    (root / "solids" / "csg.json").write_text("[]")
    assert run(root, "--source", "csg", "--count", 1) == 0 and report(root, "csg")["solids"] == 1


def test_a_data_root_that_is_a_file(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("mine")
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "file"))
    with pytest.raises(SystemExit) as end:
        make_solids.main(["--source", "csg", "--count", "1"])
    told = capsys.readouterr().err
    assert (
        end.value.code == 1
        and told.startswith("DataError: SHAPE_PROGRAMS_DATA names")
        and told.count("\n") == 1
    )


@pytest.mark.parametrize("wrong", [["--count", "0"], ["--workers", "0"], ["--source", "shapenet"]])
def test_options_that_make_no_sense(wrong, capsys):
    with pytest.raises(SystemExit):
        make_solids.main(wrong)
    assert "usage:" in capsys.readouterr().err
