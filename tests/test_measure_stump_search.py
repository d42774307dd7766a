"""Figures of the search for matrices: a quick run of the command, and what its rows must satisfy on any machine."""

import json

import numpy as np
import pytest
import torch

from data_scripts import measure_stump_search
from data_scripts.measure_stump_search import NOISE, POINTS, RESULT, SEARCHES, planted


@pytest.fixture
def found(tmp_path, capsys) -> dict:
    out = tmp_path / "new" / "result.json"
    assert measure_stump_search.main(["--quick", "--out", str(out)]) == 0
    found = json.loads(out.read_text())
    printed = capsys.readouterr().out
    assert str(out) in printed and measure_stump_search.told(found) in printed
    return found


def check(found: dict) -> None:
    rows = {(row["primitives"], row["search"]): row for row in found["rows"]}
    assert len(rows) == len(found["rows"])
    for (count, _), row in rows.items():
        assert 0 <= row["bound_percent"] <= row["wrong_percent"] + 0.001 and row["wrong_percent"] <= 100
        assert 0 <= row["proven"] <= found["seeds"] and row["seconds"] <= row["longest_seconds"]
        if row["proven"] == found["seeds"]:
            assert row["bound_percent"] == pytest.approx(row["wrong_percent"], abs=0.001)  # rounded
        assert rows[count, "solve"]["wrong_percent"] <= rows[count, "greedy"]["wrong_percent"]
        # No search is better than what another one has proven: rounding apart, they answer the same questions.
        assert all(rows[count, other]["bound_percent"] <= row["wrong_percent"] + 0.001
                   for other in SEARCHES if (count, other) in rows)  # fmt: skip


def test_a_quick_run(found):
    check(found)
    assert {row["search"] for row in found["rows"]} == set(SEARCHES)
    assert all(row["proven"] == found["seeds"] for row in found["rows"] if row["search"] != "greedy")


def test_the_kept_figures():
    if not RESULT.is_file():
        pytest.skip(f"no {RESULT}")
    found = json.loads(RESULT.read_text())
    check(found)
    assert found["points"] == POINTS and found["command"].endswith("measure_stump_search")


@pytest.mark.parametrize("count", [2, 8, 32])
def test_planted_stumps(count):
    inside, target, nodes = planted(count, 0)
    again = planted(count, 0)
    assert torch.equal(inside, again[0]) and torch.equal(target, again[1]) and nodes == max(1, count // 2)
    assert inside.shape == (count, POINTS) and not torch.equal(planted(count, 1)[1], target)
    assert 0.02 < target.double().mean() < 0.98
    # The stump that was planted is wrong at NOISE of the points, up to four standard deviations; so no bound is above.
    row = SEARCHES["solve"](inside, target, nodes, 2.0)
    spread = np.sqrt(NOISE * (1 - NOISE) / POINTS)
    assert row["bound"] <= NOISE + 4 * spread


def test_an_interruption_writes_nothing(tmp_path, monkeypatch, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setitem(SEARCHES, "solve", interrupt)
    assert measure_stump_search.main(["--quick", "--out", str(tmp_path / "result.json")]) == 130
    assert not list(tmp_path.iterdir()) and "nothing was written" in capsys.readouterr().err


def test_a_bad_out_is_told_before_anything_is_measured(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(measure_stump_search, "measure", None)  # nobody calls it
    (tmp_path / "file").touch()
    for out in ("", tmp_path, tmp_path / "file" / "result.json"):
        assert measure_stump_search.main(["--quick", "--out", str(out)]) == 1
        assert capsys.readouterr().err.startswith("DataError: ")
