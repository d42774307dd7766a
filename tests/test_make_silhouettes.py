"""Making silhouettes: each source, the same bytes again, packages that are damaged or missing, and nothing half."""

import json
import os
import stat
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest

from data_scripts import made_files, make_silhouettes, mask_files, packages, sweethome
from data_scripts.mask_files import Drawn
from lib import datasets
from lib.datasets import CATEGORIES
from tests.packages import Reply, deb, make_zip, no_network, stand_in  # noqa: F401  (a fixture)

PROGRAM = """Assembly Program_0 {
\tbbox = Cuboid(1.0, 2.0, 1.0, True)
\tcube0 = Cuboid(%s, 0.5, 1.0, True)
\tattach(cube0, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5)
}
"""
CATALOGUE = r"""# a comment = with a sign
license=Creative Commons   Attribution
name#1=Wooden chair
category#1=Living room
model#1=/m/chair/chair.obj
width#1=50
height#1=100
depth#1=25
creator#1=Zo\u00eb
name#2=Lamp
category#2=Lights
model#2=/m/lamp/lamp.obj
modelRotation#2=1 0 0 0 0 1 0 -1 0
width#2=10
height#2=100
depth#2=10
creator#2=B
name#3=Table fan
category#3=Living room
model#3=/m/fan/fan.obj
name#4=Pool table
category#4=Miscellaneous
model#4=/m/pool/pool.obj
name#5=Table
category#5=Kitchen
model#5=/m/empty/empty.obj
width#5=1
height#5=1
depth#5=1
"""


def block(width, height, depth):
    """An OBJ file with a box that has a notch missing: quads, as modellers like them."""
    lines = []
    for low, high in (((0, 0, 0), (1, 0.5, 1)), ((0, 0.5, 0), (0.5, 1, 1))):
        for x in (low[0], high[0]):
            for y in (low[1], high[1]):
                lines += [f"v {x * width} {y * height} {z * depth}" for z in (low[2], high[2])]
    quads = ((1, 2, 4, 3), (5, 6, 8, 7), (1, 2, 6, 5), (3, 4, 8, 7), (1, 3, 7, 5), (2, 4, 8, 6))
    lines += ["f " + " ".join(str(k + first) for k in quad) for first in (0, 8) for quad in quads]
    return "\n".join(lines).encode()


MODELS = {
    "m/chair/chair.obj": block(1, 1, 1),
    "m/lamp/lamp.obj": block(1, 1, 10),  # lies on its back: z is up
    "m/fan/fan.obj": b"",
    "m/pool/pool.obj": b"",
    "m/empty/empty.obj": b"# nothing",
}


@pytest.fixture
def root(tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "data"))
    return tmp_path / "data"


@pytest.fixture
def package(tmp_path, monkeypatch):
    library = make_zip({sweethome.CATALOGUE: CATALOGUE} | MODELS)
    files = {
        "./usr/share/sweethome3d/furniture/Test.sh3f": library,
        "./usr/share/doc/x/copyright": b"whose",
    }
    return stand_in(monkeypatch, sweethome, tmp_path / "small.deb", deb(files))


def run(root, *arguments):
    return make_silhouettes.main([*map(str, arguments), "--workers", "1", "--out", str(root / "silhouettes")])


def furniture(root, count=2, *more):
    return run(root, "--source", "furniture", "--count", count, *more)


def report(root, source):
    return json.loads((root / "silhouettes" / f"{source}.json").read_text())


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


# ---- the furniture maker's ----


def test_furniture_is_made_and_read_back(root, capsys):
    assert furniture(root, 20) == 0
    images, told = datasets.silhouettes("furniture"), report(root, "furniture")
    assert told["shapes"] == 60 and told["masks"] == len(images) == 120 - sum(told["rejected"].values())
    assert {split: count["masks"] for split, count in told["splits"].items()} == {
        split: len(images.select(split)) for split in ("train", "val", "test")
    }
    assert images.select(category="chair")[:2].ids == ("chair-000000",) * 2
    by_split = [set(images.select(split).ids) for split in ("train", "val", "test")]
    assert sum(map(len, by_split)) == len(set(images.ids))  # both views of a shape are in one split
    assert told["settings"]["made_of"] == "20 of each category" and "MIT" in told["licence"]
    assert f"{told['masks']} masks of 60 shapes (" in capsys.readouterr().out


def test_fewer_shapes_replace_more_only_when_told(root, capsys):
    assert furniture(root, 3, "--sheet") == 0
    path = root / "silhouettes" / "furniture.npz"
    before = path.read_bytes()
    assert furniture(root, 2) == 1
    assert "was made of something else; choose another --out, or --force" in capsys.readouterr().err
    assert path.read_bytes() == before and list(path.parent.glob("*.png"))
    assert furniture(root, 2, "--force") == 0
    assert path.read_bytes() != before and not list(path.parent.glob("*.png"))  # they showed other masks


def test_the_embedded_masks_are_the_first_of_these(root, monkeypatch):
    monkeypatch.setattr(datasets.images, "EMBEDDED", 4)
    furniture(root, 4)
    made, embedded = datasets.silhouettes("furniture"), datasets.silhouettes("embedded")
    assert (
        made.ids == embedded.ids and made.splits == embedded.splits and (made.packed == embedded.packed).all()
    )


@pytest.mark.filterwarnings("ignore:A worker stopped")
def test_the_same_bytes_whatever_the_number_of_workers(root):
    furniture(root, 14)  # 42 shapes: two chunks
    before = contents(root / "silhouettes")
    for path in (root / "silhouettes").iterdir():
        path.unlink()
    out = str(root / "silhouettes")
    assert (
        make_silhouettes.main(["--source", "furniture", "--count", "14", "--workers", "2", "--out", out]) == 0
    )
    assert contents(root / "silhouettes") == before and set(before) == {"furniture.npz", "furniture.json"}


def test_again_does_nothing_unless_something_changed(root, capsys, monkeypatch):
    furniture(root)
    folder = root / "silhouettes"
    before, times = contents(folder), [path.stat().st_mtime_ns for path in folder.iterdir()]
    capsys.readouterr()
    assert furniture(root) == 0
    assert "complete and up to date: nothing to do" in capsys.readouterr().out
    assert [path.stat().st_mtime_ns for path in folder.iterdir()] == times
    (folder / "furniture.npz").write_bytes(before["furniture.npz"][:100])
    assert furniture(root) == 0 and contents(folder) == before  # repaired
    (folder / "furniture.json").write_text("{")
    assert furniture(root) == 0 and contents(folder) == before
    assert furniture(root, 3, "--force") == 0 and report(root, "furniture")["shapes"] == 9
    capsys.readouterr()
    monkeypatch.setattr(make_silhouettes, "CODE", ("lib/interpreters/rasterising.py",))
    assert furniture(root, 3) == 0 and "nothing to do" not in capsys.readouterr().out


def test_contact_sheets(root):
    furniture(root, 4)
    assert furniture(root, 4, "--sheet") == 0  # of what is there
    for view in ("front", "side"):
        sheet = matplotlib.image.imread(root / "silhouettes" / f"furniture-{view}.png")
        assert sheet.shape[:2] == (8 * 68 + 4, 12 * 68 + 4)
        assert {0.0, 1.0} < set(np.unique(sheet[..., 0]).tolist())


def test_ctrl_c_leaves_nothing_half(root, monkeypatch, capsys):
    done = []

    def interrupted(category, seed):
        done.append(seed)
        if len(done) > 3:
            raise KeyboardInterrupt
        return views_of(category, seed)

    views_of = make_silhouettes.views_of
    monkeypatch.setattr(make_silhouettes, "views_of", interrupted)
    assert furniture(root) == 130
    assert "interrupted" in capsys.readouterr().err
    assert not list(root.rglob("*"))


def test_a_kill_between_the_two_files_is_noticed(root, monkeypatch):
    write_whole = made_files.write_whole

    def killed(path, content):
        if path.suffix == ".json":
            raise KeyboardInterrupt
        write_whole(path, content)

    monkeypatch.setattr(made_files, "write_whole", killed)
    assert furniture(root) == 130
    monkeypatch.setattr(made_files, "write_whole", write_whole)
    assert [path.name for path in root.rglob("*.*")] == ["furniture.npz"]
    assert furniture(root) == 0 and report(root, "furniture")["masks"] == len(
        datasets.silhouettes("furniture")
    )


# ---- what is left out ----


def mask(*pixels):
    picture = np.zeros((64, 64), bool)
    for rows, columns in pixels:
        picture[rows, columns] = True
    return picture


BOX, HIGH, LINE = (slice(10, 40), slice(10, 50)), (slice(4, 60), slice(20, 40)), (slice(4, 60), 20)
SQUARE = (slice(4, 60), slice(4, 60))


def test_what_is_left_out_and_why(tmp_path):
    shapes = [
        Drawn("a", "chair", "train", {"front": mask(BOX), "side": mask(LINE)}),
        Drawn("b", "chair", "test", {"front": mask(BOX), "side": mask(HIGH)}),
        Drawn("c", "lamp", "train", {"front": mask(SQUARE), "side": mask()}),
        Drawn("d", "lamp", "train", problem="no shape: found no triangles; expected at least one"),
        Drawn("e", "lamp", "test", {"front": mask(BOX)}),
    ]
    told = mask_files.write(tmp_path, "test", shapes, {"licence": "mine"})
    assert told["left_out"] == {
        "a side": "blank",
        "c front": "full",
        "c side": "blank",
        "d": "no shape: found no triangles; expected at least one",
        "a front": "in another split too",
    }
    assert told["masks"] == 3 and told["repeated"] == 1 and told["licence"] == "mine"
    assert told["splits"]["test"] == {"shapes": 2, "masks": 3} and told["splits"]["train"]["masks"] == 0
    summary = mask_files.summary(told)
    assert "3 masks of 5 shapes (0 train, 0 val, 3 test)" in summary and "2 blank, 1 full" in summary
    assert mask_files.write(tmp_path, "none", [], {})["masks"] == 0


# ---- the ShapeAssembly programs ----


def test_programs_and_their_own_splits(root):
    folder = root / "shapeassembly"
    for category in CATEGORIES:
        (folder / category).mkdir(parents=True)
        (folder / "splits" / category).mkdir(parents=True)
        for k in range(1, 10):
            (folder / category / f"{k}.txt").write_text(PROGRAM % f"0.{k}{CATEGORIES.index(category)}")
        (folder / "splits" / category / "train.txt").write_text("\n".join("2345678"))
        (folder / "splits" / category / "val.txt").write_text("1\n9\n")
    assert run(root, "--source", "shapeassembly") == 0
    images = datasets.silhouettes("shapeassembly")
    test = set(images.select("test").ids)
    assert test == {f"{category}/{k}" for category in CATEGORIES for k in (1, 9)}
    assert set(images.splits) == {"train", "val", "test"} and len(set(images.ids)) > 20
    (folder / "chair" / "2.txt").write_text("nonsense")
    assert run(root, "--source", "shapeassembly") == 1


def test_programs_that_were_not_fetched(root, capsys):
    assert run(root) == 1
    error = capsys.readouterr().err.strip()
    assert error.startswith("DataError: there are no ShapeAssembly programs in") and "\n" not in error
    assert "python -m data_scripts.fetch_shapeassembly" in error


# ---- Sweet Home 3D's models ----


def test_models_are_unpacked_turned_and_credited(root, package, capsys):
    assert run(root, "--source", "sweethome3d", "--package", package) == 0
    images, told = datasets.silhouettes("sweethome3d"), report(root, "sweethome3d")
    masks = {(i, v): m for i, v, m in zip(images.ids, images.views, images.images.numpy())}
    assert {category for category in images.categories} == {"chair", "lamp"}
    front, side = masks["Test/chair", "front"], masks["Test/chair", "side"]
    assert front.sum() == 28 * 56 * 3 / 4 and side.sum() == 14 * 56  # 50 x 100 x 25 cm
    assert front[4:32, 18:32].all() and not front[4:32, 32:].any()  # the notch is at the upper right
    lamp = masks["Test/lamp", "front"]
    assert abs(int(lamp.sum()) - 56 * 6) < 60 and np.ptp(np.nonzero(lamp)[0]) + 1 == 56  # it stands
    assert told["credits"]["Test/chair"] == {
        "name": "Wooden chair",
        "creator": "Zoë",
        "licence": "Creative Commons Attribution",
    }
    assert told["left_out"] == {"Test/empty": "no shape: no triangles"}
    assert (root / "silhouettes" / "sweethome3d-copyright.txt").read_text() == "whose"
    capsys.readouterr()
    assert run(root, "--source", "sweethome3d") == 0 and "nothing to do" in capsys.readouterr().out


@pytest.mark.parametrize(
    "title, category",
    [
        ("Desk lamp", "lamp"),
        ("Armchair", "chair"),
        ("Wheelchair", ""),
        ("Desk table", "desk"),
        ("Table fan", ""),
        ("Workbench", ""),
        ("TV stand", "storage"),
        ("Tablet", ""),
        ("Bedside table", "table"),
        ("Piano bench", "sofa"),
    ],
)
def test_names_tell_the_category(title, category):
    assert sweethome.category_of(title) == category


def test_a_package_that_is_another(root, package, capsys):
    package.write_bytes(package.read_bytes()[:-1])
    assert run(root, "--source", "sweethome3d", "--package", package) == 1
    assert "damaged or another version (its digest is sha256-" in capsys.readouterr().err
    assert run(root, "--source", "sweethome3d", "--package", root / "none.deb") == 1
    assert "there is no package" in capsys.readouterr().err
    assert not list(root.rglob("*.npz"))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"no package",
        deb({})[:60],
        deb({"./a.sh3f": b"no zip"}),
        deb({"./a.sh3f": make_zip({"x": b""})}),
        deb({"./a.sh3f": make_zip({sweethome.CATALOGUE: CATALOGUE})}),  # without the models
        deb({"./a.sh3f": make_zip({sweethome.CATALOGUE: CATALOGUE.replace("0 0 0 0 1", "0 x")} | MODELS)}),
        deb({"./a.sh3f": make_zip({sweethome.CATALOGUE: CATALOGUE})})[:-400],
    ],
)
def test_a_package_with_the_right_digest_and_wrong_content(root, tmp_path, monkeypatch, capsys, content):
    package = stand_in(monkeypatch, sweethome, tmp_path / "wrong.deb", content)
    assert run(root, "--source", "sweethome3d", "--package", package) == 1
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith(f"DataError: {package} is damaged, or no package of furniture (")


# ---- fetching packages ----


def test_a_download_is_kept(root, package, monkeypatch):
    content = package.read_bytes()
    monkeypatch.setattr(packages.urllib.request, "urlopen", lambda *_, **__: Reply(content))
    found = packages.obtain(sweethome.PACKAGE, None, root / "downloads")
    assert found == root / "downloads" / sweethome.PACKAGE.name and found.read_bytes() == content
    monkeypatch.setattr(packages.urllib.request, "urlopen", None)  # not asked again
    assert packages.obtain(sweethome.PACKAGE, None, root / "downloads") == found
    assert list((root / "downloads").iterdir()) == [found]


@pytest.mark.parametrize(
    "reply, message",
    [
        (lambda content: Reply(content[:-9], len(content)), "ended after"),
        (lambda content: Reply(content[:-9] + b"?" * 9), "its digest is sha256-"),
        (lambda content: (_ for _ in ()).throw(OSError("no network")), "no network"),
    ],
)
def test_downloads_that_fail(root, package, monkeypatch, capsys, reply, message):
    content = package.read_bytes()
    monkeypatch.setattr(packages.urllib.request, "urlopen", lambda *_, **__: reply(content))
    assert run(root, "--source", "sweethome3d") == 1
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert message in error and "there is no no-such-client here" in error and "give --package PATH" in error
    assert not list((root / "downloads").iterdir())


@pytest.mark.skipif(os.name == "nt", reason="the stand-in for a package client is a shell script")
@pytest.mark.parametrize("good", [True, False])
def test_the_package_client_is_asked_next(root, package, tmp_path, monkeypatch, no_network, good):  # noqa: F811
    client = tmp_path / "client"
    client.write_text(f"#!/bin/sh\n[ $1 = bring ] && {f'cp {package} here.deb' if good else 'exit 3'}\n")
    client.chmod(client.stat().st_mode | stat.S_IEXEC)
    wanted = replace(sweethome.PACKAGE, client=(str(client), "bring"))
    if good:
        assert packages.obtain(wanted, None, root).read_bytes() == package.read_bytes()
    else:
        with pytest.raises(datasets.DataError, match="non-zero exit status 3"):
            packages.obtain(wanted, None, root)
    assert len(list(root.iterdir())) == good


# ---- the command ----


@pytest.mark.parametrize("wrong", [["--count", "0"], ["--workers", "0"], ["--source", "shapenet"]])
def test_wrong_use(wrong, capsys):
    with pytest.raises(SystemExit) as stopped:
        make_silhouettes.main(wrong)
    assert stopped.value.code == 2 and wrong[0] in capsys.readouterr().err


def test_help_tells_of_sources_and_files(capsys):
    with pytest.raises(SystemExit):
        make_silhouettes.main(["--help"])
    told = capsys.readouterr().out
    assert all(word in told for word in (*datasets.IMAGE_SOURCES, "SOURCE.npz", "--package", "--sheet"))


def test_a_folder_that_cannot_be_written(root, capsys):
    root.mkdir()
    (root / "silhouettes").write_text("in the way")
    assert furniture(root, 1) == 1
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("DataError: a file cannot be read or written") and "silhouettes" in error
