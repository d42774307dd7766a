"""One line of a stump's text, which knows where its pieces stand, for the parser and its messages."""

from collections.abc import Iterator
from dataclasses import dataclass

from ..quoting import quoted
from .errors import ProgramError


@dataclass(frozen=True)
class Piece:
    """A piece of a line without blanks around it. row and column are 1-based places in the whole text."""

    text: str
    row: int
    column: int = 1

    def cut(self, start: int, stop: int | None = None) -> "Piece":
        """A piece of this piece, without the blanks around it."""
        raw = self.text[start:stop]
        inner = raw.lstrip()
        return Piece(inner.rstrip(), self.row, self.column + start + len(raw) - len(inner))

    def split(self, separator: str) -> Iterator["Piece"]:
        """The pieces between separators, one after the other: a wrong one ends the reading of a long line."""
        start = 0
        for raw in self.text.split(separator):
            yield self.cut(start, start + len(raw))
            start += len(raw) + len(separator)

    def error(self, why: str, expected: str) -> ProgramError:
        """The error that this piece is wrong: "'…' " and why."""
        found = quoted(self.text) if self.text else "nothing"
        return ProgramError(f"{found} {why}", self.row, self.column, self.text, expected)
