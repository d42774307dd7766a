"""The stack machine, for a whole batch of programs at once.

An operation of a program takes what the last two finished parts of it left. Which parts those are depends on the tokens
alone, so they are found first, without any picture (`plan`). Then the pictures are computed in rounds: all unions whose
operands are primitives, all intersections, all subtractions; then all operations on their results, and so on. A round
is one bitwise operation over the stacked canvases of all programs of the batch (`compute`). A canvas is a row of 64-bit
words; the machine does not know how many, nor what is drawn on them, so plane and space are the same to it.
"""

from dataclasses import dataclass
from itertools import pairwise

import torch
from jaxtyping import Bool, Int
from torch import Tensor

from ..threads import one_thread

_LEVEL_BIT = 40  # an entry of the stack: from this bit on its level, below it the number of the picture
_LEVEL = 1 << _LEVEL_BIT
_WORKSPACE = {"cpu": 1 << 20, "cuda": 1 << 27}  # words worked on in one go: some of a cache, or of a GPU
_UNION, _INTERSECT, _SUBTRACT, _STOP = range(4)  # how tokens go on after the primitives


@dataclass(frozen=True)
class Plan:
    """Which pictures the operations of a batch take, sorted so that a round's operations stand together.

    Every picture has a number: a primitive its own, from 0; what place t of program b makes, primitives + t * programs
    + b. Where b is not a valid program there are no operations, and the result is -1.
    """

    makes: Int[Tensor, " operations"]
    left: Int[Tensor, " operations"]
    right: Int[Tensor, " operations"]
    # 0 union, 1 intersect or 2 subtract, and how many, in the operations' order
    rounds: list[tuple[int, int]]
    result: Int[Tensor, " programs"]


def plan(tokens: Int[Tensor, "length programs"], primitives: int) -> Plan:
    """Find every operation's operands, and which programs are valid. Tokens: primitives, then + * - and stop."""
    length, programs = tokens.shape
    operates, top, valid = _stack_places(tokens, primitives)
    number = primitives + torch.arange(length * programs, device=tokens.device).view(length, programs)
    stack = tokens.new_zeros((length // 2 + 3, programs))
    lefts, entries = [], [stack[:1]]
    for at, operate, token, made in zip(*(x.split(1) for x in (top, operates, tokens, number + _LEVEL))):
        left = stack.gather(0, at)  # an operation finds its left operand where its result will stand
        deepest = torch.maximum(left, entries[-1]).bitwise_and_(-_LEVEL)
        entry = torch.where(operate, deepest.add_(made), token)
        stack.scatter_(0, at, entry)
        lefts.append(left), entries.append(entry)
    result = torch.where(valid, stack[0] & _LEVEL - 1, -1)
    operation = (operates & valid).flatten().nonzero().squeeze(1)
    columns = (torch.cat(lefts), torch.cat(entries[:-1]), torch.cat(entries[1:]), tokens - primitives)
    left, right, made, kind = (each.flatten().index_select(0, operation) for each in columns)
    round_of, order = (3 * (made >> _LEVEL_BIT) + kind).sort()
    kinds, many = (each.tolist() for each in round_of.unique_consecutive(return_counts=True))
    makes, left, right = (
        each.index_select(0, order) & _LEVEL - 1 for each in (operation + primitives, left, right)
    )
    return Plan(makes, left, right, [(k % 3, n) for k, n in zip(kinds, many)], result)


def _stack_places(tokens: Tensor, primitives: int) -> tuple[Tensor, Tensor, Tensor]:
    """Which places operate, where on the stack each leaves its picture, and which programs are valid.

    What comes after the stop, and what finds no room on the stack of any valid program, goes to the stack's last place.
    """
    running = tokens != primitives + _STOP
    for before, here in pairwise(running.unbind()):
        here &= before
    operates = running & (tokens >= primitives)
    depth = running.short() - 2 * operates.short()
    for before, here in pairwise(depth.unbind()):
        here += before
    valid = depth[-1] == 1
    for here in ((depth > 0) | ~running).unbind():
        valid &= here
    last = len(tokens) // 2 + 2
    top = torch.where(running & (depth > 0), depth - 1, last).clamp_(max=last).long()
    return operates, top, valid


def compute(
    plan: Plan, row: Int[Tensor, " pictures"], workspace: Int[Tensor, "rows words"], start: int
) -> None:
    """Carry out a plan: round after round, each on rows of one workspace.

    workspace  holds the primitives' canvases in rows before `start`; results are written from there on.
    row        where in the workspace each picture of the plan stands; filled in for the results.
    """
    stop = start + len(plan.makes)
    row[plan.makes] = torch.arange(start, stop, device=row.device)
    sizes = [many for _, many in plan.rounds]
    rooms = (each.split(sizes) for each in (row[plan.left], row[plan.right], workspace[start:stop]))
    for (kind, _), left, right, room in zip(plan.rounds, *rooms):
        a, b = workspace.index_select(0, left), workspace.index_select(0, right)
        if kind == _UNION:
            torch.bitwise_or(a, b, out=room)
        else:
            torch.bitwise_and(a, b.bitwise_not_() if kind == _SUBTRACT else b, out=room)


@one_thread()
def run(
    tokens: Int[Tensor, "programs length"], canvases: Int[Tensor, "primitives words"]
) -> tuple[Int[Tensor, "programs words"], Bool[Tensor, " programs"]]:
    """Each program's picture, and which programs are valid; the others' pictures are blank.

    Tokens count the canvases from 0; after them come + * - and the stop, which ends a program.
    """
    (programs, length), (primitives, words) = tokens.shape, canvases.shape
    device = canvases.device
    pictures = canvases.new_empty((programs, words))
    valid = torch.empty(programs, dtype=torch.bool, device=device)
    room = _WORKSPACE.get(device.type, _WORKSPACE["cuda"])
    step = max(1, min(programs, room // (words * max(1, length // 2))))
    workspace = canvases.new_empty((1 + min(primitives, step * length) + step * (length // 2), words))
    workspace[0] = 0
    for begin in range(0, programs, step):
        some = tokens[begin : begin + step].t().contiguous()
        planned = plan(some, primitives)
        row, start = _load(some, canvases, workspace)
        compute(planned, row, workspace, start)
        valid[begin : begin + step] = planned.result >= 0
        result = torch.where(planned.result < 0, 0, row[planned.result])  # row 0 is blank
        torch.index_select(workspace, 0, result, out=pictures[begin : begin + step])
    return pictures, valid


def _load(tokens: Tensor, canvases: Tensor, workspace: Tensor) -> tuple[Int[Tensor, " pictures"], int]:
    """Copy the canvases that are drawn to the workspace, from row 1 on. Returns where each picture stands, as far as
    that is known, and the first free row."""
    primitives = len(canvases)
    drawn = torch.zeros(primitives + 4, dtype=torch.bool, device=tokens.device)
    drawn[tokens.flatten()] = True
    drawn = drawn[:primitives].nonzero().squeeze(1)
    start = 1 + len(drawn)
    torch.index_select(canvases, 0, drawn, out=workspace[1:start])
    row = drawn.new_empty(primitives + tokens.numel())
    row[drawn] = torch.arange(1, start, device=tokens.device)
    return row, start
