"""Program -> Shape: compile the blocks, run them as one batch, place the results."""

from collections.abc import Sequence

import torch
from jaxtyping import Float, Num
from torch import Tensor

from .checking import check_block
from .compiling import Compiler
from .errors import ProgramError
from .hierarchy import Layout, place
from .machine import Machine
from .program import Block, Program
from .shape import Shape, Shapes


def execute(program: Program, parameters: Num[Tensor, "*batch p"] | None = None) -> Shape | Shapes:
    """Run one program. Raises ProgramError when the geometry is not finite.

    parameters  (p,) or (batch, p): other numbers for the same structure, in text order; gradients flow to them.
                Their dtype and device are those of the result. Default: the program's own, float64.
    Returns a Shape; for a batch of parameters Shapes, one for each vector (all with the same number of leaves).
    """
    if not isinstance(program, Program):
        raise ProgramError(f"found a {type(program).__name__}", expected="a Program: parse the text first")
    if parameters is None:
        return execute_many([program])[0]
    parameters = parameters if parameters.is_floating_point() else parameters.double()
    wanted = program.parameter_count
    if parameters.ndim not in (1, 2) or parameters.shape[-1] != wanted:
        raise ProgramError(
            f"parameters of shape {tuple(parameters.shape)}", expected=f"({wanted},) or (batch, {wanted})"
        )
    shapes = _run([program], torch.atleast_2d(parameters))
    return shapes[0] if parameters.ndim == 1 else shapes


def execute_many(programs: Sequence[Program], dtype: torch.dtype = torch.float64, device="cpu") -> Shapes:
    """Run many different programs as one batch, in order.

    A program whose geometry is not finite does not stop the others: `shapes.valid` tells, and asking for that
    shape raises its ProgramError.
    """
    programs = list(programs)
    numbers = [n for program in programs for _, _, s in program.statements() for n in s.numbers]
    return _run(programs, torch.tensor([numbers], dtype=dtype, device=device))


def trace(block: Block) -> list[Shape]:
    """The state of a block after each of its statements, as shapes without hierarchy: imperative semantics made
    visible (paper, Figure 4). The first shape, after the bbox line, has no cuboids; boxes that other blocks fill are
    drawn as leaves. Raises ProgramError for a block that makes no sense."""
    check_block(block)
    prefixes = [Block(block.name, block.statements[: stop + 1]) for stop in range(len(block.statements))]
    return list(execute_many([Program.unchecked((prefix,)) for prefix in prefixes]))


def _run(programs: list[Program], parameters: Float[Tensor, "variants p"]) -> Shapes:
    compiler, layout = Compiler(), Layout()
    for program in programs:
        layout.add(program, {block.name: compiler.add(block) for block in program.blocks})
    machine = Machine(compiler, parameters)
    return Shapes(programs, layout, place(layout, machine.state))
