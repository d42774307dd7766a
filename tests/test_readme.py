"""The README's program runs as printed, and its picture is what it draws."""

import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from lib.interpreters.shapeassembly import execute
from lib.viewing.figure import show

README = Path(__file__).parents[1] / "README.md"
PICTURE = README.parent / "notebooks" / "figures" / "stool.png"


def readme_program():
    """The program of the first code block of the README, by running that block."""
    code = re.search(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.S)[1]
    names: dict = {}
    exec(code, names)  # our own README
    return names["stool"]


def draw(path: Path) -> None:
    """Make the README's picture."""
    show(execute(readme_program()), size=3.4).savefig(path)


def test_the_readme_program_draws_its_picture(tmp_path):
    assert len(execute(readme_program()).cuboids) == 5
    draw(tmp_path / "stool.png")
    new, committed = plt.imread(tmp_path / "stool.png"), plt.imread(PICTURE)
    assert new.shape == committed.shape
    assert np.abs(new - committed).mean() < 0.01  # fonts and rays may differ at a few pixels


def test_the_readme_names_every_notebook():
    text = README.read_text(encoding="utf-8")
    for notebook in (README.parent / "notebooks").glob("[0-9][0-9]_*.ipynb"):
        assert f"notebooks/{notebook.name}" in text
