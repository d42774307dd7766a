"""Make .venv ready. `make setup` runs this file with the first Python >= 3.11 it finds; standard library only.

1. a virtual environment in .venv      a broken or half-made one is made anew
2. torch                               a CPU build where no NVIDIA GPU answers, so no gigabytes of CUDA come along
3. this project and its tools          `pip install -e .[dev]`; pyproject.toml holds the ranges

With SYSTEM_PACKAGES=1 in the environment .venv also sees the packages of the Python it is made from: a torch with
CUDA that is installed there, and in range, is used as it is. A mark inside .venv says that a set-up is under way;
one that was killed leaves it behind, and the next run starts afresh.
"""

import importlib.util
import os
import shutil
import subprocess
import sys
import time
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
VENV = ROOT / ".venv"
PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
UNFINISHED = VENV / ".set-up-unfinished"
COMPLETE = VENV / ".set-up-complete"  # the Makefile compares its age with pyproject.toml's
CPU_INDEX = "https://download.pytorch.org/whl/cpu"


class SetUpError(RuntimeError):
    """Set-up cannot go on; the message says why in one line."""


def torch_requirement() -> str:
    """The range of torch, as pyproject.toml gives it: "torch>=...,<..."."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return next(text for text in project["dependencies"] if text.startswith("torch>"))


def gpu_answers() -> bool:
    """Does a working NVIDIA driver see a GPU?"""
    try:
        return subprocess.run(["nvidia-smi", "-L"], capture_output=True, timeout=30).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False


def works(python: Path) -> bool:
    """Does this interpreter start, is it new enough, and does it have pip?"""
    check = "import sys, pip; sys.exit(sys.version_info < (3, 11))"
    try:
        return subprocess.run([python, "-c", check], capture_output=True).returncode == 0
    except OSError:
        return False


def pip_install(*arguments: str) -> bool:
    """Run pip inside .venv, printing only errors; True when it succeeded."""
    # Away from the repository, whose build leftovers pip would take for an installed project.
    elsewhere = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [PYTHON, "-m", "pip", "install", "-qq", *arguments]
    return subprocess.run(command, cwd=VENV, env=elsewhere).returncode == 0


def make_venv() -> None:
    """Create .venv, unless a whole one stands there already."""
    if works(PYTHON) and not UNFINISHED.exists():
        return
    if os.path.lexists(VENV):
        print("  the .venv found is broken or half made: making it anew", flush=True)
        VENV.unlink() if VENV.is_symlink() or VENV.is_file() else shutil.rmtree(VENV)
    if importlib.util.find_spec("ensurepip") is None:
        raise SetUpError(
            f"{sys.executable} has no ensurepip module; on Debian or Ubuntu: apt install python3-venv"
        )
    shared = os.environ.get("SYSTEM_PACKAGES") == "1"
    VENV.mkdir()
    UNFINISHED.touch()
    venv.create(VENV, with_pip=True, symlinks=os.name != "nt", system_site_packages=shared)


def install_torch() -> None:
    """Install torch: the default build beside a GPU, else a CPU build if its index can be reached."""
    requirement = torch_requirement()
    # No retries: where the index cannot be reached, pip goes on with the others at once.
    cpu_build = ["--extra-index-url", CPU_INDEX, "--retries", "0", "--timeout", "15"]
    if not gpu_answers() and pip_install(requirement, *cpu_build):
        return
    if not pip_install(requirement):
        raise SetUpError(f"pip could not install {requirement}")


def set_up() -> None:
    """All three steps; leaves the stamp only when every one is done."""
    started = time.monotonic()
    print(f"Setting up .venv with Python {sys.version.split()[0]}; a few minutes the first time.", flush=True)
    make_venv()
    UNFINISHED.touch()
    COMPLETE.unlink(missing_ok=True)
    print("  1/2 torch: about 200 MB on a CPU, gigabytes beside a GPU", flush=True)
    install_torch()
    print("  2/2 Jupyter, plotting, testing, and this project itself", flush=True)
    if not pip_install("-e", f"{ROOT}[dev]"):
        raise SetUpError("pip could not install this project's dependencies")
    if subprocess.run([PYTHON, "-c", "import torch, lib"], cwd=ROOT).returncode:
        raise SetUpError("torch was installed but does not import")
    COMPLETE.touch()
    UNFINISHED.unlink()
    print(f"Set up in {time.monotonic() - started:.0f} s.", flush=True)


if __name__ == "__main__":
    try:
        set_up()
    except KeyboardInterrupt:
        raise SystemExit("interrupted") from None
    except (SetUpError, OSError, subprocess.CalledProcessError) as error:
        raise SystemExit(f"Set-up stopped: {error}") from None
