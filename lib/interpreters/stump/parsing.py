"""Text -> Stump. One line a primitive, a node and the shape, named and numbered as in the paper; `#` starts a comment.

    F1 = box(half=(0.5, 0.5, 0.1))                          a primitive and its complement-layer node
    F2 = not cylinder(radius=0.2)                           "not": what is outside of it
    S1 = F1 & F2                                            an intersection of some F; or "everything"
    T = S1                                                  the union of some S, joined by "|"; or "nothing"

A primitive takes its sizes and, where they change something, translation= and rotation= (a quaternion w, x, y, z in
space, an angle in radians in the plane). A size may be negative: its sign does not count. Nothing is ever evaluated.
"""

import re

import torch

from .calls import kinds, read_primitive
from .errors import ProgramError
from .lines import Piece
from .primitives import Primitive
from .program import EVERYTHING, MOST, NOTHING, Stump

_LONGEST = 10_000_000  # characters; a stump of 256 primitives and nodes has about 300,000
_NUMBERED = re.compile(r"([FST])([1-9][0-9]{0,8})?")
_EXPECTED = "F1 = a primitive, S1 = F1 & … or T = S1 | …"


def parse(text: str) -> Stump:
    """Read a stump. Raises ProgramError with line, column, what was found and what was expected."""
    if not isinstance(text, str):
        raise ProgramError(f"found a {type(text).__name__}", expected="a text")
    if len(text) > _LONGEST:
        raise ProgramError(f"the text has {len(text)} characters", expected=f"at most {_LONGEST}")
    reader, row = _Reader(), 0
    for row, line in enumerate(text.removeprefix("\ufeff").splitlines(), start=1):
        statement = Piece(line.partition("#")[0], row).cut(0)
        if statement.text:
            reader.read(statement)
    return reader.stump(row)


class _Reader:
    """What was read so far."""

    def __init__(self):
        self.primitives: list[Primitive] = []
        self.complement: list[bool] = []
        self.nodes: list[list[int]] = []
        self.united: list[int] | None = None

    def read(self, statement: Piece) -> None:
        """One more line. Raises ProgramError."""
        before, equals, _ = statement.text.partition("=")
        name, value = statement.cut(0, len(before)), statement.cut(len(before) + 1)
        match = _NUMBERED.fullmatch(name.text)
        if self.united is not None:
            raise statement.error("stands after T", "nothing after T")
        if not equals or match is None or (match[1] == "T") != (match[2] is None):
            raise statement.error("is no statement", _EXPECTED)
        if match[1] == "F":
            self._add_primitive(name, value)
        elif match[1] == "S":
            _check_number(name, len(self.nodes))
            self.nodes.append(_members(value, "&", "F", len(self.primitives), EVERYTHING))
            if len(self.primitives) * len(self.nodes) > MOST:
                found = f"makes {len(self.primitives)} x {len(self.nodes)} connections"
                raise name.error(found, f"at most {MOST}")
        else:
            self.united = _members(value, "|", "S", len(self.nodes), NOTHING)

    def _add_primitive(self, name: Piece, value: Piece) -> None:
        if self.nodes:
            raise name.error("stands after the nodes", "all primitives first")
        _check_number(name, len(self.primitives))
        outside, primitive = read_primitive(value)
        dimensions = self.primitives[0].dimensions if self.primitives else primitive.dimensions
        if primitive.dimensions != dimensions:
            raise value.error(
                f"has {primitive.dimensions} dimensions, F1 has {dimensions}", kinds(dimensions)
            )
        self.primitives.append(primitive)
        self.complement.append(outside)

    def stump(self, row: int) -> Stump:
        """The whole stump; row: the last line. Raises ProgramError where something is missing."""
        if not self.primitives:
            raise ProgramError("the text has no primitives", row + 1, 1, "", "F1 = sphere(radius=0.5), say")
        if self.united is None:
            raise ProgramError("the text ends", row + 1, 1, "", "T = S1 | …, the union of nodes")
        intersection = torch.zeros(len(self.primitives), len(self.nodes), dtype=torch.bool)
        for column, members in enumerate(self.nodes):
            intersection[members, column] = True
        union = torch.zeros(len(self.nodes), dtype=torch.bool)
        union[self.united] = True
        return Stump(self.primitives, torch.tensor(self.complement), intersection, union)


def _check_number(name: Piece, before: int) -> None:
    wanted = f"{name.text[0]}{before + 1}"
    if name.text != wanted:
        raise name.error("is out of order", f"{wanted}: numbers count from 1 without gaps")


def _members(value: Piece, join: str, letter: str, count: int, empty: str) -> list[int]:
    """Which ones are named, counted from 0."""
    if value.text == empty:
        return []
    members: dict[int, None] = {}
    for word in value.split(join):
        number = _number(word, join, letter, count, empty)
        if number in members:
            raise word.error("stands twice", "each one once")
        members[number] = None
    return list(members)


def _number(word: Piece, join: str, letter: str, count: int, empty: str) -> int:
    """The place of one that is named, such as "F3". Raises ProgramError for everything else."""
    match = _NUMBERED.fullmatch(word.text)
    if match and match[1] == letter and match[2] and int(match[2]) <= count:
        return int(match[2]) - 1
    other = "|" if join == "&" else "&"
    if other in word.text:
        raise word.error(
            f"is joined by {other}", f"{join}: S is an intersection (&) of F, T a union (|) of S"
        )
    if word.text.startswith("not"):
        raise word.error("is complemented here", "the complement where the primitive stands: F1 = not …")
    known = f"{letter}1 to {letter}{count}" if count > 1 else f"{letter}1" if count else ""
    expected = f"{known}, joined by {join}, or {empty}" if known else f"{empty}: there is no {letter}1"
    raise word.error("is no node here" if letter == "S" else "is no primitive here", expected)
