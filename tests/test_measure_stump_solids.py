"""Figures of the search for stumps: a small run of the command, and what the kept ones must show."""

import json

import pytest

from data_scripts import measure_stump_solids
from data_scripts.measure_stump_solids import GOOD, RESULT, box_iou, iou
from lib.interpreters.stump import Box, Stump, execute
from tests.conftest import unchecked


def block(*sides: float) -> Stump:
    return Stump((Box([side / 2 for side in sides]),), [0], [[1]], [1])


def test_a_small_run(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(measure_stump_solids, "QUICK", {"solids": ("mug",), "seeds": 1})
    monkeypatch.setattr(measure_stump_solids, "POINTS", 4000)
    out = tmp_path / "new" / "result.json"
    with unchecked():
        assert measure_stump_solids.main(["--quick", "--out", str(out)]) == 0
    found = json.loads(out.read_text())
    assert measure_stump_solids.told(found) in capsys.readouterr().out
    assert [(r["cloud"], r["search"]) for r in found["rows"]] == [
        ("clean", "solve"), ("clean", "greedy"), ("noisy", "solve"), ("noisy", "greedy"),
    ]  # fmt: skip
    assert all(found["box_iou"]["mug"] < 0.5 < r["worst_iou"] <= r["iou"] <= 1 for r in found["rows"])


def test_iou_of_boxes_whose_overlap_is_known():
    small, large = execute(block(1, 1, 1)), execute(block(1, 1, 2))
    assert iou(large, large) == 1
    assert iou(small, large) == pytest.approx(0.5, abs=0.01)
    assert box_iou(large) == pytest.approx(1)


def test_the_kept_figures():
    found = json.loads(RESULT.read_text())
    for cloud, least in (("clean", 8), ("noisy", 6)):
        rows = [r for r in found["rows"] if r["cloud"] == cloud and r["search"] == "solve"]
        assert len(rows) == 10 and sum(r["worst_iou"] >= GOOD for r in rows) >= least
        assert all(r["iou"] > found["box_iou"][r["solid"]] for r in rows)
