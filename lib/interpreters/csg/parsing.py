"""Text -> Program. Tokens stand one after the other, blanks between them do not matter; nothing is ever evaluated.

    text   ::= token* "$"?            what follows a "$" is not read, as in the networks' output
    token  ::= LETTERS "(" NUMBER ("," NUMBER)* ")"  |  "+"  |  "*"  |  "-"

The authors' decoder of space drops the first letter of each primitive; p(…), u(…) and y(…) are read as sp, cu and cy.
"""

import re

from ..quoting import quoted
from .errors import ProgramError
from .primitives import KINDS, Primitive
from .program import LONGEST, OPERATIONS, STOP, Operation, Program, Statement, check

_TOKEN = re.compile(r"([A-Za-z_]\w*)\s*\(([^()]*)\)")
_WHOLE = re.compile(r"[+-]?[0-9]+")
_JUNK = re.compile(r"\w+\s*\(?[^()+*$\s]*\)?|\S")  # what a reader would point at
_SHORT = {letters[1:]: letters for letters in ("sp", "cu", "cy")}
_FORMS = ", ".join(map(str, KINDS.values())) + f", or one of {' '.join((*OPERATIONS, STOP))}"
_LONGEST_NUMBER = 9  # characters
_LARGEST_TEXT = 1_000_000  # characters; a program of 1,023 tokens has less than 25,000


def parse(text: str) -> Program:
    """Read a program. Raises ProgramError with the token's index and column, what was found and what was expected."""
    if not isinstance(text, str):
        raise ProgramError(f"the program is a {type(text).__name__}", expected="a text")
    if len(text) > _LARGEST_TEXT:
        raise ProgramError(f"the text has {len(text)} characters", expected=f"at most {_LARGEST_TEXT}")
    statements: list[Statement] = []
    columns: list[int] = []
    place = _skip_blanks(text, 0)
    while place < len(text) and text[place] != STOP and len(statements) <= LONGEST:
        columns.append(place + 1)
        statement, place = _statement(text, place, len(statements))
        statements.append(statement)
        place = _skip_blanks(text, place)
    check(statements, [*columns, place + 1])
    return Program(tuple(statements))


def _skip_blanks(text: str, place: int) -> int:
    while place < len(text) and text[place].isspace():
        place += 1
    return place


def _statement(text: str, place: int, index: int) -> tuple[Statement, int]:
    """The statement at `place`, and where it ends."""
    if text[place] in OPERATIONS:
        return Operation(text[place]), place + 1
    match = _TOKEN.match(text, place)
    if match is None:
        junk = _JUNK.match(text, place).group()
        what = "is not closed" if "(" in junk[1:] and junk[-1] != ")" else "is no token"
        raise ProgramError(f"{quoted(junk)} {what}", index, junk, _FORMS, place + 1)
    letters = _SHORT.get(match[1], match[1])
    if letters not in KINDS:
        found = f"{quoted(match[1])} in {quoted(match[0])} is no primitive"
        raise ProgramError(found, index, match[0], _FORMS, place + 1)
    words = [word.strip() for word in match[2].split(",")] if match[2].strip() else []
    for word in words:
        if not _WHOLE.fullmatch(word) or len(word) > _LONGEST_NUMBER:
            what = "too long a number" if _WHOLE.fullmatch(word) else "not a whole number"
            found = f"{quoted(word)} is {what}, in {quoted(match[0])}"
            raise ProgramError(found, index, match[0], str(KINDS[letters]), place + 1)
    try:
        return Primitive(letters, tuple(map(int, words))), match.end()
    except ProgramError as error:
        raise ProgramError(error.found, index, match[0], error.expected, place + 1) from None
