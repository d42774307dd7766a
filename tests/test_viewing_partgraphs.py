"""Figures and texts about part graphs: each shows what it was given."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from lib.exercises.parts import assemble, box, inner, reordered, with_box
from lib.extractor import extract, regularise, stages, survey
from lib.extractor.arranging import flatten
from lib.extractor.contacts import find_contacts
from lib.extractor.placing import judge, ways_to_place
from lib.extractor.shortening import shorten
from lib.extractor.snapping import snap_leaves
from lib.interpreters.shapeassembly.shape import PALETTE
from lib.viewing import measured
from lib.viewing.partgraphs import (
    PALE,
    blocks_of,
    by_branch,
    change_sheet,
    contact_sheet,
    group_sheet,
    inner_boxes,
    labelled,
    painted,
    painted_groups,
    tree,
    ways_chart,
    what_changed,
)

from .test_figures import ink, texts


@pytest.fixture(scope="module")
def table():
    """A top with a sunken, slightly turned leg, and a base of two parts below two nodes."""
    top = box("tabletop_surface", (0, 0.72, 0), (1.2, 0.04, 0.8))
    legs = [
        box("leg", (x, 0.36, z), (0.06, 0.72, 0.08), 3 * (x > 0)) for x in (-0.5, 0.5) for z in (-0.3, 0.3)
    ]
    return assemble("table", inner("tabletop", inner("tabletop_frame", top)), inner("table_base", *legs))


@pytest.fixture(scope="module")
def facts(table):
    return survey(regularise(table).root, "table")


def test_a_tree_has_a_line_a_part(table):
    lines = tree(table).splitlines()
    assert len(lines) == len(list(table.root.walk()))
    assert lines[0].startswith("table ") and lines[0].endswith("1.20 × 0.74 × 0.80")
    assert lines[2].startswith("│   └── tabletop_frame") and lines[-1].startswith("    └── leg")
    assert tree(table, sizes=False).splitlines()[0] == "table"


def test_labels_are_counted_and_coloured(table):
    figure = labelled(table)
    assert "leg × 4" in texts(figure) and "tabletop_surface × 1" in texts(figure) and ink(figure) > 0.05


def test_paint_is_pale_where_nothing_is_said(table):
    colors = painted(table.leaves, [None, 0, 1, None, len(PALETTE)]).visual.face_colors[::12, :3]
    assert colors.tolist() == [list(PALE), list(PALETTE[0]), list(PALETTE[1]), list(PALE), list(PALETTE[0])]


def test_branches_tell_siblings(table):
    assert by_branch(table) == [0, 1, 1, 1, 1]
    assert len(inner_boxes(table)) == 4


def test_what_changed(table):
    assert not any(what_changed(table, table).values())
    assert len(what_changed(table, snap_leaves(table))["turned"]) == 2
    assert len(what_changed(table, shorten(table))["resized"]) == 4
    assert len(what_changed(table, flatten(table))["rehung"]) == 1
    fewer = table.with_root(replace(table.root, children=table.root.children[:1]))
    gone = what_changed(table, fewer)["gone"]
    assert len(gone) == 4 and what_changed(fewer, table)["new"] == gone


def test_steps_have_their_own_names(table):
    steps = dict(stages(table))
    assert list(steps)[0] == "input" and list(steps)[-1] == "refit" and steps["input"] is table
    assert len(steps) == len(stages(table))


def test_changes_are_named(table):
    steps = {"before": table, "snapped": snap_leaves(table), "cut": shorten(table)}
    figure = change_sheet(steps, [("before", "snapped", "turned"), ("before", "cut", "resized")])
    assert "snapped: 2 leaves turned" in texts(figure) and "cut: 4 leaves resized" in texts(figure)


def test_contacts_are_dots(facts):
    inside = [c for c in facts.contacts if c.second >= 0]
    figure = contact_sheet(facts.boxes, [facts.contacts, inside, []], ["all", "without the box", "none"])
    dots = [len(ax.collections) for ax in figure.axes]
    assert dots == [len(facts.contacts), len(inside), 0] and "face on face" in texts(figure)
    assert "none" in texts(figure) and ink(figure) > 0.02


def test_contact_sheets_wrap_and_may_have_no_contact(facts):
    far = find_contacts(facts.boxes[:1], facts.size * 9)
    figure = contact_sheet([facts.boxes] * 3, [far] * 3, ["a", "b", "c"], columns=2)
    assert len(figure.axes) == 4 and not figure.legends


def test_groups_have_their_titles(facts):
    names = [name for name, _ in blocks_of(facts, "table")]
    assert names[0] == "table" and len(names) == 2
    base = blocks_of(facts)[1][1]
    assert "reflect X, 2 parts" in texts(group_sheet(facts, "table"))
    colors = painted_groups(base).visual.face_colors[::12, :3]
    assert len(np.unique(colors, axis=0)) == len(base.groups) == 2


def test_no_groups_is_no_picture():
    lone = extract(
        assemble("table", box("leg", (0, 0, 0), (1, 1, 1)), box("shelf", (0, 0.7, 0), (0.5, 0.4, 0.2)))
    )
    assert not [block for _, block in blocks_of(lone.facts) if block.groups]
    assert ink(group_sheet(lone.facts)) == 0


def test_ways_are_bars(facts):
    base = blocks_of(facts)[1][1]
    chosen = base.ways[0]
    ways = ways_to_place(chosen.cuboid, base.contacts, base.boxes, base.size, False)
    misfits = judge(ways, base.boxes, base.aligned, base.size).tolist()
    judged = [replace(way, misfit=misfit) for way, misfit in zip(ways, misfits)]
    figure = ways_chart(judged, base.tolerance, chosen, "a leg")
    assert len(figure.axes[0].patches) == len(ways) and {"a leg", "taken"} <= set(texts(figure).splitlines())


def test_boxes_by_hand():
    leaning = box("leg", (1, 2, 3), (0.1, 1, 0.2), 90)
    assert torch.allclose(leaning.box.axes @ leaning.box.axes.mT, torch.eye(3).double())
    high, low = leaning.box.corners().amax(0), leaning.box.corners().amin(0)
    assert torch.allclose(high - low, torch.tensor([1, 0.1, 0.2]).double())
    graph = assemble("table", inner("table_base", leaning), box("leg", (0, 0, 0), (1, 1, 1)))
    assert [part.id for part in graph.root.walk()] == [0, 1, 2, 3] and graph.category == "table"
    moved = with_box(graph, 3, size=(2, 2, 2))
    assert moved.leaves.size[1].tolist() == [2, 2, 2] and moved.leaves.center[1].tolist() == [0, 0, 0]
    assert torch.equal(moved.leaves.size[0], graph.leaves.size[0])
    with pytest.raises(KeyError, match="no leaf with the id 1"):
        with_box(graph, 1, size=(2, 2, 2))
    assert reordered(graph, lambda parts: parts[::-1]).labels == ["leg", "leg"]
    assert [part.id for part in reordered(graph, lambda parts: parts[::-1]).root.walk()] == [0, 3, 1, 2]


def test_measured_tables(tmp_path):
    assert "measure_extraction" in measured.saved_table("extraction_furniture", tmp_path)
    row = {
        "shapes": 40,
        "accepted_percent": 97.5,
        "lines": 20.25,
        "reasons": {"outside": 1},
        "original": {"lines": 19},
    }
    (tmp_path / "some.json").write_text(json.dumps({"real": {"chair": row}}))
    head, chair, original = measured.saved_table("some", tmp_path).splitlines()
    assert head.split() == ["shapes", "accepted", "%", "lines", "rejected"]
    assert chair.split() == ["real", "chair", "40", "97.5", "20.2", "1", "outside"]
    assert original.split() == ["the", "originals", "-", "-", "19.0"]
    assert measured.table({}).strip() == "rejected"
