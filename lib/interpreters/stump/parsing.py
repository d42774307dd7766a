"""Text -> Stump. One line a primitive, a node and the shape, named and numbered as in the paper; `#` starts a comment.

    F1 = box(half=(0.5, 0.5, 0.1))                          a primitive and its complement-layer node
    F2 = not cylinder(radius=0.2)                           "not": what is outside of it
    S1 = F1 & F2                                            an intersection of some F; or "everything"
    T = S1                                                  the union of some S, joined by "|"; or "nothing"

A primitive takes its sizes and, where they change something, translation= and rotation= (a quaternion w, x, y, z in
space, an angle in radians in the plane). Nothing is ever evaluated.
"""

import math
import re

import torch

from ..quoting import quoted
from .errors import ProgramError
from .primitives import KINDS, POSE, Primitive
from .program import EVERYTHING, NOTHING, Stump

_STATEMENT = re.compile(r"\s*([FST])([0-9]*)\s*=\s*(.*?)\s*$")
_PRIMITIVE = re.compile(r"(not\s+)?([A-Za-z_]\w*)\s*\((.*)\)$")
_ARGUMENT = re.compile(r"\s*([A-Za-z_]\w*)\s*=\s*(\([^()]*\)|[^(),]*)\s*(?:,|$)")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_LONGEST = 10_000_000  # characters; a stump of 256 primitives and nodes has about 300,000


def parse(text: str) -> Stump:
    """Read a stump. Raises ProgramError with line, column, what was found and what was expected."""
    if not isinstance(text, str):
        raise ProgramError(f"found a {type(text).__name__}", expected="a text")
    if len(text) > _LONGEST:
        raise ProgramError(f"the text has {len(text)} characters", expected=f"at most {_LONGEST}")
    primitives, complement, nodes, united = [], [], [], None
    row = 0
    for row, raw in enumerate(text.splitlines(), start=1):
        line = raw.partition("#")[0].rstrip()
        if not line.strip():
            continue
        letter, number, body, column = _statement(line, row)
        if united is not None:
            raise ProgramError(f"{quoted(line.strip())} after T", row, 1, line.strip(), "nothing after T")
        if letter == "F":
            _check_number("F", number, len(primitives), row, bool(nodes))
            outside, primitive = _primitive(body, row, column)
            if primitives and primitive.dimensions != primitives[0].dimensions:
                found = f"a {primitive.name} among primitives of {primitives[0].dimensions} dimensions"
                raise ProgramError(found, row, column, primitive.name, _kinds(primitives[0].dimensions))
            primitives.append(primitive)
            complement.append(outside)
        elif letter == "S":
            _check_number("S", number, len(nodes), row)
            nodes.append(_members(body, "&", "F", len(primitives), EVERYTHING, row, column))
        else:
            united = _members(body, "|", "S", len(nodes), NOTHING, row, column)
    if united is None:
        raise ProgramError("the text ends", row + 1, 1, "", "T = S1 | …, the union")
    if not primitives:
        raise ProgramError("the stump has no primitives", 1, 1, "", "F1 = box(half=(0.5, 0.5, 0.5)), say")
    intersection = torch.zeros(len(primitives), len(nodes), dtype=torch.bool)
    for c, members in enumerate(nodes):
        intersection[members, c] = True
    union = torch.zeros(len(nodes), dtype=torch.bool)
    union[united] = True
    return Stump(tuple(primitives), torch.tensor(complement), intersection, union)


def _statement(line: str, row: int) -> tuple[str, str, str, int]:
    match = _STATEMENT.match(line)
    if match is None or (match[1] == "T") != (match[2] == ""):
        found = line.strip()
        raise ProgramError(
            f"{quoted(found)} is no statement", row, line.index(found) + 1, found, "F1 = …, S1 = … or T = …"
        )
    return match[1], match[2], match[3], match.start(3) + 1


def _check_number(letter: str, number: str, before: int, row: int, late: bool = False) -> None:
    if late:
        raise ProgramError(f"{letter}{number} after the nodes", row, 1, letter + number, "primitives first")
    if number != str(before + 1):
        raise ProgramError(f"found {letter}{number:.20}", row, 1, letter + number, f"{letter}{before + 1}")


def _kinds(dimensions: int | None = None) -> str:
    return ", ".join(name for name, kind in KINDS.items() if dimensions in (None, kind.dimensions))


def _primitive(body: str, row: int, column: int) -> tuple[bool, Primitive]:
    match = _PRIMITIVE.match(body)
    if match is None:
        expected = "a primitive, such as sphere(radius=0.5), or not and a primitive"
        raise ProgramError(f"{quoted(body)} is no primitive", row, column, body, expected)
    if match[2] not in KINDS:
        raise ProgramError(
            f"{quoted(match[2])} is no primitive", row, column + match.start(2), match[2], _kinds()
        )
    kind, given, place = KINDS[match[2]], {}, 0
    arguments = match[3]
    while arguments[place:].strip():
        start = column + match.start(3) + place
        argument = _ARGUMENT.match(arguments, place)
        if argument is None:
            found = arguments[place:].strip()
            raise ProgramError(f"{quoted(found)} is no argument", row, start, found, _form(kind))
        key = argument[1]
        if key not in _widths(kind) or key in given:
            found = f"{kind.name} takes {key} once" if key in given else f"{kind.name} takes no {quoted(key)}"
            raise ProgramError(found, row, start, key, _form(kind))
        given[key] = _numbers(
            argument[2], _widths(kind)[key], key, row, column + match.start(3) + argument.start(2)
        )
        place = argument.end()
    needed = [key for key in kind.counts if key not in given and not _optional(kind, key)]
    if needed:
        found = f"{quoted(body)} has no {needed[0]}"
        raise ProgramError(found, row, column, body, _form(kind))
    if kind.dimensions == 3 and not any(given.get("rotation", [1])):
        expected = "a quaternion w, x, y, z with a length, such as (1, 0, 0, 0)"
        raise ProgramError(f"the rotation of {quoted(body)} is zero", row, column, body, expected)
    return bool(match[1]), kind(**{key: v if len(v) > 1 else v[0] for key, v in given.items()})


def _optional(kind: type[Primitive], key: str) -> bool:
    return key in POSE or (key == "height" and kind.dimensions == 3)


def _widths(kind: type[Primitive]) -> dict[str, int]:
    return {**kind.counts, "translation": kind.dimensions, "rotation": 4 if kind.dimensions == 3 else 1}


def _form(kind: type[Primitive]) -> str:
    """How a primitive is written, its optional arguments in brackets."""
    words = []
    for key, width in _widths(kind).items():
        word = f"{key}={'(' + ', '.join('·' * width) + ')' if width > 1 else '·'}"
        words.append(f"[{word}]" if _optional(kind, key) else word)
    return f"{kind.name}({', '.join(words)})"


def _numbers(text: str, width: int, key: str, row: int, column: int) -> list[float]:
    """`width` numbers, in round brackets where there is more than one."""
    inner = text.strip()
    words = inner[1:-1].split(",") if inner.startswith("(") else [inner]
    values = []
    for word in words:
        if not _NUMBER.fullmatch(word.strip()) or not math.isfinite(value := float(word)):
            raise ProgramError(
                f"{quoted(word.strip())} in {key} is no finite number", row, column, word.strip()
            )
        values.append(value)
    if len(values) != width:
        expected = "one number" if width == 1 else f"{width} numbers, ({', '.join('·' * width)})"
        raise ProgramError(f"{key} is {quoted(inner)}", row, column, inner, expected)
    return values


def _members(body: str, join: str, letter: str, count: int, empty: str, row: int, column: int) -> list[int]:
    """Which ones are named, counted from 0."""
    if body == empty:
        return []
    members = []
    for part in body.split(join):
        word, place = part.strip(), column + len(part) - len(part.lstrip())
        column += len(part) + 1
        last = f"{letter}1 to {letter}{count}" if count else f"{quoted(empty)}: there is no {letter}1"
        match = re.fullmatch(f"{letter}([1-9][0-9]{{0,8}})", word)
        if match is None or int(match[1]) > count:
            raise ProgramError(f"found {quoted(word)}", row, place, word, f"{last}, joined by {join}")
        if int(match[1]) - 1 in members:
            raise ProgramError(f"{word} stands twice", row, place, word, "each once")
        members.append(int(match[1]) - 1)
    return members
