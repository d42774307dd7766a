"""Maps of distances show the numbers they were given."""

import pytest
import torch

from lib.metrics.distances import distance_transform
from lib.viewing.csg_figures import show_distances, show_points


def edges_at(side: int, *places: tuple[int, int]) -> torch.Tensor:
    edges = torch.zeros(side, side, dtype=torch.bool)
    for y, x in places:
        edges[y, x] = True
    return edges


def test_small_maps_show_every_number_and_frame_the_marks():
    edges = edges_at(8, (1, 2), (6, 6))
    ax, other = show_distances([distance_transform(edges, "euclidean")] * 2, ["a", "b"], [edges, ~edges]).axes
    shown = {tuple(map(int, text.get_position())): text.get_text() for text in ax.texts}
    assert len(shown) == 64 and shown[2, 1] == "0.0" and shown[2, 4] == "3.0" and shown[3, 2] == "1.4"
    assert len(ax.patches) == 2 and len(other.patches) == 62
    assert ax.get_xlabel() == "a" and ax.images[0].get_clim() == other.images[0].get_clim()


def test_large_maps_show_lines_instead():
    (ax,) = show_distances([distance_transform(edges_at(64, (32, 32)))], ["far"]).axes
    assert len(ax.collections) == 1
    assert ax.collections[0].levels.tolist() == [8, 16, 24, 32, 40]
    marks = {text.get_text() for text in ax.texts}
    assert marks and marks <= {"8", "16", "24", "32", "40"}


@pytest.mark.parametrize("titles, marks", [(["a", "b"], None), (["a"], [])])
def test_titles_and_marks_are_one_each(titles, marks):
    with pytest.raises(ValueError, match="1 maps need"):
        show_distances([torch.zeros(8, 8)], titles, marks)


def test_points_have_markers_ticks_and_numbers():
    (ax,) = show_points([1, 3, 5], [0.5, 0.125, 0.0625], "tokens", "share", "title").axes
    (line,) = ax.lines
    assert line.get_xdata().tolist() == ax.get_xticks().tolist() == [1, 3, 5] and line.get_marker() == "o"
    assert [text.get_text() for text in ax.texts] == ["0.5", "0.12", "0.062"] and ax.get_legend() is None
    with pytest.raises(ValueError, match="1 heights for 2 places"):
        show_points([1, 3], [0.5], "x", "y", "t")


def test_maps_of_blank_and_of_thin_pictures_are_drawn():
    show_distances(
        [torch.full((20, 20), torch.inf), torch.arange(20.0).view(1, 20)], ["blank", "thin"]
    ).canvas.draw()
    with pytest.raises(ValueError, match="found no maps"):
        show_distances([], [])
