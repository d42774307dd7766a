"""Figures of made CSG programs: counted again by hand for a few, and said to be missing where there are none."""

import json

import numpy as np
import pytest
import torch

from data_scripts import make_csg_programs, measure_csg_programs
from lib.datasets import CSG_SIZES, CSG_SPLITS
from lib.interpreters.csg import execute_many, parse, vocabulary_of
from tests.conftest import unchecked

A, B, C = "c(32,32,28)", "s(32,32,20)", "t(16,16,16)"


@pytest.fixture(scope="module", autouse=True)
def quick():
    with unchecked():
        yield


@pytest.fixture
def data(tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "data"))
    return tmp_path / "data" / "csg"


def tokens(*texts: str) -> np.ndarray:
    return np.array([parse(text).tokens(vocabulary_of(2)).tolist() for text in texts], np.uint16)


@pytest.fixture
def written(data) -> dict[str, np.ndarray]:
    """Programs of the plane by hand: some tests are in train, some only what they draw, some only swapped."""
    arrays = {
        "train_3": tokens(A + B + "-", A + C + "+"),
        "test_3": tokens(C + A + "+", A + A + "*", B + C + "-"),  # swapped; another's picture, below; new
        "val_3": tokens(A + A + "+"),
    }
    for length in list(CSG_SIZES[2])[1:]:
        more = (A + "+") * ((length - 1) // 2)
        arrays |= {f"{split}_{length}": tokens(A + more) for split in CSG_SPLITS}
    data.mkdir(parents=True)
    make_csg_programs.write(data / "programs_2d.npz", arrays)
    return arrays


def measured(tmp_path, *more: str) -> dict:
    out = tmp_path / "result.json"
    assert measure_csg_programs.main(["--out", str(out), *more]) == 0
    return json.loads(out.read_text())


def test_counted_by_hand(written, data, tmp_path, capsys):
    found = measured(tmp_path, "--dimensions", "2")
    assert found.keys() == {"plane"}
    plane = found["plane"]
    assert plane["programs"]["test"] == {"3": 3, "5": 1, "7": 1, "9": 1, "11": 1, "13": 1}
    assert plane["megabytes"] == round((data / "programs_2d.npz").stat().st_size / 1e6, 2)
    # Each of the three splits has 2 + 3 + 4 + 5 + 6 unions in its programs of 5 tokens and more.
    assert plane["operations_percent"] == {"+": 95.45, "*": 1.52, "-": 3.03}  # 63 1 2 of 66
    assert plane["last_operations_percent"] == {"+": 85.71, "*": 4.76, "-": 9.52}  # 18 1 2 of 21
    assert sum(plane["primitives_percent"].values()) == pytest.approx(100, abs=0.02)
    # Of the eight tests, those of 5 to 13 tokens and the swapped one are in train, A A * is but as a picture.
    assert plane["swapped_in_train_percent"] == 75
    pictures = plane["pictures"]
    assert pictures["programs"] == {"train": 7, "val": 6, "test": 8}
    assert pictures["test_in_train_percent"] == 87.5
    assert pictures["distinct"] == 4 and pictures["are"] == "all programs"  # A-B, A+C, A, B-C
    rows = [torch.from_numpy(each.astype(np.int64)) for each in written.values()]
    on = torch.cat([execute_many(each).on for each in rows])
    assert pictures["mean_on"] == round(float(on.double().mean()), 1)
    assert "4 distinct of 21 (all programs)" in capsys.readouterr().out


def test_made_programs(data, tmp_path, monkeypatch, capsys):
    """What make_csg_programs makes, plane and space; its own summary says the same."""
    monkeypatch.setattr(make_csg_programs, "CHUNK", {2: 128, 3: 64})
    for dimensions, share in ((2, "0.0002"), (3, "0.0001")):
        asked = ["--dimensions", str(dimensions), "--share", share, "--workers", "1"]
        assert make_csg_programs.main(asked) == 0
    found = measured(tmp_path, "--sample", "10")
    assert list(found) == ["plane", "space"]
    for dimensions, figures in zip((2, 3), found.values()):
        summary = json.loads((data / f"programs_{dimensions}d.json").read_text())
        for key in ("operations_percent", "primitives_percent"):
            assert figures[key] == summary[key]
        assert {split: sum(row.values()) for split, row in figures["programs"].items()} == summary["programs"]
        assert figures["pictures"]["distinct"] > 0.8 * sum(figures["pictures"]["programs"].values())
    assert found["space"]["pictures"]["programs"] == {"train": 10, "val": 7, "test": 10}  # of 70, 7, 14
    assert found["space"]["pictures"]["are"] == "at most 10 random programs of each split"
    plane = measured(tmp_path, "--dimensions", "2")
    assert plane == found, "measuring one keeps the other's figures, and is the same each time"
    assert "space, " in capsys.readouterr().out


def test_a_sample_has_its_share_of_each_length():
    programs = {
        n: np.full((many, n), n) + np.arange(many)[:, None] for n, many in ((3, 100), (5, 0), (7, 300))
    }
    chosen = measure_csg_programs.choose(np.random.default_rng(0), programs, 200)
    assert list(chosen) == [3, 5, 7] and sum(map(len, chosen.values())) == 200
    assert 30 < len(chosen[3]) < 70 and not len(chosen[5]), "50 with a deviation of 4"
    for n, rows in chosen.items():
        assert len(np.unique(rows, axis=0)) == len(rows)
        assert {*map(tuple, rows)} <= {*map(tuple, programs[n])}
    assert measure_csg_programs.choose(np.random.default_rng(0), programs, 400) is programs


@pytest.mark.parametrize(
    "one, other, same",
    [
        (A + B + "+", B + A + "+", True),
        (A + B + "*", B + A + "*", True),
        (A + B + "-", B + A + "-", False),
        (A + B + "+", A + B + "*", False),
        (A + B + C + "+*", C + B + "+" + A + "*", True),
        (A + B + C + "*+", A + B + "*" + C + "+", False),
        (A + B + C + "-+", B + C + "-" + A + "+", True),
        (A + B + C + "-+", A + C + B + "-+", False),
    ],
)
def test_trees_but_for_the_order_of_operands(one, other, same):
    first, second = (measure_csg_programs.tree_hashes(tokens(text), 396) for text in (one, other))
    assert (first == second).all() == same


def test_what_is_not_made_is_told(data, tmp_path, capsys):
    out = tmp_path / "result.json"
    assert measure_csg_programs.main(["--out", str(out)]) == 1
    told = capsys.readouterr().err
    assert f"there is no {data / 'programs_2d.npz'}" in told and told.count("\n") == 1
    assert "python -m data_scripts.make_csg_programs --dimensions 2" in told and not out.exists()


def test_programs_that_are_not_valid_are_told(written, data, tmp_path, capsys):
    written["val_3"][0] = 396
    make_csg_programs.write(data / "programs_2d.npz", written)
    assert measure_csg_programs.main(["--dimensions", "2", "--out", str(tmp_path / "result.json")]) == 1
    assert "val_3 has rows that are no programs" in capsys.readouterr().err


def test_wrong_use(capsys):
    with pytest.raises(SystemExit) as stopped:
        measure_csg_programs.main(["--sample", "0"])
    assert stopped.value.code == 2 and "--sample must be 1 or more" in capsys.readouterr().err
