"""Fetching the real programs: good archives of every kind, and every way in which it can go wrong."""

import errno
import io
import tarfile
import urllib.error
import zipfile
from pathlib import Path

import pytest

from data_scripts import fetch_shapeassembly as fetching
from lib.datasets import DataError

TOP = "ShapeAssembly-master"
PROGRAM = b"Assembly Program_0 {\n\tbbox = Cuboid(1.0, 1.0, 1.0, True)\n}\n"
INSIDE = {
    "LICENSE": b"a licence",
    **{f"code/data/{category}/{i}.txt": PROGRAM for category in fetching.CATEGORIES for i in (7, 8)},
    **{f"code/data_splits/{category}/train.txt": b"7\n" for category in fetching.CATEGORIES},
    **{f"code/data_splits/{category}/val.txt": b"8\n" for category in fetching.CATEGORIES},
}
LEFT_THERE = {  # code, other people's splits, and paths that climb out of the folder
    "code/ShapeAssembly.py": b"import os",
    "code/data_splits/sn_chair/train.txt": b"9\n",
    "code/data/chair/../../../../escaped.txt": b"bad",
    "code/data/chair/notes.md": b"notes",
}


def tar(path, files, mode="w:gz"):
    with tarfile.open(path, mode) as archive:
        for name, content in files.items():
            member = tarfile.TarInfo(f"{TOP}/{name}")
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
        link = tarfile.TarInfo(f"{TOP}/code/data/chair/99.txt")
        link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
        archive.addfile(link)
    return path


def make_zip(path, files):
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in files.items():
            archive.writestr(f"{TOP}/{name}", content)
    return path


@pytest.fixture
def archive(tmp_path, monkeypatch):
    """A tiny archive that the script takes for the real one."""
    path = tar(tmp_path / "small.tar.gz", INSIDE | LEFT_THERE)
    files = fetching.read_archive(path)
    digests = {
        group: fetching.digest({name: files[name] for name in files if fetching.group_of(name) == group})
        for group in fetching.DIGESTS
    }
    monkeypatch.setattr(fetching, "DIGESTS", digests)
    monkeypatch.setattr(fetching, "PROGRAMS", {"chair": 2, "table": 2, "storage": 2})
    return path


@pytest.fixture
def root(tmp_path):
    return tmp_path / "data"


def contents(root):
    """Everything below the data root; hidden leftovers would show."""
    return sorted(path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file())


EXPECTED = sorted(
    ["shapeassembly/LICENSE"]
    + [f"shapeassembly/{category}/{i}.txt" for category in fetching.CATEGORIES for i in (7, 8)]
    + [f"shapeassembly/splits/{c}/{split}.txt" for c in fetching.CATEGORIES for split in ("train", "val")]
)


@pytest.mark.parametrize("kind", ["tar.gz", "tar.xz", "tar", "zip"])
def test_every_kind_of_archive(archive, root, tmp_path, kind):
    other = tmp_path / f"other.{kind}"
    if kind == "zip":
        make_zip(other, INSIDE | LEFT_THERE)
    else:
        tar(other, INSIDE | LEFT_THERE, {"tar.gz": "w:gz", "tar.xz": "w:xz", "tar": "w"}[kind])
    fetching.fetch(root, other)
    assert contents(root) == EXPECTED  # and no code, no link, nothing outside
    assert not list(tmp_path.rglob("escaped.txt"))


def test_a_second_fetch_does_nothing(archive, root, capsys):
    folder = fetching.fetch(root, archive)
    stamp = (folder / "LICENSE").stat().st_mtime_ns
    fetching.fetch(root, Path("no such archive"))
    assert "nothing to do" in capsys.readouterr().out
    assert (folder / "LICENSE").stat().st_mtime_ns == stamp


def test_a_damaged_folder_is_replaced(archive, root):
    folder = fetching.fetch(root, archive)
    (folder / "chair" / "7.txt").write_text("scratched")
    fetching.fetch(root, archive)
    assert (folder / "chair" / "7.txt").read_bytes() == PROGRAM


def test_the_command_prints_counts_and_licence(archive, root, capsys):
    assert fetching.main(["--archive", str(archive), "--out", str(root)]) == 0
    out = capsys.readouterr().out
    assert "2 programs" in out and "1 train" in out and "commercial" in out


def change(files, name, content):
    return files | {name: content}


def without(files, name):
    return {key: value for key, value in files.items() if key != name}


BAD_FILES = {
    "other bytes": (change(INSIDE, "code/data/chair/7.txt", PROGRAM + b" "), "chair files differ"),
    "one missing": (without(INSIDE, "code/data/table/8.txt"), "1 of 2 table files"),
    "one too many": (change(INSIDE, "code/data/storage/9.txt", PROGRAM), "3 of 2 storage files"),
    "other split": (change(INSIDE, "code/data_splits/chair/val.txt", b"7\n"), "splits files differ"),
    "no licence": (without(INSIDE, "LICENSE"), "LICENSE"),
    "something else": ({"README.md": b"hello"}, "incomplete"),
    "huge file": (change(INSIDE, "code/data/chair/7.txt", bytes(2_000_000)), "1 of 2 chair files"),
}


@pytest.mark.parametrize("files, message", BAD_FILES.values(), ids=BAD_FILES)
def test_a_wrong_archive_is_refused(archive, root, tmp_path, files, message):
    bad = tar(tmp_path / "bad.tar.gz", files)
    with pytest.raises(DataError, match=message):
        fetching.fetch(root, bad)
    assert contents(root) == []


@pytest.mark.parametrize("mode", ["w:gz", "w:xz", "w"])
@pytest.mark.parametrize("part", [0, 0.01, 0.3, 0.6])
def test_a_truncated_archive_is_refused(archive, root, tmp_path, mode, part):
    bad = tar(tmp_path / "bad", INSIDE, mode)
    bad.write_bytes(bad.read_bytes()[: int(part * bad.stat().st_size)])
    with pytest.raises(DataError):
        fetching.fetch(root, bad)
    assert contents(root) == []


def test_a_truncated_zip_is_refused(archive, root, tmp_path):
    bad = make_zip(tmp_path / "bad.zip", INSIDE)
    bad.write_bytes(bad.read_bytes()[:300])
    with pytest.raises(DataError):
        fetching.fetch(root, bad)


def test_good_data_survives_a_failed_fetch(archive, root, monkeypatch):
    folder = fetching.fetch(root, archive)
    monkeypatch.setattr(fetching, "is_good", lambda folder: False)  # as if the digests had moved on
    with pytest.raises(DataError):
        fetching.fetch(root, root / "missing.tar.gz")
    monkeypatch.setattr(Path, "write_bytes", disk_full)
    with pytest.raises(DataError, match="disk is full"):
        fetching.fetch(root, archive)
    assert contents(root) == EXPECTED
    assert (folder / "chair" / "7.txt").read_bytes() == PROGRAM


def disk_full(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


def interrupt(*_):
    raise KeyboardInterrupt


@pytest.mark.parametrize("happening, message", [(disk_full, "disk is full"), (interrupt, "Interrupted")])
def test_trouble_while_writing_leaves_nothing(archive, root, monkeypatch, capsys, happening, message):
    monkeypatch.setattr(Path, "write_bytes", happening)
    assert fetching.main(["--archive", str(archive), "--out", str(root)]) == 1
    assert message in capsys.readouterr().err
    assert list(root.iterdir()) == []


class Reply(io.BytesIO):
    """What urlopen returns; `length` is what the server promised."""

    def __init__(self, content, length):
        super().__init__(content)
        self.headers = {"Content-Length": str(length)} if length else {}


@pytest.mark.parametrize("promised", [True, False])
def test_download(archive, root, monkeypatch, promised):
    content = archive.read_bytes()
    length = len(content) if promised else None
    monkeypatch.setattr(fetching.urllib.request, "urlopen", lambda *_, **__: Reply(content, length))
    fetching.fetch(root)
    assert contents(root) == EXPECTED


def test_an_interrupted_download_leaves_nothing(archive, root, monkeypatch):
    content = archive.read_bytes()
    replies = {
        "ended after": lambda *_, **__: Reply(content[:100], len(content)),
        "cut short": lambda *_, **__: Reply(content[:100], None),
        "could not download": lambda *_, **__: (_ for _ in ()).throw(urllib.error.URLError("no network")),
    }
    for message, reply in replies.items():
        monkeypatch.setattr(fetching.urllib.request, "urlopen", reply)
        with pytest.raises(DataError, match=message):
            fetching.fetch(root)
        assert list(root.iterdir()) == []


def test_a_problem_is_one_line_and_exit_code_1(archive, root, capsys):
    assert fetching.main(["--archive", "nowhere.tar.gz", "--out", str(root)]) == 1
    error = capsys.readouterr().err.strip()
    assert error == "DataError: there is no archive nowhere.tar.gz"


def test_the_real_archive(shared, tmp_path):
    path = shared / "data" / "shapeassembly-programs.tar.xz"
    if not path.exists():
        pytest.skip(f"there is no {path}")
    summary = fetching.summary(fetching.fetch(tmp_path, path))
    assert "3835 programs    3339 train    496 val" in summary
    assert "6536 programs    5762 train    774 val" in summary
    assert "1551 programs    1435 train    116 val" in summary
