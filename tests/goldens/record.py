"""Records what the interpreter makes of the project's own examples: `python -m tests.goldens.record`.

Writes examples.npz beside this file. Run it when an example is added, or when a change of results is intended, and
look at the examples' pictures before committing: tests/test_shapeassembly_examples.py compares with it.

Per example, in alphabetical order: `name`, `leaves`, `numbers` (how many leaves and parameters); then, one after the
other, the leaves' `size`, `center` and `axes` (rows right, top, front), and `gradient`, for each parameter in text
order d(sum of cos(0.7 j) x_j) with j over all coordinates of all corners. float64.
"""

from pathlib import Path

import numpy as np
import torch

from lib.datasets import examples
from lib.interpreters.shapeassembly import Program, execute

GOLDENS = Path(__file__).parent / "examples.npz"


def measure(program: Program) -> dict[str, np.ndarray]:
    """What is recorded of one program."""
    numbers = program.parameters().requires_grad_()
    leaves = execute(program, numbers).cuboids
    corners = leaves.corners().flatten()
    weights = torch.cos(0.7 * torch.arange(len(corners), dtype=torch.float64))
    (gradient,) = torch.autograd.grad(weights @ corners, numbers)
    leaves = leaves.detach()
    return {name: getattr(leaves, name).numpy() for name in ("size", "center", "axes")} | {
        "gradient": gradient.numpy()
    }


def record() -> None:
    """Measure every example and write the file."""
    programs = examples()
    measured = [measure(program) for program in programs.values()]
    arrays = {name: np.concatenate([each[name] for each in measured]) for name in measured[0]}
    leaves, numbers = ([len(each[name]) for each in measured] for name in ("size", "gradient"))
    np.savez_compressed(GOLDENS, name=np.array(list(programs)), leaves=leaves, numbers=numbers, **arrays)


if __name__ == "__main__":
    record()
    print(f"{GOLDENS}: {GOLDENS.stat().st_size} bytes, {len(examples())} examples")
