"""The latent explorer without a browser: sliders, code, program, text and shape say the same."""

import pytest
import torch

from lib import datasets
from lib.interpreters.shapeassembly import parse
from lib.models.exploring import Directions, codes
from lib.models.pretrained import pretrained
from lib.models.program_vae import ProgramVAE
from lib.models.weights import CheckpointError, load
from lib.models.writing import Written, write
from lib.viewing import latent_widget
from lib.viewing.latent_widget import LatentExplorer
from lib.viewing.scene import box_buffer

pytestmark = pytest.mark.usefixtures("unchecked_shapes")


@pytest.fixture(scope="module")
def chairs():
    return list(datasets.shapeassembly("chair", "train"))[:10]


@pytest.fixture(scope="module")
def network():
    try:
        return load(ProgramVAE, pretrained("program_vae_chair"))
    except CheckpointError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def directions(network, chairs):
    return Directions.of(codes(network, chairs), count=3)


@pytest.fixture
def explorer(network, directions):
    return LatentExplorer(network, directions)


def agree(explorer) -> None:
    assert parse(explorer.text) == explorer.program
    assert explorer.view.boxes == box_buffer(explorer.shape)
    assert f"{len(explorer.shape.names)} cuboids" in explorer.status
    expected = write(explorer.network, explorer.code[None], "skip").programs[0]
    assert explorer.program == expected


def test_it_starts_at_the_mean(explorer, directions):
    assert torch.equal(explorer.code, directions.mean) and explorer.weights.tolist() == [0, 0, 0]
    assert repr(explorer) == "LatentExplorer(3 directions, [0.0, 0.0, 0.0])"
    agree(explorer)


def test_a_slider_moves_code_text_and_shape(explorer, directions):
    boxes, text = explorer.view.boxes, explorer.text
    explorer._sliders[1].value = 2.0  # as the browser does
    assert torch.allclose(explorer.code, directions.mean + 2 * directions.spread[1] * directions.axes[1])
    assert explorer.view.boxes != boxes and explorer.text != text
    agree(explorer)
    explorer.set_weight(1, 0.0)
    assert explorer.view.boxes == boxes and explorer.text == text


def test_all_sliders_at_once_write_once(explorer, monkeypatch):
    calls = []

    def counted(*given):
        calls.append(given)
        return write(*given)

    monkeypatch.setattr(latent_widget, "write", counted)
    explorer.set_weights([0.5, -1.0, 2.0])
    assert len(calls) == 1 and explorer.weights.tolist() == [0.5, -1.0, 2.0]
    explorer.reset()
    assert len(calls) == 2 and explorer.weights.tolist() == [0, 0, 0]


def test_it_can_start_from_a_program(explorer, network, chairs):
    explorer.set_weight(0, 1.0)
    explorer.go_to(chairs[4])
    assert torch.allclose(explorer.code, codes(network, chairs[4:5])[0]) and not explorer.weights.any()
    agree(explorer)
    again = LatentExplorer(network, explorer.directions, start=chairs[4])
    assert again.text == explorer.text
    explorer.go_to(None)
    assert torch.equal(explorer.code, explorer.directions.mean)


def test_surprises_are_the_same_for_everybody(explorer, network, directions):
    explorer.surprise()
    first = explorer.weights
    agree(explorer)
    explorer.surprise()
    assert not torch.equal(explorer.weights, first) and explorer.weights.abs().max() <= 3
    other = LatentExplorer(network, directions)
    other.surprise()
    assert torch.equal(other.weights, first)


def test_what_it_does_not_take(explorer):
    before = explorer.text
    with pytest.raises(IndexError, match="found direction 3; expected 0 to 2"):
        explorer.set_weight(3, 0.0)
    for bad in ([0.0], [0.0, 0.0, 3.2], [float("nan"), 0.0, 0.0]):
        with pytest.raises(ValueError, match="expected 3 from -3 to 3"):
            explorer.set_weights(bad)
    for code in (torch.zeros(3), torch.full((256,), torch.nan)):
        with pytest.raises(ValueError, match="expected 256 finite numbers"):
            explorer.go_to(code)
    assert explorer.text == before and explorer.weights.tolist() == [0, 0, 0]


def test_a_code_without_a_program_leaves_the_last_one(explorer, monkeypatch):
    before, boxes = explorer.text, explorer.view.boxes
    monkeypatch.setattr(latent_widget, "write", nothing_written)
    explorer.set_weight(0, 1.0)
    assert "gives no program (a <bad> day)" in explorer.status and explorer.text == before
    assert explorer.view.boxes == boxes and "&lt;bad&gt;" in explorer._status.value
    monkeypatch.undo()
    explorer.set_weight(0, 0.0)
    agree(explorer)


def nothing_written(*_) -> Written:
    return Written([None], ["a <bad> day"])


def test_everything_can_be_reached_and_has_a_name(explorer):
    """Sliders and the text are reached with the tab key; a screen reader hears what each is, and what changed."""
    assert [slider.description[:11] for slider in explorer._sliders] == [
        "Direction 1",
        "Direction 2",
        "Direction 3",
    ]
    assert all("variance" in slider.tooltip for slider in explorer._sliders)
    assert 'tabindex="0" role="region" aria-label="' in explorer._text.value
    assert 'role="status" aria-live="polite"' in explorer._status.value


def test_lines_with_another_structure_are_marked(explorer):
    assert "<mark" not in explorer._text.value
    structure = explorer.program.structure
    for weight in (0.1, -3.0, 3.0):
        explorer.set_weight(0, weight)
        assert ("<mark" in explorer._text.value) == (explorer.program.structure != structure) or (
            "another structure" in explorer.status  # lines may also have gone
        )
        structure = explorer.program.structure


def test_files_to_keep(explorer, monkeypatch):
    kept = {}
    monkeypatch.setattr(explorer.view, "download", kept.__setitem__)
    explorer._save_shape()
    explorer._save_program()
    assert kept["program.txt"] == explorer.text and kept["shape.glb"][:4] == b"glTF"


def test_the_still_picture(explorer):
    figure = explorer.figure(count=2, size=0.5)
    assert len(figure.axes) == 10
