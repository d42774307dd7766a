"""Figures of what a network writes, variants and films: sheets of the right size, neighbours known by hand."""

import io
import json

import numpy as np
import pytest
import torch
import trimesh
from PIL import Image

from lib.datasets import example, examples
from lib.interpreters.shapeassembly import Attach, execute, execute_many, parse
from lib.metrics.rootedness import rooted
from lib.viewing import animation
from lib.viewing.animation import animated_glb, frames, gif
from lib.viewing.latent_figures import (
    contact_sheet,
    interpolation_figure,
    line_count,
    neighbour_figure,
    neighbours,
    shapes_of,
    variant_figure,
)
from lib.viewing.variants import OUTSIDE, Amounts, _touching, overhang, variants

pytestmark = pytest.mark.usefixtures("unchecked_shapes")

BOX = """Assembly Program_0 {
    bbox = Cuboid(1.0, 1.0, 1.0, True)
    cube0 = Cuboid(0.4, 0.5, 0.4, True)
    attach(cube0, bbox, 0.5, 0.0, 0.5, 0.3, 0.0, 0.5)
}
"""


@pytest.fixture(scope="module")
def pieces():
    return list(examples().values())[:5]


def labels(figure) -> list[str]:
    return [ax.get_xlabel() for ax in figure.axes]


def test_a_contact_sheet_names_every_shape(pieces):
    figure = contact_sheet(pieces, columns=3, size=0.5)
    assert labels(figure) == [f"{i}: {line_count(p)} lines" for i, p in enumerate(pieces, start=1)]
    assert line_count(parse(BOX)) == 3


def test_neighbours_known_by_hand(pieces):
    wide = [program.with_parameters(program.parameters() * 1.0) for program in pieces]
    found = neighbours(wide, pieces)
    assert found.geometric.tolist() == found.program.tolist() == [0, 1, 2, 3, 4]
    assert found.edits.tolist() == [0] * 5
    assert (0.005 < found.distance).all() and (found.distance < 0.2).all()  # points are drawn anew
    assert torch.equal(neighbours(wide, pieces).distance, found.distance)
    with pytest.raises(ValueError):
        neighbours(pieces, [])


def test_the_two_neighbours_can_differ():
    """The same structure in another size, and another structure in the same size."""
    box = parse(BOX)
    double = box.with_parameters([2, 2, 2, 0.8, 1.0, 0.8, 0.5, 0, 0.5, 0.3, 0, 0.5])
    other = parse(BOX.replace("0.4, True)", "0.4, False)"))
    found = neighbours([box], [double, other])
    assert found.geometric.tolist() == [1] and found.program.tolist() == [0]
    assert found.edits.tolist() == [0]


def test_three_rows_of_neighbours(pieces):
    figure = neighbour_figure(pieces[:2], pieces, size=0.5)
    assert len(figure.axes) == 6 and labels(figure)[-2:] == ["0 edits", "0 edits"]
    assert [text.get_text() for text in figure.texts] == [
        "nearest by geometry", "written by the network", "nearest by program",
    ]  # fmt: skip


def test_an_interpolation_counts_its_edits(pieces):
    assert labels(interpolation_figure([pieces[0], pieces[0], pieces[1]], size=0.5))[1].endswith("\n0 edits")
    assert not labels(interpolation_figure(pieces[:2], size=0.5))[1].endswith("\n0 edits")


def test_programs_that_are_not_there_leave_a_gap(pieces):
    shapes = shapes_of([None, pieces[0], None])
    assert shapes[0] is shapes[2] is None and len(shapes[1].names) == len(execute(pieces[0]).names)


@pytest.mark.parametrize("name", ["dining_chair", "coffee_table", "bookshelf"])
def test_variants_keep_structure_and_are_valid(name):
    program = example(name)
    found = variants(program, 6, seed=1)
    shapes = list(execute_many(found))
    assert len(found) == 6 and all(each.structure == program.structure for each in found)
    assert len({tuple(each.parameters().tolist()) for each in found}) == 6
    assert rooted(shapes).all()
    reach = max(OUTSIDE, float(overhang(execute(program))))
    assert all(float(overhang(shape)) <= reach + 1e-6 for shape in shapes)
    assert found[:4] == variants(program, 4, seed=1) and found != variants(program, 6, seed=2)


def test_faces_and_middles_stay_and_other_points_slide():
    for each in variants(parse(BOX), 8):
        attach = next(s for _, _, s in each.statements() if isinstance(s, Attach))
        fixed = [n for i, n in enumerate(attach.numbers) if i != 3]
        assert fixed == [0.5, 0.0, 0.5, 0.0, 0.5] and 0 <= attach.numbers[3] <= 0.5
    assert len({each.parameters()[9].item() for each in variants(parse(BOX), 8)}) == 8


def test_an_amount_of_nothing_changes_nothing():
    program = example("dining_chair")
    same = variants(program, 2, amounts=Amounts(0, 0, 0, 0))
    assert all(torch.allclose(each.parameters(), program.parameters(), atol=1e-4) for each in same)


def test_only_what_is_asked_for_changes():
    program = example("dining_chair")
    sizes = [i for i, name in enumerate(program.parameter_names()) if ":Cuboid:" in name]
    points = [i for i, name in enumerate(program.parameter_names()) if ":Cuboid:" not in name]
    (each,) = variants(program, 1, amounts=Amounts(stretch=0.3, resize=0, slide=0, spread=0))
    assert torch.allclose(each.parameters()[points], program.parameters()[points], atol=1e-4)
    factors = (each.parameters()[sizes] / program.parameters()[sizes]).reshape(-1, 3)
    assert torch.allclose(factors, factors[:1].expand_as(factors), rtol=0.02)  # four decimals of small sizes


def test_a_filled_cuboid_and_its_block_keep_one_size():
    program = example("dining_chair")
    names = {block.name: block.statements[0] for block in program.blocks[1:]}
    assert names  # else this says nothing
    for each in variants(program, 3):
        boxes = {block.name: block.statements[0].numbers for block in each.blocks[1:]}
        declared = {
            s.name: s.numbers for _, _, s in each.statements() if s.command == "Cuboid" and s.name in boxes
        }
        assert boxes.keys() == declared.keys()
        assert all(boxes[name] == pytest.approx(declared[name], abs=2e-4) for name in boxes)  # four decimals


def test_overhang_by_hand():
    assert float(overhang(execute(parse(BOX)))) == 0
    beyond = parse(BOX.replace("0.3, 0.0, 0.5)", "0.9, 0.0, 0.5)"))  # from 0.7 to 1.1 of a box from 0 to 1
    assert float(overhang(execute(beyond))) == pytest.approx(0.2)


def test_no_variants_of_a_negative_number():
    with pytest.raises(ValueError, match="found -1 variants"):
        variants(parse(BOX), -1)


def test_a_row_of_variants():
    figure = variant_figure([example("dining_chair"), example("coffee_table")], count=2, size=0.5)
    assert labels(figure) == ["as written", "", "", "as written", "", ""]


def test_a_gif_goes_there_and_back(pieces):
    shapes = list(execute_many(pieces[:3]))
    with Image.open(io.BytesIO(gif(shapes, seconds=0.2, pixels=48))) as film:
        assert film.n_frames == 4 and film.size == (48, 48) and film.info["duration"] == 200
    with Image.open(io.BytesIO(gif(shapes, pixels=48, there_and_back=False))) as film:
        assert film.n_frames == 3
    assert all(picture.shape == (48, 48, 3) for picture in frames(shapes, 48))
    with pytest.raises(ValueError, match="found no shapes"):
        gif([])
    with pytest.raises(ValueError, match="at least 0.01"):
        gif(shapes, seconds=0.001)


def test_an_animated_glb_shows_one_shape_at_a_time(pieces):
    shapes = list(execute_many(pieces[:3]))
    content = animated_glb(shapes, seconds=0.5)
    scene = trimesh.load_scene(io.BytesIO(content), file_type="glb")
    assert len(scene.geometry) == 3
    for number, shape in enumerate(shapes):
        assert np.allclose(scene.geometry[f"frame_{number}"].bounds, shape.mesh().bounds, atol=1e-5)
    document, binary = animation._unpacked(content)
    (film,) = document["animations"]
    times = numbers_of(document, binary, film["samplers"][0]["input"])
    shown = np.stack([numbers_of(document, binary, sampler["output"])[:, 0] for sampler in film["samplers"]])
    assert times.ravel().tolist() == [0, 0.5, 1.0, 1.5]
    assert shown.tolist() == [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1]]
    for number, channel in enumerate(film["channels"]):
        node = document["nodes"][channel["target"]["node"]]
        assert node["name"] == f"frame_{number}" and "matrix" not in node
        assert film["samplers"][channel["sampler"]]["interpolation"] == "STEP"
    assert (
        json.dumps(document) and len(content) % 4 == 0 and document["buffers"][0]["byteLength"] == len(binary)
    )
    with pytest.raises(ValueError, match="expected at least one shape"):
        animated_glb([])


def numbers_of(document, binary, accessor) -> np.ndarray:
    facts = document["accessors"][accessor]
    view = document["bufferViews"][facts["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3}[facts["type"]]
    return np.frombuffer(binary, "<f4", facts["count"] * width, view["byteOffset"]).reshape(-1, width)


def test_what_touches_goes_on_touching():
    """A box on the floor and one on top of it: a variant that parts them is none."""
    program = example("dining_chair")
    before, *after = _touching([execute(each) for each in [program, *variants(program, 4)]])
    assert any(pair[0] == -1 for pair in before) and any(pair[0] >= 0 for pair in before)
    assert all(before <= each for each in after)
    apart = program.with_parameters(program.parameters() * 0.8)
    assert _touching([execute(parse(BOX))]) == [{(-1, 0)}] and _touching([execute(apart)]) != [before]


def test_nothing_but_a_bounding_box_hangs_over_nothing():
    program = parse("Assembly Program_0 {\n    bbox = Cuboid(1, 1, 1, True)\n}\n")
    assert float(overhang(execute(program))) == 0 and len(variants(program, 2)) == 2
