"""The product of the layers, block by block, against the one big tensor of the textbook."""

import math

import numpy as np
import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode

from lib.interpreters.stump import layers, products
from lib.interpreters.stump.products import STEEPEST, max_product
from tests.random_stumps import random_stump

TEMPERATURES = [None, 1.0, 20.0, STEEPEST]


def textbook(w, g, temperature):
    """The same from the (K, C, points) tensor, the weights held constant in the gradient."""
    every = w.unsqueeze(-1) * g.unsqueeze(-2)
    if temperature is None:
        return every.amax(-3)
    weights = torch.softmax(temperature * every.detach(), -3)
    return (weights * every).sum(-3)


def drawn(*shape, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(*shape, generator=generator, dtype=torch.float64).requires_grad_()


class LargestTensor(TorchDispatchMode):
    """Watches every operation and remembers the most numbers that any result had."""

    most = 0

    def __torch_dispatch__(self, function, types, arguments=(), keywords=None):
        result = function(*arguments, **(keywords or {}))
        if isinstance(result, torch.Tensor):
            self.most = max(self.most, result.numel())
        return result


@pytest.mark.parametrize("temperature", TEMPERATURES)
@pytest.mark.parametrize("block", [1, 17, 1 << 17])
def test_is_the_textbook_product_with_its_gradients(monkeypatch, temperature, block):
    monkeypatch.setattr(products, "_CACHE", block)
    w, g, up = drawn(3, 7, 5), drawn(3, 7, 11, seed=1), drawn(3, 5, 11, seed=2).detach()
    found, expected = max_product(w, g, temperature), textbook(w, g, temperature)
    torch.testing.assert_close(found, expected, atol=1e-12, rtol=0)
    gradients = torch.autograd.grad((found * up).sum(), (w, g))
    torch.testing.assert_close(
        gradients, torch.autograd.grad((expected * up).sum(), (w, g)), atol=1e-12, rtol=1e-12
    )


@pytest.mark.parametrize("temperature", TEMPERATURES)
def test_one_matrix_serves_a_batch(temperature):
    w, g = drawn(4, 3), drawn(2, 6, 4, 5, seed=1)
    found = max_product(w, g, temperature)
    assert found.shape == (2, 6, 3, 5)
    torch.testing.assert_close(found, textbook(w.expand(2, 6, 4, 3), g, temperature), atol=1e-12, rtol=0)
    assert torch.autograd.grad(found.sum(), w)[0].shape == (4, 3)


def test_of_equal_products_the_first_has_the_gradient():
    w, g = torch.ones(3, 1, requires_grad=True), torch.tensor([[0.2], [0.7], [0.7]], requires_grad=True)
    max_product(w, g).sum().backward()
    assert g.grad.flatten().tolist() == [0, 1, 0]
    assert w.grad.flatten().tolist() == pytest.approx([0, 0.7, 0])


def test_a_high_temperature_comes_near_the_maximum():
    w, g = drawn(6, 4), drawn(6, 9, seed=1)
    off = [(max_product(w, g, t) - max_product(w, g)).abs().max().item() for t in (5.0, 20.0, STEEPEST)]
    assert off == sorted(off, reverse=True) and off[-1] < 0.02


@pytest.mark.parametrize("temperature", [None, 20.0])
def test_of_nothing_it_is_nothing(temperature):
    assert max_product(torch.zeros(0, 2), torch.zeros(0, 3), temperature).tolist() == [[0, 0, 0], [0, 0, 0]]


@pytest.mark.parametrize("k", [5, 4096])
def test_extreme_values_stay_finite_in_float32(k):
    w, g = torch.ones(k, 2, requires_grad=True), torch.ones(k, 3, requires_grad=True)
    for temperature in TEMPERATURES:
        for values in (w, w.detach() * 0):
            result = max_product(values, g, temperature)
            assert result.isfinite().all() and torch.autograd.grad(result.sum(), g)[0].isfinite().all()


@pytest.mark.parametrize("temperature", [None, 20.0])
@pytest.mark.parametrize(
    "of_w, of_g", [("float32", "float64"), ("float64", "float32"), ("float16", "float16")]
)
def test_mixed_dtypes_take_the_wider_one(temperature, of_w, of_g):
    w, g = torch.rand(4, 3).to(getattr(torch, of_w)), torch.rand(4, 5).to(getattr(torch, of_g))
    w.requires_grad_(), g.requires_grad_()
    result = max_product(w, g, temperature)
    result.sum().backward()
    assert result.dtype == (torch.float32 if of_w == of_g else torch.float64)
    assert (w.grad.dtype, g.grad.dtype) == (w.dtype, g.dtype)


def test_w_and_g_of_different_length_are_refused(unchecked_shapes):
    with pytest.raises(ValueError, match="K = 1 and g with K = 4; expected the same"):
        max_product(torch.ones(1, 3), torch.ones(4, 5))


@pytest.mark.parametrize("temperature", [0, -1.0, STEEPEST + 1, float("nan")])
def test_a_temperature_out_of_range_is_refused(temperature):
    with pytest.raises(ValueError, match="temperature of .*; expected more than 0, at most 120"):
        max_product(torch.ones(2, 2), torch.ones(2, 2), temperature)


@pytest.mark.parametrize("temperature", [None, 20.0])
def test_no_tensor_of_all_products_is_ever_made(temperature):
    w, g = torch.rand(64, 48, requires_grad=True), torch.rand(64, 4096, requires_grad=True)
    with LargestTensor() as watched:
        max_product(w, g, temperature).sum().backward()
    assert watched.most == 64 * 4096  # the largest input; all products would be 48 times as many


def test_layers_are_the_papers_formulas():
    """F, S and T of arbitrary values, written out as in the paper."""
    occupancy, w_c, w_i, w_u = drawn(4, 9), drawn(4, seed=1), drawn(4, 3, seed=2), drawn(3, seed=3)
    f = w_c[:, None] * (1 - occupancy) + (1 - w_c[:, None]) * occupancy
    s = [min(w_i[k, c] * f[k, n] + 1 - w_i[k, c] for k in range(4)) for c in range(3) for n in range(9)]
    s = torch.stack(s).view(3, 9)
    t = torch.stack([max(w_u[c] * s[c, n] for c in range(3)) for n in range(9)])
    nodes, values = layers.soft(occupancy, w_c, w_i, w_u)
    torch.testing.assert_close(nodes, s)
    torch.testing.assert_close(values, t)


def test_yes_and_no_are_the_formulas_with_zeros_and_ones():
    generator = torch.Generator().manual_seed(0)
    for size in [(1, 1), (5, 3), (8, 0), (3, 6)]:
        inside = torch.rand(20, size[0], 50, generator=generator) < 0.5
        w_c = torch.rand(20, size[0], generator=generator) < 0.5
        w_i = torch.rand(20, *size, generator=generator) < 0.4  # some nodes select nothing
        w_u = torch.rand(20, size[1], generator=generator) < 0.5
        nodes, values = layers.soft(*(each.float() for each in (inside, w_c, w_i, w_u)))
        assert all(
            torch.equal(found, expected > 0.5)
            for found, expected in zip(layers.binary(inside, w_c, w_i, w_u), (nodes, values))
        )


def matrices_of(rng: np.random.Generator, k: int, c: int) -> list[torch.Tensor]:
    """Complement, intersection, union: some nodes select nothing, sometimes nothing is united."""
    return [torch.tensor(rng.random(shape) < share) for shape, share in ((k, 0.4), ((k, c), 0.4), (c, 0.6))]


def by_hand(distances, w_c, w_i, w_u):
    """Signed distances as min and max of lists of numbers."""
    return [
        min(
            (
                max((-d if w_c[k] else d for k, d in enumerate(column) if w_i[k, c]), default=-math.inf)
                for c in range(len(w_u))
                if w_u[c]
            ),
            default=math.inf,
        )
        for column in distances.T.tolist()
    ]


def test_signed_distances_are_the_smallest_of_the_largest():
    """The same numbers, not rounded; and their signs are what `binary` says."""
    rng, found_inside = np.random.default_rng(0), []
    for _ in range(60):
        k, c, m = rng.integers([1, 0, 1], [7, 6, 20])
        distances, matrices = torch.tensor(rng.normal(size=(k, m))), matrices_of(rng, k, c)
        found = layers.signed(distances, *matrices)
        assert found.tolist() == by_hand(distances, *matrices)
        assert torch.equal(found <= 0, layers.binary(distances <= 0, *matrices)[1])
        found_inside += (found <= 0).tolist()
    assert 0.2 < np.mean(found_inside) < 0.8


def test_an_intersection_of_nothing_is_everywhere_and_a_union_of_nothing_nowhere():
    distances, none = torch.tensor([[1.0, -2.0], [3.0, 4.0]]), torch.zeros(2, dtype=torch.bool)
    nodes = torch.tensor([[True, False], [True, False]])  # the second selects nothing
    first, second, both, neither = torch.tensor([[1, 0], [0, 1], [1, 1], [0, 0]]).bool()
    assert layers.signed(distances, none, nodes, first).tolist() == [3, 4]
    assert layers.signed(distances, ~none, nodes, first).tolist() == [-1, 2]
    assert layers.signed(distances, none, nodes, second).tolist() == [-torch.inf] * 2
    assert layers.signed(distances, none, nodes, both).tolist() == [-torch.inf] * 2
    assert layers.signed(distances, none, nodes, neither).tolist() == [torch.inf] * 2
    assert layers.signed(distances, none, nodes[:, :0], none[:0]).tolist() == [torch.inf] * 2


def test_no_signed_distance_is_farther_from_zero_than_the_surface_is_away():
    """Then two of them differ by no more than the way between their points."""
    rng, solids = np.random.default_rng(1), 0
    for _ in range(40):
        stump = random_stump(rng, 3, forms=("box", "sphere", "cylinder", "capped cylinder", "capped cone"))
        places = torch.tensor(rng.uniform(-0.7, 0.7, (60, 3)))
        found = layers.signed(stump.distances(places), *stump.matrices)
        apart = (found.unsqueeze(0) - found.unsqueeze(1)).abs()
        if stump.union.any():
            assert (apart <= torch.cdist(places, places) + 1e-9).all()  # rounding
            solids += 1
    assert solids > 20
