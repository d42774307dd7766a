"""Programs of the plane with their centers and sizes as one tensor: many variants of many, drawn as a batch."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Int
from torch import Tensor

from lib.interpreters.csg import Operation, Primitive, Program, ProgramError
from lib.interpreters.csg.machine import run
from lib.interpreters.csg.packing import unpack
from lib.interpreters.csg.primitives import draw_numbers
from lib.interpreters.quoting import quoted

KINDS = "cst"  # circle, square, triangle
OPERATIONS = "+*-"
LEAST, MOST = torch.tensor([8, 8, 8]), torch.tensor([56, 56, 32])  # x, y, r in the networks' vocabulary
DIGITS = torch.tensor([2**14, 2**7, 1])  # a primitive's numbers as one number, which is quick to sort


@dataclass(frozen=True)
class NumberedPrograms:
    """n programs. Their structure: tokens, kinds, below; their numbers: x, y and r of each primitive.

    tokens   (n, length) -1 - p: the p-th primitive of the program; 0, 1, 2: + * -; 3: it has ended
    kinds    (n, primitives) index into KINDS; -1 where there is none
    below    (n, length, primitives) which primitives a place of the program is made of
    """

    tokens: Int[Tensor, "n length"]
    kinds: Int[Tensor, "n primitives"]
    below: Bool[Tensor, "n length primitives"]
    numbers: Int[Tensor, "n primitives 3"]

    def rows(self, which: Int[Tensor, " some"]) -> "NumberedPrograms":
        """Some of the programs, also repeated."""
        return NumberedPrograms(
            *(each[which] for each in (self.tokens, self.kinds, self.below, self.numbers))
        )

    def limited(self, numbers: Int[Tensor, "n moves primitives 3"]) -> Int[Tensor, "n moves primitives 3"]:
        """The nearest numbers that are allowed: the vocabulary's range, wider where an own number is beyond."""
        own = self.numbers.unsqueeze(1)
        return numbers.maximum(own.minimum(LEAST)).minimum(own.maximum(MOST))

    def words(self) -> Int[Tensor, "n 64"]:
        """The packed pictures. Each different primitive is drawn once."""
        there = self.kinds >= 0
        canvases, which = _drawn(self.kinds[there], self.numbers[there])
        slot = torch.zeros_like(self.kinds)
        slot[there] = which
        primitive = slot.gather(1, (-1 - self.tokens).clamp(min=0))
        return run(torch.where(self.tokens < 0, primitive, len(canvases) + self.tokens), canvases)[0]

    def images(self) -> Bool[Tensor, "n 64 64"]:
        return unpack(self.words())

    def programs(self) -> list[Program]:
        """The programs with their present numbers."""
        return [self._program(row) for row in range(len(self.tokens))]

    def _program(self, row: int) -> Program:
        statements: list[Primitive | Operation] = []
        for token in self.tokens[row].tolist():
            if token == len(OPERATIONS):
                break
            if token >= 0:
                statements.append(Operation(OPERATIONS[token]))
            else:
                kind = KINDS[int(self.kinds[row, -1 - token])]
                statements.append(Primitive(kind, tuple(self.numbers[row, -1 - token].tolist())))
        return Program(tuple(statements))


def _drawn(kinds: Int[Tensor, " k"], numbers: Int[Tensor, "k 3"]) -> tuple[Tensor, Int[Tensor, " k"]]:
    """The canvases of the different ones among primitives, and which of them each is."""
    codes, which = (kinds * 2**21 + numbers @ DIGITS).unique(return_inverse=True)
    canvases = torch.empty((len(codes), 64), dtype=torch.int64)
    for kind, letters in enumerate(KINDS):
        these = codes // 2**21 == kind
        canvases[these] = draw_numbers(letters, codes[these].unsqueeze(1) // DIGITS % 2**7)
    return canvases, which


def numbered(programs: Sequence[Program]) -> NumberedPrograms:
    """Programs of the plane, of any lengths, as tensors. Raises ProgramError for anything else."""
    for program in programs:
        if not isinstance(program, Program) or program.dimensions != 2:
            raise ProgramError(f"found {quoted(str(program))}", expected="Programs of the plane")
    length = max(map(len, programs), default=1)
    most = (length + 1) // 2
    tokens = torch.full((len(programs), length), len(OPERATIONS))
    kinds = torch.full((len(programs), most), -1)
    below = torch.zeros((len(programs), length, most), dtype=torch.bool)
    numbers = torch.zeros((len(programs), most, 3), dtype=torch.long)
    for row, program in enumerate(programs):
        stack: list[Tensor] = []
        primitive = 0
        for place, statement in enumerate(program.statements):
            if isinstance(statement, Operation):
                tokens[row, place] = OPERATIONS.index(statement.symbol)
                right, left = stack.pop(), stack.pop()
                stack.append(left | right)
            else:
                tokens[row, place] = -1 - primitive
                kinds[row, primitive] = KINDS.index(statement.kind)
                numbers[row, primitive] = torch.tensor(statement.numbers)
                stack.append(torch.arange(most) == primitive)
                primitive += 1
            below[row, place] = stack[-1]
    return NumberedPrograms(tokens, kinds, below, numbers)
