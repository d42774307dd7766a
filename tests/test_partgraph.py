"""Part graphs: from files and back, what is put right on the way, and what every error says."""

import json
import pickle
import random
import time
import warnings
import zipfile
from copy import deepcopy
from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from lib.datasets import examples
from lib.extractor import Part, PartGraph, PartGraphError
from lib.extractor import files as partgraph_files
from lib.extractor.errors import PartGraphWarning
from lib.extractor.files import load, read_many, sources
from lib.extractor.nodes import MOST_LEVELS, MOST_PARTS
from lib.interpreters.cuboids import Cuboids
from lib.interpreters.shapeassembly import execute, parse

BOX = [0.0, 0.5, 0.0, 1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
TURNED = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.6, 0.8, 0.0, -0.8, 0.6, 0.0]
EDGES = [{"part_a": 0, "part_b": 1, "type": "ADJ", "params": []}]
CHAIR = {
    "id": 0, "label": "chair", "box": BOX, "edges": EDGES,
    "children": [
        {"id": 1, "label": "chair_seat", "box": BOX},
        {"id": 2, "label": "chair_base", "box": TURNED, "children": [{"id": 7, "label": "leg", "box": TURNED}]},
    ],
}  # fmt: skip
NEVER_SLOWER = 5.0  # seconds for one bad file; all take far less, this is for a busy machine


@pytest.fixture(autouse=True)
def warnings_are_errors():
    """A warning nobody asked for fails the test."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", PartGraphWarning)
        yield


def chair(path: str = "", **changes) -> dict:
    """CHAIR with a change in the part that `path` names by numbers, such as "1.0"; a key set to `del` goes."""
    value = node = deepcopy(CHAIR)
    for number in filter(None, path.split(".")):
        node = node["children"][int(number)]
    node.update(changes)
    for key in [key for key, change in changes.items() if change == "del"]:
        del node[key]
    return value


def box(**numbers) -> list:
    """BOX with some of its numbers replaced: box(n3=0) has side 1 zero."""
    return [numbers.get(f"n{at}", number) for at, number in enumerate(BOX)]


def error_of(source, category: str = "", file: str = "") -> PartGraphError:
    with pytest.raises(PartGraphError) as caught:
        PartGraph.from_json(source, category, file)
    return caught.value


def same(first: PartGraph, second: PartGraph) -> bool:
    """Are two graphs equal, numbers to 1e-12 (a few roundings of numbers around 1)?"""
    (names, numbers), (other_names, other_numbers) = contents(first), contents(second)
    return names == other_names and torch.allclose(numbers, other_numbers, atol=1e-12, rtol=1e-12)


def contents(graph: PartGraph) -> tuple[list, torch.Tensor]:
    parts = list(graph.root.walk())
    names = [(part.label, part.id, json.dumps(part.edges), len(part.children)) for part in parts]
    boxes = [torch.cat([part.box.center, part.box.size, part.box.axes.flatten()]) for part in parts]
    return names, torch.stack(boxes)


def sorted_rows(boxes: Cuboids) -> torch.Tensor:
    rows = torch.cat([boxes.size, boxes.center, boxes.axes.flatten(-2)], -1).detach().double()
    return torch.tensor(sorted(rows.tolist()))


# Reading


def test_what_is_read():
    graph = PartGraph.from_json(json.dumps(CHAIR), "chair", "folder/43875.json")
    assert (graph.category, graph.name, graph.labels) == ("chair", "43875", ["chair_seat", "leg"])
    assert [part.id for part in graph.root.walk()] == [0, 1, 2, 7]
    assert graph.root.edges == tuple(EDGES) and graph.root.children[0].edges == ()
    leg = graph.root.children[1].children[0].box
    assert leg.center.tolist() == [0.1, 0.2, 0.3] and leg.size.tolist() == [0.4, 0.5, 0.6]
    assert leg.axes.tolist() == [
        pytest.approx(axis) for axis in ([0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1])
    ]  # third = first x second


TEXT = json.dumps(CHAIR)
SAME = {  # texts of the same graph
    "one line": TEXT,
    "bytes": TEXT.encode(),
    "indented": json.dumps(CHAIR, indent=2),
    "a byte order mark": "\ufeff" + TEXT,
    "a byte order mark in bytes": TEXT.encode("utf-8-sig"),
    "blank lines around it": f"\n\n{TEXT}\r\n\n",
    "the last of several lines": f'{{"label": "old"}}\n{TEXT}\n',
    "below a line that is no JSON": f"# written by hand\n{TEXT}",
    "a Python object": CHAIR,
    "tuples in it": chair(box=tuple(BOX), edges=tuple(EDGES)),
    "extra keys": chair(geo="mesh.obj", box_params=None),
    "no ids": chair(id="del") | {"id": None},
    "children of a leaf empty": chair("0", children=[]),
    "children of a leaf null": chair("0", children=None),
    "edges of a part empty": chair("1", edges=[]),
    "edges of a part null": chair("1", edges=None),
}


@pytest.mark.parametrize("source", SAME.values(), ids=SAME.keys())
def test_the_same_graph_written_otherwise(source):
    assert same(PartGraph.from_json(source), PartGraph.from_json(CHAIR))


def test_a_part_without_an_id_gets_a_free_number():
    value = chair("1", id="del")
    value["children"][0]["id"] = None
    assert [part.id for part in PartGraph.from_json(value).root.walk()] == [0, 1, 2, 7]
    value["children"][1]["children"][0]["id"] = 1
    assert [part.id for part in PartGraph.from_json(value).root.walk()] == [0, 2, 3, 1]


@pytest.mark.parametrize("nothing", ["del", None])
def test_an_inner_part_without_a_box_gets_the_bounds_of_its_leaves(nothing):
    value = chair("1", box=nothing)
    value["box"] = None
    graph = PartGraph.from_json(value)
    for part in (graph.root, graph.root.children[1]):
        low, high = PartGraph(part).leaves.bounds()
        torch.testing.assert_close(part.box.center, (low + high) / 2)
        torch.testing.assert_close(part.box.size, high - low)
        assert torch.equal(part.box.axes, torch.eye(3).double())


def test_axes_become_right_angled_with_a_warning_where_they_are_near():
    near = chair("1.0", box=box(n6=1.004, n9=0.005))
    with pytest.warns(PartGraphWarning, match=r"^a.json: axes .* in chair/chair_base\[1\]/leg\[0\]$"):
        graph = PartGraph.from_json(near, file="a.json")
    axes = graph.root.children[1].children[0].box.axes
    torch.testing.assert_close(axes @ axes.T, torch.eye(3).double(), atol=1e-12, rtol=0)
    torch.testing.assert_close(axes, torch.eye(3).double(), atol=0.01, rtol=0)


def test_axes_with_few_decimals_are_mended_in_silence():
    half = 0.70711  # of a turn by 45 degrees
    value = chair("1.0", box=box(n6=half, n7=half, n9=-half, n10=half))
    axes = PartGraph.from_json(value).root.children[1].children[0].box.axes
    torch.testing.assert_close(axes @ axes.T, torch.eye(3).double(), atol=1e-12, rtol=0)


# Labels and categories


def test_unknown_labels_are_named_once_and_kept():
    value = chair("0", label="throne")
    value["children"] += [{"label": "throne", "box": BOX}, {"label": "sceptre", "box": BOX}]
    with pytest.warns(PartGraphWarning) as caught:
        graph = PartGraph.from_json(value, "chair", "king.json")
    assert [str(warning.message) for warning in caught] == [
        "king.json: labels that no chair of the authors' data has: 'throne', 'sceptre'"
    ]
    assert graph.labels == ["throne", "leg", "throne", "sceptre"]


def test_no_category_no_warning_and_other_is_always_known():
    assert PartGraph.from_json(chair("0", label="throne")).category == ""
    PartGraph.from_json(chair("0", label="other"), "chair")


def test_partnets_name_of_a_category():
    with pytest.warns(PartGraphWarning, match="no storage of"):
        assert PartGraph.from_json(CHAIR, "storagefurniture").category == "storage"


# Errors


def nested(levels: int) -> dict:
    value = {"label": "leaf", "box": BOX}
    for _ in range(levels - 1):
        value = {"label": "inner", "children": [value]}
    return value


def looped() -> dict:
    value = chair("1", children=[])
    value["children"][1]["children"].append(value["children"][1])
    return value


def nested_text(levels: int) -> str:
    return '{"label": "a", "children": [' * levels + json.dumps(CHAIR) + "]}" * levels


LEG, ROOT = "chair/chair_base[1]/leg[0]", "chair"
# source -> the part, what was found, what was expected (each a piece of the message)
BAD = {
    "nothing": ("", "", "the text is empty", "one JSON object"),
    "blanks": (b"\xef\xbb\xbf \n", "", "the text is empty", "one JSON object"),
    "not a text": (b"\x89PNG\xff", "", "not a text file: byte 0 is not UTF-8", "JSON"),
    "not JSON": ("{'label': 1}", "", "not JSON: Expecting property name", "one JSON object"),
    "cut off": ('{\n"label":\n', "", "not JSON: Expecting value at line 2, column 9", "one JSON object"),
    "the last line is bad too": ('x\n{"label"', "", "line 1, column 1", "one JSON object"),
    "a number of 5000 digits": ("[" + "9" * 5000 + "]", "", "thousands of digits", "one JSON object"),
    "brackets": ("[" * 100_000, "", "nested too deeply", "at most 100 levels"),
    "a list": ("[1, 2]", "root", "found a list of 2", "a JSON object"),
    "a number": ("3", "root", "found 3", "a JSON object"),
    "null": ("null", "root", "found null", "a JSON object"),
    "a child is a text": (chair(children=["leg"]), "chair/?[0]", 'found "leg"', "a JSON object"),
    "a Python thing": (chair("1.0", label=torch), LEG.replace("leg", "?"), "of type module", "a word"),
    "no label": (chair("1.0", label="del"), "chair/chair_base[1]/?[0]", "no label", 'a word such as "leg"'),
    "no label at the root": (chair(label="del"), "root", "no label", "a word"),
    "label null": (chair("0", label=None), "chair/?[0]", "the label is null", "a word"),
    "label a number": (chair("0", label=3), "chair/?[0]", "the label is 3", "a word"),
    "label empty": (chair("0", label=""), "chair/[0]", 'the label is ""', "a word"),
    "children a text": (chair("0", children="leg"), "chair/chair_seat[0]", 'children is "leg"', "a list"),
    "children an object": (chair("0", children={}), "chair/chair_seat[0]", "children is an object", "a list"),
    "edges a number": (chair(edges=4), ROOT, "edges is 4", "a list"),
    "edges of a leaf": (chair("1.0", edges=False), LEG, "edges is false", "a list"),
    "an edge null": (chair(edges=[*EDGES, None]), ROOT, "an edge is null", "a JSON object"),
    "no parts": (chair(children="del"), ROOT, "no parts: the root has no children", "one leaf below the root"),
    "children empty": (chair(children=[]), ROOT, "no parts", "one leaf below the root"),
    "id a text": (chair("1.0", id="7"), LEG, 'the id is "7"', "a whole number"),
    "id a fraction": (chair("1.0", id=7.0), LEG, "the id is 7.0", "a whole number"),
    "id true": (chair("1.0", id=True), LEG, "the id is true", "a whole number"),
    "id huge": (chair("1.0", id=10**5000), LEG, "the id is a huge whole number", "a whole number"),
    "id repeated": (chair("1.0", id=1), LEG, "the id 1 is also that of part chair/chair_seat[0]", "its own"),
    "contains itself": (looped(), "chair/chair_base[1]", "contains itself", "a tree"),
    "nested deeply": (nested(MOST_LEVELS + 1), "", "nested too deeply", "at most 100 levels"),
    "nested very deeply": (nested(5000), "", "nested too deeply", "at most 100 levels"),
    "nested deeply in a text": (nested_text(MOST_LEVELS), "", "nested too deeply", "at most 100 levels"),
    "nested 1000 levels in a text": (nested_text(1000), "", "nested too deeply", "at most 100 levels"),
    "too many parts": (chair(children=[CHAIR["children"][0]] * MOST_PARTS), "", "too many parts", "at most 100000"),
    "leaf without a box": (chair("1.0", box="del"), LEG, "a leaf without a box", "12 numbers"),
    "leaf with a box of null": (chair("1.0", box=None), LEG, "a leaf without a box", "12 numbers"),
    "box an object": (chair("1.0", box={}), LEG, "the box is an object", "a list of 12 numbers"),
    "box too short": (chair("1.0", box=BOX[:11]), LEG, "the box is a list of 11", "a list of 12 numbers"),
    "box too long": (chair(box=[*BOX, 0]), ROOT, "the box is a list of 13", "a list of 12 numbers"),
    "box empty": (chair("1", box=[]), "chair/chair_base[1]", "the box is a list of 0", "a list of 12 numbers"),
    "true": (chair("1.0", box=box(n6=True)), LEG, "axis 1 x of the box is true", "a number"),
    "null in a box": (chair("1.0", box=box(n2=None)), LEG, "center z of the box is null", "a number"),
    "a text in a box": (chair("1.0", box=box(n4="1" * 999)), LEG, 'side 2 of the box is "1111', "a number"),
    "NaN": (TEXT.replace("0.3", "NaN"), "chair/chair_base[1]", "center z of the box is NaN", "finite number"),
    "Infinity": (TEXT.replace("0.4", "Infinity"), "chair/chair_base[1]", "side 1 of the box is Infinity", "finite"),
    "infinite after reading": (TEXT.replace("0.5, 0.0", "-1e999, 0"), ROOT, "is -Infinity", "finite number"),
    "far away": (chair("1.0", box=box(n0=-1.1e6)), LEG, "center x of the box is -1100000.0", "at most 1e+06"),
    "a huge integer": (chair("1.0", box=box(n3=10**400)), LEG, "side 1 of the box is a huge whole number", "at most"),
    "side zero": (chair("1.0", box=box(n3=0)), LEG, "side 1 of the box is 0", "a length above 0"),
    "side negative": (chair("1.0", box=box(n5=-0.5)), LEG, "side 3 of the box is -0.5", "a length above 0"),
    "side vanishing": (chair("1.0", box=box(n4=1e-320)), LEG, "side 2 of the box is 1e-320", "a length above 0"),
    "axis zero": (chair("1.0", box=box(n6=0)), LEG, "axis 1 of the box has length 0", "a length of 1"),
    "axis long": (chair("1.0", box=box(n10=2)), LEG, "axis 2 of the box has length 2", "a length of 1"),
    "axis a little long": (chair("1.0", box=box(n10=1.02)), LEG, "axis 2 of the box has length 1.02", "of 1"),
    "axes parallel": (chair("1.0", box=box(n9=1, n10=0)), LEG, "0 degrees between axis 1 and axis 2", "90 degrees"),
    "axes oblique": (chair("1.0", box=box(n9=0.6, n10=0.8)), LEG, "53.13 degrees between", "90 degrees"),
}  # fmt: skip


@pytest.mark.parametrize("source, node, found, expected", BAD.values(), ids=BAD.keys())
def test_an_error_names_file_part_and_what_is_wrong(source, node, found, expected, time_limit):
    with time_limit(NEVER_SLOWER):
        error = error_of(source, "chair", "data/7.json")
    assert (error.file, error.node) == ("data/7.json", node)
    assert found in error.found and expected in error.expected, error
    place = f"data/7.json, part {node}: " if node else "data/7.json: "
    assert str(error) == f"{place}{error.found}; expected {error.expected}" and "\n" not in str(error)
    assert isinstance(error, ValueError) and len(str(error)) < 300
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_an_unknown_category_names_the_choices(tmp_path):
    message = 'unknown category "sofa"; expected one of chair, table, storage, or "" for none'
    assert str(error_of(CHAIR, "sofa")) == message
    with pytest.raises(PartGraphError, match="unknown category"):
        read_many(tmp_path, "sofa")  # at once, not for every file


def test_the_deepest_graph_is_read_and_written():
    graph = PartGraph.from_json(nested(MOST_LEVELS))
    assert len(list(PartGraph.from_json(graph.to_json()).root.walk())) == MOST_LEVELS


def test_the_largest_graph_is_read(time_limit, unchecked_shapes):
    with time_limit(60):
        graph = PartGraph.from_json(chair(children=[{"label": "leg", "box": BOX}] * (MOST_PARTS - 1)))
    assert len(graph.leaves) == MOST_PARTS - 1


# Writing


def test_write_then_read(tmp_path):
    PartGraph.from_json(CHAIR).write(tmp_path / "1.json")
    once = PartGraph.read(tmp_path / "1.json", "chair")
    once.write(tmp_path / "2.json")
    assert same(once, PartGraph.from_json(CHAIR)) and same(once, PartGraph.read(tmp_path / "2.json"))
    assert (once.name, once.category) == ("1", "chair")
    assert (tmp_path / "1.json").read_text().count("\n") == 1  # the authors' reader keeps the last line only
    assert sorted(path.name for path in tmp_path.iterdir()) == ["1.json", "2.json"]


def test_random_axes_come_back_to_the_last_digits():
    generator = torch.Generator().manual_seed(3)
    axes = torch.linalg.qr(torch.randn(40, 3, 3, generator=generator, dtype=torch.float64)).Q
    axes[::2, 2] *= -1  # boxes of both hands
    assert {round(sign) for sign in torch.linalg.det(axes).tolist()} == {-1, 1}
    size, center = torch.rand(2, 40, 3, generator=generator, dtype=torch.float64)
    boxes = Cuboids(size, center, axes)
    root = Part("chair", boxes[0], tuple(Part("leg", boxes[at], (), at) for at in range(1, 40)))
    read = PartGraph.from_json(PartGraph(root).to_json())
    torch.testing.assert_close(read.leaves.axes[:, :2], axes[1:, :2], atol=1e-12, rtol=0)
    torch.testing.assert_close(torch.linalg.det(read.leaves.axes), torch.ones(39).double())
    assert same(read, PartGraph.from_json(read.to_json()))


def test_ids_that_repeat_are_replaced():
    leg = PartGraph.from_json(CHAIR).root.children[0]
    root = Part("chair", leg.box, (leg, leg, leg), 5)
    assert [part.id for part in PartGraph.from_json(PartGraph(root).to_json()).root.walk()] == [0, 1, 2, 3]


def test_boxes_in_single_precision_with_a_gradient():
    box = Cuboids(torch.ones(3, requires_grad=True), torch.zeros(3), torch.eye(3))
    graph = PartGraph.from_json(PartGraph(Part("chair", box, (Part("leg", box),))).to_json())
    assert graph.leaves.size.tolist() == [[1, 1, 1]]


FLAT = Cuboids(torch.zeros(3), torch.zeros(3), torch.eye(3))
NOWHERE = Cuboids(torch.ones(3), torch.full((3,), torch.nan), torch.eye(3))


def with_leaf(part: Part, **changes) -> PartGraph:
    fields = {"label": part.label, "box": part.box, "edges": part.edges} | changes
    return PartGraph(Part(children=(Part(**fields),), label="chair", box=part.box), name="mine")


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"box": FLAT}, "mine, part chair/leg.0.: side 1 of the box is 0.0"),
        ({"box": NOWHERE}, "mine, part chair/leg.0.: center x of the box is NaN"),
        ({"label": ""}, "the label is"),
        ({"edges": ({"params": torch},)}, "mine: the edges are no JSON"),
        ({"edges": ({"params": {1, 2}},)}, "mine: the edges are no JSON"),
    ],
)  # fmt: skip
def test_what_could_not_be_read_is_not_written(changes, message, tmp_path):
    leg = PartGraph.from_json(CHAIR).root.children[1].children[0]
    (tmp_path / "a.json").write_text("as before")
    with pytest.raises(PartGraphError, match=message):
        with_leaf(leg, **changes).write(tmp_path / "a.json")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["as before"]


def test_a_failed_write_leaves_nothing_behind(tmp_path):
    graph = PartGraph.from_json(CHAIR)
    (tmp_path / "taken.json").mkdir()
    for path in (tmp_path / "no such folder" / "a.json", tmp_path / "taken.json"):
        with pytest.raises(PartGraphError, match=r"\.json: cannot be written \(.+\)"):
            graph.write(path)
    assert [path.name for path in tmp_path.iterdir()] == ["taken.json"]


def test_an_interrupted_write_leaves_the_old_file(tmp_path, monkeypatch):
    (tmp_path / "a.json").write_text("as before")

    def half(path: Path, text: str, encoding: str) -> None:
        path.write_bytes(text[: len(text) // 2].encode())
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", half)
    with pytest.raises(PartGraphError, match="No space left"):
        PartGraph.from_json(CHAIR).write(tmp_path / "a.json")
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"as before"]


# Files, folders and archives


def test_a_file_that_cannot_be_read(tmp_path):
    for path in (tmp_path / "none.json", tmp_path, "a\0b"):
        with pytest.raises(PartGraphError, match=r"cannot be read \(.+\)") as caught:
            PartGraph.read(path)
        assert caught.value.file == str(path)


def test_a_file_too_large(tmp_path, monkeypatch):
    monkeypatch.setattr(partgraph_files, "LARGEST_FILE", len(TEXT))
    (tmp_path / "a.json").write_text(TEXT)
    PartGraph.read(tmp_path / "a.json")
    (tmp_path / "a.json").write_text(TEXT + " ")
    with pytest.raises(PartGraphError, match="a.json: the file is too large; expected at most"):
        PartGraph.read(tmp_path / "a.json")


FILES = {
    "b/2.json": TEXT,
    "a.json": json.dumps(chair("0", label="mine")),
    "b/1.json": "{",
    "b/notes.txt": "no graph",
    "__MACOSX/b/._1.json": "\0",
    "b/c/2.json": TEXT,
}
NAMES = ["a", "b/1", "b/2", "b/c/2"]


@pytest.fixture(params=["folder", "archive"])
def source(request, tmp_path) -> Path:
    """The same files in a folder and in a zip archive."""
    folder = tmp_path / "folder"
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    (folder / "odd.json").mkdir()
    return folder if request.param == "folder" else archive(tmp_path / "graphs.zip", FILES)


def archive(path: Path, texts: dict, method: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", method) as members:
        for name, text in texts.items():
            members.writestr(name, text)
    return path


def test_sources_and_load(source):
    assert sources(source) == NAMES == sources(str(source))
    graph = load(source, "a")
    assert (graph.name, graph.labels) == ("a", ["mine", "leg"])
    with pytest.raises(PartGraphError, match="c/9.json: (cannot be read|there is no such file)"):
        load(source, "c/9")


def test_read_many_gives_an_error_in_place_of_a_bad_file(source):
    results = dict(read_many(source))
    assert list(results) == NAMES
    assert [isinstance(graph, PartGraph) for graph in results.values()] == [True, False, True, True]
    assert [graph.name for graph in results.values() if isinstance(graph, PartGraph)] == ["a", "b/2", "b/c/2"]
    assert str(results["b/1"]).startswith(f"{source}/b/1.json: not JSON: ")
    assert same(results["b/c/2"], PartGraph.from_json(CHAIR))


def test_read_many_passes_the_category_on(source):
    with pytest.warns(PartGraphWarning, match="a.json: labels that no chair .*: 'mine'"):
        assert next(read_many(source, "chair"))[1].category == "chair"


def test_a_source_that_is_none(tmp_path):
    (tmp_path / "a.json").write_text(TEXT)
    for read in (sources, read_many):
        with pytest.raises(
            PartGraphError, match="a.json: no zip archive, or a damaged one; expected a folder or"
        ):
            read(tmp_path / "a.json")
        with pytest.raises(PartGraphError, match=r"none.zip: cannot be read \(No such file"):
            read(tmp_path / "none.zip")
    assert sources(archive(tmp_path / "empty.zip", {})) == []


def test_names_that_climb_out_are_only_names(tmp_path):
    path = archive(tmp_path / "a.zip", {"../../up.json": TEXT, "/root.json": TEXT})
    assert [(name, type(graph)) for name, graph in read_many(path)] == [
        ("../../up", PartGraph),
        ("/root", PartGraph),
    ]
    assert [path.name for path in tmp_path.iterdir()] == ["a.zip"]


def damaged(path: Path, old: bytes, new: bytes) -> Path:
    data = path.read_bytes()
    assert old in data
    path.write_bytes(data.replace(old, new))
    return path


def test_a_damaged_member_is_an_error_of_its_own(tmp_path):
    path = archive(tmp_path / "a.zip", {"bad.json": TEXT, "good.json": CHAIR_ELSEWHERE}, zipfile.ZIP_STORED)
    results = dict(read_many(damaged(path, TEXT.encode(), TEXT.replace("leg", "arm").encode())))
    assert "a.zip/bad.json: the archive is damaged here (Bad CRC-32" in str(results["bad"])
    assert isinstance(results["good"], PartGraph)


CHAIR_ELSEWHERE = TEXT.replace("0.3", "0.7")


def test_an_encrypted_member(tmp_path):
    path = archive(tmp_path / "a.zip", {"a.json": TEXT})
    data = bytearray(path.read_bytes())
    data[data.index(b"PK\x01\x02") + 8] |= 1  # the flag in the archive's list of files
    path.write_bytes(data)
    with pytest.raises(PartGraphError, match="a.zip/a.json: the file is encrypted"):
        load(path, "a")


def test_an_unusual_compression(tmp_path):
    path = archive(tmp_path / "a.zip", {"a.json": TEXT}, zipfile.ZIP_BZIP2)
    with pytest.raises(PartGraphError, match="a.zip/a.json: compressed in an unusual way"):
        load(path, "a")


def test_a_zip_bomb_does_not_fill_the_memory(tmp_path):
    import tracemalloc

    path = tmp_path / "bomb.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as members, members.open("a.json", "w") as stream:
        for _ in range(256):
            stream.write(bytes(2**20))
    tracemalloc.start()
    with pytest.raises(PartGraphError, match="the file is too large; expected at most 64 MB"):
        load(path, "a")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2.5 * partgraph_files.LARGEST_FILE


def test_an_archive_that_changes_is_opened_anew(tmp_path):
    path = archive(tmp_path / "a.zip", {"a.json": TEXT})
    assert sources(path) == ["a"]
    time.sleep(0.01)  # clocks of file systems are coarse
    assert sources(archive(path, {"b.json": TEXT, "c.json": TEXT})) == ["b", "c"]


def test_a_forked_process_opens_an_archive_of_its_own(tmp_path, monkeypatch):
    path = archive(tmp_path / "a.zip", {"a.json": TEXT})
    parents = partgraph_files._archive(path)
    assert partgraph_files._archive(path) is parents
    monkeypatch.setattr("os.getpid", lambda: -1)
    assert partgraph_files._archive(path) is not parents


# From programs


@pytest.mark.parametrize("name, program", examples().items(), ids=examples().keys())
def test_from_the_examples(name, program):
    same_shape(execute(program))


def test_from_sampled_programs(sampled):
    for program in sampled:
        same_shape(execute(program))


def same_shape(shape) -> None:
    """The leaves are those of the shape, and every leaf lies under the boxes that it lies under there."""
    graph = PartGraph.from_shape(shape, "chair", "mine")
    assert (graph.category, graph.name, {*graph.labels}) == ("chair", "mine", {"other"})
    torch.testing.assert_close(sorted_rows(graph.leaves), sorted_rows(shape.cuboids), atol=0, rtol=0)
    for part in graph.root.walk():
        assert torch.equal(part.box.size, shape.boxes.size[part.id].double())
        assert [shape.parents[child.id] for child in part.children] == [part.id] * len(part.children)
    again = PartGraph.from_json(graph.to_json())
    assert same(again, graph)


def test_a_block_without_cuboids_is_no_leaf():
    text = """Assembly Program_0 {
        bbox = Cuboid(1, 1, 1, True)
        cube0 = Cuboid(0.5, 0.5, 0.5, True)
        Program_1 = Cuboid(0.2, 0.2, 0.2, True)
        attach(cube0, bbox, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)
        attach(Program_1, bbox, 0.5, 0.5, 0.5, 0.2, 0.2, 0.2)
    }
    Assembly Program_1 {
        bbox = Cuboid(0.2, 0.2, 0.2, True)
    }"""
    same_shape(execute(parse(text)))
    with pytest.raises(PartGraphError, match="no cuboids"):
        PartGraph.from_shape(execute(parse(text.replace("cube0 ", "# ").replace("attach(cube0", "# "))))


def test_a_part_carries_only_its_own_numbers_to_other_processes():
    few, many = (len(pickle.dumps(PartGraph.from_json(nested(levels)))) for levels in (10, 90))
    assert many < 10 * few  # 9 times as many parts; views of one table would make it 81 times


# Fuzzing: a damaged file is read or a PartGraphError. Nothing else escapes, nothing hangs.

JUNK = """0 -0.0 1e-320 99999999999999999999 null true NaN 1e999 -1e308 - . , : " { } [ ] [] {} é \\ud800
    "id" "label" "box" "children" "edges\"""".split()
JUNK += ["", " ", "\n", "\0", "\ufeff", "1" * 5000]


def mutant(rng: random.Random, text: str) -> str:
    for _ in range(rng.randint(1, 4)):
        start = rng.randrange(len(text) + 1)
        stop = start + rng.choice([0, 0, 1, 1, 4, 30])
        junk = rng.choice([*JUNK, text[start : start + rng.randint(1, 200)], chr(rng.randrange(1, 0x500))])
        text = text[:start] + junk + text[stop:]
    return text


def reads_or_says_why(source: str | dict) -> bool:
    try:
        graph = PartGraph.from_json(source, "chair", "fuzz.json")
    except PartGraphError as error:
        assert error.file == "fuzz.json" and len(str(error)) < 500
        return False
    corners = graph.leaves.corners()
    assert len(corners) and corners.isfinite().all()
    assert same(PartGraph.from_json(graph.to_json()), graph)
    return True


@pytest.mark.filterwarnings("ignore")
def test_mutants(time_limit, unchecked_shapes):
    warnings.simplefilter("ignore")
    rng = random.Random(11)
    results = []
    for _ in range(3000):
        with time_limit(NEVER_SLOWER):
            results.append(reads_or_says_why(mutant(rng, TEXT)))
    assert 100 < sum(results) < 2900  # both happen


KEYS = st.sampled_from(["id", "label", "box", "children", "edges"])
SIMPLE = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(BOX)
VALUES = st.recursive(
    SIMPLE,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner),
    max_leaves=20,
)


@settings(max_examples=200, deadline=None)
@given(VALUES, st.sampled_from(["", "0", "1", "1.0"]), KEYS)
def test_any_value_in_any_place(value, path, key):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reads_or_says_why(json.dumps(chair(path, **{key: value})))


def test_a_damaged_archive_never_raises_anything_else(tmp_path):
    good = archive(tmp_path / "good.zip", {"a.json": TEXT, "b/b.json": TEXT}).read_bytes()
    rng = random.Random(5)
    read = 0
    for number in range(400):
        data = bytearray(good)
        for _ in range(rng.randint(1, 5)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        path = tmp_path / f"{number}.zip"
        path.write_bytes(data[: rng.choice([len(data), len(data), rng.randrange(len(data))])])
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                read += sum(isinstance(graph, PartGraph) for _, graph in read_many(path))
        except PartGraphError:
            pass
    assert 0 < read < 800
