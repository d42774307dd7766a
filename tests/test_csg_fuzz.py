"""Fuzzing CSG: any text makes a shape or raises ProgramError, any tokens make what the definition says. Nothing hangs.

Texts are random changes to good programs (seeded, so a failure comes back), words in any order, and whatever hypothesis
thinks of. Tokens are compared with tests/csg_programs.by_stack, which asks every pixel.
"""

import random
import time
from collections.abc import Iterable

import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lib.interpreters.csg import (
    Program,
    ProgramError,
    Vocabulary,
    execute,
    execute_many,
    parse,
    vocabulary_of,
)
from lib.interpreters.csg.program import LONGEST
from tests.conftest import unchecked
from tests.csg_programs import by_stack, chain, random_program

MUTANTS = 20_000
SLOWEST = 1.0  # seconds for one program; the slowest takes some hundredths, this is for a busy machine
MONSTER = 999_990  # characters: nearly the longest text that is read
JUNK = [
    *("", " ", "\n", "\t", "\0", "\ufeff", "\u2028", "\u3000", "é", "٣", "１", "ｃ", "（", "−", "²", "\ud800", "\\"),
    *("(", ")", ",", ",,", "()", "((", "))", "[", "{", "+", "*", "-", "/", "$", "+-", "--", "$$", "%s", "{0}", "#"),
    *("c", "s", "t", "p", "u", "y", "sp", "cu", "cy", "C", "cc", "c(", "c()", "circle", "_", "__class__", "union"),
    *("0", "1", "8", "63", "64", "65", "-1", "+8", "007", "1_0", "0x8", "1e1", "8.0", "nan", "inf", "9" * 9, "9" * 50),
    *("c(32,32,16)", "t(8,56,64)", "sp(8,8,8,8)", "cy(1,2,3,4,5)", "p(8,8,8,8)", "c(32,32,16)+", "s(8,8,8)s(8,8,8)-"),
]  # fmt: skip


def mutate(text: str, rng: random.Random) -> str:
    """One to four random changes: something in, out, instead, elsewhere, again, or another character."""
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        start = rng.randrange(len(text) + 1)
        stop = min(len(text), start + rng.choice([1, 1, 2, 3, 12]))
        cut, rest = text[start:stop], text[:start] + text[stop:]
        elsewhere = rng.randrange(len(rest) + 1)
        digit, symbol = rng.choice("0123456789"), rng.choice("+*-")
        text = rng.choice(
            [
                text[:start] + rng.choice(JUNK) + text[start:],
                rest,
                text[:start] + rng.choice(JUNK) + text[stop:],
                rest[:elsewhere] + cut + rest[elsewhere:],
                text[:start] + cut + text[start:],
                text[:start]
                + (digit if cut[:1].isdigit() else symbol if cut[:1] in "+*-" else cut)
                + text[stop:],
                text[:start] + "".join(digit if c.isdigit() else c for c in cut) + text[stop:],
            ]
        )
    return text


def read(text: str) -> Program | None:
    """The program, or None where the text is refused; anything else is a failure."""
    try:
        program = parse(text)
    except ProgramError as error:
        assert str(error).startswith("token ") and error.found and error.expected and len(str(error)) < 300
        assert 0 <= error.index <= LONGEST and 1 <= error.column <= len(text) + 1
        return None
    assert parse(program.to_text()) == program
    return program


def outcome(text: str) -> str:
    """ "runs" or "refused"; anything else is a failure."""
    program = read(text)
    if program is None:
        return "refused"
    shape = execute(program)
    assert 0 <= shape.on <= 64**shape.dimensions
    return "runs"


def read_all(texts: Iterable[str], time_limit) -> tuple[list[Program], str]:
    """The programs among the texts, and a line on them all. Fails, showing the text, for any other error."""
    programs, refused, slowest = [], 0, 0.0
    for number, text in enumerate(texts):
        started = time.perf_counter()
        try:
            with time_limit(SLOWEST):
                program = read(text)
        except Exception as error:
            pytest.fail(f"text {number}: {type(error).__name__}: {error}\n{text!r}")
        slowest = max(slowest, time.perf_counter() - started)
        programs += [program] if program else []
        refused += program is None
    return programs, f"{len(programs)} run, {refused} refused, slowest {slowest:.3f} s"


def test_mutants_run_or_are_refused(time_limit, record_property, unchecked_shapes):
    rng, numbers = random.Random(20_000), np.random.default_rng(20_000)
    originals = [
        random_program(numbers, dimensions, length).to_text()
        for dimensions, lengths in ((2, (1, 3, 3, 5, 7, 13)), (3, (1, 3, 7)))
        for length in lengths
        for _ in range(10)
    ]
    programs, result = read_all((mutate(rng.choice(originals), rng) for _ in range(MUTANTS)), time_limit)
    print(result)
    record_property("fuzz", result)
    assert 0.05 * MUTANTS < len(programs) < 0.95 * MUTANTS  # enough of them reach the machine, and the checks
    for dimensions in (2, 3):
        some = [program for program in programs if program.dimensions == dimensions]
        shapes = execute_many(some)
        assert shapes.valid.all() and 0 < (shapes.on > 0).sum() < len(some)
        for place in range(0, len(some), 20):
            with time_limit(SLOWEST):
                assert torch.equal(execute(some[place]).words, shapes.words[place]), some[place]


def test_words_in_any_order_run_or_are_refused(time_limit, unchecked_shapes):
    rng = random.Random(1)
    good = ["c(32,32,16)", "s(20,30,12)", "t(40,40,20)", "+", "*", "-"]
    texts = [
        "".join(rng.choices(good + JUNK[:: rng.choice([1, 20, 999])], k=rng.randrange(8)))
        for _ in range(3000)
    ]
    programs, _ = read_all(texts, time_limit)
    assert 20 < len(programs) < 2000
    assert {program.dimensions for program in programs} == {2, 3}


def test_a_mutant_comes_back_from_its_seed():
    text = "c(32,32,16)s(20,30,12)-"
    assert mutate(text, random.Random(5)) == mutate(text, random.Random(5)) != mutate(text, random.Random(7))


@settings(max_examples=300, deadline=None, derandomize=True)
@example("c(32,32,16)")
@given(st.lists(st.sampled_from(JUNK), max_size=12).map("".join))
def test_any_words_run_or_are_refused(text):
    outcome(text)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.one_of(st.text(max_size=60), st.text("csptuy(0123456789,)+*-$ ", max_size=60)))
def test_anything_runs_or_is_refused(text):
    outcome(text)


numbers = st.integers(-2, 66)
plane = st.builds("{}({},{},{})".format, st.sampled_from("cst"), numbers, numbers, numbers)
space = st.builds("cy({},{},{},{},{})".format, *[numbers] * 5)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.lists(st.one_of(plane, plane, space, st.sampled_from("+*-")), min_size=1, max_size=7).map("".join))
def test_any_numbers_run_or_are_refused(text):
    outcome(text)


# Long texts, among them what makes regular expressions and recursions slow

ONE = "c(32,32,16)"
MONSTERS = {
    "letters": "c" * MONSTER,
    "underscores": "_" * MONSTER,
    "digits": "1" * MONSTER,
    "opened": "(" * MONSTER,
    "opened with letters": "c(" * (MONSTER // 2),
    "opened after blanks": "c" + " " * (MONSTER - 2) + "(",
    "blanks after opening": "c(" + " " * (MONSTER - 2),
    "letters and blanks": "c " * (MONSTER // 2),
    "opened late": "c" * (MONSTER // 2) + "(" + "1" * (MONSTER // 2 - 1),
    "closed": ")" * MONSTER,
    "commas": "c(" + "," * (MONSTER - 3) + ")",
    "a number": "c(" + "1" * (MONSTER - 7) + ",1,1)",
    "zeros": "c(" + "0" * (MONSTER - 7) + "1,1,1)",
    "Arabic digits": "c(" + "٣" * (MONSTER - 7) + ",1,1)",
    "numbers": "c(" + "1," * (MONSTER // 2 - 3) + "1)",
    "blanks": " " * MONSTER,
    "operations": "+" * MONSTER,
    "primitives": ONE * (MONSTER // 11),
    "primitives far apart": (ONE + " " * 900) * 1000,
    "a wrong token late": ONE * 1000 + "c" * (MONSTER - 11_000),
    "deep": chain(LONGEST + 2, "right"),
    "NUL": "\0" * MONSTER,
}


@pytest.mark.parametrize("text", MONSTERS.values(), ids=MONSTERS.keys())
def test_monsters_are_refused_at_once(text, time_limit):
    """A third of a second would be slow: the text is read once, from left to right."""
    with time_limit(SLOWEST):
        assert outcome(text) == "refused"


@pytest.mark.parametrize("text", [ONE + " " * (MONSTER - 12) + "$", ONE + "$" + "(" * (MONSTER - 12)])
def test_monsters_that_run(text, time_limit):
    with time_limit(SLOWEST):
        assert parse(text) == parse(ONE)


# Tokens


def random_rows(rng: np.random.Generator, count: int, length: int, vocabulary: Vocabulary) -> torch.Tensor:
    """Tokens without rhyme or reason, a third of them operations, few stops."""
    primitives = len(vocabulary) - 4
    kinds = rng.choice(3, p=[0.6, 0.35, 0.05], size=(count, length))
    operations = primitives + rng.integers(3, size=(count, length))
    draws = rng.integers(primitives, size=(count, length))
    return torch.from_numpy(np.select([kinds == 0, kinds == 1], [draws, operations], vocabulary.stop))


@pytest.mark.parametrize("dimensions, count", [(2, 300), (3, 25)])
@pytest.mark.parametrize("length", [1, 2, 3, 4, 5, 8, 13, 30])
def test_any_tokens_make_what_the_definition_says(dimensions, count, length, unchecked_shapes):
    """Shapes, blank shapes and which rows are valid, exactly."""
    vocabulary = vocabulary_of(dimensions)
    tokens = random_rows(np.random.default_rng(length), count, length, vocabulary)
    shapes = execute_many(tokens, dimensions=dimensions)
    expected = [by_stack(row, vocabulary) for row in tokens.tolist()]
    assert shapes.valid.tolist() == [valid for _, valid in expected]
    for made, (pixels, _) in zip(shapes.images if dimensions == 2 else shapes.grids, expected):
        np.testing.assert_array_equal(made, pixels)


def test_enough_random_tokens_are_programs():
    """What the test above compares is not all blank."""
    rows = [
        random_rows(np.random.default_rng(n), 300, n, vocabulary_of(2)) for n in (1, 2, 3, 4, 5, 8, 13, 30)
    ]
    valid = [int(execute_many(tokens).valid.sum()) for tokens in rows]
    assert valid[0] > 100 and sum(n > 0 for n in valid) >= 6, valid


THREE = Vocabulary(parse(text).primitives[0] for text in ("c(24,32,16)", "s(40,32,20)", "t(32,32,24)"))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.lists(st.lists(st.integers(0, 6), max_size=9), min_size=1, max_size=6), st.integers(0, 2))
def test_rows_of_three_primitives(rows, pad):
    """Few words, so that many rows are valid and share their primitives; `shapes[i]` agrees with `shapes.valid`."""
    length = max(map(len, rows)) + pad
    padded = [row + [THREE.stop] * (length - len(row)) for row in rows]
    with unchecked():
        shapes = execute_many(torch.tensor(padded, dtype=torch.int64), THREE)
        for place, row in enumerate(rows):
            pixels, valid = by_stack(row, THREE)
            assert bool(shapes.valid[place]) == valid
            np.testing.assert_array_equal(shapes.images[place], pixels)
            if valid:
                assert shapes[place].program == Program.from_tokens(row, THREE)
            else:
                with pytest.raises(ProgramError):
                    shapes[place]
