"""What several test files share: the authors' programs, sampled programs, and a clock that stops a hang."""

import signal
import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

import jaxtyping
import numpy as np
import pytest
import torch

from lib.datasets import CATEGORIES, examples


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    """Small tensors run slower on several threads, and sums come in the same order everywhere."""
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def real_texts(shared) -> dict[str, dict[str, str]]:
    """The authors' programs: real_texts["chair"]["43875"] is a text. Skipped where the archive is not at hand."""
    return read_programs(shared / "data" / "shapeassembly-programs.tar.xz")


def read_programs(archive: Path) -> dict[str, dict[str, str]]:
    """Program texts by category and number, read from the archive without unpacking it."""
    if not archive.is_file():
        pytest.skip(f"no {archive}; SHAPE_PROGRAMS_SHARED can name another folder with reference data")
    texts = {category: {} for category in CATEGORIES}
    with tarfile.open(archive) as members:
        for member in members:
            path = PurePosixPath(member.name)
            if path.suffix == ".txt" and path.parent.parent.name == "data" and path.parent.name in texts:
                texts[path.parent.name][path.stem] = members.extractfile(member).read().decode()
    return texts


@pytest.fixture(scope="session")
def recorded(shared):
    """recorded("csg_2d"): arrays that the authors' programs gave, of one file. Skipped where it is not at hand."""

    def load(name: str) -> dict[str, np.ndarray]:
        path = shared / "goldens" / f"{name}.npz"
        if not path.is_file():
            pytest.skip(f"no {path}; SHAPE_PROGRAMS_SHARED can name another folder with reference data")
        with np.load(path) as arrays:
            return dict(arrays)

    return load


@pytest.fixture(scope="session")
def sampled() -> list:
    """Sixty random programs with all five statements and up to three levels."""
    from lib.interpreters.shapeassembly import sample

    rng = np.random.default_rng(7)
    return [sample(rng) for _ in range(60)]


@pytest.fixture(scope="session")
def programs(sampled) -> list:
    """The random programs and the project's hand-written examples."""
    return [*sampled, *examples().values()]


@pytest.fixture(scope="session")
def time_limit():
    """`with time_limit(2): …` fails what takes longer than two seconds, instead of hanging with it."""
    if not hasattr(signal, "setitimer"):
        pytest.skip("this system cannot interrupt a test that hangs")
    return _time_limit


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    def stop(*_):
        raise TimeoutError(f"still running after {seconds} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture
def unchecked_shapes():
    """Switches the shape checks of lib off for one test: thousands of programs, for which others check them."""
    with unchecked():
        yield


@contextmanager
def unchecked() -> Iterator[None]:
    """No shape checks for a while. Functions within functions, which are made anew at every call, are not prepared for
    checks either."""
    disabled, prepare = jaxtyping.config.jaxtyping_disable, jaxtyping.jaxtyped
    jaxtyping.config.update("jaxtyping_disable", True)
    jaxtyping.jaxtyped = lambda *_, **__: lambda function: function
    try:
        yield
    finally:
        jaxtyping.jaxtyped = prepare
        jaxtyping.config.update("jaxtyping_disable", disabled)
