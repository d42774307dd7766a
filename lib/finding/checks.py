"""Numbers that callers give, checked. Each layer raises its own error: error(found, expected)."""

from collections.abc import Callable
from math import isfinite
from numbers import Real

from lib.interpreters.checks import whole

Error = Callable[[str, str], Exception]


def check_count(name: str, given, least: int, error: Error) -> int:
    """A whole number, numpy's and torch's too."""
    number = whole(given)
    if number is None or number < least:
        raise error(f"{name} is {given!r:.40}", f"a whole number, {least} or more")
    return number


def is_number(given) -> bool:
    """Finite, numpy's too; True and False are none."""
    return isinstance(given, Real) and not isinstance(given, bool) and isfinite(given)
