"""Shapes and checkers for 06_measuring_shapes."""

import math
from collections.abc import Sequence
from itertools import combinations

import torch
from jaxtyping import Float
from torch import Tensor

from ..interpreters.cuboids import Cuboids
from ..interpreters.shapeassembly import Program, ProgramError, execute, parse
from ..metrics.fscore import cloud_f_score
from ..metrics.points import chamfer_distance
from ..metrics.program_distance import program_distance
from ..metrics.rootedness import is_rooted
from ..metrics.stability import stable
from . import OK, UNANSWERED, hint

NEAR = 0.002  # world units that an answer of exercise 6.1 may be too long
ROUNDING = 0.006  # of the two numbers of exercise 6.3: two decimals, and a little
CLOUD_A = torch.tensor([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]], dtype=torch.float64)
CLOUD_B = torch.tensor([[0.0, 3.0, 0.0], [4.0, 0.0, 0.0], [4.0, 1.0, 0.0]], dtype=torch.float64)
THRESHOLD = 1.0  # world units, of the F-score in exercise 6.3
CHOSEN = 3  # shapes in exercise 6.4

TIPPY = """
Assembly Program_0 {
    bbox = Cuboid(1.0, 0.75, 0.8, True)
    cube0 = Cuboid(0.18, 0.03, 0.18, True)  # the foot
    cube1 = Cuboid(0.06, 0.67, 0.06, True)  # the column
    cube2 = Cuboid(1.0, 0.05, 0.8, True)    # the top
    attach(cube0, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5)
    attach(cube1, cube0, 0.5, 0.0, 0.5, 0.5, 1.0, 0.5)
    attach(cube2, cube1, 0.5, 0.0, 0.5, 0.5, 1.0, 0.5)
}
"""


def boxes(*rows: Sequence[float]) -> Cuboids:
    """Boxes parallel to the axes; a row is length, height, width, then x, y, z of the center, world units."""
    numbers = torch.tensor(rows, dtype=torch.float64).reshape(-1, 6)
    upright = torch.eye(3, dtype=torch.float64).expand(len(numbers), 3, 3)
    return Cuboids(numbers[:, :3], numbers[:, 3:], upright)


def table_on_legs(legs: float) -> Cuboids:
    """A table top that always hangs at the same height, 0.70 to 0.75; under it four legs of this length."""
    feet = [(x, z) for x in (-0.55, 0.55) for z in (-0.35, 0.35)]
    return boxes((1.2, 0.05, 0.8, 0, 0.725, 0), *((0.06, legs, 0.06, x, legs / 2, z) for x, z in feet))


def check_legs(answer: object) -> str:
    """Exercise 6.1: the shortest legs, to NEAR, for which `table_on_legs` is rooted."""
    number = _number(answer)
    if isinstance(number, str):
        return number
    if not 0 < number <= 0.7:
        return hint("a length from 0 to 0.70: longer legs would run into the top")
    if not is_rooted(table_on_legs(number)):
        return hint(f"with legs of {number:.4f} the top still floats")
    if is_rooted(table_on_legs(number - NEAR)):
        return hint(f"it is rooted, but so it is with legs {NEAR:g} shorter")
    return OK


def check_foot(answer: object) -> str:
    """Exercise 6.2: TIPPY, made to stand without a wider foot, a smaller top or another height (to 0.01)."""
    program = _program(answer)
    if isinstance(program, str):
        return program
    original = parse(TIPPY)
    if program.structure != original.structure:
        return hint("change numbers only: the statements must stay the same")
    old, new = execute(original).cuboids, execute(program).cuboids
    (low, high), (was_low, was_high) = (each.bounds()[:, 1].tolist() for each in (new, old))
    if abs((high - low) - (was_high - was_low)) > 0.01:
        return hint(f"it is {high - low:.2f} high now, it was {was_high - was_low:.2f}")
    if (new.size[0, [0, 2]] > old.size[0, [0, 2]] + 1e-9).any():
        return hint("the foot may not become wider or deeper")
    if (new.size[2] - old.size[2]).abs().max() > 1e-9:
        return hint("leave the top as large as it was")
    if (new.center[:, [0, 2]] - old.center[:, [0, 2]]).abs().max() > 1e-9:
        return hint("leave foot, column and top one above the other")
    return OK if stable(new) else hint("pushed, it still falls over")


def check_clouds(answer: object) -> str:
    """Exercise 6.3: the Chamfer distance of CLOUD_A and CLOUD_B, and their F-score in percent at THRESHOLD."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, list | tuple) or len(answer) != 2:
        return hint("the answer is two numbers: (Chamfer distance, F-score in percent)")
    numbers = [_number(each) for each in answer]
    if wrong := next((each for each in numbers if isinstance(each, str)), None):
        return hint("both numbers, please") if wrong == UNANSWERED else wrong
    distance, score = numbers
    right = chamfer_distance(CLOUD_A, CLOUD_B).item()
    if abs(distance - right) > ROUNDING:
        half = abs(distance - right / 2) < ROUNDING
        return hint(
            "it is the sum of the two means, not their mean" if half else "the Chamfer distance is another"
        )
    if abs(score - cloud_f_score(CLOUD_A, CLOUD_B, THRESHOLD)) > 100 * ROUNDING:
        return hint("the distance is right; the F-score is another")
    return OK


def cover(distances: Float[Tensor, "n n"], chosen: Sequence[int]) -> float:
    """Mean distance from every shape to the nearest of the chosen ones: their coverage of the set."""
    return float(distances[:, list(chosen)].min(1).values.mean())


def check_cover(answer: object, distances: Float[Tensor, "n n"]) -> str:
    """Exercise 6.4: CHOSEN shapes that cover the set as well as any do. distances: of each two, 0 on the diagonal."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, list | tuple | set) or len({*map(repr, answer)}) != CHOSEN:
        return hint(f"the answer is {CHOSEN} different numbers of shapes, such as [0, 1, 2]")
    if not all(type(each) is int and 0 <= each < len(distances) for each in answer):
        return hint(f"the shapes are numbered from 0 to {len(distances) - 1}")
    every = {chosen: cover(distances, chosen) for chosen in combinations(range(len(distances)), CHOSEN)}
    here = cover(distances, sorted(answer))
    better = sum(value < here - 1e-9 for value in every.values())
    return (
        OK if not better else hint(f"coverage is {here:.4f}; {better} of the {len(every)} choices are better")
    )


def check_twins(answer: object, original: Program) -> str:
    """Exercise 6.5: a program of another structure for exactly the same boxes, in any order."""
    program = _program(answer)
    if isinstance(program, str):
        return program
    mine, wanted = execute(program).cuboids, execute(original).cuboids
    if len(mine) != len(wanted):
        return hint(f"it draws {len(mine)} boxes instead of {len(wanted)}")
    apart = torch.cdist(_sorted_corners(mine), _sorted_corners(wanted)).min(0).values.max().item()
    if not apart < 1e-4:
        return hint("the boxes are not the same: one of them is missing or lies elsewhere")
    if not program_distance(program, original):
        return hint("it has the same structure: the edit distance is 0")
    return OK


def _sorted_corners(cuboids: Cuboids) -> Float[Tensor, "boxes 24"]:
    """Corners of each box in an order that does not depend on which of its axes comes first."""
    rounded = (cuboids.corners() * 1e5).round()
    key = rounded[..., 0] * 1e14 + rounded[..., 1] * 1e7 + rounded[..., 2]
    order = key.argsort(-1).unsqueeze(-1).expand(-1, -1, 3)
    return cuboids.corners().gather(1, order).flatten(1)


def _number(answer: object) -> float | str:
    """A finite number, or what to tell the reader."""
    if answer is None:
        return UNANSWERED
    try:
        number = float(answer)
    except Exception:  # whatever a reader's object does when asked for a number
        return hint(f"a number is expected, this is of type {type(answer).__name__}")
    return number if math.isfinite(number) else hint("the number should be finite")


def _program(answer: object) -> Program | str:
    """The program of an answer, which runs, or what to tell the reader."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, str | Program):
        return hint(f"the answer is a program as a text, this is of type {type(answer).__name__}")
    try:
        program = answer if isinstance(answer, Program) else parse(answer)
        execute(program)
    except ProgramError as error:
        return hint(str(error)[:300])
    return program
