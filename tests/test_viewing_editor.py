"""The program editor without a browser: text, sliders and shape say the same thing, errors leave the shape alone."""

import numpy as np
import pytest

from lib.interpreters.shapeassembly import ProgramError, execute, parse
from lib.viewing.editor import ProgramEditor, describe_error
from lib.viewing.naming import knobs, places, write_number
from lib.viewing.scene import ShapeView, box_buffer

STOOL = """# a stool
Assembly Program_0 {
	bbox = Cuboid(1.0, 1.2, 1.0, True)
	cube0 = Cuboid(0.9, .1, 0.9, True)  # the seat (0.9, 0.9)
	cube1 = Cuboid( 0.1, 6e-1 , 0.1, False)
	attach(cube0, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5)
	squeeze(cube1, bbox, cube0, bot, 0.1, 0.1)
	reflect(cube1, X)
	translate(cube1, Z, 1, 0.8)
}
"""
SEAT = "Program_0:1:Cuboid:1"  # its height


@pytest.fixture
def editor() -> ProgramEditor:
    return ProgramEditor(STOOL)


def slider(editor, name):
    return editor._sliders[name]


def test_every_parameter_has_a_slider_with_a_readable_label(editor):
    assert tuple(editor._sliders) == editor.program.parameter_names()
    labels = {name: s.description for name, s in editor._sliders.items()}
    assert labels[SEAT] == "cube0 height"
    assert labels["Program_0:3:attach:4"] == "attach cube0→bbox: y on bbox"
    assert labels["Program_0:4:squeeze:1"] == "squeeze cube1: v"
    assert labels["Program_0:6:translate:0"] == "translate cube1: distance"
    assert slider(editor, SEAT).tooltip == SEAT


def test_ranges_hold_the_value_they_start_from():
    found = knobs(parse(STOOL.replace("1.2, 1.0, True", "1.2, 7.0, True").replace("0.1, 0.1)", "0.1, -0.3)")))
    by_name = {knob.name: (knob.low, knob.high) for knob in found}
    assert by_name["Program_0:0:Cuboid:2"] == (0.01, 14.0)
    assert by_name["Program_0:4:squeeze:1"] == (-0.3, 1.0)
    assert by_name[SEAT] == (0.01, 2.0)


def test_places_find_each_parameter_in_the_text():
    found = [float(STOOL[start:end]) for start, end in places(STOOL)]
    assert found == parse(STOOL).parameters().tolist()


def test_a_number_is_rewritten_and_nothing_else():
    index = parse(STOOL).parameter_names().index(SEAT)
    assert write_number(STOOL, index, 0.25) == STOOL.replace("0.9, .1, 0.9", "0.9, 0.25, 0.9")
    assert "e" not in write_number("Cuboid(1, 1, 1)", 0, 1e-9).partition("(")[2]


def test_a_slider_moves_text_and_shape(editor):
    slider(editor, SEAT).value = 0.4
    assert "Cuboid(0.9, 0.4, 0.9, True)  # the seat" in editor.text
    assert editor.shape.cuboids.size[0, 1] == pytest.approx(0.4)
    assert editor.view.boxes == box_buffer(editor.shape)


def test_a_slider_that_snaps_to_its_steps_changes_nothing(editor):
    """The browser does so when it shows a slider; taking it for a wish would be a loop, and change the program."""
    editor.set_parameter(SEAT, 0.1234)
    text = editor.text
    for echo in (0.123, 0.12300000000000001, 0.1235):
        slider(editor, SEAT).value = echo
    assert editor.text == text
    slider(editor, SEAT).value = 0.124
    assert editor.program.parameters()[4] == 0.124


@pytest.mark.parametrize("end", ["min", "max"])
def test_a_slider_may_go_to_both_ends(editor, end):
    slider(editor, SEAT).value = getattr(slider(editor, SEAT), end)
    assert editor.error is None


def test_the_text_moves_sliders_and_shape(editor):
    editor._text.value = STOOL.replace("0.9, .1, 0.9", "0.9, 3.5, 0.9")
    assert slider(editor, SEAT).value == 3.5 and slider(editor, SEAT).max >= 3.5
    assert editor.shape.cuboids.size[0, 1] == 3.5


def test_another_structure_brings_other_sliders(editor):
    editor.set_text(STOOL.replace("\treflect(cube1, X)\n", "\tattach(cube1, bbox, 0, 0, 0, 0, 0, 0)\n"))
    assert tuple(editor._sliders) == editor.program.parameter_names()
    name = editor.program.parameter_names()[-1]
    editor.set_parameter(name, 0.5)
    assert editor.program.parameters()[-1] == 0.5


def test_an_error_shows_its_place_and_the_last_shape_stays(editor):
    before, view = editor.shape, editor.view.boxes
    editor.set_text(STOOL.replace("squeeze(cube1, bbox", "squeeze(cube1, box"))
    assert (editor.error.line, editor.error.column, editor.error.token) == (7, 17, "box")
    assert editor.shape is before and editor.view.boxes == view
    assert "line 7, column 17" in editor._error.value
    assert slider(editor, SEAT).disabled
    with pytest.raises(ValueError, match="repair that first"):
        editor.set_parameter(SEAT, 0.3)
    editor.set_text(STOOL)
    assert editor.error is None and editor._error.value == "" and not slider(editor, SEAT).disabled


def test_the_caret_stands_under_the_token():
    text = STOOL.replace("squeeze(cube1, bbox", "squeeze(cube1, box")
    with pytest.raises(ProgramError) as error:
        parse(text)
    *_, line, caret = describe_error(error.value, text).splitlines()
    assert line[caret.index("^") : caret.rindex("^") + 1] == "box"


def test_messages_cannot_smuggle_html(editor):
    editor.set_text(STOOL.replace("cube1, X", "<img src=x onerror=alert(1)>, X"))
    assert editor.error and "<img" not in editor._error.value


def test_an_unknown_parameter_is_named(editor):
    with pytest.raises(KeyError, match="no parameter"):
        editor.set_parameter("Program_9:0:Cuboid:0", 1.0)


def test_an_editor_needs_a_program_to_start_from():
    with pytest.raises(ProgramError):
        ProgramEditor("Assembly Program_0 {")


def test_the_buffer_holds_boxes_and_colours():
    shape = execute(parse(STOOL))
    rows = np.frombuffer(box_buffer(shape), dtype="<f4").reshape(-1, 18)
    assert len(rows) == len(shape.names)
    assert rows[:, :3] == pytest.approx(shape.cuboids.size.numpy())
    assert rows[:, 3:6] == pytest.approx(shape.cuboids.center.numpy())
    assert rows[:, 6:15].reshape(-1, 3, 3) == pytest.approx(shape.cuboids.axes.numpy())
    assert rows[:, 15:] * 255 == pytest.approx(shape.colors, abs=1e-4)  # float32


def test_a_widget_has_a_still_picture(editor):
    for widget in (editor, ShapeView(editor.shape), ShapeView()):
        assert len(widget.figure().axes) == 1


def test_a_view_sends_what_the_browser_shall_save(editor, monkeypatch):
    sent = []
    monkeypatch.setattr(
        editor.view, "send", lambda content, buffers: sent.append((content["download"], buffers[0]))
    )
    saves = editor.children[1].children[1].children[1].children
    for button in saves:
        button.click()
    assert [name for name, _ in sent] == ["shape.glb", "shape.obj", "program.txt"]
    assert sent[2][1].decode() == editor.program.to_text()
