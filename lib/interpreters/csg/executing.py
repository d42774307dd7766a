"""Program -> shape, one or a batch of any structures."""

from collections.abc import Sequence

import torch
from jaxtyping import Int
from torch import Tensor

from ..quoting import quoted
from .errors import ProgramError
from .machine import run
from .program import LONGEST, Primitive, Program
from .shape import Shape, Shapes
from .vocabulary import Vocabulary, vocabulary_of


def execute(program: Program) -> Shape:
    """The shape of one program: a picture in the plane, a grid of voxels in space.

    Raises ProgramError for what is no Program.
    """
    if not isinstance(program, Program):
        raise ProgramError(f"found a {type(program).__name__}", expected="a Program, see parse(text)")
    return execute_many([program])[0]


def execute_many(
    programs: Sequence[Program] | Int[Tensor, "programs length"],
    vocabulary: Vocabulary | None = None,
    dimensions: int | None = None,
    device: torch.device | str | None = None,
) -> Shapes:
    """The shapes of many programs, in order, `shapes.valid` telling which of them were programs at all.

    programs    Programs of one dimension with any primitives; or what networks write: tokens, each row a program in the
                given vocabulary that ends at the first `$`. Rows that are not valid make blank shapes.
    vocabulary  what the tokens mean: that of the plane, or of `dimensions` (2 or 3), if left out. Programs may have
                primitives of no vocabulary, so they do not need one.
    device      where to compute: that of the tokens, if left out.
    Raises ProgramError for what are no Programs, for Programs of both dimensions, and for numbers that are no tokens.
    """
    if dimensions not in (None, 2, 3):
        raise ValueError(f"found {dimensions} dimensions; expected 2 or 3")
    if isinstance(programs, Program):
        raise ProgramError("found one Program", expected="a sequence of them, or execute(program)")
    if isinstance(programs, str):
        raise ProgramError("found a str", expected="a sequence of Programs, see parse(text)")
    if isinstance(programs, Tensor):
        vocabulary = vocabulary or vocabulary_of(dimensions or 2)
        tokens = checked(programs, vocabulary)
    else:
        tokens, vocabulary = _spell(list(programs), vocabulary, dimensions)
    device = tokens.device if device is None else torch.device(device)
    tokens = tokens.to(device, torch.int64)
    words, valid = run(_without_padding(tokens, vocabulary.stop), vocabulary.canvases(device))
    return Shapes(words, valid, tokens, vocabulary)


def checked(tokens: Tensor, vocabulary: Vocabulary) -> Int[Tensor, "programs length"]:
    """The tokens as int64. Raises ProgramError, naming row and place, for what cannot be tokens."""
    if tokens.ndim != 2 or tokens.is_floating_point() or tokens.is_complex() or tokens.dtype == torch.bool:
        found = f"the tokens are a tensor {tuple(tokens.shape)} of {tokens.dtype}"
        raise ProgramError(found, expected="whole numbers (programs, length)")
    if tokens.shape[1] > LONGEST:
        raise ProgramError(f"the programs have {tokens.shape[1]} tokens", expected=f"at most {LONGEST}")
    if not vocabulary.primitives:
        raise ProgramError("the vocabulary has no primitives", expected="one or more")
    tokens = tokens.long()  # before comparing: 399 does not fit 8 bits
    if not tokens.numel() or (tokens.min() >= 0 and tokens.max() <= vocabulary.stop):
        return tokens
    row, place = ((tokens < 0) | (tokens > vocabulary.stop)).nonzero()[0].tolist()
    token = int(tokens[row, place])
    expected = vocabulary.expected_for(token, "dimensions=3")
    raise ProgramError(f"'{token}' is not a token, in program {row}", place, str(token), expected)


def _without_padding(tokens: Tensor, stop: int) -> Int[Tensor, "programs shorter"]:
    """The tokens without the columns at the end that are nothing but `$`; at least one column stays."""
    used = (tokens != stop).any(0).nonzero()
    if not len(used):  # nothing but empty programs
        return tokens.new_full((len(tokens), 1), stop)
    return tokens[:, : int(used[-1]) + 1]


def _spell(
    programs: list[Program], vocabulary: Vocabulary | None, dimensions: int | None
) -> tuple[Tensor, Vocabulary]:
    """The programs' tokens, in a vocabulary of the primitives that they have unless one is given."""
    for place, program in enumerate(programs):
        if not isinstance(program, Program):
            expected = "a Program, see parse(text), or all tokens in one torch tensor"
            raise ProgramError(f"item {place} is a {type(program).__name__}", expected=expected)
    primitives: dict[Primitive, None] = {}
    for program in programs:
        primitives |= dict.fromkeys(program.primitives)
    worlds = {primitive.dimensions for primitive in primitives} | ({dimensions} if dimensions else set())
    if len(worlds) > 1:
        wanted = dimensions or programs[0].dimensions
        other = next(program for program in programs if program.dimensions != wanted)
        found = f"{quoted(other.to_text())} has {other.dimensions} dimensions"
        raise ProgramError(found, token=other.to_text(), expected=f"programs with {wanted} only")
    vocabulary = vocabulary or Vocabulary(primitives, *worlds)
    length = max(map(len, programs), default=0)
    rows = [program.tokens(vocabulary, length) for program in programs]
    return torch.stack(rows) if rows else torch.zeros((0, 0), dtype=torch.int64), vocabulary
