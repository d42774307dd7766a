"""Making furniture files: all of them, the same ones again, and nothing half."""

import json

import pytest

from data_scripts import make_furniture
from lib.extractor import PartGraph


def contents(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*.json")}


def test_all_categories_one_line_each(tmp_path, capsys):
    assert make_furniture.main(["--count", "2", "--out", str(tmp_path)]) == 0
    files = contents(tmp_path)
    assert sorted(files) == sorted(
        f"{category}/{category}-00000{seed}.json" for category in make_furniture.CATEGORIES for seed in (0, 1)
    )
    for content in files.values():
        assert content.count(b"\n") <= 1 and json.loads(content)
    assert capsys.readouterr().out == (
        f"6 part graphs (chair, table, storage) in {tmp_path}; 6 of them written now\n"
    )


def test_a_file_is_the_graph_that_the_maker_made(tmp_path):
    make_furniture.main(["--category", "table", "--count", "1", "--seed", "7", "--out", str(tmp_path)])
    read = PartGraph.read(tmp_path / "table" / "table-000007.json", "table")
    made = make_furniture.make("table", 7)
    assert read.labels == made.labels and read.category == "table"
    assert (read.leaves.center - made.leaves.center).abs().max() < 1e-6  # what the file's digits keep


def test_again_repairs_what_is_damaged_and_touches_nothing_else(tmp_path, capsys):
    command = ["--category", "chair", "--count", "3", "--out", str(tmp_path)]
    make_furniture.main(command)
    before = contents(tmp_path)
    damaged = tmp_path / "chair" / "chair-000001.json"
    damaged.write_bytes(damaged.read_bytes()[:50])
    (tmp_path / "chair" / "chair-000002.json").unlink()
    kept = (tmp_path / "chair" / "chair-000000.json").stat().st_mtime_ns
    capsys.readouterr()
    assert make_furniture.main(command) == 0
    assert contents(tmp_path) == before and "; 2 of them written now" in capsys.readouterr().out
    assert (tmp_path / "chair" / "chair-000000.json").stat().st_mtime_ns == kept
    assert not list(tmp_path.rglob("*.part"))


@pytest.mark.parametrize("wrong", [["--count", "0"], ["--seed", "-1"], ["--category", "bed"]])
def test_wrong_use(wrong, capsys):
    with pytest.raises(SystemExit) as stopped:
        make_furniture.main(wrong)
    assert stopped.value.code == 2 and wrong[0] in capsys.readouterr().err


def test_a_folder_that_cannot_be_written(tmp_path, capsys):
    (tmp_path / "file").write_text("in the way")
    assert make_furniture.main(["--count", "1", "--out", str(tmp_path / "file")]) == 1
    assert "could not write to" in capsys.readouterr().err


def test_ctrl_c(tmp_path, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(make_furniture, "make", interrupted)
    assert make_furniture.main(["--count", "1", "--out", str(tmp_path)]) == 130
    assert "interrupted; the same command goes on" in capsys.readouterr().err
