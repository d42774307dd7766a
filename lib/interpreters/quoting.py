"""How error messages of every language quote what they found."""

_LONGEST = 40  # characters of a token that a message quotes


def quoted(token: str) -> str:
    """A token for a message: in quotes, odd characters escaped, long ones cut."""
    return repr(token if len(token) <= _LONGEST else token[: _LONGEST - 1] + "…")
