"""Every error says which token it is about, what stands there and what was expected."""

import numpy as np
import pytest
import torch

from lib.interpreters.csg import (
    Operation,
    Primitive,
    Program,
    ProgramError,
    Tree,
    Vocabulary,
    execute,
    execute_many,
    parse,
    sample,
    sample_many,
    trace,
    vocabulary_of,
)
from lib.interpreters.csg.program import LONGEST
from lib.interpreters.csg.tracing import parse_start

A, B, BALL = Primitive("c", (32, 32, 28)), Primitive("s", (32, 32, 20)), Primitive("sp", (8, 8, 8, 8))
MINUS = Operation("-")
RING = Program((A, B, MINUS))
C = "c(32,32,28)"  # 11 characters

# text -> index, column, token, what was found, what was expected
CASES = {
    "empty": ("", 0, 1, "", "the program is empty", "a primitive, such as c(32,32,16)"),
    "blank": (" \n", 0, 3, "", "the program is empty", "a primitive"),
    "stopped at once": ("$" + C, 0, 1, "", "the program is empty", "a primitive"),
    "operation first": ("+" + C, 0, 1, "+", "'+' finds 0 shapes on the stack", "two shapes before each operation"),
    "operation too early": (C + "*" + C, 1, 12, "*", "'*' finds 1 shape on the stack", "two shapes"),
    "operation too many": (C + C + "+ -", 3, 25, "-", "'-' finds 1 shape on the stack", "two shapes"),
    "operation missing": (C + C, 2, 23, "", "the program ends with 2 shapes on the stack", "1 more operation, to"),
    "operations missing": (C + C + C + "$+", 3, 34, "", "ends with 3 shapes", "2 more operations, to leave one shape"),
    "space in the plane": (C + " sp(8,8,8,8)+", 1, 13, "sp(8,8,8,8)", "in space, the program began in the plane",
                           "c(x,y,r) or s(x,y,r) or t(x,y,r)"),
    "plane in space": ("u(8,8,8,8)" + C + "+", 1, 11, C, "in the plane, the program began in space",
                       "sp(x,y,z,r) or cu(x,y,z,s) or cy(x,y,z,r,h)"),
    "unknown letters": (C + "q(8,8,8)+", 1, 12, "q(8,8,8)", "'q' in 'q(8,8,8)' is no primitive", "c(x,y,r), s(x,y"),
    "capital": ("C(8,8,8)", 0, 1, "C(8,8,8)", "'C' in 'C(8,8,8)' is no primitive", "or one of + * - $"),
    "a word": (C + "circle", 1, 12, "circle", "'circle' is no token", "c(x,y,r), s(x,y"),
    "no parenthesis": ("c 32", 0, 1, "c 32", "'c 32' is no token", "c(x,y,r), s(x,y"),
    "wrong parenthesis": ("c[8,8,8]", 0, 1, "c[8,8,8]", "'c[8,8,8]' is no token", "c(x,y,r)"),
    "never closed": (C + "c(8,8,8", 1, 12, "c(8,8,8", "'c(8,8,8' is not closed", "c(x,y,r)"),
    "closed twice": (C + ")", 1, 12, ")", "')' is no token", "c(x,y,r)"),
    "infix": (f"({C} - {C})", 0, 1, "(", "'(' is no token", "c(x,y,r)"),
    "within each other": (f"c({C},8,8)", 0, 1, "c(c", "'c(c' is not closed", "c(x,y,r)"),
    "a minus of typesetters": (C + C + "−", 2, 23, "−", "'−' is no token", "or one of + * - $"),
    "division": (C + C + "/", 2, 23, "/", "'/' is no token", "or one of + * - $"),
    "full-width letter": ("ｃ(8,8,8)", 0, 1, "ｃ(8,8,8)", "'ｃ(8,8,8)' is no token", "c(x,y,r)"),
    "NUL": (C + "\0", 1, 12, "\0", r"'\x00' is no token", "c(x,y,r)"),
    "byte order mark": ("\ufeff" + C, 0, 1, "\ufeff", r"'\ufeff' is no token", "c(x,y,r)"),
    "half a character": ("\ud800", 0, 1, "\ud800", r"'\ud800' is no token", "c(x,y,r)"),
    "no numbers": ("c()", 0, 1, "c()", "'c()' has 0 numbers", "3: c(x,y,r)"),
    "too few numbers": (C + "c(8, 8)", 1, 12, "c(8, 8)", "'c(8,8)' has 2 numbers", "3: c(x,y,r)"),
    "one number": ("c(8)", 0, 1, "c(8)", "'c(8)' has 1 number", "3: c(x,y,r)"),
    "too many numbers": ("cy(1,2,3,4,5,6)", 0, 1, "cy(1,2,3,4,5,6)", "has 6 numbers", "5: cy(x,y,z,r,h)"),
    "a number left out": ("c(8,,8)", 0, 1, "c(8,,8)", "'' is not a whole number, in 'c(8,,8)'", "c(x,y,r)"),
    "two numbers in one": ("c(8 8,8)", 0, 1, "c(8 8,8)", "'8 8' is not a whole number", "c(x,y,r)"),
    "decimal": ("c(8,8.0,8)", 0, 1, "c(8,8.0,8)", "'8.0' is not a whole number", "c(x,y,r)"),
    "exponent": ("c(8,1e1,8)", 0, 1, "c(8,1e1,8)", "'1e1' is not a whole number", "c(x,y,r)"),
    "hexadecimal": ("c(8,0x8,8)", 0, 1, "c(8,0x8,8)", "'0x8' is not a whole number", "c(x,y,r)"),
    "Python's long numbers": ("c(8,1_0,8)", 0, 1, "c(8,1_0,8)", "'1_0' is not a whole number", "c(x,y,r)"),
    "Arabic digits": ("c(8,٨,8)", 0, 1, "c(8,٨,8)", "'٨' is not a whole number", "c(x,y,r)"),
    "full-width digits": ("c(8,８,8)", 0, 1, "c(8,８,8)", "'８' is not a whole number", "c(x,y,r)"),
    "not a number": ("c(8,nan,8)", 0, 1, "c(8,nan,8)", "'nan' is not a whole number", "c(x,y,r)"),
    "long number": ("c(8,8,1234567890)", 0, 1, "c(8,8,1234567890)", "'1234567890' is too long a number", "c(x,y,r)"),
    "x off the canvas": ("c(64,8,8)", 0, 1, "c(64,8,8)", "x is '64', off the canvas, in 'c(64,8,8)'", "x from 0 to 63"),
    "y off the canvas": ("t(8,-1,8)", 0, 1, "t(8,-1,8)", "y is '-1', off the canvas, in 't(8,-1,8)'", "y from 0 to 63"),
    "z off the canvas": ("sp(8,8,99,8)", 0, 1, "sp(8,8,99,8)", "z is '99', off the canvas", "z from 0 to 63"),
    "no radius": (C + "s(8,8,0)", 1, 12, "s(8,8,0)", "r is '0', in 's(8,8,0)'", "r from 1 to 64"),
    "radius too large": ("c(8,8,65)", 0, 1, "c(8,8,65)", "r is '65', in 'c(8,8,65)'", "r from 1 to 64"),
    "no side": ("cu(8,8,8,0)", 0, 1, "cu(8,8,8,0)", "s is '0', in 'cu(8,8,8,0)'", "s from 1 to 64"),
    "no height": ("y(8,8,8,8,0)", 0, 1, "y(8,8,8,8,0)", "h is '0', in 'cy(8,8,8,8,0)'", "h from 1 to 64"),
    "too long": (C * (LONGEST + 9), LONGEST, 11 * LONGEST + 1, C, "the program goes on", f"at most {LONGEST} tokens"),
}  # fmt: skip


@pytest.mark.parametrize("text, index, column, token, found, expected", CASES.values(), ids=CASES.keys())
def test_an_error_names_its_token(text, index, column, token, found, expected):
    with pytest.raises(ProgramError) as caught:
        parse(text)
    error = caught.value
    assert found in error.found and expected in error.expected
    assert (error.index, error.column, error.token) == (index, column, token)
    assert str(error) == f"token {index} (column {column}): {error.found}; expected {error.expected}"
    assert text[column - 1 :].startswith(token)
    assert isinstance(error, ValueError) and len(str(error)) < 300


def error_of(call, *arguments, **keywords) -> ProgramError:
    with pytest.raises(ProgramError) as caught:
        call(*arguments, **keywords)
    assert len(str(caught.value)) < 300
    return caught.value


def test_a_long_token_is_quoted_in_part():
    for text in ("c" * 10_000, f"c({'1' * 10_000},8,8)", "c" + " " * 10_000, f"c(8,8,{'x' * 10_000})"):
        error = error_of(parse, text)
        assert "…" in str(error) and text.startswith(error.token)


def test_a_long_text_is_not_read():
    message = str(error_of(parse, "+" * 1_000_001))
    assert message == "the text has 1000001 characters; expected at most 1000000"


def test_a_program_is_read_from_a_text(unchecked_shapes):
    for thing in (b"c(8,8,8)", None, 8, [C]):
        assert str(error_of(parse, thing)) == f"the program is a {type(thing).__name__}; expected a text"


# Programs made by code: call, message. The shape checks, which readers do not have, are off

MADE_WRONG = {
    "no primitive": (lambda: Primitive("p", (8, 8, 8, 8)), "'p(8,8,8,8)' is no primitive; expected c s t sp cu cy"),
    "no kind": (lambda: Primitive(None, (8, 8, 8)), "'None(8,8,8)' is no primitive; expected c s t sp cu cy"),
    "too few": (lambda: Primitive("c", (8,)), "'c(8)' has 1 number; expected 3: c(x,y,r)"),
    "a float": (lambda: Primitive("c", (8.0, 8, 8)), "x is '8.0' in 'c(8.0,8,8)'; expected a whole number"),
    "a text": (lambda: Primitive("c", "888"), "x is '8' in 'c(8,8,8)'; expected a whole number"),
    "NaN": (lambda: Primitive("c", (8, 8, float("nan"))), "r is 'nan' in 'c(8,8,nan)'; expected a whole number"),
    "huge": (lambda: Primitive("c", (8, 10**400, 8)), "y is '1000"),
    "negative": (lambda: Primitive("c", (8, 8, -8)), "r is '-8', in 'c(8,8,-8)'; expected r from 1 to 64"),
    "no operation": (lambda: Operation("/"), "'/' is no operation; expected + * -"),
    "operation by name": (lambda: Operation("union"), "'union' is no operation; expected + * -"),
    "stop": (lambda: Operation("$"), "'$' is no operation; expected + * -"),
    "no statements": (lambda: Program(()), "token 0: the program is empty; expected a primitive, such as c(32,32,16)"),
    "unfinished": (lambda: Program((A, B)), "token 2: the program ends with 2 shapes on the stack; expected 1 more"),
    "reversed": (lambda: Program((A, MINUS, B)), "token 1: '-' finds 1 shape on the stack; expected two shapes"),
    "both worlds": (lambda: Program((A, BALL, MINUS)), "token 1: 'sp(8,8,8,8)' is in space, the program began in the"),
    "a text of a program": (lambda: Program("c(8,8,8)"), "token 0: 'c' is a str; expected a Primitive or an Operation"),
    "a symbol": (lambda: Program((A, B, "-")), "token 2: '-' is a str; expected a Primitive or an Operation"),
    "a program in it": (lambda: Program((A, RING, MINUS)), "is a Program; expected a Primitive or an Operation"),
    "too long": (lambda: Program((A,) * (LONGEST + 1)), f"token {LONGEST}: the program goes on; expected at most 1023"),
    "a symbol in a tree": (lambda: Program.from_tree(Tree("-", A, B)), "token 2: '-' is a str; expected a Primitive"),
    "an unfinished tree": (lambda: Program.from_tree(Tree(MINUS, A, None)), "token 1: 'None' is a NoneType; expected"),
    "a tree of programs": (lambda: Program.from_tree(Tree(MINUS, A, RING)), "is a Program; expected a Primitive"),
    "a tree without end": (lambda: Program.from_tree(forever()), "the tree goes on; expected at most 1023 primitives"),
    "not a tree": (lambda: Program.from_tree("c(8,8,8)"), "token 0: 'c(8,8,8)' is a str; expected a Primitive or an"),
    "token 400": (lambda: Program.from_tokens([0, 400]), "token 1: '400' is not a token; expected 0 to 399, where 399"),
    "token -1": (lambda: Program.from_tokens([-1]), "token 0: '-1' is not a token; expected 0 to 399, where 399 is $"),
    "no whole token": (lambda: Program.from_tokens([0.0]), "token 0: '0.0' is not a token; expected 0 to 399"),
    "a batch of tokens": (lambda: Program.from_tokens(torch.zeros(1, 3).int()), "'[0, 0, 0]' is not a token"),
    "tokens of space": (
        lambda: Program.from_tokens([0, 1, 6631]),
        "token 2: '6631' is not a token; expected 0 to 399, where 399 is $ (tokens of space: vocabulary_of(3))",
    ),
    "execute tokens of space": (
        lambda: execute_many(torch.tensor([[0, 1, 6634]])),
        "'6634' is not a token, in program 0; expected 0 to 399, where 399 is $ (tokens of space: dimensions=3)",
    ),
    "tokens of no program": (lambda: Program.from_tokens([0, 0]), "token 2: the program ends with 2 shapes on the"),
    "only stops": (lambda: Program.from_tokens([399]), "token 0: the program is empty; expected a primitive"),
    "off the grid": (
        lambda: parse("c(33,32,8)").tokens(),
        "token 0: 'c(33,32,8)' is not among the 400 tokens of the vocabulary; expected one such as c(16,16,12) or -"
        ": centers are 8, 16, … 56, sizes 8, 12, … 32, and nothing sticks out of the canvas",
    ),
    "no room": (
        lambda: parse("c(32,32,8)" * 2 + "+").tokens(length=2),
        "token 2: the program has 3 tokens; expected at most 2",
    ),
    "few parameters": (lambda: RING.with_parameters([1] * 5), "5 parameters; expected 6 of them"),
    "many parameters": (lambda: RING.with_parameters([1] * 7), "7 parameters; expected 6 of them"),
    "a batch of parameters": (lambda: RING.with_parameters(torch.ones(1, 6).int()), "1 parameters; expected 6 of them"),
    "floats": (lambda: RING.with_parameters(torch.ones(6)), "x is '1.0' in 'c(1.0,1.0,1.0)'; expected a whole number"),
    "off the canvas": (lambda: RING.with_parameters([1, 1, 1, 1, 99, 1]), "y is '99', off the canvas, in 's(1,99,1)'"),
    "a word twice": (lambda: Vocabulary([A, B, A]), "'c(32,32,28)' is there twice; expected distinct primitives"),
    "words of both": (
        lambda: Vocabulary([A, BALL]),
        "'c(32,32,28)' and 'sp(8,8,8,8)' are not of one dimension; expected all in the plane or all in space",
    ),
    "words that are texts": (lambda: Vocabulary([A, "+"]), "item 1 is a str; expected a Primitive"),
    "a word not there": (
        lambda: Vocabulary([A]).index("/"),
        "'/' is not among the 5 tokens of the vocabulary; expected one such as c(32,32,28) or -",
    ),
    "execute a text": (
        lambda: execute("c(8,8,8)"),
        "found a str; expected a Program, see parse(text)",
    ),
    "execute no program": (lambda: execute([RING]), "found a list; expected a Program, see parse(text)"),
    "execute many of a text": (
        lambda: execute_many("c(8,8,8)"),
        "found a str; expected a sequence of Programs, see parse(text)",
    ),
    "execute many of one": (
        lambda: execute_many(RING),
        "found one Program; expected a sequence of them, or execute(program)",
    ),
    "trace a text": (
        lambda: trace("c(8,8,8)"),
        "found a str; expected a Program, see parse(text), or its statements",
    ),
    "a start that is no text": (lambda: parse_start(8), "the program is a int; expected a text"),
    "a seed": (lambda: sample(0), "found 0; expected a numpy Generator, such as np.random.default_rng(0)"),
    "a seed for many": (
        lambda: sample_many(None, 1, 3),
        "found None; expected a numpy Generator, such as np.random.default_rng(0)",
    ),
    "execute texts": (lambda: execute_many([RING, "c(8,8,8)"]), "item 1 is a str; expected a Program, see parse(text)"),
    "execute numpy": (
        lambda: execute_many(np.zeros((1, 1), int)),
        "item 0 is a ndarray; expected a Program, see parse(text), or all tokens in one torch tensor",
    ),
    "execute both": (
        lambda: execute_many([RING, Program((BALL,))]),
        "'sp(8,8,8,8)' has 3 dimensions; expected programs with 2 only",
    ),
    "the plane in space": (
        lambda: execute_many([RING], dimensions=3),
        "'c(32,32,28)s(32,32,20)-' has 2 dimensions; expected programs with 3 only",
    ),
    "execute floats": (
        lambda: execute_many(torch.full((1, 2), torch.nan)),
        "the tokens are a tensor (1, 2) of torch.float32; expected whole numbers (programs, length)",
    ),
    "execute logits": (
        lambda: execute_many(torch.zeros(1, 2, 400).int()),
        "the tokens are a tensor (1, 2, 400) of torch.int32; expected whole numbers (programs, length)",
    ),
    "execute one row": (lambda: execute_many(torch.tensor([0, 1, 396])), "the tokens are a tensor (3,) of torch.int64"),
    "execute yes and no": (
        lambda: execute_many(torch.ones(1, 1).bool()),
        "the tokens are a tensor (1, 1) of torch.bool",
    ),
    "execute START": (
        lambda: execute_many(torch.tensor([[0, 399], [5, 400]])),
        "token 1: '400' is not a token, in program 1; expected 0 to 399, where 399 is $",
    ),
    "execute -1": (
        lambda: execute_many(torch.tensor([[399, -1]])),
        "token 1: '-1' is not a token, in program 0; expected",
    ),
    "execute long rows": (
        lambda: execute_many(torch.zeros(1, LONGEST + 1).int()),
        "the programs have 1024 tokens; expected at most 1023",
    ),
    "no words": (lambda: execute_many(torch.zeros(1, 1).int(), Vocabulary([])), "the vocabulary has no primitives"),
    "pictures of space": (
        lambda: execute_many([Program((BALL,))]).images,
        "these are programs with 3 dimensions; expected shapes.grids",
    ),
    "grids of the plane": (
        lambda: execute_many([RING]).grids,
        "these are programs with 2 dimensions; expected shapes.images",
    ),
    "an invalid one": (lambda: execute_many(torch.tensor([[0, 396]]))[0], "token 1: '+' finds 1 shape on the stack"),
}  # fmt: skip


def forever() -> Tree:
    """A tree with more leaves than atoms on earth, all of them the same."""
    tree = A
    for _ in range(200):
        tree = Tree(MINUS, tree, tree)
    return tree


@pytest.mark.parametrize("make, message", MADE_WRONG.values(), ids=MADE_WRONG.keys())
def test_made_by_code(make, message, unchecked_shapes, time_limit):
    with time_limit(5):  # milliseconds, but for a busy machine
        assert message in str(error_of(make))


def test_an_error_says_which_token():
    error = error_of(Program, (A, MINUS, B))
    assert (error.index, error.column, error.token) == (1, None, "-")
    error = error_of(execute_many, torch.tensor([[0, 0, 0], [0, 1000, 0]]))
    assert (error.index, error.column, error.token) == (1, None, "1000")


def test_advice_is_given_only_where_it_is_true():
    for message in (error_of(Vocabulary([A]).index, "/"), error_of(Vocabulary([A]).program, [400])):
        assert "centers" not in str(message) and "space" not in str(message)
    for token in (-1, 6635):  # not in space either
        assert "space" not in str(error_of(execute_many, torch.tensor([[token]])))
    assert "space" not in str(error_of(execute_many, torch.tensor([[6635]]), dimensions=3))
    assert "centers are 8, 16, … 56" in str(error_of(parse("sp(8,8,8,9)").tokens))


def test_there_are_two_dimensions():
    for dimensions in (0, 1, 4):
        with pytest.raises(ValueError, match=f"found {dimensions} dimensions; expected 2 or 3"):
            vocabulary_of(dimensions)
        with pytest.raises(ValueError, match=f"found {dimensions} dimensions; expected 2 or 3"):
            execute_many([RING], dimensions=dimensions)


@pytest.mark.parametrize("index", [3, -4, 10**30])
def test_there_is_no_such_shape(index):
    with pytest.raises(IndexError, match=f"shape {index} of 3"):
        execute_many([RING] * 3)[index]


def test_what_is_no_sequence_at_all_is_a_type_error(unchecked_shapes):
    for call in (execute_many, Program, Vocabulary, Program.from_tokens, RING.with_parameters):
        for thing in (None, 5, A):
            with pytest.raises(TypeError):
                call(thing)
