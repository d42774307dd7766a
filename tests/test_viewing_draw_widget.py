"""The canvas to draw on, without a browser: what is drawn is read and refined, and the page is told all of it."""

import time

import numpy as np
import pytest
import torch
from matplotlib.colors import to_hex

from lib.interpreters.csg import execute, parse
from lib.metrics.images import image_chamfer
from lib.models.csgnet import CSGNet, CSGNetConfig
from lib.models.pretrained import pretrained
from lib.models.weights import CheckpointError, load
from lib.viewing import draw_reading
from lib.viewing.canvas import COLORS, rim_of
from lib.viewing.draw_examples import example_drawings
from lib.viewing.draw_figures import reading_figure, show_reading
from lib.viewing.draw_reading import HINT, DrawingError, Reading, finished, improved, read
from lib.viewing.draw_widget import BYTES, DrawWidget, draw_a_shape

pytestmark = pytest.mark.usefixtures("unchecked_shapes")

NARROW = CSGNetConfig(2, 400, (4, 4), (4, 4), (4, 4), (1, 1), "batch", 8, 16, 0.5)  # untrained, and quick
HOUSE = example_drawings()["house"]


@pytest.fixture(scope="module")
def network() -> CSGNet:
    torch.manual_seed(0)
    return CSGNet(NARROW).eval()


@pytest.fixture
def widget(network) -> DrawWidget:
    return draw_a_shape(network)


def ask(widget, message, *buffers) -> None:
    """What the page sends."""
    widget._handle_custom_msg(message, list(buffers))


def bits(packed: bytes) -> np.ndarray:
    return np.unpackbits(np.frombuffer(packed, np.uint8), bitorder="little").reshape(-1, 64, 64).astype(bool)


def pack(image) -> memoryview:
    return memoryview(np.packbits(image, axis=1, bitorder="little").tobytes())


def agree(widget, image) -> None:
    """The page knows what Python knows, and it is true."""
    reading, view, pictures = widget.reading, widget.view, bits(widget.pictures)
    assert (pictures[0] == image).all() and (reading.image.numpy() == image).all()
    assert "".join(token["text"] for token in view["first"]) == str(reading.programs[0])
    assert "".join(token["text"] for token in view["tokens"]) == str(widget.program)
    assert list(view["distances"]) == list(reading.distances) and view["done"] == reading.done
    for program, picture in zip((reading.programs[0], widget.program), pictures[1:], strict=True):
        assert (execute(program).image.numpy() == picture).all()
    for program, distance in zip(reading.programs, reading.distances, strict=True):
        assert image_chamfer(torch.from_numpy(image), execute(program).image).item() == pytest.approx(
            distance
        )


def test_an_empty_drawing_says_what_to_do(widget):
    assert widget.reading is None and widget.program is None and widget.distance is None
    assert widget.view == {"number": 0, "message": HINT, "hint": True} and len(widget.pictures) == BYTES
    assert repr(widget) == "DrawWidget()"
    for action in (widget.improve, widget.figure):
        with pytest.raises(DrawingError, match="Draw a filled shape"):
            action()


def test_a_drawing_is_read_and_refined(widget):
    widget.draw(HOUSE)
    agree(widget, HOUSE)
    assert widget.reading.sweeps == 0 and widget.view["number"] == 1
    before = widget.distance
    assert widget.improve() and widget.distance < before
    agree(widget, HOUSE)
    while widget.improve():
        agree(widget, HOUSE)
    assert widget.view["done"]
    distances = widget.reading.distances
    assert all(later < earlier for earlier, later in zip(distances, distances[1:]))
    assert repr(widget) == f"DrawWidget({str(widget.program)!r})"


def test_a_reading_finishes_where_sweeps_end(network):
    steps = [read(network, HOUSE)]
    while not steps[-1].done:
        steps.append(improved(steps[-1]))
    assert finished(steps[0]).programs == steps[-1].programs and finished(steps[0]).done
    assert all(reading.programs == steps[-1].programs[: reading.sweeps + 1] for reading in steps)


def test_what_is_exact_is_not_refined():
    image = execute(parse("c(32,32,20)")).image
    near = Reading(image, (parse("c(33,32,20)"),), (0.7,))
    assert improved(near).done and improved(near).programs[-1] == parse("c(32,32,20)")


@pytest.mark.parametrize("picture", ["c(32,32,16)", execute(parse("c(32,32,16)")), parse("c(32,32,16)")])
def test_a_picture_may_be_a_text_a_shape_or_a_program(network, picture):
    widget = draw_a_shape(network, picture)
    agree(widget, execute(parse("c(32,32,16)")).image.numpy())


def test_the_page_draws_and_asks_for_sweeps(widget):
    ask(widget, {"do": "read", "number": 7}, pack(HOUSE))
    agree(widget, HOUSE)
    assert widget.view["number"] == 7
    ask(widget, {"do": "improve", "number": 7, "sweeps": 0})
    assert widget.reading.sweeps == 1
    before = widget.view
    for late in (
        {"number": 6, "sweeps": 1},
        {"number": 7, "sweeps": 0},
    ):  # another drawing; another page was quicker
        ask(widget, {"do": "improve"} | late)
        assert widget.view is before
    widget.draw(HOUSE)
    assert widget.view["number"] == 8, "Python's drawing has to be later than the page's"
    ask(widget, {"do": "read", "number": 9}, pack(np.zeros_like(HOUSE)))
    assert widget.view == {"number": 9, "message": HINT, "hint": True}
    ask(widget, {"do": "improve", "number": 9, "sweeps": 0})
    assert widget.view["message"] == HINT


@pytest.mark.parametrize(
    "message, buffers",
    [
        ({"do": "read", "number": 3}, []),
        ({"do": "read", "number": 3}, [memoryview(bytes(511))]),
        ({"do": "read", "number": "3"}, [memoryview(bytes(512))]),
        ({"do": "read"}, [memoryview(bytes(512))]),
        ({"do": "jump", "number": 3}, []),
        ({"do": "improve", "number": 1, "sweeps": None}, []),
        ("read", []),
        (None, []),
    ],
)
def test_other_messages_change_nothing(widget, message, buffers):
    widget.draw(HOUSE)
    before = widget.view
    ask(widget, message, *buffers)
    assert widget.view is before


def test_a_full_canvas_is_explained(widget):
    widget.draw(np.ones((64, 64), dtype=bool))
    assert "erase some of it" in widget.view["message"] and not widget.view["hint"]
    assert widget.reading is None and "tokens" not in widget.view


def test_a_failure_is_a_sentence(widget, monkeypatch):
    widget.draw(HOUSE)

    def fail(*_):
        raise RuntimeError("no memory")

    monkeypatch.setattr("lib.viewing.draw_widget.improved", fail)
    ask(widget, {"do": "improve", "number": 1, "sweeps": 0})
    assert widget.view["message"] == "This program could not be refined: no memory" and widget.reading is None
    monkeypatch.setattr("lib.viewing.draw_widget.read", fail)
    ask(widget, {"do": "read", "number": 2}, pack(HOUSE))
    assert widget.view["message"] == "This drawing could not be read: no memory"


@pytest.mark.parametrize(
    "image, error, said",
    [
        (np.zeros((32, 32), dtype=bool), ValueError, r"found an image \(32, 32\); expected \(64, 64\)"),
        (np.full((64, 64), 0.5), ValueError, "expected image"),
        ("c(32,32,", ValueError, "not closed"),
        (7, TypeError, "cannot draw a int"),
        ("sp(32,32,32,16)", TypeError, "in space"),
    ],
)
def test_what_is_no_drawing_is_refused(widget, image, error, said):
    widget.draw(HOUSE)
    with pytest.raises(error, match=said):
        widget.draw(image)
    agree(widget, HOUSE)


def test_another_network_is_refused():
    with pytest.raises(TypeError, match="found a NoneType; expected a CSGNet"):
        draw_a_shape(None)
    config = CSGNetConfig(3, 6635, (2,), (4,), (4,), (4,), "none", 2, 2, 0.0)
    with pytest.raises(ValueError, match="of space with 6635 tokens; expected one of the plane with 400"):
        draw_a_shape(CSGNet(config))


def test_a_network_in_training_stays_as_it_was(network):
    torch.manual_seed(0)
    other = CSGNet(NARROW)
    other.train()
    statistics = {name: value.clone() for name, value in other.state_dict().items()}
    found, expected = read(other, HOUSE), read(network, HOUSE)  # the same weights: dropout was off
    assert (found.programs, found.distances) == (expected.programs, expected.distances)
    assert other.training
    assert all(torch.equal(value, statistics[name]) for name, value in other.state_dict().items())


def test_tokens_have_the_rim_of_their_primitives(network, monkeypatch):
    programs = (parse("s(32,32,20)c(32,32,8)t(32,32,8)--"),)
    reading = Reading(torch.from_numpy(HOUSE), programs, (3.0,))
    monkeypatch.setattr("lib.viewing.draw_widget.read", lambda *_: reading)
    tokens = draw_a_shape(network, HOUSE).view["tokens"]
    assert [token.get("kind") for token in tokens] == ["s", "c", "t", None, None]
    assert [token["cut"] for token in tokens[:3]] == [False, True, False]
    assert [token["name"] for token in tokens[:3]] == ["square", "circle", "triangle"]
    assert tokens[1]["rim"] == (32.5, 32.5, 7.5)


@pytest.mark.parametrize("text", ["s(32,32,20)", "s(30,41,9)", "t(32,32,20)", "t(29,40,13)", "c(31,33,17)"])
def test_a_rim_goes_around_the_pixels(text):
    """Within a pixel: the corners of a triangle are cut blunt."""
    program = parse(text)
    rows, columns = np.nonzero(execute(program).image.numpy())
    rim = rim_of(program.primitives[0])
    if isinstance(rim, tuple):
        x, y, r = rim
        rim = [(x - r, y - r), (x + r, y + r)]
    (left, top), (right, bottom) = np.min(rim, 0), np.max(rim, 0)
    found = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
    assert np.allclose((left, top, right, bottom), found, atol=0.5 if text[0] == "t" else 0)


def test_a_figure_shows_the_drawing_and_both_programs(network):
    figure = show_reading(network, HOUSE)
    (ax,) = figure.axes
    reading = finished(read(network, HOUSE))
    words = [text.get_text() for text in ax.texts]
    assert len(ax.images) == 3 and "the drawing" in words
    assert f"the network's answer: {reading.distances[0]:.2f} px" in words
    assert f"after {reading.sweeps} sweeps: {reading.distances[-1]:.2f} px" in words
    for statement in reading.programs[-1].statements:
        assert str(statement) in words
    shown = {text.get_text(): to_hex(text.get_color()) for text in ax.texts}
    for primitive in reading.programs[-1].primitives:
        assert shown[str(primitive)] == COLORS[primitive.kind]


def test_a_figure_of_the_widget_is_of_what_it_shows(widget):
    widget.draw(HOUSE)
    words = [text.get_text() for text in widget.figure().axes[0].texts]
    assert f"after 0 sweeps: {widget.distance:.2f} px" in words
    widget.improve()
    words = [text.get_text() for text in widget.figure().axes[0].texts]
    assert f"after 1 sweep: {widget.distance:.2f} px" in words
    with pytest.raises(DrawingError):
        show_reading(widget._network, np.zeros((64, 64), dtype=bool))
    assert reading_figure(widget.reading).get_figwidth() < 8, "wider than a notebook"


def test_examples_are_drawings_of_their_own(widget):
    drawings = example_drawings()
    assert widget.names == list(drawings)
    assert (bits(widget.examples) == np.stack(list(drawings.values()))).all()
    for image in drawings.values():
        assert 300 < image.sum() < 2500 and not (image[0] | image[-1] | image[:, 0] | image[:, -1]).any()


def test_how_long_it_takes(capsys):
    """Not asserted: printed for `-s`. The trained network where it is at hand."""
    try:
        network = load(CSGNet, pretrained("csgnet_2d_reinforced"))
    except CheckpointError:
        pytest.skip("no trained weights")
    draw_reading.vocabulary_of(2).canvases()
    for name, image in list(example_drawings().items())[:3]:
        start = time.process_time()
        reading = read(network, image)
        first = time.process_time() - start
        reading = finished(reading)
        whole = time.process_time() - start
        with capsys.disabled():
            ends = f"{reading.distances[0]:.2f} -> {reading.distances[-1]:.2f} px"
            print(
                f"\n  {name}: read in {first:.3f} s, {reading.sweeps} sweeps in {whole - first:.2f} s, {ends}"
            )
        assert reading.done
