"""Texts nobody should write: not text at all, huge numbers, huge programs. Each is refused, or run, without delay."""

import pytest

from lib.interpreters.shapeassembly import ProgramError, execute, parse
from tests.programs import block_text

SOON = 5  # seconds; what these take is below one on an idle core, even with shape checks on


def error_of(text: str | bytes) -> ProgramError:
    with pytest.raises(ProgramError) as caught:
        execute(parse(text))
    assert len(str(caught.value)) < 1000, "nobody reads that"
    return caught.value


def boxes(*lines: str) -> int:
    """Number of boxes of a program, executed."""
    return len(execute(parse("\n".join(lines))).boxes)


GROUND = "attach({0}, bbox, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)"
CUBE = ("cube0 = Cuboid(0.1, 0.1, 0.1, True)", GROUND.format("cube0"))

# Not text


@pytest.mark.parametrize(
    "text", [b"\xff\xfe\x00", b"\x89PNG\r\n\x1a\n", block_text().encode("utf-16"), b"\xc3\x28"]
)
def test_bytes_that_are_no_text(text):
    assert "not a text" in str(error_of(text))


def test_utf_16_without_a_mark_has_nul_characters():
    error = error_of(block_text().encode("utf-16-le"))
    assert (error.line, error.column) == (1, 2) and "NUL" in str(error)


@pytest.mark.parametrize(
    "encode", [str, str.encode, lambda text: text.encode("utf-8-sig"), lambda text: "\ufeff" + text]
)
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_a_byte_order_mark_and_windows_line_ends_do_no_harm(encode, ending):
    text = encode(block_text(*CUBE).replace("\n", ending))
    assert len(execute(parse(text)).cuboids) == 1


def test_places_are_right_after_a_byte_order_mark_and_windows_line_ends():
    error = error_of("\ufeff" + block_text(*CUBE).replace("cube0, bbox", "cube0, bbax").replace("\n", "\r\n"))
    assert (error.line, error.column, error.token) == (4, 16, "bbax")


def test_lone_surrogates_and_odd_letters_are_quoted_safely():
    for odd in ("\ud800", "\u202e", "é", "\x1b[31m"):
        str(error_of(block_text(f"{odd} = Cuboid(1, 1, 1)"))).encode("utf-8", "strict")


# Huge numbers


@pytest.mark.parametrize(
    "number", ["1e999", "-1e999", "9" * 400, "1" * 100_000, "0." + "1" * 100_000, "0" * 5000 + "1"]
)
@pytest.mark.parametrize("place", ["({0}, 1, 1)", "(1, {0}, 1)"])
def test_long_numbers(number, place, time_limit):
    """Finite ones are numbers as good as others; none is slow, or an error of Python's."""
    with time_limit(SOON):
        try:
            execute(parse(block_text("cube0 = Cuboid" + place.format(number), CUBE[1])))
        except ProgramError as error:
            assert error.line == 3


def test_long_words_that_only_begin_as_numbers(time_limit):
    with time_limit(SOON):
        assert error_of(block_text(f"cube0 = Cuboid({'1' * 100_000}x, 1, 1)")).column == 17


@pytest.mark.parametrize(
    "count", ["1" * 10_000, "10" + "0" * 8, "999999999", "10001", "0" * 5000 + "1", "１"]
)
def test_long_counts(count, time_limit):
    with time_limit(SOON):
        assert error_of(block_text(*CUBE, f"translate(cube0, X, {count}, 0.5)")).line == 5


@pytest.mark.parametrize("size", ["1e-320", "1e-300", "1e300", "1.7e308"])
def test_sizes_at_the_ends_of_the_range_give_finite_corners_or_an_error(size):
    lines = [f"cube0 = Cuboid({size}, {size}, {size})", "cube1 = Cuboid(1, 1, 1, True)"]
    for place in ("0.5, 0.5, 0.5", "-1.5, 0.5, 2.5"):
        text = block_text(*lines, GROUND.format("cube1"), f"attach(cube0, bbox, 0.5, 0.5, 0.5, {place})",
                          "attach(cube0, cube1, 0, 1, 0.5, 0.5, 0.5, 0.5)", bbox=", ".join([size] * 3))  # fmt: skip
        try:
            assert execute(parse(text)).cuboids.corners().isfinite().all()
        except ProgramError as error:
            assert "finite" in str(error)


def test_corners_that_overflow_are_noticed():
    """Center and size are finite here, but not their sum."""
    text = block_text(
        "cube0 = Cuboid(1e308, 1, 1)",
        "attach(cube0, bbox, 0.5, 0.5, 0.5, -1.2, 0.5, 0.5)",
        bbox="1e308, 1, 1",
    )
    assert "finite" in str(error_of(text))


# Huge lines


@pytest.mark.parametrize(
    "line",
    ["a" * 10**6, " " * 10**6 + "x(", "(" * 10**6, "a(" + ")" * 10**6 + "x", "a(" + ") " * 10**6 + "x", "a=" * 10**6,
     "a = Cuboid(" + "," * 10**6 + ")", "a = Cuboid(" + "1" * 10**6, "{" * 10**6, "attach(" + "a, " * 10**6 + ")",
     "reflect(cube0, " + "X" * 10**6 + ")", "b" * 10**6 + " = Cuboid(1, 1, 0)"],
    ids=range(12),
)  # fmt: skip
def test_a_very_long_line(line, time_limit):
    with time_limit(SOON):
        assert error_of(block_text(*CUBE, line)).line in (3, 5)  # 3: a Cuboid after an attach
        assert error_of(line).line == 1


# Huge programs


def test_more_than_ten_thousand_cuboids(time_limit):
    lines = [f"cube{i} = Cuboid(1, 1, 1)" for i in range(10_001)]
    with time_limit(SOON):
        error = error_of(block_text(*lines))
    assert "too many cuboids" in str(error) and error.line and error.line > 9_990


def test_two_to_the_power_of_forty_boxes(time_limit):
    """Each block holds the next one twice: a short text, refused before anything is built."""
    twice = ["{0} = Cuboid(1, 1, 1)", GROUND, "reflect({0}, X)"]
    blocks = [
        block_text(*(line.format(f"Program_{i + 1}") for line in twice), name=f"Program_{i}")
        for i in range(40)
    ]
    with time_limit(SOON):
        assert "at most 10000" in str(error_of("".join(blocks) + block_text(name="Program_40")))


def chain(depth: int) -> str:
    """Blocks within blocks."""
    inner = ["{0} = Cuboid(1, 1, 1)", GROUND]
    blocks = [
        block_text(*(line.format(f"Program_{i}") for line in inner), name=f"Program_{i - 1}")
        for i in range(1, depth)
    ]
    return "".join(blocks) + block_text(name=f"Program_{depth - 1}")


@pytest.mark.parametrize("depth", [100, 3_000, 8_000])
def test_blocks_within_blocks(depth, time_limit):
    """Deep ones may be refused; Python's recursion limit has no say in it, and names do not pile up."""
    with time_limit(2 * SOON):
        try:
            assert sum(map(len, execute(parse(chain(depth))).box_names)) < 10**8
        except ProgramError:
            assert depth > 100


def test_many_unused_blocks(time_limit):
    with time_limit(SOON):
        assert "never used" in str(error_of("".join(block_text(name=f"B{i}") for i in range(20_000))))


@pytest.mark.parametrize("aligned", ["True", "False"])
def test_many_attaches_of_one_cuboid(aligned, time_limit):
    """As many as this may be refused; they must not take minutes or gigabytes."""
    cube = f"cube0 = Cuboid(1, 1, 1, {aligned})"
    with time_limit(2 * SOON):
        assert boxes(block_text(cube, *["attach(cube0, bbox, 0.5, 0.4, 0.5, 0.5, 0.5, 0.3)"] * 100)) == 2
        try:
            boxes(block_text(cube, *["attach(cube0, bbox, 0.5, 0.4, 0.5, 0.5, 0.5, 0.3)"] * 20_000))
        except ProgramError:
            pass


@pytest.mark.parametrize("aligned", ["True", "False"])
def test_many_attaches_copied_many_times(aligned, time_limit):
    """A text of 1,000 lines that stands for 9,000,000 attaches."""
    attaches = ["attach(cube0, bbox, 0.5, 0.4, 0.5, 0.5, 0.5, 0.3)"] * 1000
    with time_limit(2 * SOON):
        try:
            boxes(
                block_text(f"cube0 = Cuboid(1, 1, 1, {aligned})", *attaches, "translate(cube0, X, 9000, 0.9)")
            )
        except ProgramError:
            pass
