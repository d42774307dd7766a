"""What a parsed file says: its parameters as values, its own modules, and what it draws.

Values are numbers (doubles, as in OpenSCAD), texts, and tuples of values. Arithmetic is that of numbers; nothing but
the four operations is ever computed.
"""

import math
import operator
from dataclasses import dataclass

from ..quoting import quoted
from .document import (
    Argument,
    Assign,
    Call,
    Document,
    Expression,
    Function,
    Index,
    Module,
    Name,
    Negative,
    Number,
    Operation,
    Place,
    Statement,
    Text,
    Vector,
)
from .errors import ScadError
from .helpers import helpers, used
from .words import OUR_FUNCTIONS, RESERVED

Value = float | str | tuple
_MATRIX = "three vectors of 3 numbers"
_OPERATIONS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}


@dataclass(frozen=True)
class Contents:
    """parameters: their values; written: what stands for them, names looked up; modules and functions: but for the
    helpers; calls: what is drawn."""

    parameters: dict[str, Value]
    written: dict[str, Expression]
    modules: dict[str, Module]
    functions: dict[str, Function]
    calls: tuple[Call, ...]

    def value(self, expression: Expression) -> Value:
        return evaluate(expression, self.parameters)

    def place(self, expression: Expression) -> Place:
        """Where a reader would change it: the parameter's own place, if it is one."""
        return _looked_up(expression, self.written).at

    def number(self, expression: Expression) -> float:
        value = self.value(expression)
        if not isinstance(value, float):
            raise ScadError(f"found {describe(value)}", *self.place(expression), expected="a number")
        return value

    def numbers(self, expression: Expression, count: int) -> list[float]:
        """A vector of numbers. Raises ScadError for anything else."""
        value = self.value(expression)
        if (
            not isinstance(value, tuple)
            or len(value) != count
            or not all(isinstance(n, float) for n in value)
        ):
            expected = f"a vector of {count} numbers"
            raise ScadError(f"found {describe(value)}", *self.place(expression), expected=expected)
        return list(value)

    def matrix(self, expression: Expression) -> list[float]:
        """The nine numbers of three vectors of three."""
        value = self.value(expression)
        rows = value if isinstance(value, tuple) else ()
        if len(rows) != 3 or not all(isinstance(row, tuple) and len(row) == 3 for row in rows):
            raise ScadError(f"found {describe(value)}", *self.place(expression), expected=_MATRIX)
        if not all(isinstance(number, float) for row in rows for number in row):
            raise ScadError("found what is no number", *self.place(expression), expected=_MATRIX)
        return [number for row in rows for number in row]

    def arguments(self, call: Call, count: int) -> list[Expression]:
        """The arguments of a call, all without names. Raises ScadError unless there are as many."""
        named: Argument | None = next((a for a in call.arguments if a.name), None)
        if named or len(call.arguments) != count:
            found = (
                f"{call.name} with {quoted(named.name)}"
                if named
                else f"{call.name} with {len(call.arguments)}"
            )
            raise ScadError(f"found {found}", *call.at, call.name, f"{count} arguments without names")
        return [argument.value for argument in call.arguments]

    def module(self, call: Call) -> Module:
        """The module that a call without arguments names."""
        if call.name not in self.modules:
            raise ScadError(f"found {quoted(call.name)}", *call.at, call.name, "a module of this file")
        self.arguments(call, 0)
        without_children(call)
        return self.modules[call.name]

    def drawn(self, wrapper: str, name: str) -> Module:
        """The module `name`, which alone is drawn, as `wrapper() name();` if there is one."""
        expected = f"{wrapper}() {name}();".removeprefix("() ")
        call = self.calls[0] if len(self.calls) == 1 else None
        if call is None:
            place = self.calls[1].at if self.calls else (None, None)
            raise ScadError(f"{len(self.calls)} things are drawn", *place, expected=f"only {expected}")
        if wrapper and call.name == wrapper:
            self.arguments(call, 0)
            call = only_child(call)
        elif wrapper:
            raise ScadError(f"found {quoted(call.name)}", *call.at, call.name, expected)
        if call.name != name:
            raise ScadError(f"found {quoted(call.name)}", *call.at, call.name, expected)
        return self.module(call)


def contents(document: Document) -> Contents:
    """Raises ScadError for names that stand twice, changed helpers, and parameters that are not numbers."""
    parameters: dict[str, Value] = {}
    written: dict[str, Expression] = {}
    modules: dict[str, Module] = {}
    functions: dict[str, Function] = {}
    first: dict[tuple, Statement] = {}
    for statement in document.statements:
        if isinstance(statement, Call):
            continue
        if statement.name in RESERVED:
            found = f"{quoted(statement.name)} is OpenSCAD's own"
            raise ScadError(found, *statement.at, statement.name, "another name")
        if (before := first.setdefault((type(statement), statement.name), statement)) is not statement:
            found = f"{quoted(statement.name)} stands twice, first in line {before.at[0]}"
            raise ScadError(found, *statement.at, statement.name, "each name once")
        if isinstance(statement, Assign):
            parameters[statement.name] = evaluate(statement.value, parameters)
            written[statement.name] = _looked_up(statement.value, written)
        elif statement.name in helpers():
            _check_helper(statement)
        elif isinstance(statement, Function) and statement.name in OUR_FUNCTIONS:
            functions[statement.name] = statement
        else:
            modules[statement.name] = _own(statement)
    _check_calls(document, {name for _, name in first})
    calls = tuple(s for s in document.statements if isinstance(s, Call))
    return Contents(parameters, written, modules, functions, calls)


def _looked_up(expression: Expression, written: dict[str, Expression]) -> Expression:
    return written.get(expression.name, expression) if isinstance(expression, Name) else expression


def _check_helper(statement: Module | Function) -> None:
    if statement != helpers()[statement.name]:
        found = f"{quoted(statement.name)} is not as we write it"
        raise ScadError(found, *statement.at, statement.name, "this helper unchanged")


def _own(statement: Module | Function) -> Module:
    if isinstance(statement, Function) or statement.parameters:
        found = f"found the function or the parameters of {quoted(statement.name)}"
        raise ScadError(found, *statement.at, statement.name, "a module without parameters")
    return statement


def _check_calls(document: Document, defined: set[str]) -> None:
    """Raises ScadError where a helper is called that the file does not define, or one that this one needs."""
    missing = {name: sorted((used([helper]) | {name}) - defined) for name, helper in helpers().items()}
    waiting = [s for s in document.statements if isinstance(s, Call | Module)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Call) and (lacking := missing.get(node.name)):
            found = f"{quoted(lacking[0])} has no definition"
            raise ScadError(found, *node.at, node.name, "the helper at the end of the file, as we write it")
        waiting += node.children


def evaluate(expression: Expression, parameters: dict[str, Value]) -> Value:
    """The value. Raises ScadError for unknown names, functions, and arithmetic of anything but numbers."""
    if isinstance(expression, Number):
        return float(expression.value)
    if isinstance(expression, Text):
        return expression.value
    if isinstance(expression, Vector):
        return tuple([evaluate(item, parameters) for item in expression.items])
    if isinstance(expression, Name):
        if expression.name in parameters:
            return parameters[expression.name]
        found = f"{quoted(expression.name)} is not set before"
        raise ScadError(found, *expression.at, expression.name, "a number or a parameter from above")
    if isinstance(expression, Negative):
        return -_operand(expression.operand, parameters)
    if isinstance(expression, Operation):
        left, right = (_operand(side, parameters) for side in (expression.left, expression.right))
        return _computed(expression, left, right)
    if isinstance(expression, Index):
        return _entry(expression, parameters)
    found = f"found the function {quoted(expression.name)}"
    raise ScadError(found, *expression.at, expression.name, "numbers, parameters, + - * / and ( )")


def _operand(expression: Expression, parameters: dict[str, Value]) -> float:
    value = evaluate(expression, parameters)
    if not isinstance(value, float):
        raise ScadError(f"found {describe(value)} in a computation", *expression.at, expected="a number")
    return value


def _computed(operation: Operation, left: float, right: float) -> float:
    found = f"{left:.6g} {operation.symbol} {right:.6g} has no finite result"
    try:
        value = _OPERATIONS[operation.symbol](left, right)
    except ZeroDivisionError:
        value = math.inf
    if not math.isfinite(value):
        raise ScadError(found, *operation.at, operation.symbol, "a finite number")
    return value


def _entry(index: Index, parameters: dict[str, Value]) -> Value:
    vector, place = evaluate(index.vector, parameters), _operand(index.index, parameters)
    if isinstance(vector, tuple) and place in range(len(vector)):
        return vector[int(place)]
    raise ScadError(
        f"found entry {place:g} of {describe(vector)}", *index.at, "[", "0 for the first, and so on"
    )


def describe(value: Value) -> str:
    """For messages."""
    if isinstance(value, tuple):
        return f"a vector of {len(value)}"
    return f"the text {quoted(value)}" if isinstance(value, str) else f"the number {value:.6g}"


def without_children(call: Call) -> Call:
    """The call. Raises ScadError where it has children."""
    if call.children:
        child = call.children[0]
        raise ScadError(f"found {quoted(child.name)} after {call.name}()", *child.at, child.name, "';'")
    return call


def only_child(node: Call | Module) -> Call:
    """Raises ScadError unless there is just one."""
    if len(node.children) != 1:
        raise ScadError(f"{quoted(node.name)} has {len(node.children)} parts", *node.at, node.name, "one")
    return node.children[0]
