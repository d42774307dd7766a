"""Curves of trainings: what is kept is what the logs say, and what is no run is told."""

import json

import pytest

from data_scripts.keep_curves import main


@pytest.fixture
def run(tmp_path):
    """The folder of a run that has ended after two epochs."""
    folder = tmp_path / "run"
    folder.mkdir()
    rows = [{"epoch": 1, "reward": 0.25}, {"epoch": 2, "reward": 0.5}]
    (folder / "log.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    (folder / "csgnet_reinforce.json").write_text(
        json.dumps({"command": "python -m lib.training x", "epochs": 2})
    )
    (folder / "csgnet_reinforce.safetensors").write_bytes(b"")
    (folder / "a_notes.json").write_text("[]")  # not the run's
    return folder


def test_keeps_names_commands_and_logs(run, tmp_path):
    out = tmp_path / "new" / "curves.json"
    assert main([f"a run={run}", f"again={run}", "--out", str(out)]) == 0
    kept = json.loads(out.read_text())["runs"]
    assert [each["name"] for each in kept] == ["a run", "again"]
    assert kept[0]["command"] == "python -m lib.training x"
    assert [row["reward"] for row in kept[0]["log"]] == [0.25, 0.5]


def test_a_run_that_goes_on_has_no_command_yet(run, tmp_path):
    (run / "csgnet_reinforce.json").unlink()
    out = tmp_path / "curves.json"
    assert main([f"a={run}", "--out", str(out)]) == 0
    assert set(json.loads(out.read_text())["runs"][0]) == {"name", "log"}


def test_facts_of_an_earlier_run_are_not_of_this_one(run, tmp_path):
    with (run / "log.jsonl").open("a") as log:
        log.write('{"epoch": 3, "reward": 0.75}\n')
    out = tmp_path / "curves.json"
    assert main([f"a={run}", "--out", str(out)]) == 0
    kept = json.loads(out.read_text())["runs"][0]
    assert set(kept) == {"name", "log"} and len(kept["log"]) == 3


@pytest.mark.parametrize("named", ["run", "=run", "name=", "name=nowhere"])
def test_what_is_no_run(named, tmp_path, capsys):
    out = tmp_path / "curves.json"
    assert main([named, "--out", str(out)]) == 1
    assert "expected NAME=FOLDER" in capsys.readouterr().err and not out.exists()


@pytest.mark.parametrize(
    "log",
    [
        "{half",
        "",
        "5\n",
        "[1]\n",
        "[" * 100_000,
        '{"reward": 1}\n',
        '{"epoch": 2}\n{"epoch": 1}\n',
        '{"epoch": NaN}\n',
    ],
)
def test_a_damaged_log(run, tmp_path, capsys, log):
    (run / "log.jsonl").write_text(log)
    assert main([f"a={run}", "--out", str(tmp_path / "curves.json")]) == 1
    assert "damaged" in capsys.readouterr().err


@pytest.mark.parametrize("facts", ["{half", "{}", "[]", "null"])
def test_damaged_facts(run, tmp_path, capsys, facts):
    (run / "csgnet_reinforce.json").write_text(facts)
    assert main([f"a={run}", "--out", str(tmp_path / "curves.json")]) == 1
    assert "damaged" in capsys.readouterr().err


def test_two_runs_of_one_name(run, tmp_path, capsys):
    assert main([f"a={run}", f"a={run}", "--out", str(tmp_path / "curves.json")]) == 1
    assert "two runs of one name" in capsys.readouterr().err
