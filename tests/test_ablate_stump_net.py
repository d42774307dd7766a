"""The ablation of CSG-Stump Net: rows are what the runs logged, a choice changes what is trained, runs are reused."""

import json

import pytest

from data_scripts import ablate_stump_net
from data_scripts.ablate_stump_net import means
from tests.conftest import unchecked

CHOICES = {"default": "", "boxes only": "--kinds box"}


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """The folder of a quick ablation of two choices and one seed, and what it wrote."""
    folder = tmp_path_factory.mktemp("ablation")
    with pytest.MonkeyPatch.context() as patch, unchecked():
        patch.setattr(ablate_stump_net, "CHOICES", CHOICES)
        assert main(folder) == 0
    return folder, json.loads((folder / "found.json").read_text())


def main(folder, *options):
    there = ["--source", "embedded", "--runs", str(folder / "runs"), "--out", str(folder / "found.json")]
    return ablate_stump_net.main(["--quick", *there, *options])


def test_rows_are_what_the_runs_logged(quick):
    folder, found = quick
    assert list(found["rows"]) == list(CHOICES) and "embedded" in found["data"]
    for name, row in found["rows"].items():
        (run,) = row["runs"]
        place = folder / "runs" / "quick" / f"{name.replace(' ', '-')}-0"
        logged = json.loads((place / "log.jsonl").read_text())
        assert run["seed"] == 0 and run["decided_iou"] == pytest.approx(100 * logged["val_iou"], abs=1e-4)
        facts = json.loads((place / "stump_net.json").read_text())
        assert row["weights"] == facts["weights"] and run["commit"] == facts["code"]["commit"]


def test_a_choice_changes_what_is_trained(quick):
    folder, found = quick
    default, boxes = found["rows"].values()
    assert default["decided"] != boxes["decided"]
    facts = json.loads((folder / "runs" / "quick" / "boxes-only-0" / "stump_net.json").read_text())
    assert facts["settings"]["network"]["kinds"] == ["box"]


def test_finished_runs_are_not_trained_again(quick, monkeypatch, tmp_path):
    folder, found = quick
    monkeypatch.setattr(ablate_stump_net, "CHOICES", CHOICES)
    before = {path: path.stat().st_mtime_ns for path in folder.glob("runs/quick/*/checkpoint.safetensors")}
    assert main(folder, "--out", str(tmp_path / "again.json")) == 0
    again = json.loads((tmp_path / "again.json").read_text())
    assert again["rows"] == found["rows"]
    assert before == {path: path.stat().st_mtime_ns for path in before} and len(before) == len(CHOICES)


def test_means_over_seeds():
    runs = [{"soft_iou": 60.0, "decided_iou": 50.0}, {"soft_iou": 80.0, "decided_iou": 62.0}]
    assert means(runs) == pytest.approx({"soft": 70, "decided": 56, "lost": 20, "spread": 12})


def test_all_choices_are_options_that_the_training_takes():
    """Each differs from the others in what it makes of the network or of the lesson."""
    from lib.training import stump_net_command
    from lib.training.commands import _parser

    parser, made = _parser({"stump_net": stump_net_command.COMMAND}), []
    for options in ablate_stump_net.CHOICES.values():
        parsed = parser.parse_args(["stump_net", *options.split()])
        for setting in stump_net_command.SETTINGS:
            if getattr(parsed, setting.name) is None:
                setattr(parsed, setting.name, setting.ours)
        made.append((stump_net_command._config(parsed), stump_net_command._lesson(parsed)))
    assert len(set(made)) == len(made)


def test_a_training_that_cannot_end_leaves_no_table(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(ablate_stump_net, "CHOICES", {"too dull": "--dullest 0"})
    assert main(tmp_path) == 1
    assert "dullest" in capsys.readouterr().err and not (tmp_path / "found.json").exists()


def test_clouds_that_were_not_made(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "none"))
    assert main(tmp_path, "--source", "csg") == 1
    assert "make_solids --source csg" in capsys.readouterr().err


def test_stopped_with_ctrl_c(tmp_path, monkeypatch):
    monkeypatch.setattr(ablate_stump_net, "train", lambda commands, arguments: 130)
    assert main(tmp_path) == 130 and not (tmp_path / "found.json").exists()
