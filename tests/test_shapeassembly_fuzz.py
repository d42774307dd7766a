"""Fuzzing: a damaged program runs to finite geometry or raises ProgramError. Nothing else escapes, nothing hangs.

Two ways to make programs: random changes to good ones (seeded, so a failure comes back), and hypothesis, which
builds programs from the grammar, many of them valid, and shrinks what fails.
"""

import random
import re
import time

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from lib.interpreters.shapeassembly import ProgramError, execute, parse
from tests.programs import block_text

MUTANTS = 20_000
SLOWEST = 5.0  # seconds for one program; the slowest takes some hundredths, this is for a busy machine
JUNK = [
    *("", " ", "\n", "\t", "\r", "\0", "\ufeff", "\u2028", "é", "٣", "１", "'", '"', "\\", "%", ";"),
    *(
        "{",
        "}",
        "(",
        ")",
        ",",
        "=",
        "#",
        "-",
        "+",
        ".",
        "_",
        "e",
        "E",
        "0x1",
        "1_0",
        "1e",
        "1.2.3",
        "--1",
        "+.5",
        "5.",
    ),
    *(
        "nan",
        "inf",
        "-inf",
        "None",
        "True",
        "False",
        "true",
        "1e308",
        "-1e308",
        "1e999",
        "1e-320",
        "99999999999999999999",
    ),
    *(
        "0",
        "-0",
        "-1",
        "1",
        "2",
        "0.5",
        "3.7",
        "10000",
        "9999",
        "1000000000",
        "1e6",
        "1e-9",
        "X",
        "Y",
        "Z",
        "top",
        "bot",
        "left",
    ),
    *(
        "bbox",
        "cube0",
        "cube1",
        "cube2",
        "cube99",
        "Program_0",
        "Program_1",
        "Program_2",
        "Assembly",
        "Cuboid",
    ),
    *(
        "attach",
        "squeeze",
        "reflect",
        "translate",
        "__class__",
        "import os",
        "reflect(cube0, X)",
        "}\nAssembly A {",
    ),
    *(
        "attach(cube0, bbox, 0, 0, 0, 1, 1, 1)",
        "squeeze(cube1, cube0, bbox, top, 0.2, 0.3)",
        "translate(cube0, Z, 3, 0.4)",
    ),
]
EXCHANGES = [("True", "False"), ("X", "Z"), ("top", "left"), ("cube0", "cube1"), ("cube1", "bbox")]
NUMBER = re.compile(r"-?\d+\.\d+|-?\d+")


def mutate(text: str, rng: random.Random) -> str:
    """One to four random changes: to a token, a character, a stretch, the order of lines, a number or a flag."""
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        change = rng.randrange(8)
        lines = text.split("\n")
        if change == 0:  # another token
            tokens = re.split(r"([\w.]+)", text)
            tokens[rng.randrange(len(tokens))] = rng.choice(JUNK)
            text = "".join(tokens)
        elif change == 1:  # something pushed in
            at = rng.randrange(len(text) + 1)
            text = text[:at] + rng.choice(JUNK) + text[at:]
        elif change == 2:  # something cut out
            at = rng.randrange(len(text) + 1)
            text = text[:at] + text[at + rng.randrange(30) :]
        elif change == 3:  # two lines swapped
            i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
            text = "\n".join(lines)
        elif change == 4:  # a line repeated elsewhere
            lines.insert(rng.randrange(len(lines)), rng.choice(lines))
            text = "\n".join(lines)
        elif change == 5:  # a line lost
            del lines[rng.randrange(len(lines))]
            text = "\n".join(lines)
        elif change == 6 and (numbers := list(NUMBER.finditer(text))):  # another number
            at = rng.choice(numbers)
            number = rng.choice(
                [0, 1, -1, 0.5, 1e6, 1e-9, 1e300, rng.gauss(0, 3), rng.random(), rng.randrange(10)]
            )
            text = text[: at.start()] + str(number) + text[at.end() :]
        elif change == 7:  # flags, axes, faces, names exchanged
            old, new = rng.choice(
                [("True", "False"), ("X", "Z"), ("top", "left"), ("cube0", "cube1"), ("cube1", "bbox")]
            )
            text = text.replace(old, new, rng.choice([1, 1, 99]))
    return text


def outcome(text: str) -> str:
    """ "runs" or "refused"; anything else is a failure that shows the text."""
    try:
        shape = execute(parse(text))
    except ProgramError as error:
        assert str(error)
        assert error.line is None or 1 <= error.line <= text.count("\n") + 1
        return "refused"
    assert shape.cuboids.corners().isfinite().all(), text
    return "runs"


@pytest.mark.slow
def test_mutants_run_or_are_refused(programs, time_limit, record_property, unchecked_shapes):
    rng = random.Random(20_000)
    originals = [program.to_text() for program in programs]
    counts, slowest, began = {"runs": 0, "refused": 0}, 0.0, time.perf_counter()
    for number in range(MUTANTS):
        text = mutate(rng.choice(originals), rng)
        started = time.perf_counter()
        try:
            with time_limit(SLOWEST):
                counts[outcome(text)] += 1
        except Exception as error:
            pytest.fail(f"mutant {number}: {type(error).__name__}: {error}\n{text}")
        slowest = max(slowest, time.perf_counter() - started)
    seconds = time.perf_counter() - began
    result = f"{counts['runs']} run, {counts['refused']} refused, {seconds:.0f} s, slowest {slowest:.2f} s"
    print(result)
    record_property("fuzz", result)
    assert counts["runs"] > 0.05 * MUTANTS  # enough of them reach the machine …
    assert counts["refused"] > 0.05 * MUTANTS  # … and the checks


def test_a_mutant_comes_back_from_its_seed(programs):
    text = programs[0].to_text()
    assert mutate(text, random.Random(5)) == mutate(text, random.Random(5)) != mutate(text, random.Random(6))


# Programs from the grammar

numbers = st.one_of(
    st.floats(0, 1).map(lambda x: round(x, 3)),
    st.sampled_from([0, 0.5, 1, -1, 2, 1e-4, 1e-9, 1e-300, 1e9, 1e300, -0.0]),
    st.floats(allow_nan=False, allow_infinity=False),
)
sizes = st.one_of(st.floats(0.01, 2), st.sampled_from([1, 1e-9, 1e-300, 1e9, 1e300]))
CUBES = [f"cube{i}" for i in range(4)]


@st.composite
def blocks(draw) -> str:
    """A block whose names and order are right; its numbers are anything."""
    cubes = CUBES[: draw(st.integers(1, 4))]

    def triple(values) -> str:
        return ", ".join(map(repr, draw(st.tuples(values, values, values))))

    lines = [f"{cube} = Cuboid({triple(sizes)}, {draw(st.booleans())})" for cube in cubes]
    grounded = ["bbox"]
    for cube in [*cubes, *draw(st.lists(st.sampled_from(cubes), max_size=6))]:
        partners = st.sampled_from([name for name in grounded if name != cube])
        if draw(st.booleans()):
            lines.append(f"attach({cube}, {draw(partners)}, {triple(numbers)}, {triple(numbers)})")
        else:
            face = draw(st.sampled_from(["right", "left", "top", "bot", "front", "back"]))
            place = f"{draw(numbers)!r}, {draw(numbers)!r}"
            lines.append(f"squeeze({cube}, {draw(partners)}, {draw(partners)}, {face}, {place})")
        grounded.append(cube)
    for cube in draw(st.lists(st.sampled_from(cubes), max_size=3)):
        axis = draw(st.sampled_from("XYZ"))
        copies = f"translate({cube}, {axis}, {draw(st.integers(1, 5))}, {draw(numbers)!r})"
        lines.append(draw(st.sampled_from([f"reflect({cube}, {axis})", copies])))
    return block_text(*lines, bbox=triple(sizes))


@settings(max_examples=150, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(blocks())
def test_any_numbers_run_or_are_refused(text):
    outcome(text)


@settings(max_examples=300, deadline=None, derandomize=True)
@example("Assembly Program_0 {\nbbox = Cuboid(1, 1, 1)\n}\n")
@given(
    st.lists(
        st.sampled_from([*JUNK, "Assembly P {", "bbox = Cuboid(1, 1, 1)", "\n", "\n}"]), max_size=20
    ).map(" ".join)
)
def test_any_words_run_or_are_refused(text):
    outcome(text)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.one_of(st.text(max_size=100), st.binary(max_size=100)))
def test_anything_runs_or_is_refused(text):
    with pytest.raises(ProgramError):
        parse(text)
