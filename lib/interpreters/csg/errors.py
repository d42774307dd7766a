"""The one exception of the CSG language."""


class ProgramError(ValueError):
    """A program that cannot be read or run.

    found     what is wrong
    index     which token, counted from 0 (None where no single token is to blame)
    column    its 1-based place in the text (None for a program that did not come from a text)
    token     what stands there
    expected  what should have stood there
    """

    def __init__(
        self,
        found: str,
        index: int | None = None,
        token: str = "",
        expected: str = "",
        column: int | None = None,
    ):
        self.found, self.expected = found, expected
        self.index, self.token, self.column = index, token, column
        place = "" if index is None else f"token {index}"
        place += f" (column {column})" if place and column else ""
        wanted = f"; expected {expected}" if expected else ""
        super().__init__(f"{place}: {found}{wanted}" if place else f"{found}{wanted}")
