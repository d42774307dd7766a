"""Is everything here that the notebooks need?   python -m data_scripts.check_env

Prints OK or FAIL for Python and for each package of pyproject.toml: version found, range needed, what to do.
Exits with 0 when all is well, else 1. A notebook calls `check_environment()` for the same rows.
"""

import importlib
import platform
import tomllib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"
IMPORTED_AS = {"libigl": "igl", "scikit-image": "skimage"}  # packages whose modules have another name


class Row(NamedTuple):
    """One checked thing. `advice` is empty when it is good."""

    package: str
    needed: str
    found: str
    ok: bool
    advice: str


def check_python(needed: str) -> Row:
    """Compare the running Python with a range such as ">=3.11"."""
    found = platform.python_version()
    ok = SpecifierSet(needed).contains(found, prereleases=True)
    return Row("python", needed, found, ok, "" if ok else f"needs {needed}: see the README's set-up")


def check_package(requirement: Requirement) -> Row:
    """Is the package installed, in range, and does it import? Never raises: problems are in `advice`."""
    name, needed = requirement.name, str(requirement.specifier)
    try:
        found = version(name)
    except PackageNotFoundError:
        return Row(name, needed, "-", False, "not installed: run make setup")
    if not requirement.specifier.contains(found, prereleases=True):
        return Row(name, needed, found, False, f"needs {needed}: run make setup")
    try:
        importlib.import_module(IMPORTED_AS.get(name, name.replace("-", "_")))
    except Exception as error:  # a broken package can raise anything while it is imported
        return Row(name, needed, found, False, f"installed, but does not import: {error}")
    return Row(name, needed, found, True, "")


def check_environment() -> list[Row]:
    """A row for Python and for each package the notebooks need on this machine, in pyproject.toml's order."""
    project = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]
    requirements = [Requirement(text) for text in project["dependencies"]]
    here = [each for each in requirements if each.marker is None or each.marker.evaluate()]
    return [check_python(project["requires-python"]), *map(check_package, here)]


def report(rows: list[Row]) -> int:
    """Print the rows; return the exit code: 0 when all are good."""
    for row in rows:
        verdict = "OK  " if row.ok else "FAIL"
        print(f"{verdict}  {row.package:<14} {row.found:<14} {row.advice or row.needed}")
    bad = sum(not row.ok for row in rows)
    print("everything is ready" if not bad else f"{bad} of {len(rows)} need attention")
    return 1 if bad else 0


if __name__ == "__main__":
    raise SystemExit(report(check_environment()))
