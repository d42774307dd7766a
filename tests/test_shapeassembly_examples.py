"""The project's own examples still give what was recorded of them, here and on every machine."""

import numpy as np
import pytest

from lib.datasets import examples
from tests.goldens.record import GOLDENS, measure

RECORD_AGAIN = "if that is intended: python -m tests.goldens.record"


@pytest.fixture(scope="module")
def recorded() -> dict[str, dict[str, np.ndarray]]:
    """recorded["stool"]["size"]"""
    with np.load(GOLDENS) as file:
        arrays = dict(file)
    leaves, numbers = (np.cumsum(arrays[name])[:-1] for name in ("leaves", "numbers"))
    parts = {name: np.split(arrays[name], leaves) for name in ("size", "center", "axes")}
    parts["gradient"] = np.split(arrays["gradient"], numbers)
    return {str(name): {part: parts[part][i] for part in parts} for i, name in enumerate(arrays["name"])}


def test_every_example_is_recorded(recorded):
    assert list(recorded) == list(examples()), RECORD_AGAIN


@pytest.mark.parametrize("name", list(examples()))
def test_an_example_gives_what_was_recorded(recorded, name):
    """1e-9: float64 on another processor may sum in another order, which costs some 1e-15 an operation; gradients
    pass divisions by small gaps, so theirs is relative."""
    found = measure(examples()[name])
    for part in ("size", "center", "axes"):
        np.testing.assert_allclose(found[part], recorded[name][part], rtol=0, atol=1e-9, err_msg=RECORD_AGAIN)
    np.testing.assert_allclose(found["gradient"], recorded[name]["gradient"], rtol=1e-6, atol=1e-9)
