"""Text -> tokens: names, numbers, texts and symbols, each with its place. Comments and blanks fall away."""

import re
from dataclasses import dataclass

from ..quoting import quoted
from .document import Place
from .errors import ScadError

LONGEST = 10_000_000  # characters; a stump of 256 primitives and nodes has less than two million
END = "the end"
_TOKEN = re.compile(
    r"""(?P<blank>\s+|//[^\n]*|/\*.*?\*/)
    | (?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
    | (?P<name>\$?[A-Za-z_][A-Za-z0-9_]*)
    | (?P<text>"(?:[^"\\\n]|\\["\\])*")
    | (?P<symbol>[<>=!]=|&&|\|\||/(?!\*)|[-+*%^()\[\]{}=,;:.?<>!\#])""",
    re.VERBOSE | re.DOTALL | re.ASCII,
)
_LONE_RETURN = re.compile(r"\r(?!\n|$)")


@dataclass(frozen=True, slots=True)
class Token:
    kind: str  # number, name, text, symbol, END
    text: str
    at: Place


def tokens(text: str) -> list[Token]:
    """All tokens and, last, END. Raises ScadError for what begins no token."""
    if not isinstance(text, str):
        raise ScadError(f"found a {type(text).__name__}", expected="an OpenSCAD file as text")
    if len(text) > LONGEST:
        raise ScadError(f"the text has {len(text)} characters", expected=f"at most {LONGEST}")
    text = text.removeprefix("\ufeff")
    found, place, line, start = [], 0, 1, 0
    while place < len(text):
        match, at = _TOKEN.match(text, place), (line, place - start + 1)
        if match is None:
            raise _no_token(text, place, at)
        if match.lastgroup == "blank" and _LONE_RETURN.search(match[0]):
            raise ScadError(
                "a line ends with a carriage return alone", *at, expected="line feeds, as OpenSCAD"
            )
        if match.lastgroup != "blank":
            found.append(Token(match.lastgroup, match[0], at))
        elif "\n" in match[0]:
            line += match[0].count("\n")
            start = place + match[0].rindex("\n") + 1
        place = match.end()
    return [*found, Token(END, "", (line, place - start + 1))]


def _no_token(text: str, place: int, at: Place) -> ScadError:
    word = text[place : place + 40].split("\n")[0]
    if word.startswith("/*"):
        return ScadError("a comment is never closed", *at, "/*", "'*/'")
    if word.startswith('"'):
        return ScadError(f"{quoted(word)} is never closed", *at, word, 'a text such as "a/b" in one line')
    return ScadError(f"found {quoted(word[:1])}", *at, word[:1], "a name, a number or a sign of OpenSCAD")
