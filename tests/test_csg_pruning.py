"""Programs without parts that nobody sees."""

import pytest
import torch

from lib.datasets.csg import csg_programs
from lib.interpreters.csg import Program, ProgramError, execute_many, parse, vocabulary_of
from lib.interpreters.csg.pruning import pruned

from .conftest import unchecked

PLANE, SPACE = vocabulary_of(2), vocabulary_of(3)
A, B, FAR = "c(16,16,8)", "c(32,32,16)", "s(48,48,8)"
IN_B, OVER_B = "c(32,32,8)", "s(48,32,16)"


def text_of(text: str) -> str:
    return Program.from_tokens(pruned(parse(text).tokens()[None], PLANE)[0]).to_text()


@pytest.mark.parametrize(
    "text, expected",
    [
        (A, A),
        (A + B + "+", A + B + "+"),  # both are seen
        (B + IN_B + "+", B), (IN_B + B + "+", B),
        (B + IN_B + "*", IN_B), (IN_B + B + "*", IN_B),
        (A + FAR + "-", A),
        (B + IN_B + "-", B + IN_B + "-"),
        (B + OVER_B + "+" + IN_B + "+", B + OVER_B + "+"),
        # What is united is hidden later, by an intersection; what is cut is filled again.
        (A + FAR + "+" + FAR + "*", FAR),
        (B + OVER_B + "-" + OVER_B + "+", B + OVER_B + "+"),
        # FAR - OVER_B is seen only where B does not cover it; a whole part goes at once, not only its last shape.
        (B + IN_B + A + "-" + "+", B),
        # What is cut from an operand lies outside the other one.
        (FAR + A + B + FAR + "-" + "*" + "+", FAR + A + B + "*" + "+"),
        # A shape without an inside is as short as one shape can be.
        (A + FAR + "*", A + FAR + "*"),
    ],
)  # fmt: skip
def test_what_is_left_out(text, expected):
    assert text_of(text) == expected


def test_the_larger_part_goes_first():
    """(IN_B - A) + B: without A, one shape would be gone; without all of IN_B - A two are."""
    assert text_of(IN_B + A + "-" + B + "+") == B


@pytest.mark.parametrize("dimensions", [2, 3])
def test_random_programs_draw_the_same_and_need_every_part(dimensions):
    vocabulary = vocabulary_of(dimensions)
    tokens = csg_programs(dimensions, "val").tokens
    found = pruned(tokens, vocabulary)
    before, after = execute_many(tokens, vocabulary), execute_many(found, vocabulary)
    assert after.valid.all() and torch.equal(before.words, after.words)
    lengths, were = ((each != vocabulary.stop).sum(1) for each in (found, tokens))
    assert (lengths < were).float().mean() > 0.2 and (lengths == were).float().mean() > 0.2
    assert torch.equal(found, pruned(found, vocabulary))
    for row, words in zip(found[:40], after.words):
        for shorter in omissions(vocabulary.program(row)):
            other = execute_many(shorter.tokens(vocabulary)[None], vocabulary)
            assert not torch.equal(other.words[0], words), shorter.to_text()


def omissions(program: Program) -> list[Program]:
    """By the tree, not by places of tokens: every way to put an operand in its operation's place."""

    def of(tree):
        if not hasattr(tree, "operation"):
            return []
        lefts, rights = of(tree.left), of(tree.right)
        inner = [(left, tree.right) for left in lefts] + [(tree.left, right) for right in rights]
        return [tree.left, tree.right, *(type(tree)(tree.operation, *both) for both in inner)]

    return [Program.from_tree(each) for each in of(program.tree)]


def test_rows_do_not_matter_to_each_other():
    tokens = csg_programs(2, "val").tokens
    alone = torch.cat([pruned(row[None], PLANE) for row in tokens[::7]])
    assert torch.equal(alone, pruned(tokens, PLANE)[::7])


def test_what_is_no_program_stays():
    union = len(PLANE.primitives)
    tokens = torch.tensor([[0, 0, union, PLANE.stop], [0, 0, PLANE.stop, union], [PLANE.stop] * 4])
    given = tokens.clone()
    assert pruned(tokens, PLANE).tolist() == [[0, *[PLANE.stop] * 3], *tokens.tolist()[1:]]
    assert torch.equal(tokens, given)  # what is given is not changed
    assert pruned(tokens[:0], PLANE).shape == (0, 4) and pruned(tokens[:, :0], PLANE).shape == (3, 0)
    with pytest.raises(ProgramError, match="'401' is not a token"):
        pruned(torch.tensor([[401]]), PLANE)
    for bad in (torch.zeros(2, 3), tokens[0]):
        with unchecked(), pytest.raises(ProgramError, match="whole numbers"):
            pruned(bad, PLANE)


def test_what_comes_after_the_end_is_no_part_of_the_program():
    a, far, inner, outer = (PLANE.index(text) for text in (A, FAR, IN_B, B))
    union, cut, stop = PLANE.index("+"), PLANE.index("*"), PLANE.stop
    blank = [
        a,
        far,
        cut,
        stop,
        union,
        a,
        a,
    ]  # draws nothing: as what is behind its end, without the end, would
    needed, hidden = [a, stop, inner, outer, union], [inner, outer, union, stop, union]
    for row, expected in ((blank, blank), (needed, needed), (hidden, [outer, *[stop] * 4])):
        assert pruned(torch.tensor([row]), PLANE).tolist() == [expected]


@pytest.mark.parametrize("kind", [torch.int8, torch.int16, torch.int32])
def test_small_whole_numbers_are_tokens_too(kind):
    assert pruned(torch.tensor([[7], [9]], dtype=kind), PLANE).tolist() == [[7], [9]]
