"""One primitive in a text, such as "not box(half=(0.5, 0.5, 0.1), translation=(0, 0, 1))" -> Primitive."""

import math
import re

from .lines import Piece
from .poses import ANGLES
from .primitives import KINDS, Primitive, is_optional

_NOT = re.compile(r"not\b")
_NAME = re.compile(r"[A-Za-z_]\w*")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


def read_primitive(piece: Piece) -> tuple[bool, Primitive]:
    """Whether it is complemented, and the primitive. Raises ProgramError, naming the place."""
    outside = _NOT.match(piece.text)
    call = piece.cut(outside.end()) if outside else piece
    name = _NAME.match(call.text)
    kind = _kind(call.cut(0, name.end() if name else None))
    inner = call.cut(name.end())
    if not (inner.text.startswith("(") and inner.text.endswith(")") and len(inner.text) > 1):
        raise call.error("has no arguments in round brackets", form(kind))
    given: dict[str, list[float]] = {}
    for argument in _arguments(inner.cut(1, -1)):
        key, values = _argument(argument, kind, given)
        given[key] = values
    for key in kind.counts:
        if key not in given and not is_optional(kind, key):
            raise call.error(f"has no {key}", form(kind))
    return outside is not None, kind(**{key: v if len(v) > 1 else v[0] for key, v in given.items()})


def kinds(dimensions: int | None = None) -> str:
    """The names of all primitives, or of those of one dimension, for messages."""
    return ", ".join(name for name, kind in KINDS.items() if dimensions in (None, kind.dimensions))


def form(kind: type[Primitive]) -> str:
    """How a primitive is written, its optional arguments in square brackets."""
    words = []
    for key, width in _widths(kind).items():
        word = f"{key}={_dots(width)}"
        words.append(f"[{word}]" if is_optional(kind, key) else word)
    return f"{kind.name}({', '.join(words)})"


def _kind(name: Piece) -> type[Primitive]:
    if name.text not in KINDS:
        raise name.error("is no primitive", f"one of {kinds()}")
    return KINDS[name.text]


def _arguments(inner: Piece) -> list[Piece]:
    """The pieces between commas; commas in brackets do not count."""
    if not inner.text:
        return []
    pieces, start, depth = [], 0, 0
    for place, letter in enumerate(inner.text):
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            pieces.append(inner.cut(start, place))
            start = place + 1
    return [*pieces, inner.cut(start)]


def _argument(argument: Piece, kind: type[Primitive], given: dict) -> tuple[str, list[float]]:
    """Its name and numbers."""
    before, equals, _ = argument.text.partition("=")
    key = argument.cut(0, len(before))
    if not equals:
        raise argument.error("is no argument", form(kind))
    if key.text not in _widths(kind):
        raise key.error(f"is no argument of {kind.name}", form(kind))
    if key.text in given:
        raise key.error("is given twice", form(kind))
    value = argument.cut(len(before) + 1)
    values = _numbers(value, _widths(kind)[key.text], key.text)
    if key.text == "rotation" and not any(values) and kind.dimensions == 3:
        raise value.error("turns nothing", "a quaternion w, x, y, z that is not zero, such as (1, 0, 0, 0)")
    return key.text, values


def _numbers(value: Piece, width: int, key: str) -> list[float]:
    """`width` finite numbers, in round brackets where there is more than one."""
    bracketed = value.text.startswith("(") and value.text.endswith(")")
    words = list(value.cut(1, -1).split(",")) if bracketed else [value]
    if len(words) != width:
        raise value.error(f"has {len(words)} number{'s' * (len(words) > 1)}", f"{key}={_dots(width)}")
    return [_number(word, key) for word in words]


def _number(word: Piece, key: str) -> float:
    value = float(word.text) if _NUMBER.fullmatch(word.text) else math.nan
    if not math.isfinite(value):
        raise word.error(f"in {key} is no finite number", "a number such as 0.25 or -1e-3")
    return value


def _widths(kind: type[Primitive]) -> dict[str, int]:
    """How many numbers each argument has."""
    return {**kind.counts, "translation": kind.dimensions, "rotation": ANGLES[kind.dimensions]}


def _dots(width: int) -> str:
    return f"({', '.join('·' * width)})" if width > 1 else "·"
