"""Every error names its place: line, column and token, what is wrong, and what was expected there."""

import pytest
import torch

from lib.interpreters.shapeassembly import (
    Attach,
    Block,
    Cuboid,
    Program,
    ProgramError,
    Reflect,
    Squeeze,
    Translate,
    execute,
    parse,
)  # fmt: skip

GOOD = """Assembly Program_0 {
	bbox = Cuboid(1, 1, 1, True)
	cube0 = Cuboid(0.5, 0.1, 0.5, True)
	cube1 = Cuboid(0.1, 0.4, 0.1, False)
	Program_1 = Cuboid(0.2, 0.2, 0.2, True)
	squeeze(cube0, bbox, bbox, top, 0.5, 0.5)
	attach(cube1, bbox, 0.5, 0.0, 0.5, 0.2, 0.0, 0.2)
	attach(Program_1, cube0, 0.5, 0.0, 0.5, 0.5, 1.0, 0.5)
	reflect(cube1, X)
	translate(cube1, Z, 2, 0.6)
}
Assembly Program_1 {
	bbox = Cuboid(0.2, 0.2, 0.2, True)
}
"""


def error_of(text: str | bytes) -> ProgramError:
    with pytest.raises(ProgramError) as caught:
        execute(parse(text))
    return caught.value


def test_the_good_program_runs():
    assert len(execute(parse(GOOD)).cuboids) == 5


LAST = "0.2, 0.2, 0.2, True)\n}\n"  # the end of the last block: GOOD ends with it
INTO_NEXT = "}\nAssembly Program_1"

# what to change in GOOD, to what -> line, column, token, a part of the message
CASES = {
    "unknown statement": ("squeeze(cube0", "squash(cube0", 6, 2, "squash", "unknown statement 'squash'"),
    "statement in capitals": ("attach(cube1", "Attach(cube1", 7, 2, "Attach", "unknown statement"),
    "not a statement": ("reflect(cube1, X)", "hello", 9, 2, "hello", "expected a statement"),
    "no closing parenthesis": ("reflect(cube1, X)", "reflect(cube1, X", 9, 18, "", "never closed"),
    "text after a statement": ("cube1, X)", "cube1, X) and more", 9, 2, "reflect(cube1,", "found 'reflect(cube1, X)"),
    "two statements on a line": ("X)\n\t", "X); ", 9, 10, None, "one statement a line"),
    "too few arguments": ("0.2, 0.0, 0.2)", "0.2, 0.0)", 7, 9, None, "attach with 7 arguments; expected 8"),
    "too many arguments": ("cube1, X)", "cube1, X, Y)", 9, 10, "cube1, X, Y", "3 arguments; expected 2: name, axis"),
    "no arguments": ("reflect(cube1, X)", "reflect()", 9, 10, "", "0 arguments"),
    "arity counts from the first word": ("reflect(cube1, X)", "reflect(  cube1)", 9, 12, "cube1", "1 arguments"),
    "an argument left empty": ("0.6)", ")", 10, 25, "", "'' is not a number"),
    "not a number": ("0.5, 0.5)", "0.5, half)", 6, 39, "half", "'half' is not a number"),
    "not a number, but Python": ("0.5, 0.5)", "0.5, 1_0)", 6, 39, "1_0", "not a number"),
    "unicode digits": ("0.5, 0.5)", "0.5, ٣)", 6, 39, "٣", "not a number"),
    "hexadecimal": ("0.5, 0.5)", "0.5, 0x1)", 6, 39, "0x1", "not a number"),
    "NaN": ("0.5, 0.5)", "0.5, nan)", 6, 39, "nan", "not a number; expected a finite decimal"),
    "infinity": ("0.5, 0.5)", "0.5, -inf)", 6, 39, "-inf", "not a number; expected a finite decimal"),
    "infinite after reading": ("0.5, 0.5)", "0.5, 1e999)", 6, 39, "1e999", "too large; expected a finite"),
    "negative size": ("0.5, 0.1, 0.5", "0.5, -0.1, 0.5", 3, 22, "-0.1", "'cube0' has a side of -0.1"),
    "size zero": ("0.1, 0.4, 0.1", "0.1, 0.4, 0", 4, 27, "0", "expected a size above 0"),
    "size minus zero": ("0.1, 0.4, 0.1", "0.1, 0.4, -0.0", 4, 27, "-0.0", "expected a size above 0"),
    "size that vanishes": ("0.1, 0.4, 0.1", "0.1, 0.4, 1e-999", 4, 27, "1e-999", "expected a size above 0"),
    "bbox without volume": ("bbox = Cuboid(0.2", "bbox = Cuboid(0", 13, 16, "0", "'bbox' has a side of 0"),
    "not a flag": ("0.5, True)", "0.5, true)", 3, 32, "true", "not a flag; expected True or False"),
    "not a name": ("cube1 = Cub", "1cube = Cub", 4, 2, "1cube", "not a name"),
    "name with a sign": ("attach(cube1,", "attach(cube-1,", 7, 9, "cube-1", "not a name"),
    "Cuboid without a name": ("cube1 = Cub", "Cub", 4, 2, "Cuboid", "Cuboid needs"),
    "attach with a name": ("attach(cube1", "a = attach(cube1", 7, 2, "a", "attach takes no name"),
    "unknown cuboid, moved": ("attach(cube1,", "attach(cube7,", 7, 9, "cube7", "unknown cuboid 'cube7'"),
    "unknown cuboid, partner": ("_1, cube0,", "_1, cube8,", 8, 20, "cube8", "unknown cuboid 'cube8'"),
    "unknown cuboid, squeezed to": ("bbox, top", "cube9, top", 6, 23, "cube9", "unknown cuboid 'cube9'"),
    "unknown cuboid, reflected": ("reflect(cube1", "reflect(cube4", 9, 10, "cube4", "unknown cuboid 'cube4'"),
    "no copy of a copy": ("translate(cube1", "translate(cube3", 10, 12, "cube3", "unknown cuboid 'cube3'"),
    "names of another block": (LAST, LAST[:-2] + "\treflect(cube0, X)\n}", 14, 10, "cube0", "unknown"),
    "declared twice": ("cube1 = Cub", "cube0 = Cub", 4, 2, "cube0", "declared twice"),
    "bbox declared twice": ("cube1 = Cub", "bbox = Cub", 4, 2, "bbox", "declared twice"),
    "bbox missing": ("	bbox = Cuboid(0.2, 0.2, 0.2, True)\n", "", 12, None, None, "has no bounding box"),
    "bbox not first": ("	bbox = Cuboid(1, 1", "	box = Cuboid(1, 1", 2, 2, None, "has no bounding box"),
    "attach moves bbox": ("attach(cube1, bbox", "attach(bbox, cube0", 7, 9, "bbox", "cannot be moved"),
    "squeeze moves bbox": ("squeeze(cube0, bbox", "squeeze(bbox, cube0", 6, 10, "bbox", "cannot be moved"),
    "bbox is copied": ("reflect(cube1", "reflect(bbox", 9, 10, "bbox", "cannot be copied"),
    "attach to the ungrounded": ("(cube1, bbox", "(cube1, Program_1", 7, 16, "Program_1", "not attached"),
    "attach to itself": ("_1, cube0,", "_1, Program_1,", 8, None, "Program_1", "attached to itself"),
    "squeeze between ungrounded": ("bbox, bbox, top", "bbox, cube1, top", 6, 23, "cube1", "not attached"),
    "copy of the ungrounded": ("attach(cube1, bbox", "attach(cube0, bbox", 9, 10, "cube1", "not attached"),
    "bad face": ("top", "bottom", 6, 29, "bottom", "not a face; expected right or left or top or bot"),
    "bad axis": ("cube1, X", "cube1, x", 9, 17, "x", "not an axis; expected X or Y or Z"),
    "no copies": ("Z, 2,", "Z, 0,", 10, 22, "0", "at least 1"),
    "negative copies": ("Z, 2,", "Z, -1,", 10, 22, "-1", "at least 1"),
    "half a copy": ("Z, 2,", "Z, 1.5,", 10, 22, "1.5", "whole number of copies"),
    "a billion copies": ("Z, 2,", "Z, 1000000000,", 10, 22, "1000000000", "copies"),
    "too many copies": ("Z, 2,", "Z, 99999,", 10, 22, "99999", "copies make too many cuboids; expected at most 10000"),
    "squeeze last": ("translate(cube1, Z, 2, 0.6)", "squeeze(cube0, bbox, bbox, top, 0, 0)", 10, 2, None, "out of"),
    "Cuboid after attach": ("attach(cube1", "a = Cuboid(1, 1, 1)\n\tattach(cube1", 7, 6, "Cuboid", "out of order"),
    "sub-program missing": ("Assembly Program_1", "Assembly Program_2", 5, 2, "Program_1", "no block fills"),
    "sub-program unused": (LAST, LAST + "Assembly A {\nbbox = Cuboid(1, 1, 1)\n}\n", 15, 10, "A", "never used"),
    "recursion": (LAST, LAST[:-2] + "\tProgram_1 = Cuboid(1, 1, 1)\n}", 14, 2, "Program_1", "contains itself"),
    "recursion through the root": (LAST, LAST[:-2] + "\tProgram_0 = Cuboid(1, 1, 1)\n}", 14, 2, "Program_0", "itself"),
    "brace missing in the middle": (INTO_NEXT, INTO_NEXT[2:], 11, 1, "Assembly", "a closing brace"),
    "brace missing at the end": (LAST, LAST[:-2], 14, 1, "", "ends inside block 'Program_1'"),
    "brace too many": (INTO_NEXT, "}\n" + INTO_NEXT, 12, 1, "}", "closing brace without a block"),
    "header without brace": ("Program_1 {", "Program_1", 12, 1, "Assembly", "expected 'Assembly NAME {'"),
    "header without name": ("Assembly Program_1 {", "Assembly {", 12, 1, "Assembly", "expected 'Assembly NAME {'"),
    "statement outside a block": (INTO_NEXT, "}\nhello\nAssembly Program_1", 12, 1, "hello", "outside a block"),
    "NUL character": ("Z, 2", "Z, \x002", 10, 22, "\x00", "NUL"),
}  # fmt: skip


@pytest.mark.parametrize("old, new, line, column, token, message", CASES.values(), ids=CASES.keys())
def test_an_error_names_its_place(old, new, line, column, token, message):
    assert old in GOOD
    text = GOOD.replace(old, new, 1)
    error = error_of(text)
    assert message in str(error)
    assert error.line == line, error
    assert column is None or error.column == column, error
    assert token is None or error.token == token, error
    assert str(error).startswith(f"line {line}, column {error.column}: ")
    if error.token and error.column:  # the token stands where the error says
        assert text.splitlines()[line - 1][error.column - 1 :].startswith(error.token), error
    assert isinstance(error, ValueError) and len(str(error)) < 300


def test_a_block_defined_twice():
    block = GOOD[GOOD.index("Assembly Program_1") :]
    error = error_of(GOOD + block)
    assert (error.line, error.column, error.token) == (15, 10, "Program_1") and "defined twice" in str(error)


def test_a_declared_cuboid_must_not_bear_the_name_of_a_copy():
    error = error_of(GOOD.replace("cube0", "cube3"))
    assert (error.line, error.column, error.token) == (
        3,
        2,
        "cube3",
    ) and "copies of 'cube1' will take" in str(error)


@pytest.mark.parametrize("text", ["", "\n \n\t\n", "# only a note\n", b"", b"\xef\xbb\xbf", "\ufeff\n"])
def test_an_empty_text(text):
    error = error_of(text)
    assert "empty" in str(error) and error.line == 1


def test_parameters_that_make_no_program():
    """Errors of a program made by code point into the text that it prints as."""
    program = parse(GOOD)
    numbers = program.parameters()
    with pytest.raises(ProgramError, match="3 parameters given; expected 30"):
        program.with_parameters(numbers[:3])
    for value, message in ((-0.5, "has a side of -0.5"), (float("nan"), "nan is not finite")):
        numbers[4] = value
        with pytest.raises(ProgramError, match=message) as caught:
            program.with_parameters(numbers)
        assert caught.value.line == 3 and caught.value.column == 22


@pytest.mark.parametrize("shape", [(3,), (2, 3), (2, 2, 30)])
def test_execute_wants_as_many_parameters_as_there_are(shape):
    with pytest.raises(ProgramError, match=r"expected \(30,\) or \(batch, 30\)"):
        execute(parse(GOOD), torch.ones(shape, dtype=torch.float64))


def test_geometry_that_overflows_is_an_error():
    text = GOOD.replace("top, 0.5, 0.5", "top, 1e308, 1e308").replace("(1, 1, 1", "(10, 10, 10")
    with pytest.raises(ProgramError, match="'Program_0/cube0' have no finite result"):
        execute(parse(text))


# Programs made by code are checked as strictly as texts are


BBOX, CUBE = Cuboid("bbox", (1.0, 1.0, 1.0), True), Cuboid("cube0", (1.0, 1.0, 1.0))
ATTACH = Attach("cube0", "bbox", (0.5,) * 6)


MADE_WRONG = {  # built in the test, where the shape checks, which readers do not have, are off
    "axis": lambda: (CUBE, ATTACH, Reflect("cube0", "Q")),
    "axis of translate": lambda: (CUBE, ATTACH, Translate("cube0", "W", 1, (0.5,))),
    "no copies": lambda: (CUBE, ATTACH, Translate("cube0", "X", 0, (0.5,))),
    "negative copies": lambda: (CUBE, ATTACH, Translate("cube0", "X", -1, (0.5,))),
    "half a copy": lambda: (CUBE, ATTACH, Translate("cube0", "X", 1.5, (0.5,))),
    "two distances": lambda: (CUBE, ATTACH, Translate("cube0", "X", 1, (0.5, 0.5))),
    "face": lambda: (CUBE, Squeeze("cube0", "bbox", "bbox", "up", (0.5, 0.5))),
    "too few numbers": lambda: (CUBE, Attach("cube0", "bbox", (0.5,))),
    "too many numbers": lambda: (CUBE, Attach("cube0", "bbox", (0.5,) * 7)),
    "two sizes": lambda: (Cuboid("cube0", (1.0, 1.0)),),
    "a huge whole number": lambda: (Cuboid("cube0", (10**400, 1.0, 1.0)),),
    "a text for a number": lambda: (Cuboid("cube0", ("1", 1.0, 1.0)),),
    "a name of two words": lambda: (Cuboid("a b", (1.0, 1.0, 1.0)),),
    "an empty name": lambda: (Cuboid("", (1.0, 1.0, 1.0)),),
}


@pytest.mark.parametrize("make", MADE_WRONG.values(), ids=MADE_WRONG.keys())
def test_statements_made_by_code(make, unchecked_shapes):
    with pytest.raises(ProgramError):
        execute(Program((Block("Program_0", (BBOX, *make())),)))


def test_a_program_made_by_code_needs_a_block():
    with pytest.raises(ProgramError):
        Program(())
