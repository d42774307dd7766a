"""Gradients of geometry with respect to a program's numbers, against differences."""

import pytest
import torch

from lib.interpreters.shapeassembly import Program, execute, trace
from tests.programs import program as flat


def grows(program: Program) -> bool:
    """Does growth change any aligned cuboid? (Other attaches never change the size of one.)"""
    for block in program.blocks:
        built = trace(block)[-1].cuboids.size
        declared = [statement for statement in block.statements if statement.command == "Cuboid"][1:]
        if any(s.aligned and (built[i] != built.new_tensor(s.numbers)).any() for i, s in enumerate(declared)):
            return True
    return False


def weigh(corners: torch.Tensor) -> torch.Tensor:
    """(…, leaves, 8, 3) -> (…): a sum in which every coordinate has a weight of its own."""
    flat = corners.flatten(-3)
    return flat @ torch.cos(0.7 * torch.arange(flat.shape[-1], dtype=torch.float64))


def test_gradients_equal_central_differences(programs):
    """Step 1e-6 in float64: rounding costs 1e-16 / 1e-6 = 1e-10 times a sum over some hundred corners, curvature
    less, so 1e-5 leaves a wide margin. Where the two one-sided differences disagree, the step crosses a kink (copies
    are clamped to their partner: many points lie exactly on its faces); those are not compared, and must be few."""
    step, compared, kinks = 1e-6, 0, 0
    for program in programs:
        if grows(program):
            continue  # see the next test
        numbers = program.parameters().requires_grad_()
        value = weigh(execute(program, numbers).cuboids.corners())
        (gradient,) = torch.autograd.grad(value, numbers)
        steps = step * torch.eye(len(numbers), dtype=torch.float64)
        moved = execute(program, torch.cat([steps, -steps]) + numbers.detach()).cuboids.corners()
        up, down = weigh(moved.unflatten(0, (2 * len(numbers), -1))).split(len(numbers))
        smooth = ((up - value) - (value - down)).abs() / step < 1e-5 * (1 + gradient.abs())
        kinks, compared = kinks + int((~smooth).sum()), compared + int(smooth.sum())
        central = ((up - down) / (2 * step)).detach()
        torch.testing.assert_close(gradient[smooth], central[smooth], rtol=1e-5, atol=1e-5)
    assert compared > 1000 and kinks < 0.05 * compared


def test_quirk_the_closest_samples_of_growth_are_constants():
    """As in the authors' program: the shelf pulls the floor up to it, but no gradient flows from shelf to floor."""
    shelf = flat(
        "cube0 = Cuboid(1, 0.5, 1, True)",
        "cube1 = Cuboid(1, 0.3, 1, True)",
        "attach(cube0, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5)",
        "attach(cube1, bbox, 0.5, 0.0, 0.5, 0.5, 0.6, 0.5)",
        "attach(cube0, cube1, 0.5, 1.0, 0.5, 0.5, 0.0, 0.5)",
    )
    height = shelf.parameter_names().index("Program_0:4:attach:4")
    numbers = shelf.parameters().repeat(2, 1)
    numbers[1, height] += 0.1
    numbers.requires_grad_()
    first, second = execute(shelf, numbers).cuboids.size[:, 1].unflatten(0, (2, 2))[:, 0]
    assert (second - first).item() == pytest.approx(0.2)  # a tenth of the box, 2 high
    assert torch.autograd.grad(first, numbers)[0][0, height] == 0


def test_gradients_of_a_batch_are_those_of_each(programs):
    """Up to the order of summation in float64."""
    program = programs[1]
    batch = (program.parameters() * torch.tensor([[1.0], [1.01], [0.99]])).requires_grad_()
    execute(program, batch).cuboids.corners().square().sum().backward()
    for numbers, gradient in zip(batch.detach(), batch.grad, strict=True):
        numbers.requires_grad_()
        execute(program, numbers).cuboids.corners().square().sum().backward()
        torch.testing.assert_close(numbers.grad, gradient, rtol=1e-9, atol=1e-9)


def test_gradients_are_finite(programs):
    for dtype in (torch.float32, torch.float64):
        for program in programs:
            numbers = program.parameters().to(dtype).requires_grad_()
            execute(program, numbers).cuboids.corners().square().sum().backward()
            assert numbers.grad.isfinite().all()
