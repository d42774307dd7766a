"""Figures of notebook 04: what is drawn is what was given."""

import pytest
import torch

from lib.datasets import example
from lib.interpreters.shapeassembly import parse
from lib.models.program_lines import FIELD
from lib.models.program_table import ProgramTable, batch_of
from lib.viewing.program_vae_figures import flow_figure, levels_figure, lines_figure
from lib.viewing.training_figures import (
    codes_figure,
    curves_figure,
    progress_figure,
    surprise_figure,
    terms_figure,
)  # fmt: skip

STOOL, CHAIR = example("stool"), example("dining_chair")
WEIGHTS = {"size": 50.0, "kl": 0.2}


def texts(figure) -> list[str]:
    found = [text.get_text() for ax in figure.axes for text in ax.texts]
    ticks = [
        label.get_text() for ax in figure.axes for label in (*ax.get_xticklabels(), *ax.get_yticklabels())
    ]
    return found + ticks + [ax.get_xlabel() for ax in figure.axes] + [ax.get_title() for ax in figure.axes]


def test_lines_and_their_columns_are_named():
    found = texts(lines_figure(STOOL.blocks[0]))
    assert set(FIELD) <= set(found)
    assert {statement.to_text() for statement in STOOL.blocks[0].statements} <= set(found)


def test_a_cell_a_line():
    levels = batch_of(ProgramTable.of([STOOL, CHAIR]), [0, 1])
    figure = levels_figure(levels)
    assert [len(ax.patches) for ax in figure.axes] == [len(level.lines) for level in levels]


def test_codes_flow_through_every_block():
    codes = {block.name: torch.linspace(-1, 1, 16) for block in CHAIR.blocks}
    figure = flow_figure(CHAIR, codes, torch.zeros(16), codes)
    names = [text.get_text() for text in figure.axes[0].texts]
    assert all(names.count(name) == 2 for name in codes) and names.count("latent code") == 1
    assert len(figure.axes[0].images) == 2 * len(CHAIR.blocks) + 1
    flow_figure(STOOL, {"Program_0": torch.zeros(4)}, torch.zeros(4), {"Program_0": torch.zeros(4)})


def test_terms_are_weighted():
    [ax] = terms_figure({"before": {"size": 2.0, "kl": 0.0}}, WEIGHTS).axes
    assert [bar.get_height() for bar in ax.patches] == pytest.approx([100.0, 0.01])


def test_curves_have_all_epochs():
    log = [{"epoch": e, "loss": 3.0 / e, "val_loss": 4.0 / e, "size": 1.0 / e, "kl": e} for e in (1, 2, 3)]
    left, right = curves_figure(log, WEIGHTS).axes
    assert [len(left.lines), len(right.lines)] == [2, 2]
    assert right.lines[0].get_ydata() == pytest.approx([50, 25, 50 / 3])
    without = [{name: value for name, value in row.items() if name != "val_loss"} for row in log]
    assert len(curves_figure(without, WEIGHTS).axes[0].lines) == 1


def test_progress_has_a_place_for_what_is_missing(unchecked_shapes):
    small = parse("Assembly Program_0 {\nbbox = Cuboid(1, 1, 1, True)\n}")
    figure = progress_figure({"first": [None, small], "last": [small, STOOL]}, size=0.5)
    found = texts(figure) + [text.get_text() for text in figure.texts]
    assert len(figure.axes) == 4 and {"first", "last", "none", "1 lines", "19 lines"} <= set(found)


def test_a_bar_a_line_and_reader():
    [ax] = surprise_figure(["a", "b"], {"one": torch.tensor([1.0, 2.0]), "two": torch.zeros(2)}, "cost").axes
    assert [bar.get_width() for bar in ax.patches] == [1, 2, 0, 0] and ax.get_xlabel() == "cost"


def test_codes_are_seen_along_their_main_directions():
    codes = torch.zeros(5, 4)
    codes[:, 2], codes[:, 0] = torch.arange(5.0), torch.tensor([0.0, 1, 0, -1, 0])
    [ax] = codes_figure({"codes": codes}).axes
    points = abs(ax.collections[0].get_offsets())
    assert points[:, 0].tolist() == pytest.approx([0, 1, 2, 3, 4], abs=0.5)
    assert ax.get_xlim()[1] > 4 and len(ax.patches) == 3
