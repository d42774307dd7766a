"""The largest product as a mean of powers, against the one big tensor of its formula."""

import pytest
import torch

from lib.interpreters.stump import layers
from lib.interpreters.stump.powers import HIGHEST, power_product
from lib.interpreters.stump.products import max_product
from tests.test_stump_products import LargestTensor, drawn

POWERS = [1.0, 8.0, 20.0]


def textbook(w, g, power):
    """The same from the (K, C, points) tensor, the weights held constant in the gradient."""
    every = w.unsqueeze(-1) * g.unsqueeze(-2)
    weights = every.detach() ** power
    return (weights * every).sum(-3) / weights.sum(-3)


@pytest.mark.parametrize("power", POWERS)
def test_is_the_textbook_mean_with_its_gradients(power):
    w, g, up = drawn(3, 7, 5), drawn(3, 7, 11, seed=1), drawn(3, 5, 11, seed=2).detach()
    found, expected = power_product(w, g, power), textbook(w, g, power)
    torch.testing.assert_close(found, expected, atol=1e-12, rtol=0)
    gradients = torch.autograd.grad((found * up).sum(), (w, g))
    torch.testing.assert_close(
        gradients, torch.autograd.grad((expected * up).sum(), (w, g)), atol=1e-12, rtol=1e-10
    )


def test_one_matrix_serves_a_batch():
    w, g = drawn(4, 3), drawn(2, 6, 4, 5, seed=1)
    found = power_product(w, g, 8.0)
    assert found.shape == (2, 6, 3, 5)
    torch.testing.assert_close(found, textbook(w.expand(2, 6, 4, 3), g, 8.0), atol=1e-12, rtol=0)
    assert torch.autograd.grad(found.sum(), w)[0].shape == (4, 3)


def test_it_comes_near_the_maximum_from_below():
    w, g = 0.5 + drawn(6, 4) / 2, 0.5 + drawn(6, 9, seed=1) / 2
    off = [max_product(w, g) - power_product(w, g, power) for power in (1.0, 8.0, HIGHEST)]
    assert all((each > -1e-12).all() for each in off)
    means = [each.mean().item() for each in off]
    assert means == sorted(means, reverse=True) and means[-1] < 0.002


@pytest.mark.parametrize("value", [1.0, 0.5, 0.01])
def test_one_product_alone_and_equal_ones_are_the_maximum(value):
    w = torch.tensor([[1.0, 1.0], [1.0, 0.0]])
    g = torch.full((2, 3), value)
    torch.testing.assert_close(power_product(w, g, 8.0), torch.full((2, 3), value))


def test_of_nothing_and_of_zeros_it_is_nothing():
    assert power_product(torch.zeros(0, 2), torch.zeros(0, 3), 8.0).tolist() == [[0, 0, 0], [0, 0, 0]]
    w, g = torch.zeros(4, 2, requires_grad=True), torch.zeros(4, 3, requires_grad=True)
    result = power_product(w, g, 8.0)
    result.sum().backward()
    assert not result.any() and not w.grad.any() and not g.grad.any()


@pytest.mark.parametrize("value", [1.0, 1e-3, 1e-5, 1e-20, 1e-38])
def test_extreme_values_stay_finite_in_float32(value):
    for power in (8.0, HIGHEST):
        w, g = torch.ones(300, 2, requires_grad=True), torch.full((300, 3), value, requires_grad=True)
        result = power_product(w, g, power)
        assert (0 <= result).all() and (result <= value * 1.001).all()
        for gradient in torch.autograd.grad(result.sum(), (w, g)):
            assert gradient.isfinite().all()


@pytest.mark.parametrize("of_w, of_g", [("float32", "float64"), ("float16", "float16")])
def test_mixed_dtypes_take_the_wider_one(of_w, of_g):
    w, g = torch.rand(4, 3).to(getattr(torch, of_w)), torch.rand(4, 5).to(getattr(torch, of_g))
    w.requires_grad_(), g.requires_grad_()
    result = power_product(w, g, 8.0)
    result.sum().backward()
    assert result.dtype == (torch.float32 if of_w == of_g else torch.float64)
    assert (w.grad.dtype, g.grad.dtype) == (w.dtype, g.dtype)


def test_no_tensor_of_all_products_is_ever_made():
    w, g = torch.rand(64, 48, requires_grad=True), torch.rand(64, 4096, requires_grad=True)
    with LargestTensor() as watched:
        power_product(w, g, 8.0).sum().backward()
    assert watched.most == 64 * 4096


def test_w_and_g_of_different_length_are_refused(unchecked_shapes):
    with pytest.raises(ValueError, match="K = 1 and g with K = 4; expected the same"):
        power_product(torch.ones(1, 3), torch.ones(4, 5), 8.0)


@pytest.mark.parametrize("power", [0, -1.0, HIGHEST + 1, float("nan")])
def test_a_power_out_of_range_is_refused(power):
    with pytest.raises(ValueError, match="power of .*; expected more than 0, at most 64"):
        power_product(torch.ones(2, 2), torch.ones(2, 2), power)


def test_the_layers_take_a_temperature_or_a_power():
    occupancy, w_c, w_i, w_u = drawn(4, 9), drawn(4, seed=1), drawn(4, 3, seed=2), drawn(3, seed=3)
    nodes, values = layers.soft(occupancy, w_c, w_i, w_u, power=8.0)
    f = layers.complement(occupancy, w_c)
    torch.testing.assert_close(nodes, 1 - textbook(w_i, 1 - f, 8.0))
    torch.testing.assert_close(values, textbook(w_u[:, None], nodes, 8.0)[0])
    with pytest.raises(ValueError, match="temperature of 20.0 and a power of 8.0; expected one"):
        layers.soft(occupancy, w_c, w_i, w_u, temperature=20.0, power=8.0)
