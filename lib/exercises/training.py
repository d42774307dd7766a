"""Checkers for 04_training_a_program_vae."""

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from ..interpreters.shapeassembly import Program, Squeeze
from ..models.program_lines import FIELD, WIDTH, line_of
from . import OK, UNANSWERED, hint

NEAR = 1e-6  # of a number of a line
SHELF = Squeeze("cube3", "cube0", "bbox", "top", (0.1, 0.9))  # exercise 4.1
CUBOIDS = {"bbox": 0, "cube0": 1, "cube1": 2, "cube2": 3, "cube3": 4}  # of its block
PRICE = 0.01  # exercise 4.4: relative error allowed
CODES = 5  # exercise 4.5: random codes that are tried
_ALWAYS = {"command", "cuboids", "aligned", "leaf", "size", "root", "kl"}
_USED_BY = {  # term -> the statements that are asked for it
    "point": {"attach"},
    "axis": {"reflect", "translate"},
    "face": {"squeeze"},
    "uv": {"squeeze"},
    "count": {"translate"},
    "distance": {"translate"},
}


def check_line(answer: object) -> str:
    """Exercise 4.1: SHELF as 63 numbers, in a block with the cuboids of CUBOIDS."""
    if answer is None:
        return UNANSWERED
    try:
        found = [float(value) for value in answer]
    except Exception:
        return hint(f"the answer is a list of {WIDTH} numbers, this is of type {type(answer).__name__}")
    if len(found) != WIDTH:
        return hint(f"a line has {WIDTH} numbers, this has {len(found)}")
    wanted = line_of(SHELF, CUBOIDS)
    for name, where in FIELD.items():
        off = [abs(a - b) for a, b in zip(found[where], wanted[where])]
        if not all(each <= NEAR for each in off):
            return hint(_about_field(name, any(wanted[where])))
    return OK


def _about_field(name: str, used: bool) -> str:
    return (
        f"the field {name!r} should hold something else"
        if used
        else f"squeeze does not use the field {name!r}: 0"
    )


def check_steps(answer: object, lengths: Sequence[int]) -> str:
    """Exercise 4.2: how many nodes still run at each step, for nodes of so many lines (start and end not counted)."""
    if answer is None:
        return UNANSWERED
    try:
        found = [int(value) for value in answer]
    except Exception:
        return hint(f"the answer is a list of whole numbers, this is of type {type(answer).__name__}")
    rows = [length + 2 for length in lengths]
    wanted = [sum(row > step for row in rows) for step in range(max(rows))]
    if len(found) != len(wanted):
        return hint(f"{len(found)} steps; the longest node decides, and start and end are lines, too")
    for step, (got, right) in enumerate(zip(found, wanted)):
        if got != right:
            return hint(f"step {step}: {got} nodes; which of them still have a line there?")
    return OK


def check_silent(answer: object, program: Program) -> str:
    """Exercise 4.3: the terms of the loss that are 0 for a program, whatever a network says."""
    if answer is None:
        return UNANSWERED
    try:
        found = {str(name) for name in answer} if not isinstance(answer, str) else {answer}
    except Exception:
        return hint("the answer is a set of names of terms")
    commands = {statement.command for _, _, statement in program.statements()}
    wanted = {term for term, users in _USED_BY.items() if not users & commands}
    if unknown := sorted(found - _ALWAYS - _USED_BY.keys()):
        return hint(f"there is no term {unknown[0][:40]!r}")
    if wrong := sorted(found & _ALWAYS):
        return hint(f"{wrong[0]!r} is asked of every program")
    if wrong := sorted(found - wanted):
        return hint(f"{wrong[0]!r} is asked of this one: {', '.join(sorted(_USED_BY[wrong[0]] & commands))}")
    return OK if found == wanted else hint(f"{len(found)} of {len(wanted)} found")


def check_price(answer: object, weight: float) -> str:
    """Exercise 4.4: how far off a number may be for the price of an even choice between two, ln 2."""
    if answer is None:
        return UNANSWERED
    try:
        found = float(answer)
    except Exception:
        return hint(f"the answer is a number, this is of type {type(answer).__name__}")
    wanted = math.log(2) / weight
    if abs(found - wanted) <= PRICE * wanted:
        return OK
    if not math.isfinite(found) or found < 0:
        return hint("the answer is a distance: a number of at least 0")
    return hint(f"that costs {weight * found:.3g}; the hesitation costs {math.log(2):.3g}")


def check_kl(answer: object) -> str:
    """Exercise 4.5: a function of mean and log variance, (n, d) each, that returns the KL divergence of each code."""
    if answer is None:
        return UNANSWERED
    if not callable(answer):
        return hint(f"the answer is a function, this is of type {type(answer).__name__}")
    generator = torch.Generator().manual_seed(4)
    mean, log_variance = torch.randn(2, CODES, 3, generator=generator)
    cases = {
        "mean 0, log variance 0": (torch.zeros(CODES, 3), torch.zeros(CODES, 3)),
        "other means": (mean, torch.zeros(CODES, 3)),
        "other variances": (torch.zeros(CODES, 3), log_variance),
        "both": (mean, log_variance),
    }
    for name, (mean, log_variance) in cases.items():
        if (verdict := _check_kl(answer, name, mean, log_variance)) != OK:
            return verdict
    return OK


def _check_kl(function, name: str, mean: Tensor, log_variance: Tensor) -> str:
    """Against torch's own divergence of two normal distributions."""
    normal = torch.distributions.Normal
    wanted = torch.distributions.kl_divergence(normal(mean, (log_variance / 2).exp()), normal(0.0, 1.0)).sum(
        1
    )
    try:
        found = torch.as_tensor(function(mean.clone(), log_variance.clone())).detach().double()
    except Exception as error:  # whatever is wrong with a reader's function, it becomes a hint
        return hint(f"the function ends in an error ({str(error)[:80]})")
    if found.shape != wanted.shape:
        return hint(f"{CODES} codes have {CODES} divergences, this is of shape {tuple(found.shape)}")
    if torch.allclose(found, wanted.double(), atol=1e-4):
        return OK
    if torch.allclose(found, 2 * wanted.double(), atol=1e-4) and name != "mean 0, log variance 0":
        return hint("it is twice too large")
    return hint(
        f"wrong for {name}: {float(found[0]):.3f} for the first code, it should be {float(wanted[0]):.3f}"
    )
