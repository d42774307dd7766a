"""What an error of a language of lines tells: where, what was found, what was expected."""


class LineError(ValueError):
    """A program that cannot be read or run. Each language has its own ProgramError.

    line, column  1-based place in the text (None where no single place is to blame)
    token         what was found there
    expected      what should have stood there
    """

    def __init__(
        self,
        message: str,
        line: int | None = None,
        column: int | None = None,
        token: str = "",
        expected: str = "",
    ):
        self.line, self.column, self.token, self.expected = line, column, token, expected
        place = f"line {line}" if line else ""
        place += f", column {column}" if line and column else ""
        wanted = f"; expected {expected}" if expected else ""
        super().__init__(f"{place}: {message}{wanted}" if place else f"{message}{wanted}")
