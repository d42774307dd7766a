"""An OpenSCAD file as data: what `printing` writes and `parsing` reads, and all that we know of the language.

    document    := statement*
    statement   := NAME "=" expression ";"                                        Assign
                 | "function" NAME "(" names ")" "=" expression ";"               Function
                 | "module" NAME "(" names ")" body                               Module
                 | call                                                           Call
    call        := NAME "(" arguments ")" body                                    what it does, to which children
    body        := ";" | call | "{" call* "}"
    expression  := numbers, "texts", names, [vectors], f(calls), v[indices], + - * / and ( )

Comments are printed and, when read, left out; `at` is where something stood in the text it was read from. Neither has
a say in equality, nor has the layout: `f() g();` and `f() { g(); }` are equal.
"""

import math
from dataclasses import dataclass, field

from .errors import ScadError

Place = tuple[int, int] | tuple[None, None]  # line and column, from 1
NOWHERE = (None, None)


@dataclass(frozen=True)
class _Node:
    at: Place = field(default=NOWHERE, compare=False, repr=False, kw_only=True)


@dataclass(frozen=True)
class Number(_Node):
    """Not negative: -1 is a Negative(Number(1))."""

    value: int | float


@dataclass(frozen=True)
class Text(_Node):
    value: str


@dataclass(frozen=True)
class Name(_Node):
    name: str


@dataclass(frozen=True)
class Vector(_Node):
    items: tuple["Expression", ...]


@dataclass(frozen=True)
class Negative(_Node):
    operand: "Expression"


@dataclass(frozen=True)
class Operation(_Node):
    symbol: str  # + - * /
    left: "Expression"
    right: "Expression"


@dataclass(frozen=True)
class Index(_Node):
    vector: "Expression"
    index: "Expression"


@dataclass(frozen=True)
class Application(_Node):
    """A function's value."""

    name: str
    arguments: tuple["Expression", ...]


Expression = Number | Text | Name | Vector | Negative | Operation | Index | Application


@dataclass(frozen=True)
class Argument(_Node):
    """`value`, or `name = value`."""

    value: Expression
    name: str = ""


@dataclass(frozen=True)
class _Statement(_Node):
    above: str = field(default="", compare=False, kw_only=True)  # comment, any number of lines
    note: str = field(default="", compare=False, kw_only=True)  # comment behind, on the same line


@dataclass(frozen=True)
class Assign(_Statement):
    name: str
    value: Expression


@dataclass(frozen=True)
class Call(_Statement):
    name: str
    arguments: tuple[Argument, ...] = ()
    children: tuple["Call", ...] = ()


@dataclass(frozen=True)
class Module(_Statement):
    name: str
    parameters: tuple[str, ...]
    children: tuple[Call, ...]


@dataclass(frozen=True)
class Function(_Statement):
    name: str
    parameters: tuple[str, ...]
    value: Expression


Statement = Assign | Call | Module | Function


@dataclass(frozen=True)
class Document:
    statements: tuple[Statement, ...]
    header: str = field(default="", compare=False)  # comment at the top


def number(value: float) -> Expression:
    """A number of any sign, -0.0 included. Raises ScadError for one that is not finite."""
    if not math.isfinite(value):
        raise ScadError(f"found the number {value}", expected="one that is finite, and not near the largest")
    return Negative(Number(-value)) if str(value).startswith("-") else Number(value)


def vector(values) -> Expression:
    """A number, or a list of such, or of lists …"""
    return Vector(tuple(map(vector, values))) if isinstance(values, list | tuple) else number(values)


def call(name: str, *arguments: str | Expression, children: tuple[Call, ...] = (), **options) -> Call:
    """A call; arguments that are a str are names of parameters."""
    named = tuple(Argument(Name(a) if isinstance(a, str) else a) for a in arguments)
    return Call(name, named, tuple(children), **options)
