"""What the trace of a block says is what the writer does; the figures of notebook 05 hold what they are given."""

import pytest
import torch

from lib import datasets
from lib.interpreters.shapeassembly import execute
from lib.models.pretrained import pretrained
from lib.models.program_lines import COMMANDS
from lib.models.program_vae import ProgramVAE
from lib.models.weights import load
from lib.models.writing import write
from lib.viewing.writing_figures import compared_figure, distance_figure, outcome_bars, steps_figure
from lib.viewing.writing_trace import commands_figure, pairs_figure, root_block
from tests.conftest import unchecked


@pytest.fixture(scope="module")
def network():
    return load(ProgramVAE, pretrained("program_vae_chair"))


@pytest.fixture(scope="module")
def codes(network):
    return torch.randn(12, network.config.hidden, generator=torch.Generator().manual_seed(0))


@pytest.fixture(scope="module")
def traces(network, codes):
    with unchecked():
        return [root_block(network, code) for code in codes]


def test_a_trace_has_the_commands_of_the_program(network, codes, traces):
    """All valid lines but `end`; of the program, cuboids that stand on nothing were left out, so compare the rest."""
    with unchecked():
        programs = write(network, codes, "skip").programs
    for trace, program in zip(traces, programs):
        traced = [COMMANDS[step.taken] for step in trace if step.valid and COMMANDS[step.taken] != "end"]
        written = [statement.command for statement in program.blocks[0].statements[1:]]
        assert [each for each in traced if each != "Cuboid"] == [each for each in written if each != "Cuboid"]
        assert trace[-1].text == "end"


def test_what_is_taken_is_the_best_of_what_is_allowed(traces):
    for step in (step for trace in traces for step in trace):
        assert step.allowed[step.taken]
        assert step.taken == int(step.commands.masked_fill(~step.allowed, -torch.inf).argmax())
        if step.pair is not None:
            scores = step.pairs.masked_fill(~step.allowed_pairs, -torch.inf)
            assert step.pair == divmod(int(scores.argmax()), len(scores))
        assert bool(step.overruled) == (
            step.wanted != step.taken or step.pair is not None and step.pair != step.wanted_pair
        )


def test_figures_of_a_trace(traces):
    trace = traces[0]
    figure = commands_figure(trace)
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == [step.text for step in trace]
    attach = next(step for step in trace if step.pair is not None)
    assert len(pairs_figure(attach).axes[0].get_xticks()) == len(attach.pairs)
    with pytest.raises(ValueError, match="the line is 'end'; expected an attach"):
        pairs_figure(trace[-1])


def test_bars_hold_the_counts():
    figure = outcome_bars({"one": {"yes": 3, "no": 1}, "two": {"no": 4}})
    widths = sorted(bar.get_width() for bar in figure.axes[0].patches)
    assert widths == [0, 1, 3, 4]
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == ["one", "two"]


def test_dots_hold_the_distances():
    figure = distance_figure({"near": torch.tensor([1, 2, 3]), "far": torch.tensor([7.0, 9.0])}, "edits")
    first, second = (dots.get_offsets()[:, 0].tolist() for dots in figure.axes[0].collections)
    assert (first, second) == ([1, 2, 3], [7, 9])
    medians = [line.get_xdata()[0] for line in figure.axes[0].lines]
    assert medians == [2, 8]


def test_steps_have_two_rows_of_bars():
    figure = steps_figure([0, 3, 1], torch.tensor([0.1, 0.2, 0.3]))
    heights = [[bar.get_height() for bar in ax.patches] for ax in figure.axes]
    assert heights[0] == [0, 3, 1] and heights[1] == pytest.approx([0.1, 0.2, 0.3])


def test_compared_shapes_share_a_camera_by_column():
    stool, sofa = (execute(datasets.example(name)) for name in ("stool", "sofa"))
    figure = compared_figure({"above": [stool, sofa], "below": [sofa, None]}, size=1.0)
    assert [ax.get_xlabel() for ax in figure.axes] == ["above", "above", "below", "below"]
    limits = [ax.get_xlim() for ax in figure.axes]
    assert limits[0] == limits[2] and limits[1] == limits[3]
    with pytest.raises(ValueError):
        compared_figure({"above": [stool], "below": []})
