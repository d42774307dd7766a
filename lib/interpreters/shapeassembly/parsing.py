"""Text -> Program. One statement a line; `#` starts a comment; nothing is ever evaluated."""

import math
import re
from dataclasses import dataclass

from ..quoting import quoted
from .errors import ProgramError
from .program import (
    AXES,
    FACES,
    Attach,
    Block,
    Cuboid,
    Number,
    Program,
    Reflect,
    Squeeze,
    Statement,
    Translate,
)

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_HEADER = re.compile(r"\s*Assembly\s+([A-Za-z_][A-Za-z0-9_]*)\s*\{\s*$")
_STATEMENT = re.compile(r"\s*(?:([^\s=(]+)\s*=\s*)?([^\s=(]+)\s*\((.*)\)\s*$")
_STATEMENT_FORMS = "Cuboid, attach, squeeze, reflect or translate"
_ARGUMENTS = {  # what each command takes, in order
    "Cuboid": ("number", "number", "number", "flag"),
    "attach": ("name", "name", *["number"] * 6),
    "squeeze": ("name", "name", "name", "face", "number", "number"),
    "reflect": ("name", "axis"),
    "translate": ("name", "axis", "count", "number"),
}


def parse(text: str | bytes) -> Program:
    """Read a program. Raises ProgramError with line, column, what was found and what was expected."""
    lines = _as_lines(text)
    blocks: list[Block] = []
    rows: list[list[int]] = []  # rows[b][s]: the text line of statement s of block b; [b][-1]: its header
    name, header, statements = "", 0, None
    for row, raw in enumerate(lines):
        line = raw.partition("#")[0]
        if not line.strip():
            continue
        if statements is None:
            name, header, statements = _header(line, row), row, []
            rows.append([])
        elif line.strip() == "}":
            blocks.append(Block(name, tuple(statements)))
            rows[-1].append(header)
            statements = None
        else:
            statements.append(_statement(line, row))
            rows[-1].append(row)
    if statements is not None:
        raise ProgramError(
            f"the text ends inside block {quoted(name)}", len(lines), 1, "", "a closing brace '}'"
        )
    if not blocks:
        raise ProgramError("the program is empty", 1, 1, "", "'Assembly NAME {'")
    return Program(tuple(blocks), Source(lines, rows))


@dataclass(frozen=True)
class Source:
    """Where each statement stands in a text, so that an error can name line, column and token."""

    lines: list[str]
    rows: list[list[int]]

    @classmethod
    def printed(cls, blocks: tuple[Block, ...]) -> "Source":
        """The places in the text that `blocks` print as: for programs made by code, not read from a file."""
        lines, rows = [], []
        for block in blocks:
            first = len(lines)
            lines += block.to_text().splitlines()
            rows.append([*range(first + 1, first + 1 + len(block.statements)), first])
        return cls(lines, rows)

    def error(self, block: int, statement: int, token: str, message: str, expected: str = "") -> ProgramError:
        """An error at the first place `token` stands in a statement (-1: in the block's header)."""
        row = self.rows[block][statement]
        code = self.lines[row].partition("#")[0]
        for word in re.finditer(r"[^\s,(){}=]+", code):
            if word[0] == token or _same_number(word[0], token):
                return ProgramError(message, row + 1, word.start() + 1, word[0], expected)
        return ProgramError(message, row + 1, len(code) - len(code.lstrip()) + 1, token, expected)


def _same_number(word: str, token: str) -> bool:
    return bool(_NUMBER.fullmatch(word) and _NUMBER.fullmatch(token)) and float(word) == float(token)


def _as_lines(text: str | bytes) -> list[str]:
    if isinstance(text, bytes):
        try:
            text = text.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise ProgramError(
                f"not a text: byte {error.start} is not UTF-8", expected="a program as text"
            ) from None
    if not isinstance(text, str):
        raise ProgramError(f"found {type(text).__name__}", expected="a program as text")
    lines = text.removeprefix("\ufeff").split("\n")
    for row, line in enumerate(lines):
        if "\0" in line:
            raise ProgramError(
                "not a text: a NUL character", row + 1, line.index("\0") + 1, "\0", "a program as text"
            )
    return lines


def _header(line: str, row: int) -> str:
    if match := _HEADER.match(line):
        return match[1]
    token = line.split()[0]
    if token == "}":
        raise _error(line, row, token, "a closing brace without a block", "'Assembly NAME {'")
    raise _error(line, row, token, f"found {quoted(line.strip())} outside a block", "'Assembly NAME {'")


def _statement(line: str, row: int) -> Statement:
    match = _STATEMENT.match(line)
    if not match:
        raise _malformed(line, row)
    target, command, body = match.groups()
    kinds = _ARGUMENTS.get(command)
    if kinds is None:
        raise ProgramError(
            f"unknown statement {quoted(command)}", row + 1, match.start(2) + 1, command, _STATEMENT_FORMS
        )
    if (target is not None) != (command == "Cuboid"):
        expected = "'NAME = Cuboid(…)'" if command == "Cuboid" else f"{command}(…) without a name and '='"
        raise _error(
            line,
            row,
            target or command,
            f"{command} {'needs' if target is None else 'takes no'} name",
            expected,
        )
    words = body.split(",") if body.strip() else []
    if command == "Cuboid" and len(words) == 3:
        words.append("False")  # the flag may be left out
    if len(words) != len(kinds):
        found, expected = f"{command} with {len(words)} arguments", f"{len(kinds)}: {', '.join(kinds)}"
        if ")" in body or "(" in body:
            found, expected = "a second parenthesis", "one statement a line"
        column = match.start(3) + 1 + len(body) - len(body.lstrip())
        raise ProgramError(found, row + 1, column, body.strip(), expected)
    values, column = [], match.start(3)
    for word, kind in zip(words, kinds):
        values.append(_READERS[kind](word.strip(), row, column + 1 + len(word) - len(word.lstrip())))
        column += len(word) + 1
    return _build(command, _name(target, row, match.start(1) + 1) if target else "", values)


def _build(command: str, target: str, values: list) -> Statement:
    if command == "Cuboid":
        return Cuboid(target, tuple(values[:3]), values[3])
    if command == "attach":
        return Attach(values[0], values[1], tuple(values[2:]))
    if command == "squeeze":
        return Squeeze(*values[:4], tuple(values[4:]))
    if command == "reflect":
        return Reflect(*values)
    return Translate(*values[:3], (values[3],))


def _number(word: str, row: int, column: int) -> Number:
    if _NUMBER.fullmatch(word):
        value = float(word)
        if math.isfinite(value):
            # A whole number stays one, so that the text comes back as it was written.
            return int(word) if word.isdigit() and len(word) < 16 else value
        raise ProgramError(f"{quoted(word)} is too large", row + 1, column, word, "a finite number")
    raise ProgramError(
        f"{quoted(word)} is not a number", row + 1, column, word, "a finite decimal number such as 0.5"
    )


def _count(word: str, row: int, column: int) -> int:
    if word.isdecimal() and word.isascii() and len(word) < 10 and int(word) >= 1:
        return int(word)
    raise ProgramError(
        f"{quoted(word)} is not a count", row + 1, column, word, "a whole number of copies, at least 1"
    )


def is_name(word: object) -> bool:
    """Can it name a cuboid or a block?"""
    return isinstance(word, str) and bool(_NAME.fullmatch(word))


def _name(word: str, row: int, column: int) -> str:
    if is_name(word):
        return word
    raise ProgramError(
        f"{quoted(word)} is not a name", row + 1, column, word, "the name of a cuboid, such as cube0"
    )


def _one_of(choices: dict, what: str):
    def read(word: str, row: int, column: int):
        if word in choices:
            return choices[word]
        raise ProgramError(f"{quoted(word)} is not {what}", row + 1, column, word, " or ".join(choices))

    return read


_READERS = {
    "number": _number,
    "count": _count,
    "name": _name,
    "axis": _one_of({axis: axis for axis in AXES}, "an axis"),
    "face": _one_of({face: face for face in FACES}, "a face"),
    "flag": _one_of({"True": True, "False": False}, "a flag"),
}


def _malformed(line: str, row: int) -> ProgramError:
    """A line that has not even the outline of a statement: say what is missing."""
    word = line.split()[0]
    if word == "Assembly":
        return _error(
            line, row, word, "a new block begins before the last one is closed", "a closing brace '}'"
        )
    if "(" in line and ")" not in line:
        return ProgramError("a parenthesis is never closed", row + 1, len(line.rstrip()) + 1, "", "')'")
    return _error(
        line, row, word, f"found {quoted(line.strip())}", f"a statement: {_STATEMENT_FORMS}, or '}}'"
    )


def _error(line: str, row: int, token: str, message: str, expected: str) -> ProgramError:
    return ProgramError(message, row + 1, line.index(token) + 1, token, expected)
