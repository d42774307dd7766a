"""Fitting programs to point clouds."""

import json

import pytest
import torch

from data_scripts import fit_shapeassembly
from lib.datasets import example
from lib.interpreters.shapeassembly import ProgramError, execute
from lib.training.fitting import SMALLEST, fit_cuboids, fit_program, free_cuboids

STEPS, POINTS = 15, 200


@pytest.fixture(scope="module")
def target():
    return execute(example("stool")).surface_points(POINTS, seed=0)


@pytest.fixture(scope="module")
def start():
    """The stool with every number a tenth off."""
    stool = example("stool")
    noise = torch.rand(stool.parameter_count, generator=torch.Generator().manual_seed(3)).double()
    return stool.with_parameters(stool.parameters() * (0.9 + 0.2 * noise))


def test_a_program_comes_nearer(start, target):
    fit = fit_program(start, target, steps=STEPS, points=POINTS)
    assert fit.losses[fit.best] < 0.9 * fit.losses[0]
    assert (fit.parameters == fit.path[fit.best]).all() and fit.path.shape == (STEPS, start.parameter_count)


def test_free_boxes_come_nearer(start, target):
    boxes = execute(start).cuboids
    fit = fit_cuboids(boxes, target, steps=STEPS, points=POINTS)
    assert fit.losses[fit.best] < 0.9 * fit.losses[0]
    assert len(free_cuboids(fit.parameters, boxes)) == len(boxes)


def test_the_same_again(start, target):
    one, two = (fit_program(start, target, steps=4, points=POINTS) for _ in range(2))
    assert (one.path == two.path).all()


def test_limits_hold(start, target):
    fit = fit_program(start, target, steps=STEPS, rate=0.5, points=POINTS)  # wild steps
    sizes = torch.tensor([":Cuboid:" in name for name in start.parameter_names()])
    assert (fit.path[1:, sizes] >= SMALLEST).all()
    assert ((fit.path[1:, ~sizes] >= 0) & (fit.path[1:, ~sizes] <= 1)).all()


def test_a_target_that_is_not_finite_stops_the_fit(start):
    with pytest.raises(ProgramError, match="not finite"):
        fit_program(start, torch.full((5, 3), torch.nan), steps=2, points=10)


def test_the_script_goes_on_where_it_stopped(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "none"))
    options = ["--steps", "3", "--points", "50", "--category", "table"]
    whole, halves = tmp_path / "whole.jsonl", tmp_path / "halves.jsonl"
    assert fit_shapeassembly.main([*options, "--count", "3", "--out", str(whole)]) == 0
    assert fit_shapeassembly.main([*options, "--count", "2", "--out", str(halves)]) == 0
    halves.write_text(halves.read_text()[:-10])  # as if killed in the middle of a line
    assert fit_shapeassembly.main([*options, "--count", "3", "--out", str(halves)]) == 0
    assert halves.read_text() == whole.read_text() and len(whole.read_text().splitlines()) == 4
    assert "3 programs fitted" in capsys.readouterr().out
    assert json.loads(whole.read_text().splitlines()[0])["source"] == "embedded"


def test_the_script_does_not_mix_settings(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "none"))
    out = ["--out", str(tmp_path / "fit.jsonl"), "--count", "1", "--points", "50"]
    assert fit_shapeassembly.main(["--steps", "2", *out]) == 0
    assert fit_shapeassembly.main(["--steps", "3", *out]) == 1
    assert "other settings" in capsys.readouterr().err
