"""Variants of a program: other numbers in the same structure (ShapeAssembly paper, Figure 8).

Four kinds of change, each drawn from a seeded generator:

    stretch   all cuboids by one factor along each axis of the whole shape: taller, wider, deeper
    resize    each cuboid by factors of its own; with a cuboid that a block fills goes the bbox line of that block, and
              all that is in it
    slide     attachment points, u and v move along, those of one cuboid mostly together, so that it rather moves than
              turns; a point on a face (0 or 1) or in the middle (0.5) stays there: that keeps parts flush and centered
    spread    the distance of translated copies

Attachments hold whatever the numbers are, so parts stay connected as far as the program says so. What it does not say
is checked on the executed shape: the geometry is finite, no box leaves the box it lies in farther than the original's
do or the paper's 10 %, and parts that touch one another or the ground in the original (within the 2 % of
`lib.metrics.rootedness`) do so in the variant. So a variant of a rooted shape is rooted.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from lib.interpreters.shapeassembly import Program, Shape, execute
from lib.interpreters.shapeassembly.program import BBOX, Attach, Cuboid, Squeeze, Statement, Translate
from lib.metrics.rootedness import Links

CANDIDATES = 16  # at once; few more cost as much as one
FEW, LESS = 2, 0.85  # where fewer of the candidates are valid, the next are changed less
MOST = 64  # rounds of candidates
OUTSIDE = 0.1  # of a box's half sides: the paper's rule for what a network may write (Appendix D)
FIXED = (0.0, 0.5, 1.0)  # attachment coordinates with a meaning
ALONE = 0.25  # of the slide: what each point does by itself
NEAR = 0.03  # a network writes 0.01 or 0.98 for these: so near, they count as such


@dataclass(frozen=True)
class Amounts:
    """How far each kind of change goes; 0 switches it off.

    stretch, resize  factors lie between 1 / (1 + x) and 1 + x
    slide            local coordinates move by at most x
    spread           as `stretch`, for distances of copies, which stay at most 1
    """

    stretch: float = 0.4
    resize: float = 0.35
    slide: float = 0.12
    spread: float = 0.15

    def times(self, share: float) -> "Amounts":
        """A share of all of them."""
        return Amounts(**{name: share * amount for name, amount in vars(self).items()})


def variants(program: Program, count: int, seed: int = 0, amounts: Amounts | None = None) -> list[Program]:
    """`count` programs of the same structure and with other numbers; the same for every larger `count`.

    Where few changes of a program leave it valid, smaller ones are made. Raises ValueError where not even these are
    enough, as for a program without a number to change.
    """
    if count < 0:
        raise ValueError(f"found {count} variants to make; expected at least 0")
    rng, amounts = np.random.default_rng(seed), amounts or Amounts()
    share = 1.0  # of the amounts: less where few changes are valid
    original = execute(program)
    reach = float(overhang(original).clamp(min=OUTSIDE))
    found: list[Program] = []
    for _ in range(MOST):
        candidates = torch.stack([_changed(program, rng, amounts.times(share)) for _ in range(CANDIDATES)])
        good = _valid(original, candidates, reach + 1e-9)
        found += [program.with_parameters(numbers) for numbers in candidates[good]]
        if len(found) >= count:
            return found[:count]
        share *= LESS if good.sum() < FEW else 1.0
    raise ValueError(f"found {len(found)} valid variants in {MOST * CANDIDATES} tries; expected {count}")


def overhang(shape: Shape) -> Float[Tensor, ""]:
    """How far boxes reach beyond the box they lie in, as a share of its half sides; the largest, at least 0."""
    parents = torch.tensor(shape.parents)
    inner = (parents >= 0).nonzero().squeeze(-1)
    if not len(inner):  # a program of nothing but a bounding box
        return shape.boxes.size.new_zeros(())
    within = shape.boxes[parents[inner]]
    corners = within.local_many(shape.boxes[inner].corners())
    return ((corners - 0.5).abs() * 2 - 1).amax().clamp(min=0)


def _valid(original: Shape, candidates: Float[Tensor, "n p"], reach: float) -> Bool[Tensor, " n"]:
    shapes = execute(original.program, candidates)
    good = shapes.valid.clone()
    for number in good.nonzero().squeeze(-1).tolist():
        good[number] = bool(overhang(shapes[number]) <= reach)
    at = good.nonzero().squeeze(-1)
    kept, *touching = _touching([original, *(shapes[number] for number in at.tolist())])
    good[at] = torch.tensor([kept <= others for others in touching], dtype=torch.bool)
    return good


def _touching(shapes: list[Shape]) -> list[set[tuple[int, int]]]:
    """For each shape, which pairs of its boxes touch; a box on the ground touches number -1."""
    links = Links.of(shapes)
    first = np.cumsum([0, *links.count])
    owner = np.searchsorted(first, links.pairs[0], side="right") - 1
    found = [{(-1, int(box)) for box in part.nonzero()[0]} for part in links.split(links.on_ground)]
    for shape, (one, other) in zip(owner, (links.pairs - first[owner]).T.tolist()):
        found[shape].add((min(one, other), max(one, other)))
    return found


def _changed(program: Program, rng: np.random.Generator, amounts: Amounts) -> Float[Tensor, " p"]:
    """Other numbers for a program, in text order, rounded to 4 decimals as real programs have them."""
    blocks = {block.name: block for block in program.blocks}
    stretch = _factors(rng, amounts.stretch, 3)
    waiting = [(program.blocks[0].name, np.ones(3))]  # blocks, and how much the box of each was resized
    numbers: dict[str, list[float]] = {}
    for name, own in waiting:  # grows while it is walked: outer blocks before inner ones
        numbers[name], shifts = [], {}
        for statement in blocks[name].statements:
            factor = own
            if isinstance(statement, Cuboid) and statement.name != BBOX:
                factor = own * _factors(rng, amounts.resize, 3)
                if statement.name in blocks:
                    waiting.append((statement.name, factor))
            numbers[name] += _changed_numbers(statement, stretch * factor, shifts, rng, amounts)
    return torch.tensor([n for block in program.blocks for n in numbers[block.name]], dtype=torch.float64)


def _changed_numbers(
    statement: Statement, factor: np.ndarray, shifts: dict, rng: np.random.Generator, amounts: Amounts
) -> list[float]:
    """Other numbers for one statement.

    factor  (3,) what the sides of a cuboid are multiplied by
    shifts  how far all points of each cuboid slide together, local coordinates; new ones are noted
    """
    given = np.asarray(statement.numbers, dtype=float)
    match statement:
        case Cuboid():
            new = given * factor
        case Translate():
            new = np.minimum(given * _factors(rng, amounts.spread, 1), np.maximum(given, 1))
        case Attach(moved=moved) | Squeeze(moved=moved):
            together = shifts.setdefault(moved, rng.uniform(-1, 1, 3))[: len(given)]
            own = rng.uniform(-1, 1, len(given))
            own *= ALONE
            own[-len(together) :] += (
                1 - ALONE
            ) * together  # of an attach: the place on the partner, x2, y2, z2
            new = _slid(given, amounts.slide * own)
        case _:
            new = given
    return new.round(4).tolist()


def _factors(rng: np.random.Generator, amount: float, count: int) -> np.ndarray:
    """As likely to shrink as to grow."""
    return (1 + amount) ** rng.uniform(-1, 1, count)


def _slid(given: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Local coordinates moved along, but not those at a face or in the middle, and none across the middle or a face."""
    low, high = np.where(given < 0.5, 0.0, 0.5), np.where(given < 0.5, 0.5, 1.0)
    fixed = np.abs(given[:, None] - FIXED).min(axis=1) <= NEAR
    return np.where(fixed, given, (given + shift).clip(low, high))
