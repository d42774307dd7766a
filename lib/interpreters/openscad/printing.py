"""Document -> text: one statement a paragraph or a line, blocks indented, nothing wider than needed.

`parse(to_text(document)) == document`. Works without recursion on calls, which may be nested as deep as programs are.
"""

import textwrap

from .document import (
    Application,
    Argument,
    Assign,
    Call,
    Document,
    Expression,
    Function,
    Index,
    Name,
    Negative,
    Number,
    Operation,
    Statement,
    Text,
    Vector,
)

WIDTH = 110  # columns, where a call can be broken
_STEP = "  "
_STRENGTH = {"+": 1, "-": 1, "*": 2, "/": 2}  # what binds more tightly
_SIGN, _ATOM = 3, 4


def to_text(document: Document) -> str:
    """The file, comments included."""
    lines = _comment(document.header)
    for statement in document.statements:
        if statement.above:
            lines += ["", *_comment(statement.above)]
        printed = _lines(statement)
        if statement.note:
            printed[-1] += f"  // {statement.note}"
        lines += printed
    return "\n".join(lines) + "\n"


def _comment(text: str) -> list[str]:
    """Comment lines, wrapped."""
    lines = [part for line in text.splitlines() for part in textwrap.wrap(line, WIDTH) or [""]]
    return [f"// {line}".rstrip() for line in lines]


def _lines(statement: Statement) -> list[str]:
    if isinstance(statement, Assign):
        return [f"{statement.name} = {expression(statement.value)};"]
    if isinstance(statement, Function):
        head = f"function {statement.name}({', '.join(statement.parameters)}) ="
        value = _broken(statement.value)
        if len(value) > 1:
            return [f"{head} {value[0]}", *value[1:-1], f"{value[-1]};"]
        wrapped = {"subsequent_indent": _STEP, "break_long_words": False, "break_on_hyphens": False}
        return textwrap.wrap(f"{head} {value[0]};", WIDTH, **wrapped)
    if isinstance(statement, Call):
        return _calls([statement], "")
    head = f"module {statement.name}({', '.join(statement.parameters)})"
    if len(statement.children) == 1:
        return _calls([statement.children[0]], f"{head} ")
    return [f"{head} {{", *_calls(statement.children, "", 1), "}"] if statement.children else [f"{head} {{}}"]


def _broken(value: Expression) -> list[str]:
    """A vector of vectors with one of them a line; everything else in one line."""
    if not (isinstance(value, Vector) and any(isinstance(item, Vector) for item in value.items)):
        return [expression(value)]
    return ["[", *(f"{_STEP}{expression(item)}," for item in value.items), "]"]


def _calls(calls: list[Call] | tuple[Call, ...], before: str, indent: int = 0) -> list[str]:
    """Lines of calls one below the other; `before` stands before the first."""
    lines: list[str] = []
    waiting: list = [(call, indent) for call in reversed(calls)]
    while waiting:
        item, depth = waiting.pop()
        if isinstance(item, str):
            lines.append(_STEP * depth + item)
            continue
        text = before + _head(item)
        before = ""
        if not item.children:
            lines += [_STEP * depth + line for line in _leaf(text, item, WIDTH - len(_STEP * depth))]
        elif len(item.children) == 1:
            (child,) = item.children
            if len(_STEP * depth + text) + len(_head(child)) + 2 <= WIDTH:
                before = f"{text} "
                waiting.append((child, depth))
            else:
                lines.append(_STEP * depth + text)
                waiting.append((child, depth + 1))
        elif row := _row(item.children, WIDTH - len(_STEP * depth + text) - 4):
            lines.append(f"{_STEP * depth}{text} {{ {row} }}")
        else:
            lines.append(f"{_STEP * depth}{text} {{")
            waiting.append(("}", depth))
            waiting += [(child, depth + 1) for child in reversed(item.children)]
    return lines


def _leaf(text: str, call: Call, room: int) -> list[str]:
    """A call without children: in one line, or with its arguments one below the other."""
    if len(text) < room or not call.arguments:
        return [f"{text};"]
    start = text[: len(text) - len(_head(call))] + f"{call.name}("
    (*others, last) = map(_argument, call.arguments)
    items = [f"{_STEP}{item}," for item in others] + [_STEP + last]
    if not others and isinstance(call.arguments[0].value, Vector):
        start, *items, end = [f"{start}[", *_broken(call.arguments[0].value)[1:-1], "]"]
        return [start, *items, f"{end});"]
    return [start, *items, ");"]


def _row(calls: tuple[Call, ...], room: int) -> str:
    """Short calls side by side; nothing where there is no room, or one has children."""
    if any(call.children for call in calls):
        return ""
    row = " ".join(f"{_head(call)};" for call in calls)
    return row if len(row) <= room else ""


def _head(call: Call) -> str:
    return f"{call.name}({', '.join(map(_argument, call.arguments))})"


def _argument(argument: Argument) -> str:
    return f"{argument.name} = {expression(argument.value)}" if argument.name else expression(argument.value)


def expression(value: Expression, least: int = 0) -> str:
    """In brackets where it binds less than `least`."""
    if isinstance(value, Number):
        return repr(value.value)
    if isinstance(value, Text):
        escaped = value.value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    if isinstance(value, Name):
        return value.name
    if isinstance(value, Vector):
        return f"[{', '.join(map(expression, value.items))}]"
    if isinstance(value, Application):
        return f"{value.name}({', '.join(map(expression, value.arguments))})"
    if isinstance(value, Index):
        return f"{expression(value.vector, _ATOM)}[{expression(value.index)}]"
    if isinstance(value, Negative):
        text, strength = f"-{expression(value.operand, _ATOM)}", _SIGN
    else:
        assert isinstance(value, Operation)
        strength = _STRENGTH[value.symbol]
        left, right = expression(value.left, strength), expression(value.right, strength + 1)
        text = f"{left} {value.symbol} {right}"
    return f"({text})" if strength < least else text
