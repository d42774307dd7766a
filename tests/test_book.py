"""`make run`: the book holds every chapter and figure, reads without a network, and survives a broken notebook."""

import re

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from lib.viewing import book

FIGURE = "import matplotlib.pyplot as plt\nplt.plot([1, 2, 4]);"
METADATA = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}


def write(folder, name, *code):
    opening = new_markdown_cell(
        f"# {name[:2]} · Title {name}\n\n**Question:** why {name}? The area is $a^2$."
    )
    cells = [opening, *map(new_code_cell, code)]
    nbformat.write(new_notebook(cells=cells, metadata=METADATA), folder / f"{name}.ipynb")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A book of a good, a failing and an unreadable notebook: its folder, its exit code, the notebooks' folder."""
    notebooks, folder = tmp_path_factory.mktemp("notebooks"), tmp_path_factory.mktemp("build") / "book"
    write(notebooks, "00_good", FIGURE, "import ipywidgets\nipywidgets.IntSlider()", "import lib")
    write(notebooks, "01_bad", "x = 1", "x / 0", "'never reached'")
    (notebooks / "02_torn.ipynb").write_text("{")
    before = {path: path.read_bytes() for path in notebooks.iterdir()}
    code = book.make_book(notebooks, folder)
    assert before == {path: path.read_bytes() for path in notebooks.iterdir()}, "a notebook was changed"
    return folder, code


def test_a_failure_is_told_and_the_others_still_run(made):
    folder, code = made
    assert code == 1
    assert "stopped at cell 3" in (folder / "01_bad.html").read_text()
    assert "ZeroDivisionError" in (folder / "01_bad.html").read_text()
    assert (folder / "index.html").read_text().count("failed") == 2


def test_the_index_has_title_question_and_every_figure(made):
    folder, _ = made
    index = (folder / "index.html").read_text()
    assert "Title 00_good" in index and "why 00_good?" in index
    figures = [path.name for path in (folder / "figures").iterdir()]
    assert figures and all(f"figures/{name}" in index for name in figures)
    assert all(f"figures/{name}" in (folder / "00_good.html").read_text() for name in figures)


def test_pages_load_nothing_from_the_network(made):
    folder, _ = made
    for page in folder.glob("*.html"):
        text = page.read_text()
        assert "<script" not in text
        assert re.findall(r"""(?:src|<link[^>]*href)=["']?(?:https?:)?//""", text) == []


def test_formulas_and_widgets_have_something_to_show(made):
    page = (made[0] / "00_good.html").read_text()
    assert "<math" in page and "$a^2$" not in page
    assert "live widget" in page


def test_no_notebook_is_a_clear_message(tmp_path, capsys):
    assert book.make_book(tmp_path, tmp_path / "book") == 1
    assert "no notebook" in capsys.readouterr().err
