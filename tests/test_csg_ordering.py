"""Operands of unions and intersections in a fixed order."""

import numpy as np
import pytest
import torch

from lib.interpreters.csg import (
    Operation,
    Primitive,
    Program,
    ProgramError,
    Tree,
    execute_many,
    parse,
    vocabulary_of,
)
from lib.interpreters.csg.ordering import ordered

from .conftest import unchecked
from .csg_programs import chain, random_mixture, random_tokens

PLANE, SPACE = vocabulary_of(2), vocabulary_of(3)
A, B, C, D = "c(16,16,8)", "c(32,32,16)", "s(48,48,8)", "t(24,24,16)"
LENGTHS = (1, 3, 5, 7, 9, 13)


def text_of(text: str) -> str:
    return Program.from_tokens(ordered(parse(text).tokens()[None], PLANE)[0]).to_text()


def shuffled(tree: Tree | Primitive, rng: np.random.Generator) -> Tree | Primitive:
    """The same shape, said another way: + and * with other neighbours, in another order, and subtractions moved."""
    if isinstance(tree, Primitive):
        return tree
    if tree.operation.symbol == "-":
        return moved(Tree(tree.operation, shuffled(tree.left, rng), shuffled(tree.right, rng)), rng)
    parts = [shuffled(part, rng) for part in chained(tree, tree.operation.symbol)]
    while len(parts) > 1:
        left, right = (parts.pop(rng.integers(len(parts))) for _ in range(2))
        parts.append(Tree(tree.operation, left, right))
    return parts[0]


def moved(tree: Tree, rng: np.random.Generator) -> Tree:
    """X - C, for X = A - B or A * B, or A - X for X = B + C, perhaps as one of the others that are the same."""
    minus, left, right = tree.operation, tree.left, tree.right
    if rng.random() < 0.3:
        return tree
    if isinstance(left, Tree) and left.operation == minus:
        if rng.random() < 0.5:
            return Tree(minus, Tree(minus, left.left, right), left.right)
        return Tree(minus, left.left, Tree(Operation("+"), left.right, right))
    if isinstance(left, Tree) and left.operation.symbol == "*":
        return Tree(left.operation, left.left, Tree(minus, left.right, right))
    if isinstance(right, Tree) and right.operation.symbol == "+":
        return Tree(minus, Tree(minus, left, right.left), right.right)
    return tree


def chained(tree: Tree | Primitive, symbol: str) -> list[Tree | Primitive]:
    """What a chain of one operation joins."""
    if isinstance(tree, Primitive) or tree.operation.symbol != symbol:
        return [tree]
    return chained(tree.left, symbol) + chained(tree.right, symbol)


@pytest.fixture(scope="module")
def mixture() -> torch.Tensor:
    return random_mixture(np.random.default_rng(1), LENGTHS, 60, PLANE)


def test_the_picture_stays_to_the_last_bit(mixture):
    result = ordered(mixture, PLANE)
    before, after = execute_many(mixture), execute_many(result)
    assert after.valid.all() and torch.equal(before.words, after.words)
    assert not torch.equal(mixture, result)


def test_primitives_and_padding_stay(mixture):
    """Of the operations only their number: A B C + - becomes A B - C -."""
    result, first = ordered(mixture, PLANE), len(PLANE.primitives)
    assert torch.equal(*(tokens.clamp(max=first).sort(1).values for tokens in (mixture, result)))
    assert torch.equal(mixture == PLANE.stop, result == PLANE.stop)


def test_ordering_twice_is_ordering_once(mixture):
    once = ordered(mixture, PLANE)
    assert torch.equal(once, ordered(once, PLANE))


def test_however_it_is_said_the_result_is_the_same(mixture):
    rng = np.random.default_rng(2)
    said = [PLANE.program(row).tree() for row in mixture]
    otherwise = [Program.from_tree(shuffled(tree, rng)) for tree in said]
    tokens = torch.stack([program.tokens(PLANE, mixture.shape[1]) for program in otherwise])
    assert not torch.equal(tokens, mixture)
    assert torch.equal(ordered(tokens, PLANE), ordered(mixture, PLANE))


@pytest.mark.parametrize("symbol", "+*")
def test_all_ways_to_say_a_chain_of_three(symbol):
    s = symbol
    ways = {
        text_of(form)
        for x, y, z in ((A, B, C), (A, C, B), (B, A, C), (B, C, A), (C, A, B), (C, B, A))
        for form in (f"{x}{y}{s}{z}{s}", f"{x}{y}{z}{s}{s}")
    }
    assert len(ways) == 1


@pytest.mark.parametrize(
    "before, after",
    [
        (A, A),
        (f"{B}{A}+", f"{A}{B}+"),  # by their numbers in the vocabulary
        (f"{B}{A}-", f"{B}{A}-"),  # a subtraction's operands stay
        (f"{A}{B}-{C}{D}-+", f"{A}{B}-{C}{D}-+"),
        (f"{A}{B}{C}-+", f"{B}{C}-{A}+"),  # longer parts first
        (f"{B}{A}+{C}-", f"{A}{B}+{C}-"),  # inside of a subtraction too
        (f"{C}{B}{A}+-", f"{C}{A}-{B}-"),  # a union is cut away part by part
        (f"{B}{D}-{A}-{C}-", f"{B}{A}-{C}-{D}-"),
        (f"{B}{D}-{A}{C}-*", f"{A}{B}*{C}-{D}-"),  # what is cut away comes last
        (f"{A}{B}{C}--", f"{A}{B}{C}--"),  # A and C, less B: said otherwise it would be longer
        (f"{C}{B}{A}*-", f"{C}{A}{B}*-"),
        (f"{A}{B}-{C}+", f"{A}{B}-{C}+"),  # nothing is moved across a union
        (f"{A}{B}+{C}*", f"{A}{B}+{C}*"),  # + within * is one part, not two
        (f"{C}{B}{A}*+{D}+", f"{A}{B}*{C}+{D}+"),
    ],
)
def test_known_orders(before, after):
    assert text_of(before) == after


def test_all_ways_to_cut_two_away():
    ways = {text_of(t) for t in (f"{A}{B}-{C}-", f"{A}{C}-{B}-", f"{A}{B}{C}+-", f"{A}{C}{B}+-")}
    assert len(ways) == 1


def test_in_space():
    tokens = random_mixture(np.random.default_rng(3), (1, 3, 5), 4, SPACE)
    result = ordered(tokens, SPACE)
    before, after = execute_many(tokens, SPACE), execute_many(result, SPACE)
    assert after.valid.all() and torch.equal(before.words, after.words)
    assert torch.equal(ordered(result, SPACE), result)


def test_empty_programs_stay():
    stops = torch.full((2, 4), PLANE.stop)
    assert torch.equal(ordered(stops, PLANE), stops)
    assert ordered(stops[:0], PLANE).shape == (0, 4)
    assert ordered(stops[:, :0], PLANE).shape == (2, 0)


def test_what_stands_after_the_end_stays():
    tokens = torch.tensor([[5, 2, 396, 399, 7, 398]])
    assert ordered(tokens, PLANE).tolist() == [[2, 5, 396, 399, 7, 398]]


def test_the_kind_of_number_stays():
    tokens = random_tokens(np.random.default_rng(5), 8, 5, PLANE)
    short = ordered(tokens.short(), PLANE)
    assert short.dtype == torch.int16 and torch.equal(short.long(), ordered(tokens, PLANE))


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_longest_programs(side):
    tokens = parse(chain(1023, side)).tokens()[None]
    result = ordered(tokens, PLANE)
    assert torch.equal(execute_many(result).words, execute_many(tokens).words)


@pytest.mark.parametrize(
    "row, why",
    [
        ([396, 0, 1], "an operation finds no two shapes"),
        ([0, 396, 399], "an operation finds no two shapes"),
        ([0, 1, 399], "it ends with 2 shapes"),
        ([400, 399, 399], "'400' is not a token"),
        ([-1, 399, 399], "'-1' is not a token"),
    ],
)
def test_what_is_no_program_is_named(row, why):
    good = [0, 399, 399]
    with pytest.raises(ProgramError, match=f"row 1 is no program: {why}"):
        ordered(torch.tensor([good, row]), PLANE)


@pytest.mark.parametrize("tokens", [torch.tensor([0, 399]), torch.tensor([[0.0, 399]])])
def test_what_are_no_tokens_is_named(tokens):
    with unchecked(), pytest.raises(ProgramError, match="expected whole numbers"):
        ordered(tokens, PLANE)
