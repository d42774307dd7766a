"""The stack machine, for a whole batch of programs at once.

An operation of a program takes what the last two finished parts of it left. Which parts those are depends on the tokens
alone, so they are found first, without any picture (`plan`). Then the pictures are computed in rounds: all unions whose
operands are primitives, all intersections, all subtractions; then all operations on their results, and so on. A round
is one bitwise operation over the stacked canvases of all programs of the batch (`run`). A canvas is a row of 64-bit
words; the machine does not know how many, nor what is drawn on them, so plane and space are the same to it.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Int
from torch import Tensor

LEVEL_BITS = 10  # a level, that is how deep operations are nested, is below 1,024
_WORKSPACE = {
    "cpu": 1 << 19,
    "cuda": 1 << 27,
}  # words worked on in one go: what a core's cache holds, or a GPU
_PLANNED = 1 << 14  # programs whose operands are found in one go
_UNION, _INTERSECT, _SUBTRACT, _STOP = range(4)  # how tokens go on after the primitives


@dataclass(frozen=True)
class Plan:
    """Which pictures the operations of a batch take. Rows are places in the programs, columns are programs.

    A picture is named by a number: below `primitives` it is that primitive, from there on the result at a place of
    the same program.
    """

    primitives: int
    left: Int[Tensor, "length programs"]
    right: Int[Tensor, "length programs"]
    round: Int[
        Tensor, "length programs"
    ]  # 3 * level + operation; 0 where a program has no operation to carry out
    result: Int[Tensor, " programs"]
    valid: Bool[Tensor, " programs"]

    def part(self, start: int, stop: int) -> "Plan":
        """The plan of some of the programs."""
        left, right, rounds = (each[:, start:stop] for each in (self.left, self.right, self.round))
        return Plan(self.primitives, left, right, rounds, self.result[start:stop], self.valid[start:stop])


def plan(tokens: Int[Tensor, "programs length"], primitives: int) -> Plan:
    """Find every operation's operands, and which programs are valid. Tokens: primitives, then + * - and stop."""
    programs, length = tokens.shape
    depth = torch.zeros(programs, dtype=torch.int64, device=tokens.device)
    ended = torch.zeros_like(depth, dtype=torch.bool)
    valid = ~ended
    stack = depth.new_zeros(
        (length // 2 + 3, programs)
    )  # each entry: picture and level, the latter in the low bits
    latest = stack[0]
    left, right, rounds = depth.new_zeros((3, length, programs))
    level_of = (1 << LEVEL_BITS) - 1
    for place, token in enumerate(tokens.t().contiguous()):
        ended = ended | (token == primitives + _STOP)
        draws = token < primitives
        depth = depth + torch.where(ended, 0, torch.where(draws, 1, -1))
        valid = valid & (ended | (depth > 0))
        top = (depth - 1).clamp_(0, len(stack) - 1).unsqueeze(0)
        below = stack.gather(0, top)[0]  # for an operation: the entry under the latest, which it will replace
        level = torch.maximum(below & level_of, latest & level_of) + 1
        left[place], right[place] = below >> LEVEL_BITS, latest >> LEVEL_BITS
        rounds[place] = torch.where(draws | ended, 0, 3 * level + token - primitives)
        entry = torch.where(draws, token << LEVEL_BITS, (primitives + place << LEVEL_BITS) + level)
        latest = torch.where(ended, latest, entry)
        stack.scatter_(0, top, torch.where(ended, below, entry).unsqueeze(0))
    valid = valid & (depth == 1)
    return Plan(primitives, left, right, rounds * valid, latest >> LEVEL_BITS, valid)


def run(
    tokens: Int[Tensor, "programs length"], canvases: Int[Tensor, "primitives words"]
) -> tuple[Int[Tensor, "programs words"], Bool[Tensor, " programs"]]:
    """Each program's picture, and which programs are valid; the others' pictures are blank.

    Tokens count the canvases from 0; after them come + * - and the stop, which ends a program.
    """
    (programs, length), words = tokens.shape, canvases.shape[1]
    pictures = canvases.new_empty((programs, words))
    valid = torch.empty(programs, dtype=torch.bool, device=canvases.device)
    step = max(1, _WORKSPACE[canvases.device.type] // (words * max(1, length // 2)))
    for first in range(0, programs, _PLANNED):
        planned = plan(tokens[first : first + _PLANNED], len(canvases))
        valid[first : first + _PLANNED] = planned.valid
        for start in range(0, len(planned.valid), step):
            part = planned.part(start, start + step)
            _compute(part, canvases, out=pictures[first + start : first + start + len(part.valid)])
    return pictures, valid


def _compute(part: Plan, canvases: Tensor, out: Tensor) -> None:
    """Carry out a plan: round after round, each on rows of one workspace."""
    operations = part.round.flatten().nonzero().squeeze(1)
    rounds = part.round.flatten()[operations]
    rounds, order = rounds.sort(stable=True)
    operations = operations[order]
    program = operations % len(part.valid)
    left = _address(part, part.left.flatten()[operations], program)
    right = _address(part, part.right.flatten()[operations], program)
    result = _address(part, part.result, torch.arange(len(part.valid), device=out.device))
    result = torch.where(part.valid, result, 0)

    drawn = torch.zeros(part.primitives, dtype=torch.bool, device=out.device)
    for addresses in (left, right, result):
        drawn[addresses[addresses < part.primitives]] = True
    drawn = drawn.nonzero().squeeze(1)
    workspace = out.new_empty((len(drawn) + len(operations), out.shape[1]))
    torch.index_select(canvases, 0, drawn, out=workspace[: len(drawn)])
    row = left.new_zeros(part.primitives + part.round.numel())  # of the workspace, for each address
    row[drawn] = torch.arange(len(drawn), device=out.device)
    row[part.primitives + operations] = torch.arange(len(drawn), len(workspace), device=out.device)

    left, right, start = row[left], row[right], len(drawn)
    for kind, many in zip(*(each.tolist() for each in rounds.unique_consecutive(return_counts=True))):
        stop = start + many
        a = workspace.index_select(0, left[start - len(drawn) : stop - len(drawn)])
        b = workspace.index_select(0, right[start - len(drawn) : stop - len(drawn)])
        if kind % 3 == _UNION:
            torch.bitwise_or(a, b, out=workspace[start:stop])
        else:
            torch.bitwise_and(a, b.bitwise_not_() if kind % 3 == _SUBTRACT else b, out=workspace[start:stop])
        start = stop
    torch.index_select(workspace, 0, row[result], out=out)
    out[~part.valid] = 0


def _address(part: Plan, pictures: Tensor, program: Tensor) -> Tensor:
    """Primitives keep their number; results are numbered after them, through all programs of the part."""
    places = pictures - part.primitives
    return torch.where(places < 0, pictures, part.primitives + places * len(part.valid) + program)
