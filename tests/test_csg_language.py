"""Laws of CSG programs as texts, tokens, trees and numbers: what is written can be read back."""

import re

import numpy as np
import pytest
import torch

from lib.interpreters.csg import (
    KINDS,
    OPERATIONS,
    Operation,
    Primitive,
    Program,
    ProgramError,
    Tree,
    Vocabulary,
    parse,
    vocabulary_of,
)
from lib.interpreters.csg.program import LONGEST
from tests.conftest import unchecked
from tests.csg_programs import chain, random_program, random_tokens

CRESCENT = "c(24,32,12)c(36,32,12)-"


@pytest.fixture(scope="module")
def programs() -> list[Program]:
    """Programs of plane and space of every length up to 13, with any primitives."""
    rng = np.random.default_rng(1)
    with unchecked():
        return [
            random_program(rng, dimensions, length)
            for dimensions in (2, 3)
            for length in range(1, 14, 2)
            for _ in range(8)
        ]


@pytest.fixture(scope="module")
def on_the_grid() -> list[tuple[Vocabulary, torch.Tensor]]:
    """Valid tokens of the networks' two vocabularies, of every length up to 13."""
    rng = np.random.default_rng(2)
    vocabularies = [vocabulary_of(2), vocabulary_of(3)]
    return [(v, row) for v in vocabularies for n in range(1, 14, 2) for row in random_tokens(rng, 8, n, v)]


def test_the_random_programs_use_the_whole_language(programs):
    statements = {statement for program in programs for statement in program.statements}
    assert {s.kind for s in statements if isinstance(s, Primitive)} == set(KINDS)
    assert {s.symbol for s in statements if isinstance(s, Operation)} == set(OPERATIONS)
    assert len(set(programs)) == len(programs) == len({program.to_text() for program in programs})


# Texts


def test_text_and_back(programs, unchecked_shapes):
    for program in programs:
        text = program.to_text()
        assert parse(text) == program and hash(parse(text)) == hash(program)
        assert parse(text).to_text() == text == str(program)
        assert re.sub(r"\s", "", text) == text


def test_blanks_and_what_follows_the_stop_do_not_matter(programs, unchecked_shapes):
    for program in programs:
        words = re.findall(r"\w+|\W", program.to_text())
        assert parse("\t" + " \n ".join(words) + "\r\n$ c(… anything") == program
        assert parse(program.to_text() + "$") == program
        assert parse("\u3000".join(map(str, program.statements))) == program  # a blank of Chinese texts


def test_the_authors_short_names_of_space(programs):
    for program in programs:
        if program.dimensions == 3:
            short = program.to_text().replace("sp(", "p(").replace("cu(", "u(").replace("cy(", "y(")
            assert parse(short) == program


def test_numbers_may_have_signs_and_zeros_in_front():
    assert parse("c(+24,032,000000012)").to_text() == "c(24,32,12)"
    assert parse("c(-0,0,1)") == parse("c(0,0,1)")


def test_a_kind_of_text_is_a_text():
    assert parse(np.str_(CRESCENT)) == parse(CRESCENT)


def test_a_program_is_a_value(unchecked_shapes):
    program = parse(CRESCENT)
    assert Program(list(program.statements)) == program == Program(iter(program.statements))
    assert len({program, parse(CRESCENT), Program(list(program.statements))}) == 1
    assert program != parse("c(36,32,12)c(24,32,12)-")
    assert Primitive("c", [24, np.int16(32), torch.tensor(12)]) == Primitive("c", (24, 32, 12))
    with pytest.raises(AttributeError):
        program.statements = ()


def test_length_and_dimensions_are_those_of_the_statements(programs):
    for program in programs:
        assert len(program) == len(program.statements) == 2 * len(program.primitives) - 1
        assert {primitive.dimensions for primitive in program.primitives} == {program.dimensions}
        assert all(len(primitive.numbers) == primitive.dimensions + 1 + (primitive.kind == "cy")
                   for primitive in program.primitives)  # fmt: skip


# Trees


def test_tree_and_back(programs):
    for program in programs:
        assert Program.from_tree(program.tree()) == program


def test_a_subtraction_takes_the_right_from_the_left():
    a, b = parse(CRESCENT).primitives
    assert parse(CRESCENT).tree() == Tree(Operation("-"), a, b)
    assert Program.from_tree(a) == Program((a,)) and parse(str(a)).tree() == a
    assert Operation("-").name == "subtract"


def test_a_tree_may_share_its_branches():
    a, b = parse(CRESCENT).primitives
    branch = Tree(Operation("*"), a, b)
    assert Program.from_tree(Tree(Operation("+"), branch, branch)).to_text() == 2 * f"{a}{b}*" + "+"


def postfix(infix: str) -> str:
    """Reads what `infix` writes: an operation comes out where its parenthesis closes."""
    written, waiting = [], []
    for word in re.findall(r"[a-z]+\([\d,]+\)|[()+*-]", infix):
        if word in OPERATIONS:
            waiting.append(word)
        elif word != "(":
            written.append(waiting.pop() if word == ")" else word)
    return "".join(written)


def test_infix_says_the_same(programs):
    assert parse(CRESCENT).infix() == "(c(24,32,12) - c(36,32,12))"
    for program in programs:
        infix = program.infix()
        assert postfix(infix) == program.to_text()
        assert infix.count("(") == infix.count(")") == len(program)


def test_the_view_of_a_tree():
    program = parse("c(32,32,28)s(32,32,20)t(32,24,8)+-c(8,8,8)*")
    expected = """
* intersect
├── - subtract
│   ├── c(32,32,28)
│   └── + union
│       ├── s(32,32,20)
│       └── t(32,24,8)
└── c(8,8,8)
"""
    assert program.tree_view() == expected.strip("\n")


def test_the_view_has_a_line_for_every_token(programs):
    for program in programs:
        lines = [re.sub("^[│├└─ ]*", "", line).split(" ")[0] for line in program.tree_view().split("\n")]
        assert sorted(lines) == sorted(map(str, program.statements))
        assert [line for line in lines if line not in OPERATIONS] == list(map(str, program.primitives))


# Tokens


def test_tokens_and_back(on_the_grid):
    for vocabulary, tokens in on_the_grid:
        program = Program.from_tokens(tokens, vocabulary)
        assert program == vocabulary.program(tokens)
        assert program.tokens().tolist() == program.tokens(vocabulary).tolist() == tokens.tolist()
        assert parse("".join(vocabulary.texts[token] for token in tokens)) == program


def test_padding_says_nothing(on_the_grid, unchecked_shapes):
    for vocabulary, tokens in on_the_grid:
        program = vocabulary.program(tokens)
        padded = program.tokens(length=len(program) + 3)
        assert padded.tolist() == tokens.tolist() + 3 * [vocabulary.stop]
        padded[-2] = len(vocabulary)  # no token at all, but after the first `$`
        for same in (padded, padded.numpy(), padded.tolist(), tuple(padded), padded.int(), iter(padded)):
            assert Program.from_tokens(same, vocabulary) == program


def test_tokens_mean_the_plane_unless_told_otherwise():
    assert Program.from_tokens([0, 1, 396]) == Program.from_tokens([0, 1, 396], vocabulary_of(2))
    assert parse("sp(8,8,8,8)").tokens().tolist() == [vocabulary_of(3).index("sp(8,8,8,8)")]


def test_any_primitives_make_a_vocabulary(programs):
    for program in programs:
        vocabulary = Vocabulary(dict.fromkeys(program.primitives))
        assert vocabulary.dimensions == program.dimensions
        assert vocabulary.program(program.tokens(vocabulary)) == program
        assert program.tokens(vocabulary)[0] == 0  # the first primitive is the first token


# The networks' vocabularies


def test_a_vocabulary_says_what_it_is():
    assert repr(vocabulary_of(2)) == "Vocabulary(2D: 396 primitives, then + * - $)"
    assert repr(vocabulary_of(3)) == "Vocabulary(3D: 6631 primitives, then + * - $)"


@pytest.mark.parametrize("dimensions, size", [(2, 400), (3, 6635)])
def test_a_vocabulary_numbers_its_texts(dimensions, size, unchecked_shapes):
    vocabulary = vocabulary_of(dimensions)
    assert vocabulary is vocabulary_of(dimensions)
    assert len(vocabulary) == len(vocabulary.texts) == len(set(vocabulary.texts)) == size
    assert [vocabulary.index(text) for text in vocabulary.texts] == list(range(size))
    assert vocabulary.texts[-4:] == (*OPERATIONS, "$") and vocabulary.stop == size - 1
    assert vocabulary.texts[:-4] == tuple(map(str, vocabulary.primitives))
    assert all(parse(str(p)).primitives == (p,) for p in vocabulary.primitives[:: max(1, size // 400)])
    assert str(size - 4) in repr(vocabulary)


def test_primitives_are_sorted_as_the_authors_sort_theirs():
    texts = [str(primitive) for primitive in vocabulary_of(2).primitives]
    assert texts == sorted(texts)
    shortened = [str(primitive)[1:] for primitive in vocabulary_of(3).primitives]
    assert shortened == sorted(shortened)


def test_how_many_there_are_of_each_kind():
    kinds = [p.kind for dimensions in (2, 3) for p in vocabulary_of(dimensions).primitives]
    counts = {kind: kinds.count(kind) for kind in KINDS}
    assert counts == {"c": 91, "s": 169, "t": 136, "sp": 649, "cu": 1341, "cy": 4641}


@pytest.mark.parametrize(
    "first, mirrored",
    [("c(8,8,8)", "c(56,56,8)"), ("s(8,8,8)", "s(56,56,8)"), ("cu(8,8,8,16)", "cu(56,56,56,16)"),
     ("cy(32,32,8,8,16)", "cy(32,32,56,8,16)")],
)  # fmt: skip
def test_what_touches_the_rim(first, mirrored):
    """Pixels go from 0 to 63: what just fits at the low end ends at 64 at the other. The square is drawn less wide."""
    texts = vocabulary_of(parse(first).dimensions).texts
    assert first in texts
    assert (mirrored in texts) == first.startswith("s(")


# Parameters


def test_its_own_parameters_change_nothing(programs, unchecked_shapes):
    for program in programs:
        numbers = program.parameters()
        for same in (numbers, numbers.tolist(), numbers.numpy(), tuple(numbers), numbers.to(torch.uint8)):
            assert program.with_parameters(same) == program
        names = program.parameter_names()
        assert len(names) == len(numbers) == len(set(names))


def test_parameters_come_in_text_order(programs):
    for program in programs:
        assert program.parameters().tolist() == [int(n) for n in re.findall(r"\d+", program.to_text())]
    names = parse("c(1,2,3)s(4,5,6)-").parameter_names()
    assert names == ("0:c:x", "0:c:y", "0:c:r", "1:s:x", "1:s:y", "1:s:r")
    assert parse("cy(1,2,3,4,5)").parameter_names() == ("0:cy:x", "0:cy:y", "0:cy:z", "0:cy:r", "0:cy:h")


def test_the_structure_is_what_is_not_a_number():
    assert parse("c(1,2,3)s(4,5,6)-").structure == ("c", "s", "-") == parse("c(9,9,9)s(7,7,7)-").structure
    assert parse("c(1,2,3)").structure == ("c",) != parse("s(1,2,3)").structure


def test_other_parameters_change_the_numbers_only(programs, unchecked_shapes):
    rng = np.random.default_rng(3)
    for program in programs:
        numbers = rng.integers(1, 64, len(program.parameters()))
        other = program.with_parameters(numbers)
        assert other.parameters().tolist() == numbers.tolist()
        assert other.parameter_names() == program.parameter_names()
        assert other.structure == program.structure
        assert re.sub(r"\d+", "", other.to_text()) == re.sub(r"\d+", "", program.to_text())


# The longest programs


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_longest_programs(side, unchecked_shapes):
    text = chain(LONGEST, side)
    program = parse(text)
    assert len(program) == LONGEST and program.to_text() == text
    assert Program.from_tree(program.tree()) == program
    assert postfix(program.infix()) == text
    assert program.tree_view().count("\n") == LONGEST - 1
    assert program.with_parameters(program.parameters()) == program
    vocabulary = Vocabulary({program.primitives[0]})
    assert vocabulary.program(program.tokens(vocabulary, LONGEST + 5)) == program
    with pytest.raises(ProgramError):
        parse(chain(LONGEST + 2, side))
