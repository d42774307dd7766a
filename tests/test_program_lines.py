"""A line of a program is 63 numbers, and the numbers are the line again."""

import numpy as np
import pytest
import torch

from lib.interpreters.shapeassembly import ProgramError, parse
from lib.models.program_lines import (
    COMMAND,
    COMMANDS,
    FIELD,
    MAX_CUBOIDS,
    WIDTH,
    WIDTHS,
    block_lines,
    line_of,
    statement_of,
)  # fmt: skip

TEXT = """Assembly Program_0 {
\tbbox = Cuboid(1.0, 2.0, 3.0, True)
\tcube0 = Cuboid(0.4, 0.5, 0.6, False)
\tcube1 = Cuboid(0.1, 1.5, 0.2, True)
\tattach(cube0, bbox, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
\tsqueeze(cube1, bbox, cube0, bot, 0.7, 0.8)
\treflect(cube1, Z)
\ttranslate(cube0, Y, 3, 0.25)
}
"""
NAMES = ["bbox", "cube0", "cube1"]
# What each line holds beside zeros, by field: one-hots by the place of their 1, numbers as they are.
BY_HAND = [
    {"command": 1, "first": 0, "size": (1.0, 2.0, 3.0), "aligned": (1.0,)},
    {"command": 1, "first": 1, "size": (0.4, 0.5, 0.6)},
    {"command": 1, "first": 2, "size": (0.1, 1.5, 0.2), "aligned": (1.0,)},
    {"command": 2, "first": 1, "second": 0, "point": (0.1, 0.2, 0.3), "place": (0.4, 0.5, 0.6)},
    {"command": 5, "first": 2, "second": 0, "third": 1, "face": 3, "uv": (0.7, 0.8)},
    {"command": 3, "first": 2, "axis": 2},
    {"command": 4, "first": 1, "axis": 1, "count": (3.0,), "distance": (0.25,)},
]


@pytest.fixture
def block():
    return parse(TEXT).blocks[0]


def test_the_fields_are_63_numbers_in_the_authors_order():
    assert WIDTH == 63 and sum(WIDTHS.values()) == 63
    starts = {
        "command": 0, "first": 7, "second": 18, "third": 29, "size": 40, "point": 43, "place": 46, "axis": 49,
        "count": 52, "distance": 53, "face": 54, "uv": 60, "aligned": 62,
    }  # fmt: skip
    assert {name: where.start for name, where in FIELD.items()} == starts
    assert COMMANDS[COMMAND["squeeze"]] == "squeeze"


def test_each_line_holds_what_is_expected_by_hand(block):
    for line, expected in zip(block_lines(block), BY_HAND, strict=True):
        for name, where in FIELD.items():
            value = expected.get(name, (0.0,) * WIDTHS[name])
            if isinstance(value, int):
                value = tuple(float(i == value) for i in range(WIDTHS[name]))
            assert tuple(line[where]) == value, name


def test_lines_are_statements_again(block):
    for line, statement in zip(block_lines(block), block.statements, strict=True):
        assert statement_of(line, NAMES) == statement
        assert statement_of(torch.tensor(line), NAMES) == statement  # float32 is enough for six decimals


def test_soft_one_hots_are_read_as_their_largest_entry(block):
    rng = np.random.default_rng(0)
    for line, statement in zip(block_lines(block), block.statements, strict=True):
        soft = np.array(line)
        for name in ("command", "first", "second", "third", "axis", "face"):
            soft[FIELD[name]] += rng.uniform(0, 0.4, WIDTHS[name])
        assert statement_of(soft.tolist(), NAMES) == statement


def test_a_count_is_a_whole_number_from_one_on():
    line = line_of(parse(TEXT).blocks[0].statements[-1], {"cube0": 1})
    for written, count in {2.6: 3, 0.2: 1, -4.0: 1}.items():
        line[FIELD["count"]] = [written]
        assert statement_of(line, NAMES).count == count


@pytest.mark.parametrize("command", ["start", "end"])
def test_start_and_end_are_no_statements(command):
    line = [0.0] * WIDTH
    line[COMMAND[command]] = 1.0
    with pytest.raises(ProgramError, match=f"a line says '{command}'"):
        statement_of(line, NAMES)


def test_a_cuboid_without_a_name_is_told(block):
    line = block_lines(block)[4]
    with pytest.raises(ProgramError, match="names cuboid 2.*one of the 2 cuboids"):
        statement_of(line, NAMES[:2])


@pytest.mark.parametrize("parts, fits", [(MAX_CUBOIDS - 1, True), (MAX_CUBOIDS, False)])
def test_a_block_has_room_for_ten_cuboids_and_its_bbox(parts, fits):
    lines = ["bbox = Cuboid(1, 1, 1, True)", *(f"cube{i} = Cuboid(1, 1, 1, True)" for i in range(parts))]
    lines += [f"attach(cube{i}, bbox, 0.5, 0, 0.5, 0.5, 0, 0.5)" for i in range(parts)]
    block = parse("Assembly Program_0 {\n" + "\n".join(lines) + "\n}\n").blocks[0]
    if fits:
        assert len(block_lines(block)) == 2 * parts + 1
    else:
        with pytest.raises(ProgramError, match="'Program_0' declares 12 cuboids.*at most 11, bbox included"):
            block_lines(block)
