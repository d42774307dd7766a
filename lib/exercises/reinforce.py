"""Checkers for 10_csgnet_reinforce, and the picture that one of them is about."""

import math

import numpy as np
import torch
from jaxtyping import Bool
from torch import Tensor

from ..interpreters.csg import Program, ProgramError, execute, parse
from ..metrics.images import IMAGE_DIAGONAL, image_chamfer
from ..models.csgnet_grammar import LONGEST
from . import OK, UNANSWERED, hint

REWARDS, SURE = (0.3, 0.7), 0.8  # exercises 10.1 and 10.2: what the arms pay, and the probability of arm 1
NEAR = 1e-3  # of their numbers
DISTANCE, SHARE = 4.0, 0.1  # exercise 10.4: px, and what is left of the reward there
PERCENT = 0.02  # relative error of its answer that is allowed
CLOSE = 0.5  # exercise 10.5: px to the target


def arrow() -> Bool[Tensor, "64 64"]:
    """Exercise 10.5: an arrow that points up, image[y, x]."""
    y, x = np.mgrid[:64, :64]
    head = (y >= 6) & (y <= 30) & (np.abs(x - 30) <= 0.62 * (y - 6))
    shaft = (y > 30) & (y <= 57) & (np.abs(x - 30) <= 7)
    return torch.from_numpy(head | shaft)


def check_estimates(answer: object) -> str:
    """Exercise 10.1: (estimate if arm 1 was drawn, estimate if arm 0 was drawn, exact slope), without a baseline."""
    found = _numbers(answer, 3)
    if isinstance(found, str):
        return found
    low, high = REWARDS
    wanted = (high * (1 - SURE), -low * SURE, SURE * (1 - SURE) * (high - low))
    about = ("the estimate from arm 1", "the estimate from arm 0", "the exact slope")
    for name, got, right in zip(about, found, wanted):
        if abs(got - right) <= NEAR:
            continue
        if abs(got + right) <= NEAR:
            return hint(f"{name} has the wrong sign")
        return hint(f"{name} is not {got:.4g}")
    return OK


def check_quiet_baseline(answer: object) -> str:
    """Exercise 10.2: the baseline for which both arms give the same estimate."""
    found = _numbers([answer] if answer is not None else None, 1)
    if isinstance(found, str):
        return found
    low, high = REWARDS
    up, down = (high - found[0]) * (1 - SURE), -(low - found[0]) * SURE
    if abs(up - down) <= NEAR:
        return OK
    mean = SURE * high + (1 - SURE) * low
    more = "; that is the mean reward: good, but not noiseless" if abs(found[0] - mean) <= NEAR else ""
    return hint(f"with {found[0]:.4g}, arm 1 gives {up:.4g} and arm 0 gives {down:.4g}{more}")


def check_baseline_function(answer: object) -> str:
    """Exercise 10.3: a function from rewards (pictures, programs) to the mean reward of each picture's *other* ones."""
    if answer is None:
        return UNANSWERED
    if not callable(answer):
        return hint(f"the answer is a function, this is of type {type(answer).__name__}")
    generator = torch.Generator().manual_seed(10)
    for pictures, programs in ((3, 5), (1, 2), (4, 4)):
        rewards = torch.rand(pictures, programs, generator=generator)
        if (verdict := _compared(answer, rewards)) != OK:
            return verdict
    return OK


def _compared(function, rewards: Tensor) -> str:
    pictures, programs = rewards.shape
    others = torch.stack(
        [rewards[:, [j for j in range(programs) if j != k]].mean(1) for k in range(programs)], 1
    )
    try:
        result = function(rewards.clone())
        if result is None:
            return UNANSWERED
        found = torch.as_tensor(result).detach().double()
        found = found.expand(pictures, programs)
    except Exception as error:  # whatever is wrong with a reader's function, it becomes a hint
        return hint(
            f"for {pictures} pictures and {programs} programs it ends in an error ({str(error)[:80]})"
        )
    if torch.allclose(found, others.double(), atol=1e-5):
        return OK
    if torch.allclose(found, rewards.mean(1, keepdim=True).double().expand_as(found), atol=1e-5):
        return hint("a program's own reward is among those averaged; leave it out")
    if torch.allclose(found, rewards.mean().double().expand_as(found), atol=1e-5):
        return hint("every picture has its own mean")
    wanted = f"{others[0, 0]:.3f}"
    return hint(
        f"the first of {programs} programs of the first picture gets {found[0, 0]:.3f}, it should be {wanted}"
    )


def check_power(answer: object) -> str:
    """Exercise 10.4: the power for which an answer DISTANCE px off earns SHARE of what a perfect one earns."""
    found = _numbers([answer] if answer is not None else None, 1)
    if isinstance(found, str):
        return found
    wanted = math.log(SHARE) / math.log(1 - DISTANCE / IMAGE_DIAGONAL)
    if abs(found[0] - wanted) <= PERCENT * wanted:
        return OK
    if not 0 < found[0] < 1e6:
        return hint("a power is a number above 0")
    earned = (1 - DISTANCE / IMAGE_DIAGONAL) ** found[0]
    return hint(f"with the power {found[0]:.4g} it earns {earned:.3g}")


def check_arrow(answer: object) -> str:
    """Exercise 10.5: a program of the plane, at most LONGEST tokens, at most CLOSE px from the arrow."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, str | Program):
        return hint(f"the answer is a program or its text, this is of type {type(answer).__name__}")
    try:
        program = answer if isinstance(answer, Program) else parse(answer)
        if program.dimensions != 2:
            return hint("this is a program of space; write one of the plane, with c, s and t")
        if len(program) > LONGEST[2]:
            return hint(f"{len(program)} tokens; a network may write {LONGEST[2]}")
        image = execute(program).image
    except ProgramError as error:
        return hint(str(error)[:300])
    distance = image_chamfer(arrow(), image).item()
    return OK if distance <= CLOSE else hint(f"it is {distance:.2f} px from the arrow, {CLOSE:g} will do")


def _numbers(answer: object, count: int) -> list[float] | str:
    """So many finite numbers, or what to tell the reader."""
    if answer is None:
        return UNANSWERED
    try:
        found = [float(value) for value in answer]
    except Exception:
        return hint(f"the answer is {'a number' if count == 1 else f'{count} numbers'}")
    if len(found) != count:
        return hint(f"the answer is {count} numbers, this has {len(found)}")
    if not all(map(math.isfinite, found)):
        return hint("the answer is of finite numbers")
    return found
