"""The stump widget without a browser: cells, stump and text say the same, and every change can be taken back."""

import numpy as np
import pytest
import torch

from lib.interpreters.stump import Circle, HalfPlane, ProgramError, Stump, parse
from lib.viewing.stump_pictures import pictures_of
from lib.viewing.stump_widget import RESOLUTION, StumpWidget

TEXT = """F1 = square(half=(0.5, 0.3))
F2 = not circle(radius=0.15)
S1 = F1 & F2
S2 = F1
T = S1
"""


@pytest.fixture
def widget():
    return StumpWidget(TEXT)


def test_it_starts_as_it_was_given(widget):
    assert widget.stump == parse(TEXT) and widget.text == parse(TEXT).to_text()
    assert widget.cells == "01" + "11" + "10" + "10"
    assert widget.names == [
        "not F1", "not F2", "F1 in S1", "F1 in S2", "F2 in S1", "F2 in S2", "S1 in T", "S2 in T",
    ]  # fmt: skip
    assert StumpWidget(parse(TEXT)).cells == widget.cells
    assert repr(widget) == "StumpWidget(Stump(2 primitives, 2 nodes, 1 united))"


@pytest.mark.parametrize(
    "name, old, new",
    [
        ("not F1", "F1 = square", "F1 = not square"),
        ("not F2", "F2 = not circle", "F2 = circle"),
        ("F2 in S2", "S2 = F1", "S2 = F1 & F2"),
        ("F1 in S2", "S2 = F1", "S2 = everything"),
        ("S2 in T", "T = S1", "T = S1 | S2"),
        ("S1 in T", "T = S1", "T = nothing"),
    ],
)
def test_a_cell_is_a_word_of_the_text(widget, name, old, new):
    widget.toggle(name)
    assert widget.text == TEXT.replace(old, new) and widget.stump == parse(widget.text)
    widget.toggle(name)
    assert widget.stump == parse(TEXT) and len(widget.past) == 2


def test_cells_from_the_page_change_the_stump(widget):
    seen = []
    widget.observe(seen.append, "stump")
    widget.set_state({"cells": "01111010", "past": [widget.cells]})  # as the browser does
    assert widget.text == TEXT and not seen  # nothing new
    widget.set_state({"cells": "00111010", "past": [widget.cells]})
    assert len(seen) == 1 and seen[0].new is widget.stump
    assert not widget.stump.complement.any() and "not" not in widget.text


def test_undo_and_reset(widget):
    with pytest.raises(ValueError, match="nothing to undo"):
        widget.undo()
    widget.toggle("F2 in S1")
    widget.toggle("S2 in T")
    widget.reset()
    assert widget.text == TEXT
    widget.reset()  # changes nothing, and is nothing to undo
    for expected in (
        TEXT.replace("F1 & F2", "F1").replace("T = S1", "T = S1 | S2"),
        TEXT.replace("F1 & F2", "F1"),
        TEXT,
    ):
        widget.undo()
        assert widget.text == expected
    assert not widget.past


def test_another_stump_begins_anew(widget):
    widget.toggle("S2 in T")
    other = parse("F1 = circle(radius=1.0)\nS1 = F1\nT = S1\n")
    widget.stump = other
    assert widget.cells == "011" and widget.past == [] and widget.board["columns"] == 1
    assert len(widget.inside) == RESOLUTION**2 // 8 and widget.text == other.to_text()
    widget.toggle("not F1")
    widget.reset()
    assert widget.stump == other


def test_the_same_matrices_with_other_primitives_are_loaded(widget):
    before = widget.inside
    widget.stump = parse(TEXT.replace("0.15", "0.2"))
    assert widget.inside != before and "radius=0.2" in widget.text
    assert "radius=0.2" in widget.board["rows"][1]["title"]


def test_the_same_primitives_with_other_matrices_are_loaded(widget):
    widget.toggle("S2 in T")
    widget.stump = Stump(widget.stump.primitives, [1, 1], torch.ones(2, 3), [1, 0, 0])
    assert widget.cells == "11" + "111" * 2 + "100" and widget.past == [] and widget.board["columns"] == 3


def test_the_page_gets_the_pictures_of_the_primitives(widget):
    bits = np.unpackbits(np.frombuffer(widget.inside, np.uint8), bitorder="little").astype(bool)
    pictures = pictures_of(widget.stump, RESOLUTION).primitives
    assert (bits.reshape(pictures.shape) == pictures).all()
    assert [row["name"] for row in widget.board["rows"]] == ["square", "circle"]
    closer = StumpWidget(TEXT, window=[[-0.1, -0.1], [0.1, 0.1]])
    assert set(closer.inside) == {255}


def test_a_still_picture_of_the_same(widget):
    widget.toggle("F2 in S2")
    assert "S2" in [text.get_text() for text in widget.figure().axes[0].texts]


@pytest.mark.parametrize("name", ["F3 in S1", "not F0", "T", "", "F1 in T", "S1", 7, None])
@pytest.mark.usefixtures("unchecked_shapes")
def test_an_unknown_cell_is_named(widget, name):
    with pytest.raises(ValueError, match="there is no cell .*expected one such as 'not F1'"):
        widget.toggle(name)
    assert widget.text == TEXT


@pytest.mark.parametrize("cells", ["", "0", "01111010x"[:7] + "2", "0" * 9])
def test_bad_cells_are_refused(widget, cells):
    with pytest.raises(ValueError, match="found cells .*expected 8 of 0 and 1"):
        widget.cells = cells
    assert widget.text == TEXT and widget.cells == "01111010"


def test_a_text_sets_the_stump(widget):
    widget.toggle("F2 in S2")
    other = TEXT.replace("0.15", "0.25")
    widget.text = other.replace("0.25", "2.5e-1")
    assert widget.text == other and widget.stump == parse(other)
    assert widget.past == [] and widget.cells == "01111010"


@pytest.mark.parametrize(
    "text, error, said",
    [("rubbish", ProgramError, "rubbish"), ("F1 = sphere(radius=1)\nT = nothing", ValueError, "of space")],
)
def test_a_bad_text_is_refused(widget, text, error, said):
    stump = widget.stump
    with pytest.raises(error, match=said):
        widget.text = text
    assert widget.text == TEXT and widget.stump is stump


@pytest.mark.usefixtures("unchecked_shapes")
def test_what_cannot_be_shown_is_refused():
    with pytest.raises(ProgramError, match="the text ends"):
        StumpWidget("F1 = circle(radius=1)")
    with pytest.raises(TypeError, match="found a int; expected a Stump or its text"):
        StumpWidget(7)
    with pytest.raises(ValueError, match="stump of space"):
        StumpWidget("F1 = sphere(radius=1)\nT = nothing")
    with pytest.raises(ValueError, match="found 1 primitives and 13 nodes; expected at most 12"):
        StumpWidget(Stump([HalfPlane()], [0], torch.zeros(1, 13), [0] * 13))


def test_a_stump_without_nodes_is_shown():
    widget = StumpWidget(Stump([Circle(1.0)], [0], torch.zeros(1, 0), []))
    assert widget.names == ["not F1"] and widget.text.endswith("T = nothing\n")
    widget.toggle("not F1")
    assert widget.stump.complement.all()
