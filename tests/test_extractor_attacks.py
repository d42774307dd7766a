"""Whatever a graph holds: extraction says what is wrong with it, in finite time, and its neighbours do not notice."""

import math
import resource

import pytest
import torch

from lib.extractor import (
    REASONS,
    Options,
    Part,
    PartGraph,
    PartGraphError,
    RejectedError,
    extract,
    extract_many,
    stages,
)
from lib.extractor.nodes import MOST_LEVELS
from lib.extractor.soundness import MOST_PARTS
from lib.interpreters.cuboids import Cuboids

from .conftest import unchecked
from .graphs import (
    CATEGORIES,
    box,
    extract_all,
    extracted,
    furniture,
    graph,
    leaf,
    node,
    random_boxes,
    text,
    turn,
)

NAN, INF = math.nan, math.inf
SECONDS = 20.0  # for one graph on a busy machine with shape checks on; alone the slowest takes two
MEMORY = 500 * 2**10  # kB that all of them together may add
CUBE = leaf((1, 1, 1))


def on_top(size=(1, 1, 1), y: float = 1, axes=None, label: str = "other") -> Part:
    return leaf(size, (0, y, 0), label, axes)


def chain(levels: int, branches: bool = False) -> PartGraph:
    """A leaf so many levels below the root; with branches, a leaf at every level."""
    part = CUBE
    for level in range(levels):
        children = (part, leaf((1, 1, 1), (0, level + 1.0, 0))) if branches else (part,)
        part = Part("other", box((1, 1, 1)), children)
    return PartGraph(part)


def cloud(count: int, seed: int = 0) -> PartGraph:
    boxes = random_boxes(seed, count)
    return graph(*(Part("other", boxes[i]) for i in range(count)))


LEFT = [[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, -1]]
FINE = {  # graphs that have a program
    "one leaf": graph(CUBE),
    "the same leaf ten times": graph(*[CUBE] * 10),
    "all leaves identical": graph(*(leaf((1, 1, 1)) for _ in range(100))),
    "a sliver on a block": graph(CUBE, on_top((1, 1e-6, 1), 0.5)),
    "copies at almost one place": graph(leaf((1, 1, 1), (-1e-9, 0, 0)), leaf((1, 1, 1), (1e-9, 0, 0))),
    "thin copies at almost one place": graph(
        *(leaf((0.1, 1, 1), (x, 0, 0)) for x in (-1e-9, 1e-9)),
        *(leaf((1, 0.1, 1), (0, y, 0)) for y in (-0.55, 0.55)),
    ),
    "far from the origin": graph(*(leaf((1, 1, 1), (1e5, 1e5 + y, -1e5)) for y in (0, 1))),
    "tiny": graph(*(leaf((1e-8, 1e-8, 1e-8), (0, y * 1e-8, 0)) for y in (0, 1))),
    "large": graph(*(leaf((1e5, 1e5, 1e5), (0, y * 1e5, 0)) for y in (0, 1))),
    "left-handed and upright": graph(leaf((1, 1, 2), axes=[[1, 0, 0], [0, 1, 0], [0, 0, -1]]), on_top()),
    "left-handed and turned": graph(leaf((1, 1, 2), axes=LEFT), on_top()),
    "a category nobody knows": PartGraph(graph(CUBE, on_top()).root, "spaceship"),
    "labels of others": PartGraph(
        graph(leaf((1, 1, 1), label="drawer"), on_top(label="cabinet_door")).root, "chair"
    ),
    "odd labels": PartGraph(graph(leaf((1, 1, 1), label=""), on_top(label="a\n}\0")).root, "chair"),
    "single precision": graph(Part("x", Cuboids(torch.ones(3), torch.zeros(3), torch.eye(3)))),
    "deep": chain(MOST_LEVELS - 1),
    "a storage of one frame": PartGraph(
        graph(node("cabinet_frame", CUBE), on_top(label="shelf")).root, "storage"
    ),
}
BAD = {  # graphs that have none, or perhaps one
    "a huge cloud": cloud(MOST_PARTS + 1),
    "thousands of leaves": graph(*(leaf((1, 1, 1), (i, 0, 0)) for i in range(5000))),
    "a cloud": cloud(20),
    "a grid": graph(*(leaf((1, 1, 1), (i % 8, i // 8, 0)) for i in range(64))),
    "a row": graph(*(leaf((1, 1, 1), (i, 0, 0)) for i in range(100))),
    "only slivers": graph(leaf((1, 1e-6, 1)), leaf((1, 1e-9, 1))),
    "all thin": graph(leaf((1e-6, 1e-6, 1e-6)), leaf((1e-6, 1e-6, 1e-6), (1e-6, 0, 0))),
    "a needle": graph(leaf((1e5, 1, 1)), on_top()),
    "no size": graph(leaf((0, 0, 0)), leaf((0, 0, 0))),
    "a size of zero": graph(leaf((0, 1, 1)), on_top()),
    "a size below zero": graph(leaf((-1, 1, 1)), on_top()),
    "a size that is none": graph(leaf((NAN, 1, 1)), CUBE),
    "a place that is none": graph(leaf((1, 1, 1), (0, NAN, 0)), CUBE),
    "axes that are none": graph(leaf((1, 1, 1), axes=[[NAN] * 3] * 3), CUBE),
    "nothing but NaN": graph(leaf((NAN,) * 3, (NAN,) * 3)),
    "an endless size": graph(leaf((INF, 1, 1)), CUBE),
    "an endless place": graph(leaf((1, 1, 1), (INF, 0, 0)), CUBE),
    "no axes": graph(leaf((1, 1, 1), axes=[[0, 0, 0]] * 3), on_top()),
    "sheared axes": graph(leaf((1, 1, 1), axes=[[1, 0, 0], [0.6, 0.8, 0], [0, 0, 1]]), on_top()),
    "coordinates of 1e300": graph(leaf((1, 1, 1), (1e300,) * 3), leaf((1, 1, 1), (1e300,) * 3)),
    "sizes of 1e300": graph(leaf((1e300, 1e300, 1e300)), on_top()),
    "sizes of 1e-300": graph(leaf((1e-300,) * 3), leaf((1e-300,) * 3, (0, 1e-300, 0))),
    "each inside the next": graph(*(leaf((k, k, k)) for k in range(1, 20))),
    "a root that is a leaf": PartGraph(CUBE),
    "islands": graph(CUBE, leaf((1, 1, 1), (5, 5, 5)), leaf((1, 1, 1), (-5, 2, 5))),
    "too deep": chain(MOST_LEVELS),
    "far too deep": chain(3000),
    "too deep, with branches": chain(400, branches=True),
    "deep, with branches": chain(60, branches=True),
    "turned anyhow": graph(
        *(leaf((3, 1, 2), (0, y, 0), axes=turn(37 * y, 0) @ turn(23 * y, 1)) for y in range(9))
    ),
    "detail whose box is none": PartGraph(
        graph(CUBE, Part("caster", box((NAN, 1, 1)), (CUBE,))).root, "chair"
    ),
    "detail whose box is nothing": PartGraph(
        graph(CUBE, Part("caster", box((0, 0, 0)), (CUBE,))).root, "chair"
    ),
    "detail far away": PartGraph(
        graph(CUBE, Part("caster", box((1, 1, 1), (1e300, 0, 0)), (CUBE,))).root, "chair"
    ),
    "an inner box that is none": graph(Part("x", box((NAN, 1, 1)), (CUBE, on_top()))),
}
OPTIONS = {"usual": Options(), "everything left out": Options(False, False, False, False, True)}


@pytest.mark.parametrize("name", FINE)
def test_odd_but_fine(name, time_limit):
    with time_limit(SECONDS):
        extraction = extract(FINE[name])
    assert extraction.accepted, (extraction.reason, extraction.detail)
    assert extraction.f_score > 99


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize("name", BAD)
def test_nothing_is_raised(name, options, time_limit):
    with time_limit(SECONDS), unchecked():
        extraction = extract(BAD[name], OPTIONS[options])
    assert extraction.reason in ("", *REASONS)
    assert extraction.accepted or extraction.detail
    assert extraction.program is None or extraction.accepted or OPTIONS[options].keep_rejected


@pytest.mark.parametrize("name", BAD)
def test_stages_reject_and_nothing_else(name, time_limit):
    with time_limit(SECONDS), unchecked():
        try:
            assert len(stages(BAD[name])) > 5
        except RejectedError as error:
            assert error.reason in REASONS


def test_a_gradient_is_cut_off():
    """Sizes that are being learned."""
    single = box((1, 1, 1))
    learned = Part("x", Cuboids(single.size.requires_grad_(), single.center, single.axes))
    extraction = extract(PartGraph(Part("root", box((1, 1, 1)), (learned,))))
    assert extraction.accepted and not extraction.graph.leaves.size.requires_grad


def test_memory():
    """Peak memory grows by less than 500 MB over what came before."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    extract_all([BAD["a cloud"], BAD["a grid"], BAD["thousands of leaves"], BAD["a row"]])
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MEMORY


# Company


def test_no_graphs():
    assert extract_many([]) == []


def test_what_is_no_part_graph():
    with pytest.raises((PartGraphError, TypeError, AttributeError)):
        extract("chair")


def test_bad_graphs_change_nothing_for_the_others():
    """Exactly: texts and scores are those of each graph alone."""
    good = [furniture(category, 3)[-1] for category in CATEGORIES]
    alone = [extracted(category, 3)[-1] for category in CATEGORIES]
    bad = [
        BAD[name] for name in ("islands", "nothing but NaN", "turned anyhow", "far too deep", "sheared axes")
    ]
    mixed = extract_all([*bad[:2], good[0], bad[2], *good[1:], *bad[3:]], Options(keep_rejected=True))
    for here, there in zip([mixed[2], *mixed[4:6]], alone, strict=True):
        assert (text(here), here.f_score, here.reason) == (text(there), there.f_score, there.reason)
    assert [e.reason for e in mixed[:2]] == ["disconnected", "unsound"]


def test_only_bad_graphs():
    found = extract_all([BAD["islands"], BAD["only slivers"], BAD["islands"]])
    assert [e.reason for e in found] == ["disconnected", "empty", "disconnected"]
    assert [e.program for e in found] == [None] * 3


# Chance


@pytest.mark.parametrize("seed", range(3))
def test_random_clouds(seed, time_limit):
    """Boxes turned anyhow, in blocks within blocks, at scales from 1e-7 to 1e7: beyond a million they are unsound."""
    with time_limit(4 * SECONDS), unchecked():
        graphs = []
        for k in range(8):
            boxes, by = random_boxes(100 * seed + k, 2 + k, spread=1.5), 10.0 ** (2 * k - 7)
            parts = [
                Part("other", Cuboids(b.size * by, b.center * by, b.axes))
                for b in map(boxes.__getitem__, range(2 + k))
            ]
            graphs.append(graph(node("a", *parts[:2]), node("b", *parts[-2:]), *parts[2:-2]))
        for extraction in extract_many(graphs, Options(keep_rejected=True)):
            assert extraction.reason in ("", *REASONS)


def test_what_is_no_part_graph_is_named(unchecked_shapes):
    with pytest.raises(PartGraphError, match="found a str; expected a PartGraph"):
        extract("43875.json")


def test_graphs_and_extractions_are_shown_in_a_line():
    found = extract(graph(leaf((1, 1, 1)), leaf((1, 1, 1), (0, 1, 0))))
    assert repr(found) == "<Extraction accepted, F-score 100.0>"
    assert repr(extract(graph(leaf((0, 0, 0))))) == "<Extraction rejected: unsound>"
    assert repr(found.graph) == "<PartGraph without a name: any category, 2 leaves>"
