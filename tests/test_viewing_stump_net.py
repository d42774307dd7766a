"""Figures of what networks say of clouds: faces belong to the node that made them; a slider moves a stump's number."""

import json

import numpy as np
import pytest
import torch
import trimesh

from lib.interpreters.openscad import read
from lib.interpreters.stump import Box, ProgramError, Sphere, parse
from lib.models.reconstructing import surface
from lib.models.soft_stump import SoftStump
from lib.viewing.stump_choices import choices, choices_figure, choices_table
from lib.viewing.stump_net_figures import (
    gap_figure,
    owners,
    parts_of,
    plain,
    rivals,
    rivals_figure,
    rivals_table,
    sheet,
    training_figure,
    use_figure,
)
from lib.viewing.stump_sliders import StumpSliders
from tests.conftest import unchecked

CORNERS = torch.cartesian_prod(*[torch.tensor([-0.4, 0.0, 0.4])] * 3)
TWO = parse("""F1 = box(half=(0.1, 0.2, 0.1), translation=(-0.2, 0, 0))
F2 = sphere(radius=0.15, translation=(0.2, 0, 0))
S1 = F1
S2 = F2
T = S1 | S2
""")


def answer() -> SoftStump:
    """A box on the left, node 2; a ball on the right, node 0; node 1 is not united."""
    boxes = Box(torch.tensor([[[0.1, 0.2, 0.1]]]), torch.tensor([[[-0.2, 0, 0]]]))
    balls = Sphere(torch.tensor([[0.15]]), torch.tensor([[[0.2, 0, 0]]]))
    yes, no = 4.0, -4.0
    selects = torch.tensor([[[no, yes, yes], [yes, yes, no]]])
    return SoftStump((boxes, balls), torch.tensor([[no, no]]), selects, torch.tensor([[yes, no, yes]]))


def test_points_belong_to_the_node_they_are_in():
    node, primitive = owners(answer(), torch.tensor([[-0.2, 0, 0], [0.2, 0, 0], [-0.3, 0.1, 0]]))
    assert node.tolist() == [2, 0, 2] and primitive.tolist() == [0, 1, 0]
    said = answer()
    said.union.fill_(-1)
    with pytest.raises(ValueError, match="unites no node"):
        owners(said, torch.zeros(1, 3))


@pytest.mark.parametrize("by", ["node", "primitive"])
def test_faces_have_the_colour_of_what_made_them(by):
    said = answer()
    mesh = surface(lambda points: said.signed(said.distances(points[None]))[0], CORNERS)
    colors = parts_of(said, mesh, by).visual.face_colors
    left = mesh.triangles_center[:, 0] < 0
    assert len(np.unique(colors[left], axis=0)) == len(np.unique(colors[~left], axis=0)) == 1
    assert (colors[left][0] != colors[~left][0]).any()
    assert len(np.unique(plain(mesh).visual.face_colors, axis=0)) == 1
    with pytest.raises(ValueError, match="'node' or 'primitive'"):
        parts_of(said, mesh, "part")
    assert parts_of(said, trimesh.Trimesh()).is_empty


def test_a_sheet_has_a_picture_for_each_shape():
    box = trimesh.creation.box()
    figure = sheet({"cloud": [CORNERS, CORNERS], "answer": [box, trimesh.Trimesh()]}, ["a", "b"])
    assert len(figure.axes) == 4 and figure.axes[2].get_ylabel() == "answer"
    assert [ax.get_xlabel() for ax in figure.axes[2:]] == ["a", "b"]
    with pytest.raises(ValueError, match="expected as many"):
        sheet({"cloud": [CORNERS], "answer": []})
    with pytest.raises(ValueError, match="expected as many, 1 or more"):
        sheet({"cloud": []})
    assert len(sheet({"cloud": [CORNERS.clone().requires_grad_()]}).axes) == 1


def test_curves_and_bars_show_what_they_are_given():
    log = [
        {"epoch": k, "reconstruction": 0.2 / k, "val_soft_iou": 0.5, "val_iou": 0.1 * k} for k in (1, 2, 3)
    ]
    left, right = training_figure(log).axes
    assert left.lines[0].get_ydata().tolist() == pytest.approx([0.2, 0.1, 0.2 / 3])
    assert right.lines[1].get_ydata() == pytest.approx([10, 20, 30])
    said = answer()
    bars = [int(bar.get_height()) for bar in gap_figure(said).axes[0].patches]
    assert sum(bars) == sum(each.numel() for each in said.logits) == bars[0] + bars[-1]
    assert use_figure({"node": np.eye(3)}).axes[0].images[0].get_array().tolist() == np.eye(3).tolist()


def test_the_table_has_the_measured_rows(tmp_path):
    row = {
        "chamfer_mean": 1.234,
        "chamfer_sum": 2.468,
        "iou": 70.0,
        "f_score": 50.0,
        "primitives": 3.0,
        "seconds": 0.1,
    }
    path = tmp_path / "r.json"
    path.write_text(json.dumps({"rows": {"zebra": row, "bounding_box": row | {"nodes": 1.0}}}))
    assert list(rivals(path)) == ["bounding box", "zebra"]
    lines = rivals_table(path).splitlines()
    assert len({*map(len, lines)}) == 1 and len(lines) == 4
    # bounding box 1.23 70.0 50.0 3.0 1.0 0.10, and a zebra without nodes
    assert lines[2].split()[2:4] == ["1.23", "70.0"] and lines[3].split()[5:6] == ["-"]
    assert [text.get_text() for text in rivals_figure(path).axes[0].texts] == ["1.23", "1.23"]
    with pytest.raises(FileNotFoundError, match="measure_stump_net"):
        rivals(tmp_path / "none.json")
    (tmp_path / "seed_1").mkdir()
    second = {name: row | {"chamfer_mean": 9.0} for name in ("zebra", "bounding_box", "unknown")}
    (tmp_path / "seed_1" / "r.json").write_text(json.dumps({"rows": second}))
    lines = rivals_table(path).splitlines()
    assert len(lines) == 4 and [line.split()[-1] for line in lines[:2]] == ["IoU,", "1"]
    assert lines[2].split()[-2:] == ["-", "-"]  # a box has no seed
    assert lines[3].split()[-2:] == ["9.00", "70.0"]
    assert [ax.lines[0].get_xdata().tolist() for ax in rivals_figure(path).axes] == [[9.0], [70.0]]


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"rows": {}}', '{"rows": {"ucsg": 3}}', '{"rows": {"ucsg": {}}}']
)
def test_a_damaged_result_is_told(tmp_path, text):
    (tmp_path / "r.json").write_text(text)
    with pytest.raises(ValueError, match="r.json: found no rows as they are measured; .*measure_stump_net"):
        rivals(tmp_path / "r.json")


def test_each_choice_has_a_line_and_each_seed_a_dot(tmp_path):
    runs = [{"soft_iou": 61.0, "decided_iou": 60.0}, {"soft_iou": 63.0, "decided_iou": 60.0}]
    row = {"runs": runs, "soft": 62.0, "decided": 60.0, "lost": 3.2258, "weights": 1234567}
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"rows": {"default": row, "no ground": row | {"lost": 4.0}}}))
    lines = choices_table(path).splitlines()
    assert lines[1].split() == ["default", "62.0", "60.0", "3.2", "1,234,567"]
    assert lines[2].split()[:5] == ["no", "ground", "62.0", "60.0", "4.0"]
    (ax,) = choices_figure(path).axes
    assert [label.get_text() for label in ax.get_yticklabels()] == ["default", "no ground"]
    assert [list(line.get_xdata()) for line in ax.lines] == [[61, 63], [60, 60]] * 2
    path.write_text(json.dumps({"rows": {"default": {"runs": runs}}}))
    with pytest.raises(ValueError, match="a.json: found no rows .*ablate_stump_net"):
        choices(path)
    with pytest.raises(FileNotFoundError, match="ablate_stump_net"):
        choices(tmp_path / "none.json")


def test_a_slider_moves_a_number():
    widget = StumpSliders(TWO, CORNERS)
    assert list(widget.numbers)[:3] == ["half x", "half y", "half z"] and widget.chosen == 0
    before = widget.surface().volume
    widget.set("half x", 0.15)
    assert widget.numbers["half x"] == pytest.approx(0.15)
    assert widget.surface().volume == pytest.approx(before * 1.3, rel=0.1)  # the ball stays
    assert read(widget.text).structure == TWO.structure
    widget.choose(1)
    assert list(widget.numbers)[0] == "radius" and widget.numbers["radius"] == pytest.approx(0.15)
    widget.reset()
    assert widget.stump == TWO.to(torch.float32) and "StumpSliders" in repr(widget)


def test_numbers_that_make_no_primitive_move_nothing():
    widget = StumpSliders(TWO, CORNERS)
    with pytest.raises(ProgramError, match="rotation of primitive 1"):
        widget.set("rotation w", 0.0)
    assert widget._sliders["rotation w"].value == 1 and widget.stump == TWO.to(torch.float32)


def test_the_menu_chooses_and_the_picture_follows():
    widget = StumpSliders(TWO, CORNERS)
    before = widget._image.value
    widget._menu.value = 1
    assert widget.chosen == 1 and widget._image.value != before and widget._image.value[1:4] == b"PNG"


def test_what_is_no_solid_stump_is_refused():
    with unchecked(), pytest.raises(TypeError, match="expected a Stump"):
        StumpSliders("F1 = box", CORNERS)
    with pytest.raises(ValueError, match="one of space"):
        StumpSliders(parse("F1 = circle(radius=1)\nS1 = F1\nT = S1\n"), CORNERS)
    with pytest.raises(ValueError, match="expected 0 to 1"):
        StumpSliders(TWO, CORNERS).choose(2)
    with unchecked():
        with pytest.raises(ValueError, match="found points of shape .*; expected"):
            StumpSliders(TWO, CORNERS[:, :2])
        with pytest.raises(ValueError, match="found primitive 1.0; expected 0 to 1"):
            StumpSliders(TWO, CORNERS.numpy()).choose(1.0)
