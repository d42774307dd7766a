"""`make setup` on machines that are not ready: each says in one line what to do. Pythons here are small pretenders."""

import os
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from data_scripts import set_up

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="there is no make here")


def make_setup(folder, pythons, **environment):
    """Run `make setup` in a copy of the repository's bones where only `pythons` {name: shell script} exist."""
    tools = folder / "bin"
    tools.mkdir()
    shutil.copy(ROOT / "Makefile", folder)
    shutil.copy(ROOT / "pyproject.toml", folder)
    for name, script in pythons.items():
        (tools / name).write_text(f"#!/bin/sh\n{script}\n")
        (tools / name).chmod(0o755)
    make, environment = shutil.which("make"), {"PATH": str(tools), **environment}
    return subprocess.run([make, "setup"], cwd=folder, env=environment, capture_output=True, text=True)


def pretend(version, new_enough, sets_up=0):
    """A Python that answers the Makefile's two questions, and ends set_up.py with the exit code `sets_up`."""
    return f"""case "$2" in
        *python_version*) echo {version};;
        *version_info*) exit {0 if new_enough else 1};;
        *) [ "$1" = data_scripts/set_up.py ] && echo "set up by {version}"; exit {sets_up};;
    esac"""


def test_a_python_that_is_too_old(tmp_path):
    result = make_setup(
        tmp_path, {"python3": pretend("3.8.18", False), "python3.11": pretend("3.10.1", False)}
    )
    assert result.returncode != 0
    first_line = result.stderr.splitlines()[0]
    assert "3.11 or newer is needed" in first_line and "python3 is 3.8.18" in first_line
    assert "python3.11 is 3.10.1" in first_line and "make setup PYTHON=" in first_line


def test_no_python_at_all(tmp_path):
    result = make_setup(tmp_path, {})
    assert result.returncode != 0 and "no Python was found" in result.stderr.splitlines()[0]


def test_a_newer_python_beside_an_old_one_is_taken(tmp_path):
    result = make_setup(
        tmp_path, {"python3": pretend("3.8.18", False), "python3.12": pretend("3.12.1", True)}
    )
    assert result.returncode == 0 and "set up by 3.12.1" in result.stdout


def test_the_named_python_comes_first(tmp_path):
    pythons = {"python3": pretend("3.11.0", True), "mine": pretend("3.13.0", True)}
    assert "set up by 3.13.0" in make_setup(tmp_path, pythons, PYTHON="mine").stdout


def test_a_set_up_that_fails_says_that_it_repairs_itself(tmp_path):
    result = make_setup(tmp_path, {"python3": pretend("3.11.0", True, sets_up=1)})
    assert result.returncode != 0 and "Set-up did not finish" in result.stderr.splitlines()[0]


def test_the_range_of_torch_is_that_of_pyproject():
    dependencies = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    assert set_up.torch_requirement() in dependencies


def test_no_gpu_answers_where_there_is_no_driver(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert not set_up.gpu_answers()


@pytest.mark.parametrize("exit_code, answer", [(0, True), (9, False)])
def test_a_gpu_answers_when_its_tool_works(monkeypatch, tmp_path, exit_code, answer):
    tool = tmp_path / "nvidia-smi"
    tool.write_text(f"#!/bin/sh\nexit {exit_code}\n")
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path) + os.pathsep + "/bin")
    assert set_up.gpu_answers() is answer


def test_a_broken_environment_is_made_anew(monkeypatch, tmp_path):
    broken = tmp_path / ".venv"
    (broken / "bin").mkdir(parents=True)
    (broken / "bin" / "python").symlink_to(tmp_path / "gone")
    (broken / "old").touch()
    monkeypatch.setattr(set_up, "VENV", broken)
    monkeypatch.setattr(set_up, "PYTHON", broken / "bin" / "python")
    monkeypatch.setattr(set_up, "UNFINISHED", broken / ".set-up-unfinished")
    set_up.make_venv()
    assert set_up.works(broken / "bin" / "python") and not (broken / "old").exists()
