"""Fréchet distance against known answers, and a classifier that is fooled by what it should be."""

import numpy as np
import pytest
import scipy.linalg
import torch

from lib.metrics.realism import cloud_features, frechet_distance, realism
from lib.models.point_net import PointNetConfig
from lib.training.point_net import PointNetSchedule, new_point_net
from lib.training.realism import percent_fooled

QUICK = PointNetSchedule(epochs=4, batch=8, points=64)


def gaussian(n: int, seed: int, k: int = 4) -> torch.Tensor:
    return torch.randn(n, k, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def whitened(n: int, seed: int, k: int = 4) -> torch.Tensor:
    """Features with mean 0 and covariance 1, exactly."""
    x = gaussian(n, seed, k)
    x = x - x.mean(0)
    return x @ torch.linalg.inv(torch.linalg.cholesky(x.T @ x / (n - 1))).T


def test_known_answers():
    x, y = whitened(50, 0), whitened(70, 1)
    assert frechet_distance(x, y) == pytest.approx(0, abs=1e-12)
    assert frechet_distance(x, y + torch.tensor([3.0, 0, 4, 0])) == pytest.approx(25)  # |mean|²
    assert frechet_distance(x, 3 * y) == pytest.approx(4 * (1 - 3) ** 2)  # Σ (s - t)²


def test_covariances_that_do_not_commute_agree_with_the_matrix_root():
    x, y = gaussian(40, 2) @ gaussian(4, 3), gaussian(60, 4) @ gaussian(4, 5) + 1
    a, b = np.cov(x.T), np.cov(y.T)
    root = scipy.linalg.sqrtm(a @ b).real
    expected = float((x.mean(0) - y.mean(0)).square().sum()) + np.trace(a + b - 2 * root)
    assert frechet_distance(x, y) == pytest.approx(expected, rel=1e-9)


def test_laws():
    x, y = gaussian(30, 6), gaussian(45, 7) * 2 + 1
    distance = frechet_distance(x, y)
    turn = torch.linalg.qr(gaussian(4, 8)).Q
    assert distance > 0 and frechet_distance(y, x) == pytest.approx(distance)
    assert frechet_distance(x.flip(0), y) == pytest.approx(distance)
    assert frechet_distance(x @ turn, y @ turn) == pytest.approx(distance)
    assert frechet_distance(5 * x, 5 * y) == pytest.approx(25 * distance)


@pytest.mark.parametrize("n", [2, 5, 40])
def test_fewer_shapes_than_features_and_features_that_are_always_zero(n):
    x = gaussian(n, 9, 16)
    x[:, 12:] = 0
    assert frechet_distance(x, x) == pytest.approx(0, abs=1e-12)
    assert frechet_distance(x, x + 1) == pytest.approx(16)


def test_the_precision_of_the_features_does_not_limit_the_sums():
    x = (gaussian(30, 1) + 1000).float()  # as variances of 1 beside squares of 10⁶, in float32
    assert frechet_distance(x, x.double()) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    "a, b, told",
    [
        (torch.zeros(1, 3), torch.zeros(4, 3), "features of 1 shapes; expected at least 2"),
        (torch.zeros(4, 3), torch.zeros(4, 2), "3 and 2 features"),
        (torch.zeros(4, 3), torch.full((4, 3), torch.nan), "not finite"),
    ],
)
def test_feature_sets_that_cannot_be_compared(a, b, told, unchecked_shapes):
    with pytest.raises(ValueError, match=told):
        frechet_distance(a, b)


def test_features_of_many_clouds_are_those_of_each():
    network = new_point_net(PointNetConfig(("a", "b"), (8, 16), (4, 8), 8), seed=0).train()
    points = gaussian(70, 1, 30).reshape(70, 10, 3)
    features = cloud_features(network, points)
    assert features.shape == (70, 16) and network.training and not features.requires_grad
    torch.testing.assert_close(cloud_features(network, points[40:43]), features[40:43], rtol=0, atol=1e-6)


def spheres(n: int, seed: int, radius: float = 1.0) -> torch.Tensor:
    """Clouds on spheres of nearly one radius."""
    generator = torch.Generator().manual_seed(seed)
    points = torch.randn(n, 80, 3, generator=generator)
    return (
        points
        / points.norm(dim=-1, keepdim=True)
        * (radius + 0.05 * torch.randn(n, 1, 1, generator=generator))
    )


def test_what_is_the_same_fools_about_half():
    result = percent_fooled(spheres(80, 1), spheres(80, 2), schedule=QUICK, last=2)
    assert (result.fooled + result.doubted) / 2 == pytest.approx(50, abs=20)  # 80 shapes: 3.6 standard errors
    assert (result.held_out, result.epochs) == (40, 2)


def test_what_looks_different_fools_nobody():
    result = percent_fooled(spheres(80, 1, radius=2), spheres(80, 2), schedule=QUICK, last=1)
    assert result.fooled <= 5 and result.doubted <= 5  # two of forty


def test_equal_numbers_of_both_kinds_and_the_same_seed_the_same_share():
    few, many = spheres(20, 1, 1.05), spheres(50, 2)
    first, again = (percent_fooled(few, many, seed=3, schedule=QUICK, last=2) for _ in range(2))
    assert first == again and first.held_out == 10


def test_shares_are_of_verdicts():
    generated = torch.tensor([[True, False, False, False], [True, True, True, False]])
    real = torch.tensor([[True, True, True, False], [True, True, True, True]])
    result = realism(generated, real)
    assert (result.fooled, result.doubted, result.held_out, result.epochs) == (50, 12.5, 4, 2)
    with pytest.raises(ValueError, match="no verdict"):
        realism(generated[:0], real[:0])


def test_too_little_to_judge_is_refused():
    with pytest.raises(ValueError, match="found 7 shapes of one kind; expected at least 8"):
        percent_fooled(spheres(7, 1), spheres(30, 2))
    with pytest.raises(ValueError, match="found 5 last epochs of 4"):
        percent_fooled(spheres(9, 1), spheres(9, 2), schedule=QUICK)
