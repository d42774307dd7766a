"""A CSG program: primitives and operations in postfix order.

    program    ::= primitive | program program operation
    operation  ::= "+" union | "*" intersect | "-" subtract

An operation takes the two shapes before it: `A B -` is A without B. All primitives of a program are of the plane, or
all of space. (Sharma et al. 2018, section 3.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Int
from torch import Tensor

from ..quoting import quoted
from .errors import ProgramError
from .primitives import KINDS, Primitive

OPERATIONS = {"+": "union", "*": "intersect", "-": "subtract"}
STOP = "$"  # ends a program in the networks' vocabulary; not a statement
LONGEST = 1023  # tokens of one program: far more than a network writes


@dataclass(frozen=True)
class Operation:
    """One of + (union), * (intersect), - (subtract)."""

    symbol: str

    def __post_init__(self):
        if self.symbol not in OPERATIONS:
            symbol = str(self.symbol)
            raise ProgramError(f"{quoted(symbol)} is no operation", None, symbol, " ".join(OPERATIONS))

    @property
    def name(self) -> str:
        return OPERATIONS[self.symbol]

    def __str__(self) -> str:
        return self.symbol


Statement = Primitive | Operation


@dataclass(frozen=True)
class Tree:
    """An operation and what it combines: `left` without `right` where the operation is a subtraction."""

    operation: Operation
    left: "Tree | Primitive"
    right: "Tree | Primitive"


def check(statements: Sequence[Statement], columns: Sequence[int] | None = None) -> None:
    """Raises ProgramError, naming the token, unless the statements are one whole program.

    columns: the 1-based place in the text of each statement and, last, of the text's end.
    """
    if problem := _problem(statements):
        index, token, found, expected = problem
        raise ProgramError(found, index, token, expected, columns[index] if columns else None)


def _problem(statements: Sequence[Statement]) -> tuple[int, str, str, str] | None:
    """The first token that cannot stand where it does: index, token, what is wrong, what was expected."""
    if not statements:
        return 0, "", "the program is empty", "a primitive, such as c(32,32,16)"
    if len(statements) > LONGEST:
        return LONGEST, str(statements[LONGEST]), "the program goes on", f"at most {LONGEST} tokens"
    stack = 0  # how many shapes wait
    dimensions = next((s.dimensions for s in statements if isinstance(s, Primitive)), None)
    for index, statement in enumerate(statements):
        token = str(statement)
        if isinstance(statement, Operation):
            if stack < 2:
                found = f"'{token}' finds {stack} {'shape' if stack == 1 else 'shapes'} on the stack"
                return index, token, found, "two shapes before each operation"
            stack -= 1
        elif not isinstance(statement, Primitive):
            found = f"{quoted(token)} is a {type(statement).__name__}"
            return index, token, found, "a Primitive or an Operation"
        elif statement.dimensions != dimensions:
            found = (
                f"{quoted(token)} is {_world(statement.dimensions)}, the program began {_world(dimensions)}"
            )
            expected = " or ".join(str(k) for k in KINDS.values() if k.dimensions == dimensions)
            return index, token, found, expected
        else:
            stack += 1
    if stack > 1:
        found = f"the program ends with {stack} shapes on the stack"
        missing = f"{stack - 1} more operation{'s' if stack > 2 else ''}, to leave one shape"
        return len(statements), "", found, missing
    return None


def _world(dimensions: int) -> str:
    return "in space" if dimensions == 3 else "in the plane"


@dataclass(frozen=True)
class Program:
    """A whole program; building one that is not valid raises ProgramError.

    Equal programs have the same tokens; programs with different tokens may still make the same shape.
    """

    statements: tuple[Statement, ...]

    def __post_init__(self):
        # A list could be changed, and has no hash.
        object.__setattr__(self, "statements", tuple(self.statements))
        check(self.statements)

    def __len__(self) -> int:
        """How many tokens; the networks' `$` does not count."""
        return len(self.statements)

    def __str__(self) -> str:
        return self.to_text()

    @property
    def dimensions(self) -> int:
        """2 for a program of the plane, 3 for one of space."""
        return self.statements[0].dimensions

    @cached_property
    def primitives(self) -> tuple[Primitive, ...]:
        """The primitives in text order."""
        return tuple(s for s in self.statements if isinstance(s, Primitive))

    def to_text(self) -> str:
        """The program as a text without blanks, such as "c(32,32,28)s(32,32,20)-"; parse reads it back."""
        return "".join(map(str, self.statements))

    def to_openscad(self) -> str:
        """An OpenSCAD file of the exact shape; `openscad.read` gives the same program."""
        from ..openscad import write

        return write(self)

    def tokens(self, vocabulary=None, length: int | None = None) -> Int[Tensor, " tokens"]:
        """Indices into the vocabulary of the program's dimension (or another), padded with `$` up to `length`.

        Raises ProgramError for a primitive that is not in the vocabulary, and for a program longer than `length`.
        """
        from .vocabulary import vocabulary_of

        words = vocabulary or vocabulary_of(self.dimensions)
        indices = [words.index(str(statement), place) for place, statement in enumerate(self.statements)]
        if length is not None and len(indices) > length:
            found = f"the program has {len(indices)} tokens"
            raise ProgramError(found, length, str(self.statements[length]), f"at most {length}")
        padding = [words.stop] * ((length or 0) - len(indices))
        return torch.tensor(indices + padding)

    @staticmethod
    def from_tokens(tokens: Sequence[int] | Int[Tensor, " tokens"], vocabulary=None) -> "Program":
        """The program that indices spell, up to the first `$`, in the vocabulary of the plane unless told otherwise.

        Raises ProgramError for what is no program.
        """
        from .vocabulary import vocabulary_of

        return (vocabulary or vocabulary_of(2)).program(tokens)

    def parameters(self) -> Int[Tensor, " parameters"]:
        """All numbers in text order."""
        return torch.tensor([number for primitive in self.primitives for number in primitive.numbers])

    @property
    def structure(self) -> tuple[str, ...]:
        """What is left without the parameters, such as ("c", "s", "-"): comparable and hashable."""
        return tuple(s.kind if isinstance(s, Primitive) else s.symbol for s in self.statements)

    def parameter_names(self) -> tuple[str, ...]:
        """A name for each number, such as "0:c:x": token, primitive, field."""
        return tuple(
            f"{index}:{statement.kind}:{field}"
            for index, statement in enumerate(self.statements)
            if isinstance(statement, Primitive)
            for field in KINDS[statement.kind].fields
        )

    def with_parameters(self, vector: Sequence[int] | Int[Tensor, " parameters"]) -> "Program":
        """The same structure with other numbers. Raises ProgramError for numbers that are off the canvas."""
        numbers = vector.tolist() if isinstance(vector, Tensor) else list(vector)
        if len(numbers) != len(self.parameters()):
            raise ProgramError(f"{len(numbers)} parameters", expected=f"{len(self.parameters())} of them")
        statements, waiting = [], iter(numbers)
        for statement in self.statements:
            if isinstance(statement, Primitive):
                statement = Primitive(statement.kind, tuple(next(waiting) for _ in statement.numbers))
            statements.append(statement)
        return Program(tuple(statements))

    def tree(self) -> Tree | Primitive:
        """The program as a tree of operations with primitives at its leaves."""
        stack = []
        for statement in self.statements:
            if isinstance(statement, Operation):
                right = stack.pop()
                statement = Tree(statement, stack.pop(), right)
            stack.append(statement)
        return stack[0]

    @staticmethod
    def from_tree(tree: Tree | Primitive) -> "Program":
        """The program whose tree this is."""
        backwards, waiting = [], [tree]
        while waiting:  # a chain of a thousand operations would be too deep for recursion
            node = waiting.pop()
            if isinstance(node, Tree):
                waiting += [node.left, node.right]
                node = node.operation
            backwards.append(node)
            if len(backwards) > LONGEST:
                raise ProgramError(
                    "the tree goes on", expected=f"at most {LONGEST} primitives and operations"
                )
        return Program(tuple(reversed(backwards)))

    def infix(self) -> str:
        """The program as one reads it at school, such as "(c(32,32,28) - s(32,32,20))"."""
        stack = []
        for statement in self.statements:
            text = str(statement)
            if isinstance(statement, Operation):
                right = stack.pop()
                text = f"({stack.pop()} {text} {right})"
            stack.append(text)
        return stack[0]

    def tree_view(self) -> str:
        """The tree as indented text, the operation above what it combines."""
        lines, waiting = [], [(self.tree(), "", "", "")]
        while waiting:
            node, before, branch, below = waiting.pop()
            operation = node.operation if isinstance(node, Tree) else None
            lines.append(before + branch + (f"{operation} {operation.name}" if operation else str(node)))
            if operation:
                waiting.append((node.right, before + below, "└── ", "    "))
                waiting.append((node.left, before + below, "├── ", "│   "))
        return "\n".join(lines)
