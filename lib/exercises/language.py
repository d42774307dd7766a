"""Checkers for 00_tour and 01_shapeassembly_language."""

from ..interpreters.shapeassembly import (
    Attach,
    Program,
    ProgramError,
    Reflect,
    Shape,
    Squeeze,
    execute,
    parse,
)
from . import OK, UNANSWERED, hint


def check_height(answer: object, original: Program, height: float) -> str:
    """Exercise 0.1: the same stool with another height (to 0.05), as wide and deep as before (to 0.03 units)."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, Program):
        return hint(f"the answer should be a Program, this is a {type(answer).__name__}")
    if answer.structure != original.structure:
        return hint("change numbers only: the statements must stay the same")
    old, new = (_sides(execute(program)) for program in (original, answer))
    if abs(new[1] - height) > 0.05:
        return hint(
            f"it is {new[1]:.2f} tall from the lowest to the highest point, it should be {height:.2f}"
        )
    if abs(new[0] - old[0]) > 0.03 or abs(new[2] - old[2]) > 0.03:
        return hint("the height is right, but its width or depth changed too")
    return OK


def check_table(text: object) -> str:
    """Exercise 1.1: a table with a top and four legs, in at most nine statements."""
    if text is None:
        return UNANSWERED
    made = _executed(text)
    if isinstance(made, str):
        return made
    program, shape = made
    statements = [statement for _, _, statement in program.statements()]
    if len(statements) > 9:
        return hint(f"{len(statements)} statements; nine are enough if reflect makes two of the legs")
    if not any(isinstance(s, Squeeze) for s in statements) or not any(
        isinstance(s, Reflect) for s in statements
    ):
        return hint("use squeeze for the legs and reflect for their mirror images")
    if len(shape.cuboids) < 5:
        return hint(f"{len(shape.cuboids)} cuboids; a top and four legs are five")
    return _stands_on_four_corners(shape)


def _stands_on_four_corners(shape: Shape) -> str:
    low, high = shape.bounds().tolist()
    boxes = shape.cuboids
    feet = [c for c, s in zip(boxes.center.tolist(), boxes.size.tolist(), strict=True)
            if abs(c[1] - s[1] / 2 - low[1]) < 1e-3 and s[1] > 0.5 * (high[1] - low[1])]  # fmt: skip
    quarters = {(x > 0, z > 0) for x, _, z in feet}
    if len(quarters) < 4:
        return hint(f"legs stand in {len(quarters)} of the four quarters of the floor")
    if not any(
        s[0] > 0.9 * (high[0] - low[0]) and s[2] > 0.9 * (high[2] - low[2]) for s in boxes.size.tolist()
    ):
        return hint("no cuboid is wide and deep enough to be the top")
    return OK


def check_expansion(answer: object, squeeze: Squeeze) -> str:
    """Exercise 1.2: the two attaches that a squeeze between two cuboids stands for."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, list) or len(answer) != 2 or not all(isinstance(a, Attach) for a in answer):
        return hint("the answer is a list of two Attach statements")
    u, v = squeeze.numbers
    wanted = [
        Attach(squeeze.moved, squeeze.first, (1.0, 0.5, 0.5, 0.0, u, v)),
        Attach(squeeze.moved, squeeze.second, (0.0, 0.5, 0.5, 1.0, u, v)),
    ]
    for number, (got, right) in enumerate(zip(answer, wanted, strict=True), 1):
        if (got.moved, got.still) != (right.moved, right.still):
            return hint(f"attach {number} should move {right.moved} to {right.still}")
        if any(abs(a - b) > 1e-9 for a, b in zip(got.numbers[:3], right.numbers[:3], strict=True)):
            return hint(f"attach {number} starts at the center of a face of {right.moved}: which one?")
        if any(abs(a - b) > 1e-9 for a, b in zip(got.numbers[3:], right.numbers[3:], strict=True)):
            return hint(
                f"attach {number} ends on the face of {right.still} that looks at {right.moved}, at (u, v)"
            )
    return OK


def check_repair(text: object) -> str:
    """Exercise 1.3: the broken bench, made to run without adding or removing a statement."""
    if text is None:
        return UNANSWERED
    made = _executed(text)
    if isinstance(made, str):
        return made
    program, shape = made
    if sum(1 for _ in program.statements()) != 8:
        return hint("keep all eight statements: each needs one small change at most")
    if len(shape.cuboids) != 4:
        return hint(
            f"it runs, but draws {len(shape.cuboids)} cuboids; the bench has a seat, a rail and two legs"
        )
    return OK


def _executed(text: object) -> tuple[Program, Shape] | str:
    """The program of a text and its shape, or the hint that its error gives."""
    try:
        program = parse(text)
        return program, execute(program)
    except ProgramError as error:
        return hint(str(error))


def _sides(shape: Shape) -> list[float]:
    low, high = shape.bounds()
    return (high - low).tolist()
