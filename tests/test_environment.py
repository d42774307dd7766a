"""environment.yml carries the ranges of pyproject.toml, and the environment check can say no."""

import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

from data_scripts import check_env

ROOT = Path(__file__).parents[1]
CONDA_NAME = {"torch": "pytorch", "matplotlib": "matplotlib-base"}
FROM_PIP_ALONE = {"embreex", "latex2mathml", "libigl", "manifold3d", "rtree"}  # `-e .` installs these


def ranges(requirements):
    """Requirement strings -> {name: range}, e.g. {"numpy": "<3,>=2.0"}."""
    parsed = [Requirement(text) for text in requirements]
    return {requirement.name: str(requirement.specifier) for requirement in parsed}


@pytest.fixture
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


@pytest.fixture
def conda():
    return yaml.safe_load((ROOT / "environment.yml").read_text())["dependencies"]


def test_conda_has_the_ranges_of_pyproject(project, conda):
    wanted = ranges(project["dependencies"])
    wanted = {CONDA_NAME.get(name, name): text for name, text in wanted.items() if name not in FROM_PIP_ALONE}
    found = ranges(entry for entry in conda if isinstance(entry, str))
    assert found.pop("python") == project["requires-python"]
    assert found.pop("pip") == ""
    assert found == wanted


def test_conda_installs_lib_itself(conda):
    assert {"pip": ["-e ."]} in conda


def test_every_dependency_says_why():
    text = (ROOT / "pyproject.toml").read_text()
    entries = [
        line for line in text.splitlines() if line.startswith('    "') and (">=" in line or "==" in line)
    ]
    assert len(entries) > 20
    assert [line for line in entries if " # " not in line] == []


def test_this_environment_is_good():
    assert [row for row in check_env.check_environment() if not row.ok] == []


@pytest.mark.parametrize(
    "requirement, advice",
    [("numpy>=999", "needs >=999"), ("a-package-nobody-made>=1", "not installed")],
)
def test_a_bad_package_is_named(requirement, advice, capsys):
    row = check_env.check_package(Requirement(requirement))
    assert not row.ok and advice in row.advice
    assert check_env.report([row]) == 1
    assert "FAIL" in capsys.readouterr().out
