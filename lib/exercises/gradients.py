"""Checkers for 02_differentiable_programs."""

import torch
from torch import Tensor

from ..interpreters.shapeassembly import Program, ProgramError, execute
from ..metrics.points import chamfer_distance
from . import OK, UNANSWERED, hint


def lamp_center_truth(lamp: Program, names: tuple[str, ...]) -> dict[str, float]:
    """Derivative of the height of the second leaf's center by the named parameters."""
    vector = lamp.parameters().requires_grad_()
    (gradient,) = torch.autograd.grad(execute(lamp, vector).cuboids.center[1, 1], vector)
    return {name: float(gradient[lamp.parameter_names().index(name)]) for name in names}


def check_prediction(answer: object, truth: dict[str, float]) -> str:
    """Exercise 2.1: predicted derivatives by parameter name, each within 0.01."""
    if answer is None:
        return UNANSWERED
    if not isinstance(answer, dict):
        return hint("the answer is a dictionary from names to numbers")
    for name, value in truth.items():
        if name not in answer:
            return hint(f"what about {name}?")
        if abs(answer[name] - value) > 0.01:
            return hint(f"{name}: {answer[name]:g} is not it; what moves when this number grows by 0.1?")
    return OK


def check_loss(answer: object, program: Program) -> str:
    """Exercise 2.2: a loss that is lowest for a shape of height 1 and has a gradient."""
    if answer is None:
        return UNANSWERED
    vector = program.parameters().requires_grad_()
    try:
        loss = answer(program, vector)
        (gradient,) = torch.autograd.grad(loss, vector)
    except (RuntimeError, TypeError, ProgramError) as error:
        return hint(f"the loss must be one number with a gradient ({str(error)[:80]})")
    if not gradient.abs().sum() > 0:
        return hint("its gradient is zero everywhere: does it depend on the shape?")
    low, high = execute(program, vector.detach()).bounds()
    too_tall = bool(high[1] - low[1] > 1)
    step = 0.01 * gradient / gradient.norm()
    now, then = (execute(program, vector.detach() - s).bounds() for s in (0 * step, step))
    shrinks = bool((then[1] - then[0])[1] < (now[1] - now[0])[1])
    return OK if shrinks == too_tall else hint("a step down its gradient moves the height away from 1")


def check_fit(answer: object, program: Program, target: Tensor) -> str:
    """Exercise 2.3: a parameter vector whose shape is nearer to the target than 0.08 (Chamfer distance)."""
    if answer is None:
        return UNANSWERED
    try:
        points = execute(program, answer.detach()).surface_points(len(target), 1)
    except (ProgramError, AttributeError) as error:
        return hint(f"this is no parameter vector of the program ({str(error)[:80]})")
    distance = float(chamfer_distance(points, target))
    return OK if distance < 0.08 else hint(f"the Chamfer distance is {distance:.3f}; below 0.08 will do")
