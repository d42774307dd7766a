"""Visually guided refinement as in CSGNet's paper (3.2): Powell's method on the centers and sizes of one program.

SciPy's implementation searches along one direction after another, in real numbers; the objective rounds them towards
zero and keeps them in range, as the authors' does, so that it is a landscape of steps. Slow and simple, to compare
`picture_refining` with. (The authors let sizes grow to 56 while they search, and cut them to 32 in the end.)
"""

from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Bool
from scipy.optimize import minimize
from torch import Tensor

from lib.interpreters.checks import whole
from lib.interpreters.csg import Program
from lib.metrics.images import image_chamfer

from .picture_numbers import numbered
from .picture_targets import check_images

TOLERANCE = 1e-4  # the authors'


def refine_by_powell(
    program: Program, target: Bool[Tensor, "64 64"], iterations: int | None = None
) -> tuple[Program, list[float]]:
    """The program with better numbers, and its Chamfer distance to the target, px, before and after each iteration.

    iterations  of Powell's method, at most; None: until they gain less than TOLERANCE
    Raises ProgramError for what is no Program of the plane, ValueError for a target that is no bool image and for less
    than 0 iterations.
    """
    if iterations is not None and (whole(iterations) is None or iterations < 0):
        raise ValueError(f"found {iterations} iterations; expected 0 or more, or None")
    start, target = numbered([program]), check_images(target, 2)[None]
    first = image_chamfer(target, start.images()).item()
    if iterations == 0:  # SciPy would make one
        return program, [first]
    # What the search has met: its own answer may lie between two steps of the landscape.
    best: list = [first, start]
    distances = [first]

    def distance(vector: np.ndarray) -> float:
        numbers = torch.from_numpy(np.trunc(vector).astype(np.int64)).view(start.numbers.shape)
        tried = replace(start, numbers=start.limited(numbers.unsqueeze(1)).squeeze(1))
        found = image_chamfer(target, tried.images()).item()
        if found < best[0]:
            best[:] = found, tried
        return found

    minimize(
        distance,
        start.numbers.flatten().double().numpy(),
        method="Powell",
        tol=TOLERANCE,
        callback=lambda _: distances.append(best[0]),
        options={} if iterations is None else {"maxiter": iterations},
    )
    return best[1].programs()[0], distances
