"""Making the ablations' data: whole, the same however it runs, and found again by lib.datasets."""

import json
import os
import shutil

import pytest

from data_scripts import make_ablations
from lib.datasets import CATEGORIES, SPLITS, DataError, examples, shapeassembly
from lib.extractor.rewriting import ABLATIONS
from lib.interpreters.shapeassembly import Cuboid, Reflect, Squeeze, Translate, execute

NAMES = ["armchair", "dining_chair", "sofa", "stool", "bench"]


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    """Several chunks from a few programs; and lib may change while the tests run."""
    monkeypatch.setattr(make_ablations, "CHUNK", 2)
    monkeypatch.setattr(make_ablations, "CODE", ())


@pytest.fixture
def root(tmp_path, monkeypatch):
    """A data root with five chairs as the fetch script leaves them."""
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path))
    folder, programs = tmp_path / "shapeassembly", examples()
    for category in CATEGORIES:
        (folder / category).mkdir(parents=True)
        (folder / "splits" / category).mkdir(parents=True)
    for name in NAMES:
        (folder / "chair" / f"{name}.txt").write_text(programs[name].to_text())
    (folder / "splits" / "chair" / "train.txt").write_text("\n".join(NAMES[:3]))
    (folder / "splits" / "chair" / "val.txt").write_text("\n".join(NAMES[3:]))
    return tmp_path


def make(root, *arguments, ablation: str = "no_order") -> int:
    command = ["--out", str(root), "--categories", "chair", "--ablations", ablation, "--workers", "1"]
    return make_ablations.main([*command, *arguments])


def contents(root) -> dict[str, bytes]:
    folder = root / "shapeassembly-ablations"
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()
    }


@pytest.mark.parametrize("ablation", ABLATIONS)
def test_what_is_made_is_what_the_data_set_reads(root, ablation, capsys, unchecked_shapes):
    assert make(root, ablation=ablation) == 0
    said, summary = capsys.readouterr().out, json.loads(contents(root)[f"{ablation}/chair.json"])
    assert said.startswith(f"{ablation} chair: {summary['made']} of 5 made")
    assert summary["made"] + sum(summary["left_out"].values()) == 5 and summary["mean_f_score"] > 90
    train, val = (shapeassembly("chair", split, ablation=ablation) for split in SPLITS)
    assert len(train) + len(val) == summary["made"] >= 3
    assert train.source == "made" and "rewritten from the real ones" in train.describe()
    order = [NAMES.index(name) for name in (*train.ids, *val.ids)]
    assert order == sorted(order)  # as the original lists have them
    assert all(len(execute(program).cuboids) > 1 for program in (*train, *val))


def test_again_nothing_changes_and_the_journal_is_enough(root):
    make(root)
    before = contents(root)
    stamps = [path.stat().st_mtime_ns for path in sorted(root.rglob("*.txt"))]
    make(root)
    assert contents(root) == before
    assert [path.stat().st_mtime_ns for path in sorted(root.rglob("*.txt"))] == stamps
    shutil.rmtree(root / "shapeassembly-ablations" / "no_order" / "chair")
    (root / "shapeassembly-ablations" / "no_order" / "splits" / "chair" / "train.txt").unlink()
    make(root)
    assert contents(root) == before


def test_an_interrupted_run_goes_on(root, monkeypatch, capsys):
    make(root)
    whole = contents(root)
    shutil.rmtree(root / "shapeassembly-ablations")
    rewrite, calls = make_ablations.rewrite_many, []

    def interrupted(programs, *rest):
        calls.append(len(programs))
        if len(calls) == 2:
            raise KeyboardInterrupt
        return rewrite(programs, *rest)

    monkeypatch.setattr(make_ablations, "rewrite_many", interrupted)
    assert make(root) == 130 and "the same command goes on" in capsys.readouterr().err
    assert not list(root.glob("shapeassembly-ablations/no_order/splits/chair/*"))
    assert make(root) == 0 and contents(root) == whole
    assert calls == [2, 2, 2, 1]  # the first chunk was not done twice


def test_two_workers_write_the_same(root):
    make(root)
    one = contents(root)
    shutil.rmtree(root / "shapeassembly-ablations")
    assert make(root, "--workers", "2") == 0 and contents(root) == one


def test_a_changed_program_is_noticed(root, capsys):
    make(root)
    path = root / "shapeassembly" / "chair" / "sofa.txt"
    path.write_text(path.read_text().replace("0.5", "0.4", 1))
    assert make(root) == 1 and "sofa has changed" in capsys.readouterr().err


def test_without_real_programs_there_is_nothing_to_rewrite(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path))
    assert make(tmp_path) == 1
    assert "first run: python -m data_scripts.fetch_shapeassembly" in capsys.readouterr().err
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize("wrong", [["--ablations", "small"], ["--categories", "bed"], ["--workers", "0"]])
def test_wrong_use(wrong, capsys):
    with pytest.raises(SystemExit) as stopped:
        make_ablations.main(wrong)
    assert stopped.value.code == 2 and wrong[0] in capsys.readouterr().err


# lib.datasets


def test_an_ablation_that_was_not_made(root):
    with pytest.raises(DataError, match="make_ablations --ablations no_macros"):
        shapeassembly("chair", "train", ablation="no_macros")


def test_another_ablation_there_is_none(root):
    with pytest.raises(DataError, match="unknown ablation 'no order': choose one of flat, no_order"):
        shapeassembly("chair", ablation="no order")


def test_the_embedded_programs_are_rewritten_where_they_are_asked_for(
    tmp_path, monkeypatch, unchecked_shapes
):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "nothing"))
    usual = shapeassembly("table", "val")
    found = {ablation: shapeassembly("table", "val", ablation=ablation) for ablation in ABLATIONS}
    assert all(set(each.ids) <= set(usual.ids) and each.source == "embedded" for each in found.values())
    lines = {name: [s for p in each for _, _, s in p.statements()] for name, each in found.items()}
    assert all(len(each) >= 6 for each in found.values())
    assert all(len(program.blocks) == 1 for program in found["flat"])
    assert not any(isinstance(s, Squeeze | Reflect | Translate) for s in lines["no_macros"])
    assert not any(s.aligned for s in lines["no_align"] if isinstance(s, Cuboid) and s.name != "bbox")
    assert [p.to_text() for p in found["no_order"]] != [p.to_text() for p in usual]
