"""Many programs as one table, and its batches by level, against a slow reading of the same programs."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from lib.datasets import examples, shapeassembly
from lib.interpreters.shapeassembly import Block, Cuboid, Program, parse, sample
from lib.models.program_lines import COMMAND, FIELD, WIDTH, block_lines
from lib.models.program_table import ProgramTable, batch_of
from lib.training import program_tables
from lib.training.program_tables import table_of, table_path
from tests.conftest import unchecked


@pytest.fixture(scope="module")
def programs() -> list[Program]:
    """Sixty random programs with all five statements and up to three levels, and the hand-written examples."""
    rng = np.random.default_rng(7)
    with unchecked():
        return [*(sample(rng) for _ in range(60)), *examples().values()]


@pytest.fixture(scope="module")
def table(programs):
    with unchecked():
        return ProgramTable.of(programs)


def breadth_first(program: Program) -> list[tuple[Block, int, int]]:
    """(block, its parent's place in this list, the parent's statement that it fills); -1 twice for the root."""
    blocks = {block.name: block for block in program.blocks}
    found = [(program.blocks[0], -1, -1)]
    for place, (block, _, _) in enumerate(found):
        for at, statement in enumerate(block.statements):
            if isinstance(statement, Cuboid) and statement.name in blocks:
                found.append((blocks[statement.name], place, at))
    return found


def renamed(program: Program) -> tuple[Block, ...]:
    """The program with the names that a table gives: cube0, cube1, … and Program_0, Program_1, … breadth-first."""
    order = [block.name for block, _, _ in breadth_first(program)]
    found = []
    for block, _, _ in breadth_first(program):
        declared = [s.name for s in block.statements if isinstance(s, Cuboid)][1:]
        to = {"bbox": "bbox"} | {
            name: f"Program_{order.index(name)}" if name in order else f"cube{i}"
            for i, name in enumerate(declared)
        }
        statements = []
        for statement in block.statements:
            names = {
                field: to[getattr(statement, field)]
                for field in ("name", "moved", "still", "first", "second", "source")
                if hasattr(statement, field)
            }
            statements.append(replace(statement, **names))
        found.append(Block(f"Program_{order.index(block.name)}", tuple(statements)))
    return tuple(found)


def same(found: tuple[Block, ...], expected: tuple[Block, ...]) -> None:
    """Structure exactly, numbers to 1e-6, which is what six decimals of a float32 keep."""
    assert [block.name for block in found] == [block.name for block in expected]
    for one, other in zip(found, expected):
        assert [s.structure for s in one.statements] == [s.structure for s in other.statements]
        mine, theirs = ([x for s in block.statements for x in s.numbers] for block in (one, other))
        assert np.abs(np.subtract(mine, theirs)).max() <= 1e-6, one.to_text()


def test_programs_come_back(programs, table, unchecked_shapes):
    assert len(table) == len(programs)
    for found, program in zip(table.programs(), programs, strict=True):
        same(found.blocks, renamed(program))


@pytest.mark.slow
@pytest.mark.parametrize("category", ["chair", "table", "storage"])
def test_every_real_program_comes_back(real_texts, category, unchecked_shapes):
    programs = [parse(text) for text in real_texts[category].values()]
    for found, program in zip(ProgramTable.of(programs).blocks(), programs, strict=True):
        same(found, renamed(program))


def test_the_table_lists_blocks_breadth_first(programs, table, unchecked_shapes):
    node = line = 0
    for number, program in enumerate(programs):
        first_of = []
        for block, parent, at in breadth_first(program):
            lines = block_lines(block)
            first_of.append(line)
            assert table.first[node] == line and table.program[node] == number
            assert table.parent[node] == (-1 if parent < 0 else first_of[parent] + at)
            assert np.array_equal(table.lines[line : line + len(lines)], np.array(lines, dtype=np.float32))
            node, line = node + 1, line + len(lines)
    assert table.first[node] == line == len(table.lines) and node == len(table.program)


def test_an_empty_table():
    empty = ProgramTable.of([])
    assert len(empty) == 0 and empty.programs() == [] and empty.lines.shape == (0, WIDTH)


# ---- batches ----


def nodes_of(levels) -> dict[tuple, tuple[list, ...]]:
    """(program of the batch, path of filled cuboid lines from the root) -> (lines of the node, its size), slowly."""
    found = {}
    above: list[tuple] = []  # path of each row of the level above, with the row's place in its node
    for level in levels:
        longest, rows = len(level.steps), []
        at = 0
        columns = [[] for _ in level.size]
        for step in range(longest):
            for node in range(int(level.steps[step])):
                assert level.node[at] == node
                columns[node].append(at)
                at += 1
        assert at == len(level.lines)
        paths = [() if level.depth == 0 else above[int(level.filled[node])] for node in range(len(columns))]
        rows = [None] * at
        for node, column in enumerate(columns):
            for place, row in enumerate(column):
                rows[row] = (*paths[node], place)
            found[int(level.program[node]), paths[node]] = (level.lines[column], level.size[node])
        above = rows
    return found


def expected_nodes(programs: list[Program]) -> dict[tuple, tuple]:
    marks = torch.zeros(2, WIDTH)
    marks[0, COMMAND["start"]] = marks[1, COMMAND["end"]] = 1
    found = {}
    for number, program in enumerate(programs):
        paths = []
        for block, parent, at in breadth_first(program):
            paths.append(() if parent < 0 else (*paths[parent], at + 1))  # one on: start stands first
            lines = torch.cat([marks[:1], torch.tensor(block_lines(block)), marks[1:]])
            found[number, paths[-1]] = (lines, torch.tensor(block.statements[0].numbers, dtype=torch.float32))
    return found


@pytest.mark.parametrize("picks", [[0], [3, 1, 40, 17], list(range(30, 62))])
def test_a_batch_has_each_line_in_its_place(programs, table, picks):
    found = nodes_of(batch_of(table, picks))
    expected = expected_nodes([programs[pick] for pick in picks])
    assert found.keys() == expected.keys()
    for key, (lines, size) in expected.items():
        assert torch.equal(found[key][0], lines) and torch.equal(found[key][1], size), key


def test_targets_are_the_lines_after_the_inputs(table):
    for level in batch_of(table, range(20)):
        place = {}  # node -> rows, in order
        for row, node in enumerate(level.node.tolist()):
            place.setdefault(node, []).append(row)
        follows = {row: after for rows in place.values() for row, after in zip(rows, rows[1:])}
        assert sorted(level.inputs.tolist()) == sorted(follows)
        for index, row in enumerate(level.inputs.tolist()):
            assert torch.equal(level.targets[index], level.lines[follows[row]])


def test_filled_rows_declare_cuboids_of_the_same_program(table):
    levels = batch_of(table, range(20))
    assert len(levels) > 1
    for above, level in zip(levels, levels[1:]):
        lines = above.lines[level.filled]
        assert (lines[:, FIELD["command"]].argmax(-1) == COMMAND["Cuboid"]).all()
        assert torch.equal(above.program[above.node[level.filled]], level.program)


@pytest.mark.parametrize("picks", [[], [0, 0], [-1], [0, 10**6]])
def test_bad_picks_are_told(table, picks):
    with pytest.raises(ValueError, match="expected different programs from 0 to"):
        batch_of(table, picks)


# ---- kept on disk ----


@pytest.fixture
def few(tmp_path, monkeypatch, programs):
    """Six programs where the fetch script would have put real ones."""
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path))
    folder = tmp_path / "shapeassembly"
    (folder / "chair").mkdir(parents=True)
    (folder / "splits" / "chair").mkdir(parents=True)
    for number, program in enumerate(programs[:6]):
        (folder / "chair" / f"{number}.txt").write_text(program.to_text())
    (folder / "splits" / "chair" / "train.txt").write_text("\n".join("012345"))
    return folder / "chair"


def chairs():
    return shapeassembly("chair", "train")


def equal(one: ProgramTable, other: ProgramTable) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in program_tables.FIELDS)


def test_a_table_is_kept_and_read_without_parsing(few, monkeypatch):
    table = table_of(chairs())
    assert equal(table, ProgramTable.of(list(chairs())))
    assert [path.name for path in (few.parents[1] / "cache").iterdir()] == [table_path(chairs()).name]
    monkeypatch.setattr(ProgramTable, "of", None)  # would be called to make it again
    again = table_of(chairs())
    assert equal(again, table) and all(
        getattr(again, name).dtype == getattr(table, name).dtype for name in program_tables.FIELDS
    )


def test_other_programs_have_another_table(few):
    whole = table_path(chairs())
    assert table_path(chairs()[:4]) != whole and len(table_of(chairs()[:4])) == 4
    (few / "3.txt").write_text((few / "2.txt").read_text())
    assert table_path(chairs()) != whole
    assert equal(table_of(chairs()), ProgramTable.of(list(chairs())))


@pytest.mark.parametrize("content", [b"", b"something else", "cut", "flipped", "other arrays"])
def test_a_damaged_table_is_made_again(few, content):
    table, path = table_of(chairs()), table_path(chairs())
    whole = path.read_bytes()
    if content == "other arrays":
        np.savez(path, lines=np.zeros(3))
    elif content == "flipped":
        middle = len(whole) // 2
        path.write_bytes(whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :])
    else:
        path.write_bytes(whole[:-100] if content == "cut" else content)
    assert equal(table_of(chairs()), table)
    assert len(path.read_bytes()) == len(whole)


def test_a_root_that_cannot_be_written_to_is_no_obstacle(few):
    (few.parents[1] / "cache").write_text("a file where the folder should be")
    assert len(table_of(chairs())) == 6


def test_embedded_programs_are_not_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path))
    with unchecked():
        assert len(table_of(chairs())) == 40
    assert list(tmp_path.iterdir()) == []
