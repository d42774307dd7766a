"""The made data set of random CSG programs: as many as asked for, all different, and the same bytes however it runs."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from data_scripts import csg_worker, make_csg_programs
from lib.datasets import CSG_SIZES, CSG_SPLITS, DataError, csg_programs
from lib.interpreters.csg import execute_many, sample_many, vocabulary_of
from tests.conftest import unchecked

ROOT = Path(__file__).parents[1]
SHARE = {2: 0.0002, 3: 0.0001}
IN_SMALL_CHUNKS = """
import sys
from data_scripts import make_csg_programs
make_csg_programs.CHUNK, make_csg_programs.code_digest = {2: 20, 3: 16}, lambda *_: "here"
sys.exit(make_csg_programs.main(sys.argv[1:]))
"""


@pytest.fixture(autouse=True, scope="module")
def small_chunks():
    """Several chunks from a few programs, unchecked shapes; and lib may change while the tests run."""
    with pytest.MonkeyPatch.context() as patch, unchecked():
        patch.setattr(make_csg_programs, "CHUNK", {2: 20, 3: 16})
        patch.setattr(make_csg_programs, "code_digest", lambda *_: "here")
        yield


@pytest.fixture
def quick(monkeypatch):
    """Stands in for the sampler, where it does not matter which programs it makes."""

    def numbered(rng, number, length, dimensions):
        primitives = rng.integers(396, size=(number, length // 2 + 1))
        return torch.from_numpy(np.c_[primitives, np.full((number, length // 2), 396)])

    monkeypatch.setattr(csg_worker, "sample_many", numbered)


@pytest.fixture(scope="module")
def plane(tmp_path_factory) -> Path:
    """What one undisturbed process makes of the plane."""
    out = tmp_path_factory.mktemp("plane")
    run(out)
    return out


@pytest.fixture(scope="module")
def reference(plane) -> dict[str, bytes]:
    return contents(plane)


@pytest.fixture(scope="module", params=[2, 3], ids=["plane", "space"])
def made(request, tmp_path_factory) -> tuple[int, Path]:
    """(dimensions, folder)"""
    if request.param == 2:
        return 2, request.getfixturevalue("plane")
    out = tmp_path_factory.mktemp("space")
    run(out, "--dimensions", "3", "--share", str(SHARE[3]))
    return 3, out


def options(out: Path, *more: str) -> list[str]:
    where = [] if {"--workers", "--scheduler"} & set(more) else ["--workers", "1"]
    share = [] if "--share" in more else ["--share", str(SHARE[2])]
    return ["--out", str(out), *share, *where, *more]


def run(out: Path, *more: str) -> dict[str, bytes]:
    """Run in this process; returns all files of the folder."""
    assert make_csg_programs.main(options(out, *more)) == 0
    return contents(out)


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()
    }


def arrays(folder: Path, dimensions: int = 2) -> dict[str, np.ndarray]:
    with np.load(folder / f"programs_{dimensions}d.npz") as file:
        return dict(file)


def begun(out: Path) -> subprocess.Popen:
    """A run in a process of its own, two workers below it, that has finished two chunks and not all."""
    process = subprocess.Popen(
        [sys.executable, "-c", IN_SMALL_CHUNKS, *options(out, "--workers", "2")],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    until = time.monotonic() + 60
    while len(list(out.glob("*.parts/*.npy"))) < 2:
        assert process.poll() is None and time.monotonic() < until, process.communicate()
        time.sleep(0.005)
    return process


# What comes out


def test_as_many_as_asked_for(made):
    dimensions, out = made
    found = arrays(out, dimensions)
    table = CSG_SIZES[dimensions]
    assert list(found) == [f"{split}_{length}" for length in table for split in CSG_SPLITS]
    for length, row in table.items():
        for split, number in row.items():
            tokens = found[f"{split}_{length}"]
            assert tokens.shape == (max(1, round(number * SHARE[dimensions])), length)
            assert tokens.dtype == np.uint16
    names = {f"programs_{dimensions}d.npz", f"programs_{dimensions}d.json"}
    assert contents(out).keys() == names, "the parts are gone"


def test_programs_are_valid_and_different(made):
    dimensions, out = made
    found = arrays(out, dimensions)
    for length in CSG_SIZES[dimensions]:
        tokens = np.concatenate([found[f"{split}_{length}"] for split in CSG_SPLITS])
        assert len(np.unique(tokens, axis=0)) == len(tokens), "in all splits together"
        shapes = execute_many(torch.from_numpy(tokens.astype(np.int64)), dimensions=dimensions)
        assert shapes.valid.all() and shapes.on.min() >= {2: 12**2, 3: 7**3}[dimensions]


def test_the_summary_is_true(made):
    dimensions, out = made
    found, summary = arrays(out, dimensions), json.loads((out / f"programs_{dimensions}d.json").read_text())
    made_how = {"dimensions": dimensions, "seed": 0, "share": SHARE[dimensions], "code": "here"}
    assert made_how.items() <= summary.items()
    assert summary["by_length"] == {name: len(tokens) for name, tokens in found.items()}
    assert summary["programs"] == {
        split: sum(len(tokens) for name, tokens in found.items() if name.split("_")[0] == split)
        for split in CSG_SPLITS
    }
    texts = vocabulary_of(dimensions).texts
    words = [texts[token].partition("(")[0] for tokens in found.values() for token in tokens.flat]
    for key, group in (("operations_percent", "+*-"), ("primitives_percent", summary["primitives_percent"])):
        total = sum(word in group for word in words)
        expected = {word: pytest.approx(100 * words.count(word) / total, abs=0.006) for word in group}
        assert summary[key] == expected, key
    assert summary["primitives_percent"].keys() == {
        *(["c", "s", "t"] if dimensions == 2 else ["cu", "cy", "sp"])
    }


def test_the_rest_of_the_project_reads_it(made, monkeypatch):
    dimensions, out = made
    (out / "csg").symlink_to(out)
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(out))
    try:
        programs = csg_programs(dimensions, "test", 7)
    finally:
        (out / "csg").unlink()
    assert programs.source == "made"
    assert (programs.tokens[:, :7].numpy() == arrays(out, dimensions)["test_7"]).all()


def test_any_part_of_a_chunk_is_balanced():
    """sample_many finds what is rare last, and a chunk is not always used up: 400 of 1,200 should have a third of the
    133 programs with each ending, 133 with a deviation of 8 (of 400 without replacement), bounds at 4 of them."""
    _, tokens = csg_worker.make_chunk(0, (2, 3, 0), 1200)
    assert np.bincount(tokens[:, -1] - 396).tolist() == [400] * 3
    assert all(101 <= many <= 165 for many in np.bincount(tokens[:400, -1] - 396))
    inside = sample_many(np.random.default_rng([0, 2, 3, 0]), 1200, 3).numpy()
    assert {tuple(row) for row in inside} == {tuple(row) for row in tokens.tolist()}


def test_programs_that_come_twice_are_replaced(tmp_path, monkeypatch, quick):
    """Chunks that hold hardly anything new: more are made until all are there."""
    few = csg_worker.sample_many

    def poor(rng, number, length, dimensions):
        tokens = few(rng, number, length, dimensions)
        tokens[1:] = tokens[0]
        return tokens

    monkeypatch.setattr(csg_worker, "sample_many", poor)
    run(tmp_path, "--share", "0.00001")
    found = arrays(tmp_path)
    assert len(found["train_13"]) == 4 and len({*map(tuple, found["train_13"].tolist())}) == 4


# The same, whatever happens


def test_two_workers_make_the_same(reference, tmp_path):
    assert run(tmp_path, "--workers", "2") == reference


def test_another_seed_makes_others(plane, reference, tmp_path):
    found = run(tmp_path, "--seed", "1")
    assert found.keys() == reference.keys()
    assert all(found[name] != reference[name] for name in reference)
    both = (arrays(folder)["train_13"].tolist() for folder in (plane, tmp_path))
    assert not set.intersection(*({*map(tuple, tokens)} for tokens in both))


def test_a_killed_run_goes_on_to_the_same_end(reference, tmp_path):
    process = begun(tmp_path)
    process.kill()
    process.communicate(timeout=20)  # returns when the workers, who hold its pipes, have ended too
    parts = tmp_path / "programs_2d.parts"
    finished = {path.name for path in parts.glob("*.npy")}
    assert len(finished) >= 2 and not (tmp_path / "programs_2d.json").exists()
    (parts / "half.part").write_bytes(b"the kill came in the middle of a write")
    with pytest.MonkeyPatch.context() as patch:
        again = []
        patch.setattr(
            make_csg_programs, "make_chunk", lambda *job: again.append(job) or csg_worker.make_chunk(*job)
        )
        assert run(tmp_path) == reference
    assert again and not {f"{length:02d}-{k:05d}.npy" for _, (_, length, k), *_ in again} & finished


def test_ctrl_c(tmp_path):
    process = begun(tmp_path)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers too
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 130 and "Traceback" not in errors
    assert errors.endswith("interrupted; the same command goes on from here\n")
    assert not list(tmp_path.glob("*.npz"))


def test_a_dask_cluster_makes_the_same(reference, tmp_path):
    distributed = pytest.importorskip("distributed", reason="Dask is not installed: pip install distributed")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        assert run(tmp_path, "--scheduler", cluster.scheduler_address) == reference


def test_a_finished_run_is_not_done_again(tmp_path, quick, capsys):
    run(tmp_path)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    capsys.readouterr()
    run(tmp_path)
    assert "is there already, made with the same settings: nothing to do" in capsys.readouterr().out
    assert {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("change", [["--seed", "3"], ["--share", "0.0001"]], ids=lambda change: change[0])
def test_other_settings_replace_nothing_unless_told(tmp_path, quick, change, capsys):
    made = run(tmp_path, *change)
    assert make_csg_programs.main(options(tmp_path)) == 1
    said = capsys.readouterr().err
    assert "was made with other settings" in said and "choose another --out, or --force" in said
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == made
    assert run(tmp_path, "--force") != made
    fresh = run(tmp_path / "fresh", *change)
    run(tmp_path, *change, "--force")
    assert {path.name: path.read_bytes() for path in tmp_path.glob("*.*")} == fresh


@pytest.mark.parametrize("lost", ["npz", "json", "half of the json", "a list"])
def test_what_is_lost_or_damaged_is_made_again(tmp_path, quick, lost):
    whole, told = run(tmp_path), tmp_path / "programs_2d.json"
    if lost == "half of the json":
        told.write_bytes(told.read_bytes()[:40])
    elif lost == "a list":
        told.write_text("[]")
    else:
        (tmp_path / f"programs_2d.{lost}").unlink()
    assert run(tmp_path) == whole


def test_plane_and_space_do_not_disturb_one_another(tmp_path, quick):
    plane = run(tmp_path)
    assert run(tmp_path, "--dimensions", "3").items() > plane.items()


# Bad input


@pytest.fixture
def interrupted(tmp_path, monkeypatch, quick) -> Path:
    """The folder of parts of a run that Ctrl-C ended after three chunks."""
    chunks = []

    def three(*job):
        if len(chunks) == 3:
            raise KeyboardInterrupt
        chunks.append(job)
        return csg_worker.make_chunk(*job)

    with monkeypatch.context() as patch:
        patch.setattr(make_csg_programs, "make_chunk", three)
        assert make_csg_programs.main(options(tmp_path)) == 130
    return tmp_path / "programs_2d.parts"


def test_parts_of_other_settings_are_refused(interrupted, tmp_path, capsys):
    (tmp_path / "programs_2d.json").write_text("{}")
    before = contents(tmp_path)
    assert make_csg_programs.main(options(tmp_path, "--seed", "1")) == 1
    told = capsys.readouterr().err
    assert f"DataError: {interrupted} holds the beginning of something else" in told
    assert '"seed": 0' in told and '"seed": 1' in told and "remove it, or choose another --out" in told
    assert contents(tmp_path) == before
    run(tmp_path)  # and those of the same are not


def damaged(content: bytes) -> dict[str, bytes]:
    """Ways in which a file can be wrong."""
    return {
        "empty": b"",
        "cut": content[:-3],
        "cut early": content[:20],
        "nonsense": b"nonsense" * 30,
        "an archive": b"PK\x03\x04" + content,
        "of another kind": content.replace(b"<u2", b"<i2"),
        "of another length": content.replace(b"(20, 13)", b"(13, 20)"),
    }


@pytest.mark.parametrize("how", damaged(b""))
def test_a_damaged_part_is_named(interrupted, tmp_path, capsys, how):
    part = min(interrupted.glob("13-*.npy"))
    part.write_bytes(damaged(part.read_bytes())[how])
    assert make_csg_programs.main(options(tmp_path)) == 1
    told = capsys.readouterr().err
    assert f"DataError: {part} is damaged (" in told
    assert told.endswith("remove it, and the same command makes it again\n") and "Traceback" not in told
    part.unlink()
    run(tmp_path)


def test_damaged_settings_are_refused(interrupted, tmp_path, capsys):
    (interrupted / "settings.json").write_bytes(b"\xff\xfe")
    assert make_csg_programs.main(options(tmp_path)) == 1
    assert "remove it, or choose another --out" in capsys.readouterr().err


def test_a_folder_that_cannot_be_written(tmp_path, capsys, quick):
    (tmp_path / "file").write_text("in the way")
    assert make_csg_programs.main(options(tmp_path / "file" / "out")) == 1
    told = capsys.readouterr().err
    assert str(tmp_path / "file") in told and told.count("\n") == 1


@pytest.mark.parametrize(
    "wrong",
    [
        ["--workers", "0"],
        ["--workers", "-2"],
        ["--workers", "2", "--scheduler", "x"],
        ["--share", "0"],
        ["--share", "1.01"],
        ["--share", "nan"],
        ["--seed", "-1"],
        ["--dimensions", "4"],
    ],
    ids=" ".join,
)
def test_wrong_use(wrong, tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        make_csg_programs.main(["--out", str(tmp_path / "out"), *wrong])
    assert stopped.value.code == 2 and wrong[-2] in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_whole_is_the_papers_table():
    """Table 1: 1,225,000 + 95,000 + 355,000 programs of the plane, 700,000 + 70,000 + 140,000 of space."""
    totals = [
        sum(row[split] for row in make_csg_programs.sizes(dimensions, 1.0).values())
        for dimensions in (2, 3)
        for split in CSG_SPLITS
    ]
    assert totals == [1_225_000, 95_000, 355_000, 700_000, 70_000, 140_000]


def test_what_is_damaged_after_it_was_made_is_made_again(tmp_path, quick):
    whole = run(tmp_path)
    (tmp_path / "programs_2d.npz").write_bytes(whole["programs_2d.npz"][:1000])
    assert run(tmp_path) == whole


def test_two_runs_at_once_do_not_fill_one_folder(tmp_path):
    folder = tmp_path / "programs_2d.parts"
    first = make_csg_programs.Parts(folder, {"seed": 0})
    with pytest.raises(DataError, match="another run is filling .*programs_2d.parts"):
        make_csg_programs.Parts(folder, {"seed": 0})
    first._locked.close()
    make_csg_programs.Parts(folder, {"seed": 0})
