"""Making logos: drawn as they should be, licences respected, and every way in which a package can be wrong."""

import json
import sys

import numpy as np
import pytest

from data_scripts import make_logos
from lib.datasets import logos
from tests.packages import Reply, no_network, stand_in, tar  # noqa: F401  (a fixture)

pytest.importorskip("resvg_py")

SVG = '<svg role="img" viewBox="0 0 24 24" xmlns="http://www.w3.org/2000/svg"><title>T</title><path d="%s"/></svg>'
ICONS = {
    "square": SVG % "M0 0h24v24H0z",
    "half": SVG % "M0 0h12v24H0z",
    "ring": SVG % "M0 0h24v24H0zM6 6v12h12V6z",
    "hairline": SVG % "M0 0h24v.1H0zM0 12h24v.1H0zM0 23h24v.1H0z",
    "dot": SVG % "M0 0h1v1H0z",
    "owned": SVG % "M0 0h24v12H0z",
    "wide": SVG.replace("24 24", "48 24") % "M0 0h24v12H0z",
    "torn": SVG[:-6] % "M0 0h24v12H0z",
}


def icon_list(**more):
    entries = [{"title": slug.title(), "slug": slug, "source": f"https://{slug}.org"} for slug in ICONS]
    for entry in entries:
        entry |= {"license": {"type": "CC-BY-4.0"}} if entry["slug"] == "owned" else {}
    return json.dumps(entries).encode()


def files(**changes):
    found = {f"{make_logos.ICONS}{slug}.svg": svg.encode() for slug, svg in ICONS.items()}
    return {make_logos.LIST: icon_list(), "package/index.js": b"code", **found, **changes}


@pytest.fixture
def root(tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "data"))
    return tmp_path / "data"


@pytest.fixture
def package(tmp_path, monkeypatch):
    return stand_in(monkeypatch, make_logos, tmp_path / "small.tgz", tar(files(), "w:gz"))


def run(root, *arguments):
    return make_logos.main([*map(str, arguments), "--out", str(root / "silhouettes")])


def last_error(capsys):
    return capsys.readouterr().err.strip().splitlines()[-1]


def test_logos_are_drawn_and_read_back(root, package, capsys):
    assert run(root, "--package", package, "--sheet") == 0
    found = logos()
    assert found.ids == ("hairline", "half", "ring") and set(found.splits) == {"test"} == {*found.splits}
    hairline, half, ring = found.images.numpy()
    assert half[4:60, 4:32].all() and half.sum() == 56 * 28  # 24 units take 56 pixels
    assert ring.sum() == 56**2 - 28**2 and not ring[18:46, 18:46].any()
    assert (hairline.sum(axis=0)[4:60] >= 3).all() and set(np.nonzero(hairline)[1]) == set(range(4, 60))
    assert (root / "silhouettes" / "logos-logo.png").is_file()
    out = capsys.readouterr().out
    assert "3 masks of 8 shapes (0 train, 0 val, 3 test)" in out and "1 a licence of its own" in out


def test_the_report_says_what_was_left_out_and_whose_they_are(root, package):
    run(root, "--package", package)
    report = json.loads((root / "silhouettes" / "logos.json").read_text())
    assert {name: why.partition(":")[0] for name, why in report["left_out"].items()} == {
        "dot logo": "blank",
        "square logo": "full",
        "owned": "a licence of its own",
        "torn": "no picture",
        "wide": "not drawn for a square of 24 units",
    }
    assert "CC0-1.0" in report["licence"] and "trademarks remain their owners'" in report["licence"]
    assert report["credits"]["half"] == {"title": "Half", "source": "https://half.org"}


def test_again_does_nothing(root, package, capsys):
    run(root, "--package", package)
    before = (root / "silhouettes" / "logos.npz").read_bytes()
    assert run(root) == 0 and "complete and up to date: nothing to do" in capsys.readouterr().out
    (root / "silhouettes" / "logos.npz").write_bytes(before[:-5])
    assert run(root, "--package", package) == 0
    assert (root / "silhouettes" / "logos.npz").read_bytes() == before


def test_other_code_draws_again(root, package, monkeypatch, capsys):
    run(root, "--package", package)
    monkeypatch.setattr(make_logos, "CODE", ("lib/interpreters/rasterising.py",))
    capsys.readouterr()
    assert run(root, "--package", package) == 0 and "nothing to do" not in capsys.readouterr().out


def test_a_download_is_checked(root, package, monkeypatch, capsys):
    content = package.read_bytes()
    monkeypatch.setattr("urllib.request.urlopen", lambda *_, **__: Reply(content + b"?"))
    assert run(root) == 1 and "its digest is sha512-" in last_error(capsys)
    monkeypatch.setattr("urllib.request.urlopen", lambda *_, **__: Reply(content))
    assert run(root) == 0 and (root / "downloads" / make_logos.PACKAGE.name).read_bytes() == content


def test_no_network(root, package, no_network, capsys):  # noqa: F811
    assert run(root) == 1
    error = last_error(capsys)
    assert error.startswith(f"DataError: could not fetch {make_logos.PACKAGE.name} (no network; there is no")
    assert "give --package PATH" in error
    package.write_bytes(b"other")
    assert run(root, "--package", package) == 1 and "damaged or another version" in last_error(capsys)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"no package",
        tar(files(), "w:gz")[:-300],
        tar({"package/index.js": b""}, "w:gz"),
        tar(files(**{make_logos.LIST: b"["}), "w:gz"),
        tar(files(**{make_logos.LIST: b'{"icons": 1}'}), "w:gz"),
        tar(files(**{make_logos.LIST: b'[{"title": "T"}]'}), "w:gz"),
        tar(files(**{make_logos.LIST: b'[{"slug": "missing"}]'}), "w:gz"),
        tar(files(**{f"{make_logos.ICONS}half.svg": b"\xff"}), "w:gz"),
    ],
)
def test_a_package_with_the_right_digest_and_wrong_content(root, tmp_path, monkeypatch, capsys, content):
    package = stand_in(monkeypatch, make_logos, tmp_path / "wrong.tgz", content)
    assert run(root, "--package", package) == 1
    assert last_error(capsys).startswith(f"DataError: {package} is damaged, or no package of icons (")
    assert not list(root.rglob("*.npz"))


def test_without_resvg(root, package, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "resvg_py", None)
    assert run(root, "--package", package) == 1
    assert "drawing logos needs resvg: pip install -e '.[logos]'" in last_error(capsys)


def test_ctrl_c_leaves_nothing_half(root, package, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(make_logos, "draw", interrupted)
    assert run(root, "--package", package) == 130
    assert last_error(capsys) == "interrupted: nothing was changed" and not list(root.rglob("*"))


def test_a_folder_that_cannot_be_written(root, package, capsys):
    root.mkdir()
    (root / "silhouettes").write_text("in the way")
    assert run(root, "--package", package) == 1
    assert last_error(capsys).startswith("DataError: a file cannot be read or written")
