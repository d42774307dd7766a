"""Figures that explain: films, bars, curves, the map. Each shows what it was given."""

import io

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch

from lib.datasets import example
from lib.interpreters.shapeassembly import execute, parse
from lib.metrics.programs import PAPER_GROUND_TRUTH
from lib.viewing.film import film
from lib.viewing.gradients import draw_fit, gradient_bars, plot_against
from lib.viewing.house import house_map
from lib.viewing.tables import compare_bars


def texts(figure) -> str:
    """All words of a figure."""
    return "\n".join(t.get_text() for t in figure.findobj(lambda artist: hasattr(artist, "get_text")))


def ink(figure) -> float:
    """Share of the pixels that are not white."""
    file = io.BytesIO()
    figure.savefig(file, format="png")
    file.seek(0)
    return float((plt.imread(file)[..., :3] < 0.98).any(-1).mean())


def test_a_film_has_a_frame_and_a_caption_for_each_statement():
    block = example("stool").blocks[0]
    figure = film(block, first=7)
    assert len(figure.axes) == len(block.statements) - 7
    captions = " ".join(texts(figure).split())
    assert "attach(cube0, bbox," in captions and "reflect(cube5, X)" in captions and ink(figure) > 0.05


def test_a_film_marks_both_points_of_an_attach():
    text = """Assembly Program_0 {
        bbox = Cuboid(1, 1, 1, True)
        cube0 = Cuboid(0.4, 0.4, 0.4, True)
        cube1 = Cuboid(0.4, 0.4, 0.4, True)
        attach(cube0, bbox, 0.5, 0, 0.5, 0.2, 0, 0.2)
        attach(cube1, bbox, 0.5, 0, 0.5, 0.8, 0, 0.8)
        attach(cube1, bbox, 0.5, 1, 0.5, 0.5, 1, 0.5)
    }"""
    last = film(parse(text).blocks[0]).axes[-1]
    points = [collection.get_offsets().data[0] for collection in last.collections]
    assert len(points) == 2 and np.abs(points[0] - points[1]).max() > 0.1  # aligned: the points do not meet


def test_gradient_bars_have_the_gradients_height():
    program = example("stool")
    gradient = torch.arange(program.parameter_count).double() - 30
    figure = gradient_bars(program, gradient, gradient, title="a title")
    heights = [bar.get_height() for bar in figure.axes[0].containers[0]]
    assert heights == gradient.tolist() and "a title" in texts(figure) and "attach" in texts(figure)


def test_curves_show_their_data():
    figure = plot_against(torch.tensor([0.0, 1.0]), {"result": torch.tensor([2.0, 5.0])}, "x", "y", "title")
    assert figure.axes[0].get_lines()[0].get_ydata().tolist() == [2, 5]


def test_a_fit_is_drawn_beside_its_target():
    shape = execute(example("stool"))
    figure = draw_fit([shape, shape], ["start", "end"], shape.surface_points(50, 0))
    assert len(figure.axes) == 3 and "the target" in texts(figure)
    assert all(len(ax.collections[-1].get_offsets()) == 50 for ax in figure.axes)


@pytest.mark.parametrize("sources", [1, 2])
def test_bars_side_by_side(sources):
    paper = {category: row.as_row() for category, row in PAPER_GROUND_TRUTH.items()}
    rows = dict(zip(("paper", "here"), [paper] * sources))
    figure = compare_bars(rows, {"lines": "lines a program"})
    heights = [bar.get_height() for bars in figure.axes[0].containers for bar in bars]
    assert heights == [24.4, 20.0, 24.7] * sources and "lines a program" in texts(figure)


def test_the_map_names_the_notebooks():
    assert {"01", "02", "03"} <= set(texts(house_map()).split()) and ink(house_map()) > 0.05
