"""The stack of a program, token after token; also of a program that is only half written.

What stands on the stack is itself a program: the tokens that made it. So every entry is a shape that knows its text.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from .errors import ProgramError
from .executing import execute_many
from .parsing import parse
from .program import STOP, Operation, Program, Statement, check
from .shape import Shape


@dataclass(frozen=True)
class Step:
    """One token and what it did.

    taken  the operation's operands A, B, as in `A B -`; nothing for a primitive.
    stack  after the token, bottom first; the last entry is the one that the token put there.
    """

    token: Statement
    taken: tuple[Shape, ...]
    stack: tuple[Shape, ...]


def trace(program: Program | Sequence[Statement]) -> list[Step]:
    """One step a token. Of a half-written program give its statements: the last stack then has several entries.

    Raises ProgramError for a text, where an operation finds no two shapes, or plane and space are mixed.
    """
    if isinstance(program, str):
        raise ProgramError("found a str", expected="a Program, see parse(text), or its statements")
    statements = program.statements if isinstance(program, Program) else tuple(program)
    if not statements:
        return []
    check(statements + (Operation("+"),) * missing(statements))
    sizes: list[int] = []  # tokens of each entry of the stack
    made: list[Program] = []
    taken: list[int] = []
    for place, statement in enumerate(statements):
        taken.append(2 if isinstance(statement, Operation) else 0)
        sizes.append(1 + sum(sizes.pop() for _ in range(taken[-1])))
        made.append(Program(statements[place + 1 - sizes[-1] : place + 1]))
    steps: list[Step] = []
    stack: tuple[Shape, ...] = ()
    for statement, shape, many in zip(statements, execute_many(made), taken):
        kept = len(stack) - many
        operands, stack = stack[kept:], (*stack[:kept], shape)
        steps.append(Step(statement, operands, stack))
    return steps


def missing(statements: Sequence[Statement]) -> int:
    """How many operations a half-written program lacks, to leave one shape; 0 for a whole one, and for none at all."""
    operations = sum(isinstance(statement, Operation) for statement in statements)
    return max(0, len(statements) - 2 * operations - 1)


def parse_start(text: str) -> tuple[Statement, ...]:
    """The statements of a program that may be half written, or empty. Raises ProgramError for everything else."""
    if not isinstance(text, str):
        raise ProgramError(f"the program is a {type(text).__name__}", expected="a text")
    text = text.partition(STOP)[0]
    if not text.strip():
        return ()
    try:
        return parse(text).statements
    except ProgramError as error:
        if error.token or not error.index:
            raise
        tokens, primitives = error.index, text.count("(")  # the text was read to its end
        return parse(text + "+" * (2 * primitives - tokens - 1)).statements[:tokens]
