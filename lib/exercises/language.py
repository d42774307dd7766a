"""Checkers for 00_tour and 01_shapeassembly_language."""

from ..interpreters.shapeassembly import (
    Attach,
    Program,
    ProgramError,
    Shape,
    Squeeze,
    execute,
    parse,
)
from . import OK, UNANSWERED, hint

NEAR = 0.02  # world units that a leg may miss the floor or the top by


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
    """Exercise 1.1: a table with a top and four legs from floor to top, in at most nine statements."""
    made = _executed(text)
    if isinstance(made, str):
        return made
    program, shape = made
    statements = [statement for _, _, statement in program.statements()]
    if len(statements) > 9:
        return hint(f"{len(statements)} statements; nine are enough if reflect makes two of the legs")
    if len(shape.cuboids) < 5:
        return hint(f"{len(shape.cuboids)} cuboids; a top and four legs are five")
    return _check_legs(shape)


def _check_legs(shape: Shape) -> str:
    """The widest cuboid is the top; under it a leg in each quarter, near the corner, from floor to top."""
    (left, _, back), (right, _, front) = shape.bounds().tolist()
    floor = -float(shape.boxes.size[0, 1]) / 2  # of the bounding box
    low = shape.cuboids.corners().amin(1).tolist()
    high = shape.cuboids.corners().amax(1).tolist()
    areas = [(b[0] - a[0]) * (b[2] - a[2]) for a, b in zip(low, high)]
    top = areas.index(max(areas))
    if areas[top] < 0.8 * (right - left) * (front - back):
        return hint("no cuboid is wide and deep enough to be the top")
    legs = [i for i in range(len(low)) if i != top]
    if any(abs(low[i][1] - floor) > NEAR or abs(high[i][1] - low[top][1]) > NEAR for i in legs):
        return hint("a leg should reach from the floor to the underside of the top, no farther")
    quarters = set()
    for i in legs:
        x, z = (low[i][0] + high[i][0] - left - right) / 2, (low[i][2] + high[i][2] - back - front) / 2
        if abs(x) > (right - left) / 4 and abs(z) > (front - back) / 4:
            quarters.add((x > 0, z > 0))
    return OK if len(quarters) == 4 else hint(f"legs stand near {len(quarters)} of the four corners")


def check_expansion(answer: object, squeeze: Squeeze) -> str:
    """Exercise 1.2: the two attaches that a squeeze between two cuboids stands for."""
    if answer is None:
        return UNANSWERED
    if (
        not isinstance(answer, list | tuple)
        or len(answer) != 2
        or not all(isinstance(a, Attach) for a in answer)
    ):
        return hint("the answer is a list of two Attach statements")
    u, v = squeeze.numbers
    wanted = [
        Attach(squeeze.moved, squeeze.first, (1.0, 0.5, 0.5, 0.0, u, v)),
        Attach(squeeze.moved, squeeze.second, (0.0, 0.5, 0.5, 1.0, u, v)),
    ]
    for number, (got, right) in enumerate(zip(answer, wanted), 1):
        if (got.moved, got.still) != (right.moved, right.still):
            return hint(f"attach {number} should move {right.moved} to {right.still}")
        if len(got.numbers) != 6:
            return hint(f"attach {number} has {len(got.numbers)} numbers, it needs six")
        if any(abs(a - b) > 1e-9 for a, b in zip(got.numbers[:3], right.numbers[:3])):
            return hint(f"attach {number} starts at the center of a face of {right.moved}: which one?")
        if any(abs(a - b) > 1e-9 for a, b in zip(got.numbers[3:], right.numbers[3:])):
            return hint(
                f"attach {number} ends on the face of {right.still} that looks at {right.moved}, at (u, v)"
            )
    return OK


def check_repair(text: object) -> str:
    """Exercise 1.3: the broken bench, made to run without adding or removing a statement."""
    made = _executed(text)
    if isinstance(made, str):
        return made
    program, shape = made
    if sum(1 for _ in program.statements()) != 8:
        return hint("keep all eight statements; the mistakes are inside lines, or in their order")
    centers = sorted([round(x, 2) for x in center] for center in shape.cuboids.center.tolist())
    if len(centers) != 4 or [-0.64, -0.03, 0.0] not in centers or [0.64, -0.03, 0.0] not in centers:
        return hint("it runs, but a bench stands on two legs, one a mirror image of the other")
    if [0.0, -0.03, 0.0] not in centers:
        return hint("it runs, but the rail should go from the middle of one leg to the middle of the other")
    return OK


def _executed(text: object) -> tuple[Program, Shape] | str:
    """The program of a text and its shape, or what to tell the reader: unanswered, or the hint its error gives."""
    if text is None:
        return UNANSWERED
    try:
        program = parse(text)
        return program, execute(program)
    except ProgramError as error:
        return hint(str(error))


def _sides(shape: Shape) -> list[float]:
    low, high = shape.bounds()
    return (high - low).tolist()
