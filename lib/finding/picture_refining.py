"""Visually guided refinement: better numbers for a program whose structure and kinds of primitives stay (paper, 3.2).

A network's programs have centers and sizes on a coarse grid. Here they become any whole numbers that bring the outline
of the picture closer to that of a target. The distance changes in jumps, so there is no gradient to follow.

    refine(programs, targets)          coordinate search, all programs at once
    refine_by_powell(program, target)  Powell's method, as in the paper: `picture_powell`

A sweep of the coordinate search goes through the places of a program. At each it tries to move what stands there, a
primitive or all primitives of an operation, by 1, 2, 4, 8 or 16 pixels along x or y; a primitive is also made larger or
smaller, around its center or away from one side, one above or one corner of it. All moves of all programs are drawn as
one batch; those that change nothing on the canvas are not measured; the best, if it is better, is kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from tqdm import tqdm

from lib.interpreters.checks import whole
from lib.interpreters.csg import Program
from lib.interpreters.csg.packing import unpack
from lib.interpreters.threads import one_thread

from .picture_numbers import NumberedPrograms, numbered
from .picture_targets import Targets, targets_of

STEPS = (16, 8, 4, 2, 1)  # pixels
# What a move does to x, y and r of a primitive.
SHIFTS = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))
SIZES = tuple((x, y, r) for r in (1, -1) for x, y in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)))
LEAST_GAIN = 1e-5  # px: less is rounding
MOST_SWEEPS = 100


@dataclass(frozen=True)
class Refined:
    """programs: the best found; distances: (sweeps + 1, n) Chamfer distances, px, before the first sweep and after
    each; history: the numbers (n, primitives, 3) that belong to each row of distances."""

    programs: list[Program]
    distances: Float[Tensor, "sweeps n"]
    history: list[Int[Tensor, "n primitives 3"]]


@one_thread()
def refine(
    programs: Sequence[Program], targets: Bool[Tensor, "n 64 64"], sweeps: int | None = None
) -> Refined:
    """Coordinate search on the centers and sizes of programs of the plane.

    Centers stay in 8..56 and sizes in 8..32, as in the networks' vocabulary, but at every whole number; a number that
    is beyond goes no farther.
    sweeps  how many at most; None: until none is better, or 100
    Works on the CPU. Raises ProgramError for what are no Programs of the plane, ValueError where these and the targets
    are not equally many, for targets that are no bool images, and for other sweeps.
    """
    known = targets_of(targets)
    if not isinstance(programs, Sequence) or len(programs) != len(targets):
        programs = programs if isinstance(programs, Sequence) else ["one that is in no list"]
        raise ValueError(f"found {len(programs)} programs and {len(targets)} targets; expected one for each")
    if sweeps is not None and (whole(sweeps) is None or sweeps < 0):
        raise ValueError(f"found {sweeps} sweeps; expected 0 or more, or None")
    now = numbered(programs)
    active = torch.arange(len(programs))
    distances, history = [known.chamfer(active, now.images())], [now.numbers]
    bar = tqdm(range(MOST_SWEEPS if sweeps is None else sweeps), desc="refining", leave=False, disable=None)
    for _ in bar:
        if not len(active):
            break
        better, found = _sweep(now.rows(active), known.rows(active), distances[-1][active])
        numbers, distance = now.numbers.clone(), distances[-1].clone()
        numbers[active], distance[active] = better.numbers, found
        now = replace(now, numbers=numbers)
        active = active[found < distances[-1][active] - LEAST_GAIN]
        distances.append(distance)
        history.append(numbers)
    return Refined(now.programs(), torch.stack(distances), history)


def _sweep(
    now: NumberedPrograms, targets: Targets, distance: Float[Tensor, " n"]
) -> tuple[NumberedPrograms, Float[Tensor, " n"]]:
    """One pass over the places of every program."""
    for place in range(now.tokens.shape[1]):
        tried = _moves(now, place)
        best, least = _best(now, tried, targets, distance)
        better = least < distance - LEAST_GAIN
        now = replace(now, numbers=torch.where(better.view(-1, 1, 1), best, now.numbers))
        distance = torch.where(better, least, distance)
    return now, distance


def _moves(now: NumberedPrograms, place: int) -> Int[Tensor, "n moves primitives 3"]:
    """The numbers after each move at one place of each program; the same numbers where there is nothing to move."""
    moved = now.below[:, place]  # (n, primitives)
    single = moved.sum(1, keepdim=True) == 1
    shifts, sizes = (torch.tensor(each) for each in (SHIFTS, SIZES))
    directions = torch.cat([shifts, sizes])
    steps = torch.tensor(STEPS).view(-1, 1, 1) * directions  # (steps, directions, 3)
    change = steps.flatten(0, 1).view(1, -1, 1, 3) * moved.view(len(moved), 1, -1, 1)
    resizes = (torch.arange(len(directions)) >= len(shifts)).repeat(len(STEPS)).view(1, -1, 1, 1)
    change = torch.where(resizes & ~single.view(-1, 1, 1, 1), 0, change)
    return now.limited(now.numbers.unsqueeze(1) + change)


def _best(
    now: NumberedPrograms,
    tried: Int[Tensor, "n moves primitives 3"],
    targets: Targets,
    distance: Float[Tensor, " n"],
) -> tuple[Int[Tensor, "n primitives 3"], Float[Tensor, " n"]]:
    """The best numbers of those that were tried for each program, and their distance; its own where nothing changes."""
    n, moves = tried.shape[:2]
    row = torch.arange(n).repeat_interleave(moves)
    same = (tried == now.numbers.unsqueeze(1)).flatten(2).all(2).flatten()
    row, numbers = row[~same], tried.flatten(0, 1)[~same]
    drawn = replace(now.rows(torch.cat([torch.arange(n), row])), numbers=torch.cat([now.numbers, numbers]))
    own, words = drawn.words().tensor_split([n])
    changed = (words != own[row]).any(1)
    row, numbers, words = row[changed], numbers[changed], words[changed]
    if not len(row):
        return now.numbers, distance
    found = targets.chamfer(row, unpack(words))
    least = distance.scatter_reduce(0, row, found, "amin")
    place = torch.where(found == least[row], torch.arange(len(row)), len(row))
    first = torch.full((n,), len(row)).scatter_reduce(0, row, place, "amin")  # of equally good ones
    better = first < len(row)
    best = now.numbers.clone()
    best[better] = numbers[first[better]]
    return best, least
