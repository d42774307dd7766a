"""Text -> Document, by the grammar of `document`; no meaning yet.

What OpenSCAD knows and the grammar does not is refused by name. Blocks may be nested as deep as the longest CSG program
needs, so they are read with a stack of our own; expressions are short, so they are read by recursion.
"""

from ..quoting import quoted
from .document import (
    Application,
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
    Statement,
    Text,
    Vector,
)
from .errors import ScadError
from .tokens import END, Token, tokens
from .words import KEYWORDS, OTHER_MODULES, OTHER_SYMBOLS

DEEPEST_BLOCK = 1024  # calls within calls
DEEPEST_EXPRESSION = 8  # brackets within brackets
LONGEST_CHAIN = 20  # terms of a sum, factors of a product
_LONGEST_WHOLE = 15  # digits of a whole number that a double holds for certain


def parse(text: str) -> Document:
    """Read a file of the subset. Raises ScadError with line, column, what was found and what was expected."""
    parser = _Parser(tokens(text))
    statements = []
    while parser.next.kind != END:
        statements.append(parser.statement())
    return Document(tuple(statements))


class _Parser:
    def __init__(self, tokens: list[Token]):
        self.tokens, self.place, self.depth = tokens, 0, 0

    @property
    def next(self) -> Token:
        return self.tokens[self.place]

    def take(self) -> Token:
        self.place += 1
        return self.tokens[self.place - 1]

    def expect(self, symbol: str) -> Token:
        if self.next.text != symbol:
            raise self.wrong(quoted(symbol))
        return self.take()

    def name(self, what: str) -> Token:
        if self.next.kind != "name" or self.next.text in KEYWORDS:
            raise self.wrong(what)
        return self.take()

    def wrong(self, expected: str) -> ScadError:
        """Something else stands here."""
        token = self.next
        found = f"found {quoted(token.text)}"
        if token.kind == END:
            found = "the text ends"
        elif token.text in KEYWORDS or token.text in OTHER_SYMBOLS:
            found += ", a part of OpenSCAD that is not read here"
        return ScadError(found, *token.at, token.text, expected)

    def statement(self) -> Statement:
        """A module, a function, a parameter or a call."""
        if self.next.text == "module":
            return self.module()
        if self.next.text == "function":
            return self.function()
        if self.next.kind == "name" and self.tokens[self.place + 1].text == "=":
            return self.assign()
        return self.call("a parameter 'name = …;', a module, or a call 'name();'")

    def assign(self) -> Assign:
        name = self.name("a name")
        self.expect("=")
        value = self.expression()
        self.expect(";")
        return Assign(name.text, value, at=name.at)

    def function(self) -> Function:
        self.take()
        name, parameters = self.signature()
        self.expect("=")
        value = self.expression()
        self.expect(";")
        return Function(name.text, parameters, value, at=name.at)

    def module(self) -> Module:
        self.take()
        name, parameters = self.signature()
        if self.next.text != "{":
            return Module(name.text, parameters, (self.call("'{' or a call 'name();'"),), at=name.at)
        self.take()
        children = []
        while self.next.text != "}":
            children.append(self.call("'}' or a call 'name();'"))
        self.take()
        return Module(name.text, parameters, tuple(children), at=name.at)

    def signature(self) -> tuple[Token, tuple[str, ...]]:
        name = self.name("a name")
        self.expect("(")
        parameters = []
        while self.next.text != ")":
            parameters.append(self.name("the name of a parameter, or ')'").text)
            if self.next.text != ")":
                self.expect(",")
        self.take()
        return name, tuple(parameters)

    def call(self, expected: str) -> Call:
        """One call and all within it."""
        open_calls: list[
            tuple[Token, tuple, list[Call], bool]
        ] = []  # name, arguments, children, in brackets?
        while True:
            if open_calls and open_calls[-1][3] and self.next.text == "}":
                self.take()
                name, arguments, children, _ = open_calls.pop()
            else:
                name, arguments, children = *self.head(expected), []
                expected = "a call 'name();'"
                if self.next.text != ";":
                    braces = self.next.text == "{"
                    self.place += braces
                    open_calls.append((name, arguments, children, braces))
                    if len(open_calls) > DEEPEST_BLOCK:
                        raise ScadError(
                            f"{DEEPEST_BLOCK} calls are nested here", *name.at, name.text, "fewer of them"
                        )
                    continue
                self.take()
            finished = Call(name.text, arguments, tuple(children), at=name.at)
            while open_calls and not open_calls[-1][3]:
                name, arguments, _, _ = open_calls.pop()
                finished = Call(name.text, arguments, (finished,), at=name.at)
            if not open_calls:
                return finished
            open_calls[-1][2].append(finished)
            expected = "'}' or a call 'name();'"

    def head(self, expected: str) -> tuple[Token, tuple[Argument, ...]]:
        """The name and the arguments of a call."""
        if self.next.text in OTHER_MODULES:
            raise (
                self.wrong(expected)
                if self.next.text in KEYWORDS
                else ScadError(
                    f"found {quoted(self.next.text)}, a part of OpenSCAD that is not read here",
                    *self.next.at,
                    self.next.text,
                    expected,
                )
            )
        name = self.name(expected)
        self.expect("(")
        return name, self.listed(self.argument, ")")

    def argument(self) -> Argument:
        name = ""
        if self.next.kind == "name" and self.tokens[self.place + 1].text == "=":
            name = self.name("a name").text
            self.take()
        at = self.next.at
        return Argument(self.expression(), name, at=at)

    def listed(self, read, end: str) -> tuple:
        """Any number of something, between commas, up to a bracket."""
        items = []
        while self.next.text != end:
            items.append(read())
            if self.next.text != end:
                self.expect(",")
        self.take()
        return tuple(items)

    def expression(self) -> Expression:
        self.depth += 1
        if self.depth > DEEPEST_EXPRESSION:
            raise ScadError("brackets or signs are nested too deep", *self.next.at, self.next.text, "less")
        value = self.chain("+-", lambda: self.chain("*/", self.factor))
        self.depth -= 1
        return value

    def chain(self, symbols: str, read) -> Expression:
        """What `read` reads, joined from left to right by the symbols."""
        value, count = read(), 1
        while self.next.kind == "symbol" and self.next.text in symbols:
            symbol = self.take()
            value, count = Operation(symbol.text, value, read(), at=symbol.at), count + 1
            if count > LONGEST_CHAIN:
                found = f"more than {LONGEST_CHAIN} numbers are joined by {' or '.join(symbols)}"
                raise ScadError(found, *symbol.at, symbol.text, "fewer of them, or a parameter for a part")
        return value

    def factor(self) -> Expression:
        """An atom with any signs before it."""
        at, negative = self.next.at, False
        while self.next.text in ("-", "+"):
            negative ^= self.take().text == "-"
        value = self.atom()
        while self.next.text == "[":
            opened = self.take()
            value = Index(value, self.expression(), at=opened.at)
            self.expect("]")
            if isinstance(value.vector, Index) and isinstance(value.vector.vector, Index):
                raise ScadError("a third index in a row", *opened.at, "[", "at most two")
        return Negative(value, at=at) if negative else value

    def atom(self) -> Expression:
        token = self.next
        if token.kind == "number":
            return Number(_number(self.take()), at=token.at)
        if token.kind == "text":
            self.take()
            return Text(token.text[1:-1].replace('\\"', '"').replace("\\\\", "\\"), at=token.at)
        if token.kind == "name" and token.text not in KEYWORDS:
            self.take()
            if self.next.text != "(":
                return Name(token.text, at=token.at)
            self.take()
            return Application(token.text, self.listed(self.expression, ")"), at=token.at)
        if token.text == "[":
            self.take()
            return Vector(self.listed(self.expression, "]"), at=token.at)
        if token.text == "(":
            self.take()
            value = self.expression()
            self.expect(")")
            return value
        raise self.wrong("a number, a name, a vector [ ] or ( )")


def _number(token: Token) -> int | float:
    if token.text.isdecimal() and len(token.text) <= _LONGEST_WHOLE:
        return int(token.text)
    value = float(token.text)
    if value == float("inf"):
        raise ScadError(f"{quoted(token.text)} is too large", *token.at, token.text, "a finite number")
    return value
