"""Extracting programs from folders of part graphs: the same bytes however it runs, and no file that can stop it."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

from data_scripts import extract_programs, extraction_worker
from data_scripts.journal import Journal
from lib.datasets import DataError
from lib.extractor import Extraction
from lib.furniture import make
from lib.interpreters.shapeassembly import parse

ROOT = Path(__file__).parents[1]
IN_SMALL_CHUNKS = """
import sys
from data_scripts import extract_programs
extract_programs.CHUNK, extract_programs.CODE = 2, ()
sys.exit(extract_programs.main(sys.argv[1:]))
"""
TIDY = Extraction(parse("Assembly Program_0 {\n\tbbox = Cuboid(1, 1, 1, True)\n}\n"), f_score=99.999)


@pytest.fixture(autouse=True, scope="module")
def small_chunks():
    """Several chunks from a few files; and lib may change while the tests run."""
    before = extract_programs.CHUNK, extract_programs.CODE
    extract_programs.CHUNK, extract_programs.CODE = 2, ()
    yield
    extract_programs.CHUNK, extract_programs.CODE = before


@pytest.fixture
def quick(monkeypatch):
    """Stands in for the extractor where what it finds does not matter."""
    monkeypatch.setattr(extraction_worker, "extract_many", lambda graphs, options: [TIDY] * len(graphs))


@pytest.fixture(scope="module")
def furniture(tmp_path_factory) -> Path:
    """chair/ with 6 part graphs and table/ with 4."""
    folder = tmp_path_factory.mktemp("furniture")
    for category, count in (("chair", 6), ("table", 4)):
        (folder / category).mkdir()
        for seed in range(count):
            graph = make(category, seed)
            graph.write(folder / category / f"{graph.name}.json")
    return folder


@pytest.fixture(scope="module")
def reference(furniture, tmp_path_factory) -> dict[str, bytes]:
    """What one undisturbed process makes of it: a new one, where no annotations are checked, which takes longer."""
    out = tmp_path_factory.mktemp("reference")
    subprocess.run(command(furniture, out, "--workers", "1"), cwd=ROOT, check=True)
    return contents(out)


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()
    }


def command(source: Path, out: Path, *more: str) -> list[str]:
    return [sys.executable, "-c", IN_SMALL_CHUNKS, str(source), "--out", str(out), *more]


def extracted(source: Path, out: Path, *more: str) -> dict[str, bytes]:
    """Run in this process; returns all files of the output."""
    where = [] if "--scheduler" in more or "--workers" in more else ["--workers", "1"]
    assert extract_programs.main([str(source), "--out", str(out), *where, *more]) == 0
    return contents(out)


def begun(source: Path, out: Path) -> subprocess.Popen:
    """A run in a process of its own, two workers below it, that has finished at least one chunk and not all."""
    process = subprocess.Popen(
        command(source, out, "--workers", "2"),
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    journal, until = out / "journal.jsonl", time.monotonic() + 60
    while not (journal.exists() and journal.read_bytes().count(b"\n") > 2):
        assert process.poll() is None and time.monotonic() < until, process.communicate()
        time.sleep(0.01)
    return process


def test_what_comes_out(furniture, reference):
    summary, rejected = json.loads(reference["summary.json"]), json.loads(reference["rejected.json"])
    names = {path.relative_to(furniture).with_suffix("").as_posix() for path in furniture.rglob("*.json")}
    programs = {
        name.removeprefix("programs/").removesuffix(".txt") for name in reference if "programs/" in name
    }
    assert programs | rejected.keys() == names and not programs & rejected.keys()
    assert summary["shapes"] == 10 and summary["accepted"] == len(programs) >= 5
    assert summary["mean_f_score"] > 90 and sum(summary["rejected"].values()) == len(rejected)
    for name in programs:
        assert parse(reference[f"programs/{name}.txt"].decode()).blocks


def test_two_workers_make_the_same(furniture, reference, tmp_path):
    assert extracted(furniture, tmp_path / "out", "--workers", "2") == reference


def test_an_archive_makes_the_same(furniture, tmp_path, quick):
    archive = shutil.make_archive(str(tmp_path / "all"), "zip", furniture)
    (furniture / "chair" / "broken.json").write_text("{")
    with zipfile.ZipFile(archive, "a") as more:
        more.writestr("chair/broken.json", "{")
    from_folder = extracted(furniture, tmp_path / "folder")
    (furniture / "chair" / "broken.json").unlink()
    assert extracted(Path(archive), tmp_path / "zip") == from_folder


def test_a_killed_run_goes_on_to_the_same_end(furniture, reference, tmp_path, capsys):
    process = begun(furniture, tmp_path / "out")
    process.kill()
    process.communicate(timeout=20)  # returns when the workers, who hold its pipes, have ended too
    with (tmp_path / "out" / "journal.jsonl").open("a") as journal:
        journal.write('{"name": "chair/cha')  # and the kill came in the middle of a write
    assert extracted(furniture, tmp_path / "out", "--workers", "2") == reference
    assert "10 extracted now" not in capsys.readouterr().out


def test_a_finished_run_is_not_done_again(furniture, reference, tmp_path, capsys):
    for name, content in reference.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(content)
    lost = next(name for name in reference if name.startswith("programs/"))
    (tmp_path / lost).unlink()
    assert extracted(furniture, tmp_path) == reference
    assert ", 0 extracted now" in capsys.readouterr().out


def test_ctrl_c(furniture, tmp_path):
    process = begun(furniture, tmp_path / "out")
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers too
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 130 and "Traceback" not in errors
    assert errors.endswith("interrupted; the same command goes on from here\n")


def test_a_worker_that_is_killed_is_named(furniture, tmp_path):
    process = begun(furniture, tmp_path / "out")
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    if not children.exists():
        process.kill()
        pytest.skip("this system does not list a process's children")
    worker = next(
        c for c in children.read_text().split() if b"LokyProcess" in Path(f"/proc/{c}/cmdline").read_bytes()
    )
    os.kill(int(worker), signal.SIGKILL)
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 1 and "Traceback" not in errors
    assert "a worker was ended from outside, perhaps for want of memory" in errors


def test_a_dask_cluster_makes_the_same(furniture, reference, tmp_path):
    distributed = pytest.importorskip("distributed", reason="Dask is not installed: pip install distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        found = extracted(furniture, tmp_path / "out", "--scheduler", cluster.scheduler_address)
    assert found == reference


def test_no_cluster_there(furniture, tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed", reason="Dask is not installed: pip install distributed")
    asked = [str(furniture), "--out", str(tmp_path), "--scheduler", "nonsense://here"]
    assert extract_programs.main(asked) == 1
    assert "no Dask scheduler answers at nonsense://here" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "distributed", None)  # as if it were not installed
    assert extract_programs.main(asked) == 1
    assert "pip install -e '.[cluster]'" in capsys.readouterr().err


def test_poisoned_files_stop_nothing(furniture, tmp_path):
    source = tmp_path / "chair"
    source.mkdir()
    good = (furniture / "chair" / "chair-000000.json").read_text()
    shutil.copy(furniture / "chair" / "chair-000000.json", source / "good.json")
    poison = {
        "bytes": b"\xff\xfe\x00garbage",
        "cut": good[: len(good) // 2].encode(),
        "deep": b'{"label": "chair", "children": [' * 100_000,
        "empty": b"",
        "list": b"[]",
        "nan": good.replace('"box": [', '"box": [NaN, ', 1).encode(),
        "infinite": b'{"label": "chair", "box": [0, 0, 0, 1e999, 1, 1, 1, 0, 0, 0, 1, 0]}',
        "n" * 248: b"{}",  # with its ending it is longer than some would write
        "odd \udcff name": b"{}",
    }
    for name, content in poison.items():
        (source / f"{name}.json").write_bytes(content)
    (source / "folder.json").mkdir()
    assert subprocess.run(command(source, tmp_path / "out", "--workers", "1"), cwd=ROOT).returncode == 0
    found = contents(tmp_path / "out")
    rejected = json.loads(found["rejected.json"])
    assert rejected.keys() == poison.keys() and "programs/good.txt" in found
    assert {row["reason"] for row in rejected.values()} == {"unreadable"}
    assert not [row for row in rejected.values() if str(tmp_path) in row["detail"]], "details name no folders"


def test_names_that_climb_out_of_the_folder(furniture, tmp_path, quick):
    good = (furniture / "chair" / "chair-000000.json").read_bytes()
    with zipfile.ZipFile(tmp_path / "chair.zip", "w") as archive:
        for name in ("../up", "a/../../up", "/root", "good"):
            archive.writestr(f"{name}.json", good)
    found = extracted(tmp_path / "chair.zip", tmp_path / "out")
    assert [name for name in found if name.endswith(".txt")] == ["programs/good.txt"]
    assert len(json.loads(found["rejected.json"])) == 3 and not list(tmp_path.glob("*.txt"))


def test_one_graph_that_breaks_the_extractor_is_rejected_alone(furniture, tmp_path, monkeypatch):
    def fragile(graphs, options):
        if any(graph.name == "chair/chair-000002" for graph in graphs):
            raise ZeroDivisionError("by hand")
        return [TIDY] * len(graphs)

    monkeypatch.setattr(extraction_worker, "extract_many", fragile)
    rejected = json.loads(extracted(furniture, tmp_path / "out")["rejected.json"])
    detail = "ZeroDivisionError: by hand"
    assert rejected == {"chair/chair-000002": {"reason": "error", "detail": detail, "f_score": None}}


def test_rejected_programs_are_kept_on_demand(furniture, tmp_path, monkeypatch):
    def extract_many(graphs, options):
        program = TIDY.program if options.keep_rejected else None
        return [Extraction(program, "outside", "a leg", float("nan"))] * len(graphs)

    monkeypatch.setattr(extraction_worker, "extract_many", extract_many)
    without, kept = (
        extracted(furniture, tmp_path / str(len(more)), *more) for more in ([], ["--keep-rejected"])
    )
    assert not [name for name in without if name.endswith(".txt")]
    assert kept["rejected/table/table-000003.txt"] == TIDY.program.to_text().encode()
    assert without["rejected.json"] == kept["rejected.json"] and b"NaN" not in kept["rejected.json"]
    summary = {"shapes": 10, "accepted": 0, "mean_f_score": None, "rejected": {"outside": 10}}
    assert json.loads(kept["summary.json"]) == summary


def changed_setting(source, out):
    return ["--keep-rejected"], "keep_rejected: 'False' then, 'True' now"


def changed_code(source, out):
    extract_programs.CODE = ("metrics",)
    return [], "code: '.*' then, '.*' now"


def changed_file(source, out):
    path = source / "chair" / "chair-000003.json"
    path.write_bytes(path.read_bytes().replace(b"0.1", b"0.2"))
    return [], "chair/chair-000003 has changed since"


def removed_file(source, out):
    (source / "chair" / "chair-000003.json").unlink()
    return [], "chair/chair-000003 is in .* but no longer in the input"


def damaged_journal(source, out):
    (out / "journal.jsonl").write_text("nonsense\n")
    return [], "journal.jsonl is damaged"


def lost_journal(source, out):
    (out / "journal.jsonl").unlink()
    return [], "holds programs of something else"


@pytest.mark.parametrize(
    "change", [changed_setting, changed_code, changed_file, removed_file, damaged_journal, lost_journal]
)
def test_two_runs_are_never_mixed(furniture, tmp_path, quick, capsys, change, monkeypatch):
    monkeypatch.setattr(extract_programs, "CODE", ())
    source, out = tmp_path / "in", tmp_path / "out"
    shutil.copytree(furniture, source)
    extracted(source, out)
    more, message = change(source, out)
    before = contents(out)
    assert extract_programs.main([str(source), "--out", str(out), "--workers", "1", *more]) == 1
    assert contents(out) == before
    assert re.search(message, capsys.readouterr().err)


def test_new_files_are_added(furniture, tmp_path, quick, capsys):
    source = tmp_path / "in"
    shutil.copytree(furniture, source)
    shutil.move(source / "table", tmp_path / "table")
    extracted(source, tmp_path / "out")
    shutil.move(tmp_path / "table", source / "table")
    assert extracted(source, tmp_path / "out") == extracted(source, tmp_path / "fresh")
    assert "4 extracted now" in capsys.readouterr().out


@pytest.mark.parametrize(
    "files, message",
    [
        (None, "in"),
        ({}, "there are no .json files in"),
        ({"chair/a.json": "x", "chair/b.json": "y"}, "none of 2 files gave a part graph; chair/a: not JSON"),
        ({"a.json": "{}"}, "no folder's name tells the category of a; give --category, one of chair, table"),
    ],
    ids=["missing", "empty", "nothing readable", "no category"],
)
def test_input_from_which_nothing_comes(tmp_path, files, message, capsys):
    for name, content in (files or {}).items():
        (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "in" / name).write_text(content)
    if files == {}:
        (tmp_path / "in").mkdir()
    assert (
        extract_programs.main([str(tmp_path / "in"), "--out", str(tmp_path / "out"), "--workers", "1"]) == 1
    )
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    "source, name, category",
    [
        ("data/chair", "1", "chair"),
        ("data/Chair_hier.zip", "1", "chair"),
        ("data/partnet", "storagefurniture_hier/1", "storage"),
        ("data/chair", "table_hier/train/1", "table"),
    ],
)
def test_the_innermost_folder_tells_the_category(source, name, category):
    assert extract_programs.category_of(Path(source), name) == category


@pytest.mark.parametrize(
    "wrong", [["--workers", "0"], ["--category", "bed"], ["--workers", "2", "--scheduler", "x"]]
)
def test_wrong_use(wrong, tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        extract_programs.main([str(tmp_path), "--out", str(tmp_path / "out"), *wrong])
    assert stopped.value.code == 2 and wrong[-2] in capsys.readouterr().err


def test_the_help_says_where_own_data_goes(capsys):
    with pytest.raises(SystemExit):
        extract_programs.main(["--help"])
    said = capsys.readouterr().out
    assert "data/partnet/chair_hier/43875.json" in said and "licence" in said


def test_a_folder_that_cannot_be_written(furniture, tmp_path, capsys, quick):
    (tmp_path / "file").write_text("in the way")
    assert (
        extract_programs.main([str(furniture), "--out", str(tmp_path / "file" / "out"), "--workers", "1"])
        == 1
    )
    assert "cannot be read or written" in capsys.readouterr().err


def test_a_journal_of_something_else(tmp_path):
    (tmp_path / "journal").write_text('{"steps": 3}\n')
    with pytest.raises(DataError, match="other settings"):
        Journal(tmp_path / "journal", {"code": "x"})
