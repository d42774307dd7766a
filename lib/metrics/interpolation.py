"""How smoothly one shape turns into another along a sequence of programs (ShapeAssembly paper, Table 6).

    geometric   mean Chamfer distance between successive shapes, in units of the shape's scale
    program     mean edit distance between successive programs, tokens

The paper takes 100 sequences of 100 steps between random codes. It does not define the scale of a shape; here it is
the diagonal of its bounding box, the mean of the two shapes of a step. Each shape has points of its own, so that a step
of no change at all still measures the distance between two clouds of one surface: 0.033 to 0.041 on the real
validation shapes, most of what the paper reports. Compare with `still_step`, the same measure where nothing moves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from ..interpreters.shapeassembly import Program, Shapes, execute_many
from .chamfer import POINTS
from .cloud_search import paired_distances
from .clouds import surface_points_many
from .program_distance import program_distance


@dataclass(frozen=True)
class StepSize:
    """A row of Table 6: `geometric` in shape scales, `program` in tokens; means over the steps of all sequences."""

    geometric: float
    program: float


# Jones et al. 2020, Table 6, their model ("Ours").
PAPER = {"chair": StepSize(0.0384, 1.33), "table": StepSize(0.0389, 2.48), "storage": StepSize(0.0482, 2.6)}


def step_size(sequences: Sequence[Sequence[Program]], seed: int = 0) -> StepSize:
    """Mean step of several interpolations, each given as its programs in order, both ends included.

    Sequences may differ in length; each step counts once. Raises ValueError for a sequence of fewer than two programs,
    and for a shape without a surface.
    """
    if not sequences:
        raise ValueError("no sequences to measure")
    for number, sequence in enumerate(sequences):
        if len(sequence) < 2:
            raise ValueError(f"sequence {number} has {len(sequence)} programs; expected at least 2")
    steps = [pair for sequence in sequences for pair in zip(sequence, sequence[1:])]
    programs = [program for sequence in sequences for program in sequence]
    last = torch.tensor([len(sequence) for sequence in sequences]).cumsum(0) - 1
    start = torch.ones(len(programs), dtype=torch.bool)
    start[last] = False  # no step begins at the end of a sequence
    geometric = geometric_steps(execute_many(programs), seed)[start[:-1]]
    return StepSize(
        geometric=float(geometric.mean()),
        program=sum(program_distance(one, next_one) for one, next_one in steps) / len(steps),
    )


def geometric_steps(shapes: Shapes, seed: int = 0) -> Float[Tensor, " steps"]:
    """From each shape to the next: Chamfer distance, in units of the two shapes' mean bounding box diagonal."""
    clouds = surface_points_many(shapes, POINTS, seed)
    scale = scales(shapes)
    return paired_distances(clouds[:-1], clouds[1:]) / ((scale[:-1] + scale[1:]) / 2)


def still_step(shapes: Shapes, seed: int = 0) -> float:
    """Mean geometric step from each shape to itself, with other points: what remains where nothing moves."""
    one, other = (surface_points_many(shapes, POINTS, 2 * seed + i) for i in (0, 1))
    return float((paired_distances(one, other) / scales(shapes)).mean())


def scales(shapes: Shapes) -> Float[Tensor, " shapes"]:
    """The diagonal of each shape's bounding box, world units."""
    corners = shapes.cuboids.detach().corners().split(shapes.count)
    return torch.stack([(c.amax((0, 1)) - c.amin((0, 1))).norm() for c in corners]).double().cpu()
