"""Checkers for 05_writing_new_shapes, and what its exercises and experiments measure."""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from ..interpreters.shapeassembly import (
    Attach,
    Cuboid,
    Program,
    ProgramError,
    Shape,
    execute,
    execute_many,
    parse,
)
from ..interpreters.shapeassembly.program import BBOX
from ..models.exploring import codes
from ..models.program_lines import line_of
from ..models.program_vae import ProgramVAE
from ..models.writing import write
from ..models.writing_rules import AUTHORS, BlockStates, Rules
from ..models.written_blocks import NAMES
from . import OK, UNANSWERED, hint

HALF_WRITTEN = """Assembly Program_0 {
    bbox = Cuboid(0.8, 1.0, 0.8, True)
    cube0 = Cuboid(0.8, 0.1, 0.8, True)
    cube1 = Cuboid(0.3, 0.4, 0.3, True)
    cube2 = Cuboid(0.8, 0.5, 0.1, True)
    attach(cube1, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5)
    attach(cube0, cube1, 0.5, 0.0, 0.5, 0.5, 1.0, 0.5)
}
"""
NEAR = 1e-4  # exercise 5.4: of a code's length
TALLER = 1.15  # exercise 5.5
GRID = (40, 60, 15)  # points across, up and to the front at which `has_arms` looks
FEWEST_LEVELS = 3  # of the 60


def has_arms(shape: Shape) -> bool:
    """Something stands up at the left and at the right of the front half, and between there is room: a rule of thumb.

    Looked at from the front, the front half of a chair is a picture; above the highest thing in its middle fifth (the
    seat) both outer quarters must show something in at least three of sixty levels.
    """
    low, high = shape.bounds()
    x, y, z = (torch.arange(n, dtype=low.dtype).add(0.5) / n for n in GRID)
    grid = torch.cartesian_prod(x, y, 0.5 + z / 2)
    front = shape.occupancy(low + grid * (high - low)).view(GRID).any(2)  # (across, up)
    wide = GRID[0] // 4
    left, middle, right = (
        front[:wide].any(0),
        front[2 * GRID[0] // 5 : 3 * GRID[0] // 5].any(0),
        front[-wide:].any(0),
    )
    if not middle.any():
        return False
    above = torch.arange(GRID[1]) > int(middle.nonzero().max())
    return int((left & right & above).sum()) >= FEWEST_LEVELS


def slenderness(shape: Shape) -> float:
    """Height of a shape divided by its width."""
    width, height, _ = (shape.bounds()[1] - shape.bounds()[0]).tolist()
    return height / width


def half_written() -> BlockStates:
    """Exercise 5.1: where the rules stand after the lines of HALF_WRITTEN."""
    states, row = BlockStates.new(1), torch.tensor([0])
    number = {name: index for index, name in enumerate(NAMES)}
    for statement in parse(HALF_WRITTEN).blocks[0].statements[1:]:  # the bbox line is known already
        states.add(row, torch.tensor([line_of(statement, number)]))
    return states


def check_pairs(answer: object) -> str:
    """Exercise 5.1: the pairs (moved, still) that the next attach may have, as names."""
    if answer is None:
        return UNANSWERED
    try:
        got = {(str(moved), str(still)) for moved, still in answer}
    except (TypeError, ValueError):
        return hint("the answer is a set of pairs of names, such as {('cube0', 'bbox'), …}")
    known = NAMES[: int(half_written().declared)]
    strange = sorted({name for pair in got for name in pair} - set(known))
    if strange:
        return hint(f"there is no cuboid {strange[0]!r}; the block has {', '.join(known)}")
    right = {(NAMES[moved], NAMES[still]) for moved, still in half_written().pairs()[0].nonzero().tolist()}
    if wrong := sorted(got - right):
        return hint(f"attach{wrong[0]} is forbidden: read the four conditions again with this pair")
    missing = len(right - got)
    return (
        hint(f"all of these are allowed, but {missing} more {'are' if missing > 1 else 'is'}")
        if missing
        else OK
    )


def check_best_pair(function: object) -> str:
    """Exercise 5.2: function(first (n,), second (n,), allowed (n, n)) -> the best allowed (moved, still), or None."""
    if function is None:
        return UNANSWERED
    if not callable(function):
        return hint(f"the answer is a function, this is of type {type(function).__name__}")
    for name, first, second, allowed in _pair_cases():
        scores = (first[:, None] + second[None, :]).masked_fill(~allowed, -torch.inf)
        wanted = divmod(int(scores.argmax()), len(second)) if allowed.any() else None
        try:
            found = function(first.clone(), second.clone(), allowed.clone())
            got = None if found is None else tuple(int(number) for number in found)
        except Exception as error:  # whatever a reader's function does, it becomes a hint
            return hint(f"{name}: it raised {type(error).__name__}: {str(error)[:120]}")
        if got != wanted:
            return hint(f"{name}: it found {got}, the best allowed pair is {wanted}")
    return OK


def _pair_cases() -> list[tuple[str, Tensor, Tensor, Tensor]]:
    """Name, first, second, allowed: three by hand, then random ones."""
    first, second = torch.tensor([3.0, 2.0, 0.0]), torch.tensor([1.0, 0.0, 2.5])
    every = torch.ones(3, 3, dtype=torch.bool)
    stuck = torch.tensor([[0, 0, 0], [1, 1, 0], [1, 0, 0]], dtype=torch.bool)
    cases = [
        ("everything allowed", first, second, every),
        ("the favourite to be moved has no partner", first, second, stuck),
        ("nothing allowed", first, second, ~every),
    ]
    noise = torch.Generator().manual_seed(5)
    for number in range(50):
        scores = torch.randn(2, 11, generator=noise)
        cases.append((f"random case {number}", *scores, torch.rand(11, 11, generator=noise) < 0.1))
    return cases


def check_outside(answer: object) -> str:
    """Exercise 5.3: a text: one block, whose cuboids leave it too far for the paper, not for AUTHORS."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, str):
        return hint(f"the answer is a program as a text, this is of type {type(answer).__name__}")
    try:
        program = parse(answer)
        shape = execute(program)
    except ProgramError as error:
        return hint(str(error))
    if len(program.blocks) > 1 or len(shape.names) == 0:
        return hint("one block with a bbox and at least one cuboid, please")
    if problem := _sizes_and_places(program):
        return hint(problem)
    reach = float(_reach(shape, program))
    if reach < Rules().outside:
        return hint(f"cuboids reach {reach:.0%} of a half side beyond the bbox; the paper lets that pass")
    return (
        OK if reach < AUTHORS.outside else hint(f"{reach:.0%} of a half side is too far for the authors, too")
    )


def _sizes_and_places(program: Program) -> str:
    """What the writer would have corrected: sides beyond those of the bbox, and attaches to its middle; or ""."""
    statements = program.blocks[0].statements
    sides, standing = statements[0].numbers, set()
    for statement in statements[1:]:
        if isinstance(statement, Cuboid) and any(a > b for a, b in zip(statement.numbers, sides)):
            return f"{statement.name} is larger than the bbox: the writer would cut it"
        if isinstance(statement, Attach) and statement.still == BBOX and 0.05 < statement.numbers[4] < 0.95:
            return "an attach to the bbox has to be near its bottom (height up to 0.05) or its top"
        standing |= {getattr(statement, "moved", "")}
    loose = [s.name for s in statements[1:] if isinstance(s, Cuboid) and s.name not in standing]
    return f"{loose[0]} is attached to nothing: the writer would drop it" if loose else ""


def _reach(shape: Shape, program: Program) -> Float[Tensor, ""]:
    """How far cuboids reach beyond the bbox, as a share of its half sides."""
    corners = shape.cuboids.corners()
    half = corners.new_tensor(program.blocks[0].statements[0].numbers) / 2
    return (corners.abs() / half - 1).amax().clamp(min=0)


def check_arc(function: object) -> str:
    """Exercise 5.4: function(a (n,), b (n,), share) -> the code at that share of the way along the arc from a to b."""
    if function is None:
        return UNANSWERED
    if not callable(function):
        return hint(f"the answer is a function, this is of type {type(function).__name__}")
    a, b = torch.randn(2, 256, generator=torch.Generator().manual_seed(54), dtype=torch.float64)
    a, b = a * 16 / a.norm(), b * 16 / b.norm()
    try:
        on_way = torch.stack(
            [torch.as_tensor(function(a.clone(), b.clone(), s)).double() for s in (0, 0.25, 0.5, 1)]
        )
    except Exception as error:  # whatever a reader's function does, it becomes a hint
        return hint(f"it raised {type(error).__name__}: {str(error)[:150]}")
    if on_way.shape != (4, 256):
        return hint(f"a code has 256 numbers, this has the shape {tuple(on_way.shape[1:])}")
    return _on_arc(a, b, on_way)


def _on_arc(a: Tensor, b: Tensor, on_way: Float[Tensor, "4 n"]) -> str:
    length, angle = a.norm(), torch.acos(a @ b / a.norm() / b.norm())
    if not (on_way[0] - a).norm() < NEAR * length or not (on_way[3] - b).norm() < NEAR * length:
        return hint("share 0 should give a, share 1 should give b")
    if abs(on_way[2].norm() - length) > NEAR * length:
        return hint(f"a and b are {length:.1f} long, half-way the code is {on_way[2].norm():.2f} long")
    quarter = torch.acos((on_way[1] @ a / on_way[1].norm() / length).clamp(-1, 1)) / angle
    if abs(quarter - 0.25) > NEAR or abs(on_way[1].norm() - length) > NEAR * length:
        return hint(f"at share 0.25 the code has gone {quarter:.1%} of the angle, it should be a quarter")
    return OK


def check_taller(answer: object, network: ProgramVAE, programs: Sequence[Program]) -> str:
    """Exercise 5.5: what to add to the codes of these chairs, (latent,), so that they become taller for their width."""
    if answer is None:
        return UNANSWERED
    try:
        change = torch.as_tensor(answer).detach().float()
    except Exception:
        return hint(f"the answer is a tensor of numbers, this is of type {type(answer).__name__}")
    if change.shape != (network.config.hidden,) or not change.isfinite().all():
        return hint(
            f"a change of a code has {network.config.hidden} finite numbers, not {tuple(change.shape)}"
        )
    start = codes(network, programs)
    before, after = (
        _typical_slenderness(write(network, code, "skip").accepted) for code in (start, start + change)
    )
    if before is None or after is None:
        return hint("hardly any of the changed codes gives a program: is the change too large?")
    if after < TALLER * before:
        return hint(
            f"height / width was {before:.2f} and is {after:.2f}; make it at least {TALLER * before:.2f}"
        )
    return OK


def _typical_slenderness(programs: Sequence[Program], fewest: int = 3) -> float | None:
    """The median; None for too few programs."""
    if len(programs) < fewest:
        return None
    return float(torch.tensor([slenderness(shape) for shape in execute_many(programs)]).median())
