"""The furniture maker: the same for the same seed, varied, whole, in the known vocabulary, with surfaces in boxes."""

from collections import Counter

import numpy as np
import pytest
import torch

from lib.extractor.labels import COLLAPSED, FLATTENED, FRAME, HELD_BY_FRAME, RANKED
from lib.extractor.partgraph import CATEGORIES, UNLABELLED, stack
from lib.furniture import dense_mesh, dense_surface, make, make_many, structure, surface
from lib.furniture.surfaces import leaf_mesh, style_of

SAMPLE = 1000  # graphs a category in the tests of variety
ALIKE = 0.03  # boxes that differ by less, in shares of the shape's diagonal, are symmetric


@pytest.fixture(scope="module")
def many() -> dict[str, list]:
    """A thousand graphs of each category."""
    from jaxtyping import config

    before = config.jaxtyping_disable
    config.update("jaxtyping_disable", True)
    graphs = {category: make_many(category, SAMPLE) for category in CATEGORIES}
    config.update("jaxtyping_disable", before)
    return graphs


def prepared(part, category: str, root: bool = True) -> tuple:
    """(label, box, children) as an extractor rearranges them: details collapsed, groups flattened, chains skipped."""
    collapsed, flattened = COLLAPSED[category], FLATTENED.get(category, set())
    children = () if part.label in collapsed else part.children
    while len(children) == 1 and children[0].label not in collapsed:
        children = children[0].children
    nodes = [prepared(child, category, root=False) for child in children]
    if root and category in HELD_BY_FRAME:
        held = [node for node in nodes if node[0] in HELD_BY_FRAME[category]]
        rest = [node for node in nodes if node[0] not in HELD_BY_FRAME[category]]
        nodes = [(FRAME, node[1], [*node[2], *held]) if node[0] == FRAME else node for node in rest]
    if part.label in flattened:
        nodes = [leaf for node in nodes for leaf in leaves_below(node)]
    return part.label, box_of(part), nodes


def box_of(part) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return tuple(each.numpy() for each in (part.box.size, part.box.center, part.box.axes))


def leaves_below(node: tuple) -> list[tuple]:
    return [leaf for child in node[2] for leaf in leaves_below(child)] if node[2] else [node]


def groups(node: tuple) -> list[list[tuple]]:
    """Every list of siblings in a prepared tree."""
    return ([node[2]] if node[2] else []) + [each for child in node[2] for each in groups(child)]


def gaps(siblings: list[tuple]) -> np.ndarray:
    """(n, n) distances between boxes, by projecting a point onto one box and the other in turn."""
    size, center, axes = (np.stack([node[1][k] for node in siblings]) for k in range(3))
    n = len(siblings)
    first, second = (index.ravel() for index in np.indices((n, n)))

    def project(points, box):
        local = np.einsum("nj,nij->ni", points - center[box], axes[box])
        local = np.clip(local, -size[box] / 2, size[box] / 2)
        return center[box] + np.einsum("ni,nij->nj", local, axes[box])

    here = center[first]
    for _ in range(60):
        there = project(here, second)
        here = project(there, first)
    return np.linalg.norm(there - here, axis=1).reshape(n, n)


def loose(siblings: list[tuple], diagonal: float) -> list[str]:
    """Labels of siblings that no chain of touching parts joins to the top or bottom of the group."""
    lows, highs = [], []
    for _, (size, center, axes), _ in siblings:
        reach = (size / 2) @ np.abs(axes)
        lows.append(center[1] - reach[1])
        highs.append(center[1] + reach[1])
    near = 0.01 * diagonal
    reached = (np.array(lows) < min(lows) + near) | (np.array(highs) > max(highs) - near)
    touching = gaps(siblings) <= near
    for _ in siblings:
        reached |= (touching & reached).any(axis=1)
    return [node[0] for node, held in zip(siblings, reached) if not held]


def distinct(siblings: list[tuple], diagonal: float) -> list[tuple]:
    """One sibling of each mirrored pair and of each row of equal steps."""
    tolerance, kept, left = ALIKE * diagonal, [], list(siblings)
    while left:
        first = left.pop(0)
        same = [
            node
            for node in left
            if node[0] == first[0] and np.abs(node[1][0] - first[1][0]).max() < tolerance
        ]
        offsets = [node[1][1] - first[1][1] for node in same]
        best = []
        for axis in range(3):
            line = [
                k for k, offset in enumerate(offsets) if np.abs(np.delete(offset, axis)).max() < tolerance
            ]
            best = max(best, line, key=len)
        mirrored = [
            k
            for k, node in enumerate(same)
            if np.abs(node[1][1] * (-1, 1, 1) - first[1][1]).max() < tolerance
        ]
        gone = {id(same[k]) for k in best or mirrored[:1]}
        left = [node for node in left if id(node) not in gone]
        kept.append(first)
    return kept


def distinct_leaves(node: tuple, diagonal: float) -> int:
    return sum(distinct_leaves(child, diagonal) for child in distinct(node[2], diagonal)) if node[2] else 1


def diagonal_of(graph) -> float:
    return float(graph.root.box.size.norm())


@pytest.mark.parametrize("category", CATEGORIES)
def test_the_same_seed_makes_the_same_furniture(category):
    first, again = make(category, 42), [make(category, seed) for seed in (7, 42)][1]
    assert first.name == again.name == f"{category}-000042" and first.category == category
    assert first.labels == again.labels and structure(first) == structure(again)
    for name in ("size", "center", "axes"):
        assert torch.equal(getattr(first.leaves, name), getattr(again.leaves, name))
    assert [graph.name for graph in make_many(category, 2, seed=41)] == [
        f"{category}-00004{k}" for k in (1, 2)
    ]


def test_an_unknown_category_names_the_choices():
    with pytest.raises(ValueError, match="'lamp'.*chair, table, storage"):
        make("lamp", 0)


@pytest.mark.parametrize("category, at_least", [("chair", 400), ("table", 200), ("storage", 300)])
def test_there_are_many_structures_and_no_two_graphs_are_equal(many, category, at_least):
    assert len({structure(graph) for graph in many[category]}) >= at_least
    assert len({tuple(graph.leaves.size.ravel().tolist()) for graph in many[category]}) == SAMPLE


def test_structure_ignores_the_order_of_siblings_and_counts_parts():
    graph = make("chair", 3)
    root = graph.root
    turned = graph.with_root(type(root)(root.label, root.box, root.children[::-1]))
    fewer = graph.with_root(type(root)(root.label, root.box, root.children[1:]))
    assert structure(turned) == structure(graph) != structure(fewer)


@pytest.mark.parametrize("category", CATEGORIES)
def test_labels_are_known_and_ids_unique(many, category):
    used = Counter()
    for graph in many[category]:
        parts = list(graph.root.walk())
        assert len({part.id for part in parts}) == len(parts)
        used.update(part.label for part in parts)
    assert set(used) <= {*RANKED[category], UNLABELLED}
    assert len(used) >= 18


@pytest.mark.parametrize("category", CATEGORIES)
def test_boxes_are_sound(many, category):
    tilted = 0
    for graph in many[category][:300]:
        boxes, root = graph.leaves, graph.root.box
        assert (boxes.size >= 0.0159).all()  # thinner parts are dropped below 0.01
        torch.testing.assert_close(boxes.axes @ boxes.axes.mT, torch.eye(3).double().expand_as(boxes.axes))
        assert (torch.linalg.det(boxes.axes) > 0.999).all()
        tilted += bool(((boxes.axes.abs() > 0.1).sum((1, 2)) > 3).any())
        assert torch.equal(root.axes, torch.eye(3).double()) and root.center.abs().max() < 1e-12
        torch.testing.assert_close(boxes.bounds(), torch.stack([-root.size / 2, root.size / 2]))
        assert 1.5 <= diagonal_of(graph) <= 2
    assert tilted >= 8  # slanted parts are a trouble worth having


@pytest.mark.parametrize("category", CATEGORIES)
def test_inner_boxes_fit_their_leaves(many, category):
    for graph in many[category][:40]:
        for part in graph.root.walk():
            q = part.box.local_many(stack(part.leaves()).corners().reshape(-1, 3))
            assert q.min() == pytest.approx(0, abs=1e-9) and q.max() == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("category", CATEGORIES)
def test_every_part_is_held(many, category):
    for graph in many[category][:100]:
        for siblings in groups(prepared(graph.root, category)):
            assert loose(siblings, diagonal_of(graph)) == [], graph.name


def test_a_floating_part_is_noticed():
    def node(y):
        return "leg", (np.full(3, 0.1), np.array([0, y, 0.0]), np.eye(3)), []

    assert loose([node(0.0), node(0.5), node(1.0)], 1.7) == ["leg"]
    assert loose([node(0.0), node(0.11), node(1.0)], 1.7) == []


@pytest.mark.parametrize("category", CATEGORIES)
def test_programs_of_it_can_be_short(many, category):
    trees = [(prepared(graph.root, category), diagonal_of(graph)) for graph in many[category][:300]]
    counts = np.array([distinct_leaves(*tree) for tree in trees])
    assert np.mean(counts <= 12) >= 0.95
    siblings = [max(len(distinct(each, diagonal)) for each in groups(tree)) for tree, diagonal in trees]
    assert np.mean(np.array(siblings) <= 10) == 1


@pytest.mark.parametrize("category", CATEGORIES)
def test_dense_surfaces_fill_their_boxes(many, category):
    for graph in many[category][:15]:
        style = style_of(graph)
        for part in graph.root.leaves():
            vertices = torch.from_numpy(np.array(leaf_mesh(part, style).vertices))
            q = part.box.local_many(surface(part, 400, seed=1, style=style))
            assert q.dtype == torch.float64 and q.min() > -1e-9 and q.max() < 1 + 1e-9
            assert ((q.amax(0) - q.amin(0)) > 0.8).all()  # 400 points do not reach every corner
            whole = part.box.local_many(vertices)
            torch.testing.assert_close(whole.amin(0), torch.zeros(3).double(), atol=1e-9, rtol=0)
            torch.testing.assert_close(whole.amax(0), torch.ones(3).double(), atol=1e-9, rtol=0)


@pytest.mark.parametrize("category", CATEGORIES)
def test_points_know_their_leaves(category):
    graph = make(category, 11)
    points, leaf = dense_surface(graph, 500, seed=4, with_parts=True)
    assert torch.equal(points, dense_surface(graph, 500, seed=4)) and points.shape == (500, 3)
    assert not torch.equal(points, dense_surface(graph, 500, seed=5))
    q = graph.leaves[leaf].local(points)
    assert q.min() > -1e-9 and q.max() < 1 + 1e-9
    assert set(leaf.tolist()) >= set(np.argsort(graph.leaves.volume().numpy())[-2:].tolist())


def test_dense_meshes_are_closed_and_not_boxes():
    graph = make("chair", 5)
    mesh = dense_mesh(graph)
    assert mesh.is_watertight and len(mesh.faces) > 50 * len(graph.labels)
    assert 0.3 < mesh.volume / float(graph.leaves.volume().sum()) < 0.99
