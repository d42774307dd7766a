"""Trees become stumps and stumps trees: the same solid, in short; and a tree that is too long says so at once."""

import tracemalloc

import numpy as np
import pytest
import torch

from lib.interpreters import csg
from lib.interpreters.csg import Operation, Tree
from lib.interpreters.stump import (
    Box,
    Circle,
    Constant,
    ProgramError,
    Sphere,
    Stump,
    disjunctive_form,
    execute,
    parse,
    sample,
)
from lib.interpreters.stump.trees import MOST_TERMS
from tests.conftest import unchecked
from tests.stumps import masks, probes, random_primitive, random_tree, stump_occupancy, tree_occupancy

A, B, C, D = (Sphere(0.3, (0.1 * k, 0.0, 0.0)) for k in range(4))
ALL, NONE = Constant.EVERYTHING, Constant.NOTHING
POOLS, EACH, POINTS = 50, 20, 10_000  # 2 dimensions x 50 x 20 = 2,000 trees


def tree(text: str):
    """A tree from postfix letters: "AB-" is A without B; 1 is everything, 0 nothing."""
    stack, leaves = [], {"A": A, "B": B, "C": C, "D": D, "1": ALL, "0": NONE}
    for letter in text:
        if letter in leaves:
            stack.append(leaves[letter])
        else:
            right = stack.pop()
            stack.append(Tree(Operation(letter), stack.pop(), right))
    return stack[0]


def balls(count: int) -> list[Sphere]:
    return [Sphere(0.5, (float(k), 0.0, 0.0)) for k in range(count)]


def chain(operation: str, count: int, side: str):
    """A tree as deep as it can be."""
    first, *others = balls(count)
    made = first
    for ball in others:
        made = Tree(Operation(operation), *((made, ball) if side == "left" else (ball, made)))
    return made


def nodes_of(stump: Stump) -> str:
    """The matrices as text, such as "A -B | C"."""
    names = dict(zip((A, B, C, D), "ABCD"))
    nodes = []
    for column in stump.intersection[:, stump.union].T.tolist():
        rows = zip(stump.primitives, stump.complement.tolist(), column)
        nodes.append(" ".join("-" * outside + names[p] for p, outside, selected in rows if selected))
    return " | ".join(node or "everything" for node in nodes) or "nothing"


@pytest.mark.parametrize("dimensions", [2, 3])
def test_the_same_solid_there_and_back_and_there(dimensions, record_property, unchecked_shapes):
    """The law: tree -> stump -> tree -> stump on 1,000 trees, at each of 10,000 points, surfaces included."""
    rng = np.random.default_rng(dimensions)
    sizes, terms = [], []
    for _ in range(POOLS):
        pool = [random_primitive(rng, dimensions) for _ in range(12)]
        inside = masks(pool, probes(rng, pool, POINTS))
        for _ in range(EACH):
            leaves = [pool[k] for k in rng.permutation(12)[: rng.integers(1, 13)]]
            given = random_tree(rng, leaves, int(rng.integers(1, 13)))
            stump = Stump.from_tree(given)
            back = stump.to_tree()
            again = Stump.from_tree(back)
            expected = tree_occupancy(given, inside)
            for other in (
                stump_occupancy(stump, inside),
                tree_occupancy(back, inside),
                stump_occupancy(again, inside),
            ):
                assert torch.equal(expected, other)
            sizes.append(stump.intersection.shape)
            terms.append((disjunctive_form(given).leaves, disjunctive_form(given).expanded))
            assert sizes[-1][1] <= terms[-1][1]
    before, after = np.array(terms), np.array(sizes)
    record_property("before", f"median {np.median(before, 0)}, largest {before.max(0)}")
    record_property("after", f"median {np.median(after, 0)}, largest {after.max(0)}")
    assert np.prod(after, 1).sum() < np.prod(before, 1).sum() / 2


def test_the_law_holds_for_the_shapes_that_execute_makes(unchecked_shapes):
    """Points nearer than 1e-9 to a surface are left out: kinds computed together may round otherwise than alone."""
    rng = np.random.default_rng(5)
    for dimensions in [2, 3] * 20:
        pool = [random_primitive(rng, dimensions) for _ in range(6)]
        points = torch.from_numpy(rng.uniform(-0.6, 0.6, (2000, dimensions)))
        clear = points[(torch.stack([p.distance(points) for p in pool]).abs() > 1e-9).all(0)]
        given = random_tree(rng, pool, 10)
        inside = {primitive: primitive.distance(clear) <= 0 for primitive in pool}
        assert torch.equal(execute(Stump.from_tree(given)).occupancy(clear), tree_occupancy(given, inside))


@pytest.mark.parametrize(
    "given, expected",
    [
        ("A", "A"),
        ("AB-", "A -B"),
        ("AB+", "A | B"),
        ("ABC+-", "A -B -C"),
        ("ABC*-", "A -B | A -C"),
        ("ABC--", "A -B | A C"),
        ("AB+C*", "A C | B C"),
        ("AB+CD+*", "A C | A D | B C | B D"),
        ("AA-", "nothing"),
        ("AA+", "A"),
        ("AAB*+", "A"),  # absorbed
        ("ABA-+", "A | B"),  # "outside A" changes nothing
        ("AB*AB-+", "A"),
        ("A1A-+", "everything"),
        ("1AB*-", "-A | -B"),
        ("AB-BA-+", "A -B | -A B"),  # both ways: the exclusive or
        ("AB-CA*+", "A -B | A C"),
        ("A0+", "A"), ("A0*", "nothing"), ("A1*", "A"), ("A1+", "everything"), ("A1-", "nothing"), ("0A-", "nothing"),
    ],
)  # fmt: skip
def test_hand_known_forms(given, expected):
    assert nodes_of(Stump.from_tree(tree(given))) == expected


def test_a_primitive_used_both_ways_has_two_rows():
    stump = Stump.from_tree(tree("AB-BA-+"))
    assert stump.primitives == (A, A, B, B)
    assert stump.complement.tolist() == [False, True, False, True]


def test_equal_primitives_are_one():
    other = Box((0.1, 0.2, 0.3))
    twin = Box(torch.tensor([0.1, 0.2, 0.3], dtype=torch.float64))
    assert Stump.from_tree(Tree(Operation("+"), other, twin)).primitives == (other,)


def test_rows_follow_the_leaves_and_nodes_their_rows():
    stump = Stump.from_tree(tree("DC+BA-+"))
    assert stump.primitives == (D, C, B, A)
    assert stump.intersection.T.tolist() == [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1]]
    assert stump.union.all()


@pytest.mark.parametrize(
    "text, expected",
    [
        ("T = nothing", "A0*"),
        ("S1 = everything\nT = S1", "A1+"),
        ("S1 = F1\nS2 = everything\nT = S1 | S2", "A1+"),
        ("S1 = F2\nT = S1", "1B-"),
        ("S1 = F1 & F2\nS2 = F1\nT = S1", "AB-"),  # S2 is not united
        ("S1 = F1 & F2 & F3 & F4\nT = S1", "AC*D*B-"),
    ],
)
def test_hand_known_trees(text, expected):
    lines = ["A", "not B", "C", "D"]
    spheres = [f"sphere(radius=0.3, translation=({0.1 * k!r}, 0, 0))" for k in range(4)]
    primitives = [f"F{k + 1} = {'not ' * ('not' in line)}{spheres[k]}" for k, line in enumerate(lines)]
    made = parse("\n".join([*primitives, text])).to_tree()
    expected = expected.replace("AC*D*B-", "AC*D*B-")
    assert made == tree(expected)


def test_trees_of_many_nodes_are_not_deep():
    stump = Stump(balls(256), torch.zeros(256), torch.eye(256), torch.ones(256))
    made, depth = [stump.to_tree()], 0
    while any(isinstance(node, Tree) for node in made):
        made = [part for node in made if isinstance(node, Tree) for part in (node.left, node.right)]
        depth += 1
    assert depth == 8
    assert Stump.from_tree(stump.to_tree()) == stump


def test_sampled_stumps_come_back(unchecked_shapes):
    rng = np.random.default_rng(1)
    for dimensions in [2, 3] * 20:
        stump = sample(rng, dimensions)
        points = probes(rng, list(stump.primitives), 2000)
        inside = masks(list(stump.primitives), points)
        assert torch.equal(
            stump_occupancy(Stump.from_tree(stump.to_tree()), inside), stump_occupancy(stump, inside)
        )


@pytest.mark.parametrize("operation", "+*-")
@pytest.mark.parametrize("side", ["left", "right"])
def test_chains_of_a_thousand_operations(operation, side, time_limit, unchecked_shapes):
    with time_limit(20):
        stump = Stump.from_tree(chain(operation, 1001, side))
    nodes = {"+": 1001, "*": 1, "-": 1 if side == "left" else 501}[operation]
    assert stump.intersection.shape == (1001, nodes)


def test_a_subtree_in_many_places_is_visited_once(time_limit):
    made = A
    for _ in range(200):
        made = Tree(Operation("+"), made, made)
    with time_limit(5):
        form = disjunctive_form(made)
    assert form.terms == (1,) and form.leaves == 2**200


def test_sizes_before_and_after():
    form = disjunctive_form(tree("AB+CD+*AB*+"))
    assert (form.leaves, form.expanded, len(form.terms)) == (6, 5, 5)
    form = disjunctive_form(tree("AB+AB+*"))
    assert (form.leaves, form.expanded, len(form.terms)) == (4, 4, 2)


def test_a_form_that_explodes_says_how_long_it_would_be(time_limit, unchecked_shapes):
    pairs = [Tree(Operation("+"), a, b) for a, b in zip(balls(80)[::2], balls(80)[1::2])]
    made = pairs[0]
    for pair in pairs[1:]:
        made = Tree(Operation("*"), made, pair)
    tracemalloc.start()
    try:
        with time_limit(10), pytest.raises(ProgramError) as error:
            Stump.from_tree(made)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert f"{2**40:,} intersections of its 80 leaves" in str(error.value)
    assert f"at most {MOST_TERMS:,}" in error.value.expected
    assert peak < 20e6  # bytes


def test_what_only_looks_long_is_no_problem():
    """The product of 40 equal unions has 2^40 terms at first, and two in the end."""
    made = pair = tree("AB+")
    for _ in range(39):
        made = Tree(Operation("*"), made, pair)
    form = disjunctive_form(made)
    assert form.expanded == 2**40 and len(form.terms) == 2


@pytest.mark.parametrize(
    "given, words",
    [
        (ALL, "no primitives"),
        (Tree(Operation("-"), ALL, NONE), "no primitives"),
        (Tree(Operation("+"), A, Circle(0.5)), "has 2 dimensions"),
        (Tree(Operation("+"), A, Sphere(torch.ones(2))), "is a batch"),
        (Tree(Operation("+"), A, Sphere(float("nan"))), "not finite"),
    ],
)
def test_bad_trees(given, words):
    with pytest.raises(ProgramError, match=words):
        Stump.from_tree(given)


@pytest.mark.parametrize("operation", "+*-")
def test_a_tree_that_stands_in_itself(operation, time_limit):
    inner = Tree(Operation("+"), A, B)
    outer = Tree(Operation(operation), inner, B)
    object.__setattr__(inner, "right", outer)
    with time_limit(5), pytest.raises(ProgramError, match="stands below itself"):
        Stump.from_tree(outer)
    object.__setattr__(inner, "right", inner)
    with time_limit(5), pytest.raises(ProgramError, match="stands below itself"):
        Stump.from_tree(Tree(Operation(operation), A, inner))


def test_what_is_no_tree_at_all():
    """Not checked by annotations: a user has none."""
    with unchecked():
        for given in (None, "A", csg.parse("c(32,32,8)").tree(), Tree(Operation("+"), A, "B")):
            with pytest.raises(
                ProgramError, match="the tree has a leaf .*; expected a primitive of this language"
            ):
                Stump.from_tree(given)
        with pytest.raises(ProgramError, match="the tree has an operation"):
            Stump.from_tree(Tree("+", A, B))
