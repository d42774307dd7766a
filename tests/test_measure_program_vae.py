"""Rows of Tables 2 to 6: a quick run of the command for every method, on embedded data and the committed weights."""

import json
from functools import partial

import pytest
import torch

from data_scripts import measure_program_vae
from data_scripts.measure_program_vae import ABLATIONS, FITTED, LEAST, METHODS, WRITTEN
from lib.models import writing
from lib.models.pretrained import pretrained
from lib.models.program_vae import ProgramVAE, ProgramVAEConfig
from lib.models.weights import save
from lib.training.point_net import PointNetSchedule
from lib.training.realism import percent_fooled
from lib.viewing.program_tables import NAMES, load_rows, not_measured
from tests.conftest import unchecked

CHAIRS = pretrained("program_vae_chair")
HEADER = {"category", "method", "data", "seed", "samples", "date", "commit", "code", "seconds"}
PHYSICS = {"rooted", "stable", "stable_authors_trial"}
COUNTS = {"lines", "reflect", "translate", "squeeze", "macros_per_line", "leaves"}
NEAR = {"generalisation", "coverage", "variety", "novel_percent"}
LOOKS = {"fool", "doubted", "frechet"}
WRITING = {"weights", "rules", "rejected_percent", "seconds_writing"}
EXPECTED = {method: WRITING | PHYSICS | LOOKS | COUNTS | NEAR for method in WRITTEN} | {
    "ground_truth": {"programs"} | PHYSICS | COUNTS,
    "validation": NEAR,
    "interpolation": {"weights", "steps", "geometric_step", "program_step"},
}


@pytest.fixture(autouse=True)
def quick(monkeypatch, tmp_path):
    """Embedded data, and every slow part as short as it gets."""
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "no-data"))
    for name, value in {"QUICK": LEAST, "CLOUD": 64, "SEQUENCES": 2, "STEPS": 3}.items():
        monkeypatch.setattr(measure_program_vae, name, value)
    monkeypatch.setattr(writing, "CODES_AT_ONCE", 16)
    hasty = partial(percent_fooled, schedule=PointNetSchedule(epochs=1, batch=8, points=32), last=1)
    monkeypatch.setattr(measure_program_vae, "percent_fooled", hasty)
    with unchecked():
        yield


def run(out, method: str, *options: str) -> dict:
    """The row that the command writes for chairs."""
    command = ["chair", "--method", method, "--quick", "--out", str(out), *options]
    assert measure_program_vae.main(command) == 0
    return json.loads(out.read_text())


@pytest.mark.parametrize("method", METHODS)
def test_a_row(method, tmp_path, capsys):
    out = tmp_path / "new" / f"chair_{method}.json"
    given = ["--weights", str(CHAIRS)] if method in ABLATIONS else []
    row = run(out, method, *given)
    printed = capsys.readouterr().out
    assert str(out) in printed and all(name in printed for name in row)
    assert set(row) == HEADER | EXPECTED[method]
    assert (row["category"], row["method"], row["data"], row["seed"]) == ("chair", method, "embedded", 0)
    assert row["samples"] == (2 if method == "interpolation" else LEAST)
    check(row)
    if method in WRITTEN:
        assert row["rules"]["mode"] == ("skip" if method == "no_reject" else "reject")
        assert (row["rules"]["outside"] > 0.1) == (method == "ours_authors_rules")  # 0.1 is the paper's
        assert row["rules"]["fitted_codes"] == (method in FITTED) == (row["rules"]["spread"] < 1)
    if method not in ABLATIONS:  # what is written is what the tables read
        assert (
            "python" not in not_measured(load_rows(out.parent), ["chair"]).partition(NAMES[method] + " ")[1]
        )


def check(row: dict) -> None:
    """What holds for any row, wherever it was measured."""
    for name in (
        "rooted",
        "stable",
        "stable_authors_trial",
        "fool",
        "doubted",
        "novel_percent",
        "rejected_percent",
    ):
        assert 0 <= row.get(name, 0) <= 100
    for name in ("stable", "stable_authors_trial"):  # what is not rooted is not stable
        assert row.get(name, 0) <= row.get("rooted", 100)
    for name in ("frechet", "generalisation", "variety", "geometric_step", "lines", "leaves"):
        assert row.get(name, 1) > 0
    if "lines" in row:
        macros = sum(row[name] for name in ("reflect", "translate", "squeeze"))
        assert row["macros_per_line"] == pytest.approx(macros, abs=2e-4)  # four rounded numbers


def test_kept_rows():
    """Every committed row holds what its method measures, and what holds for any row."""
    rows = load_rows()
    for category, methods in rows.items():
        for method, row in methods.items():
            assert EXPECTED[method] <= set(row), (category, method)
            check(row)


def test_the_same_seed_gives_the_same_row(tmp_path):
    keep = NEAR | COUNTS | PHYSICS | LOOKS | {"rejected_percent", "weights"}
    one, same = (run(tmp_path / f"{i}.json", "ours") for i in "ab")
    assert {name: one[name] for name in keep} == {name: same[name] for name in keep}
    other = run(tmp_path / "c.json", "interpolation", "--seed", "1")
    assert run(tmp_path / "d.json", "interpolation")["geometric_step"] != other["geometric_step"]


@pytest.mark.parametrize("method", ["ours", "interpolation"])
def test_a_network_that_writes_nothing(method, tmp_path, capsys):
    torch.manual_seed(2)  # of these weights no code gives a program, whatever the mode
    weights = tmp_path / "untrained.safetensors"
    save(ProgramVAE(ProgramVAEConfig(hidden=16, head=8)), weights)
    out = tmp_path / "row.json"
    arguments = ["chair", "--method", method, "--quick", "--weights", str(weights), "--out", str(out)]
    assert measure_program_vae.main(arguments) == 1 and not out.exists()
    assert "write hardly any program" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options, said",
    [
        (["--method", "flat"], "--method flat needs --weights"),
        (["--weights", "nowhere.safetensors"], "nowhere.safetensors"),
        (["--samples", "7"], f"--samples is 7; expected at least {LEAST}"),
        (["--method", "ground_truth", "--seed", "-1"], "--seed is -1; expected 0 to"),
        (["--method", "validation", "--seed", str(10**20)], f"--seed is {10**20}; expected 0 to"),
    ],
)
def test_what_cannot_be_measured(options, said, tmp_path, capsys):
    out = tmp_path / "row.json"
    assert measure_program_vae.main(["chair", "--out", str(out), *options]) == 1
    told = capsys.readouterr().err
    assert told.startswith("DataError: ") and said in told and not out.exists()


def test_an_interruption_writes_nothing(tmp_path, monkeypatch, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(measure_program_vae, "physics", interrupt)
    out = tmp_path / "row.json"
    assert (
        measure_program_vae.main(["chair", "--method", "ground_truth", "--quick", "--out", str(out)]) == 130
    )
    assert not out.exists() and "nothing was written" in capsys.readouterr().err
