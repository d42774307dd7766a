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
        if not isinstance(answer.get(name), int | float):
            return hint(f"what about {name}? Its derivative is a number")
        if not abs(answer[name] - value) <= 0.01:
            return hint(f"{name}: {answer[name]:g} is not it; what moves when this number grows by 0.1?")
    return OK


def check_loss(answer: object, program: Program) -> str:
    """Exercise 2.2: a loss that has a gradient and is lowest for a shape of height 1, from above and from below."""
    if answer is None:
        return UNANSWERED
    for scale in (1.3, 1.0, 0.7, 0.5):
        vector = (program.parameters() * scale).clamp(max=1.5).requires_grad_()
        verdict = _check_slope(answer, program, vector)
        if verdict != OK:
            return verdict
    return OK


def _check_slope(loss: object, program: Program, vector: Tensor) -> str:
    """Does a small step down the gradient bring the height nearer to 1?"""
    try:
        value = loss(program, vector)
        (gradient,) = torch.autograd.grad(value, vector)
    except Exception as error:  # whatever is wrong with a reader's function, it becomes a hint
        return hint(f"the loss must be one number with a gradient ({str(error)[:80]})")
    if not gradient.abs().sum() > 0:
        return hint("its gradient is zero: does it depend on the height?")
    step = 1e-3 * gradient / gradient.norm()
    before, after = (abs(_height(program, vector.detach() - s) - 1) for s in (0 * step, step))
    return OK if after < before else hint("a step down its gradient moves the height away from 1")


def _height(program: Program, vector: Tensor) -> float:
    low, high = execute(program, vector).bounds()
    return float((high - low)[1])


def check_fit(answer: object, program: Program, target: Tensor, nearer_than: float) -> str:
    """Exercise 2.3: a parameter vector whose shape is nearer to the target than a Chamfer distance (world units)."""
    if answer is None:
        return UNANSWERED
    try:
        points = execute(program, answer.detach().double()).surface_points(len(target), 1)
    except (ProgramError, AttributeError) as error:
        return hint(f"this is no parameter vector of the program ({str(error)[:80]})")
    distance = float(chamfer_distance(points, target))
    wanted = f"below {nearer_than:g} will do"
    return OK if distance < nearer_than else hint(f"the Chamfer distance is {distance:.3f}; {wanted}")
