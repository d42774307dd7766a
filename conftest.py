"""What every test run shares. It imports nothing from lib: the shape checks must be switched on first."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parent
os.environ["PYTHONPATH"] = str(ROOT)  # notebooks start in notebooks/; lib/ is one level up


def pytest_collectstart(collector):
    if hasattr(collector, "skip_compare"):  # a notebook, collected by nbval
        collector.skip_compare += ("stderr", "text/html")  # progress bars, warnings; styled tables


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item):
    """Notebooks are compared on the embedded data, as they are committed, whatever data/ holds."""
    if item.path.suffix != ".ipynb":
        return (yield)
    with pytest.MonkeyPatch.context() as patch:  # the notebook's kernel starts here and inherits this
        patch.setenv("SHAPE_PROGRAMS_DATA", str(ROOT / "build" / "no-data"))
        return (yield)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder with reference data that is not in the repository; tests that need it are skipped without it."""
    folder = Path(os.environ.get("SHAPE_PROGRAMS_SHARED") or ROOT.parent / "shared")
    if not folder.is_dir():
        pytest.skip(f"no reference data in {folder}; SHAPE_PROGRAMS_SHARED can name another folder")
    return folder
