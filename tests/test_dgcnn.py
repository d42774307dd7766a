"""DGCNN against its definition: an EdgeConv edge by edge, and a feature that knows no order of points."""

import pytest
import torch

from lib.models.dgcnn import DGCNN, EdgeConv, nearest


def clouds(count: int = 2, points: int = 30, seed: int = 0) -> torch.Tensor:
    return torch.rand(count, points, 3, generator=torch.Generator().manual_seed(seed)) - 0.5


def trained_a_little(network: torch.nn.Module) -> torch.nn.Module:
    """In evaluation mode, with statistics in its batch norms that are not those of the start."""
    torch.manual_seed(1)
    for norm in network.modules():
        if isinstance(norm, torch.nn.BatchNorm1d):
            norm.running_mean.normal_()
            norm.running_var.uniform_(0.5, 2)
            torch.nn.init.normal_(norm.weight)
    return network.eval()


def edge_by_edge(conv: EdgeConv, x: torch.Tensor, near: torch.Tensor) -> torch.Tensor:
    """The greatest answer to [x_j - x_i, x_i] over the neighbours j of each point i."""
    rows = []
    for cloud, others in zip(x, near):
        for i, neighbours in enumerate(others):
            edges = torch.stack([torch.cat([cloud[j] - cloud[i], cloud[i]]) for j in neighbours])
            for linear, norm in zip((conv.first, *conv.others), conv.norms):
                edges = torch.nn.functional.leaky_relu(norm(linear(edges)), 0.2)
            rows.append(edges.amax(0))
    return torch.stack(rows).view(*near.shape[:2], -1)


@pytest.mark.parametrize("widths", [(5,), (5, 4)])
def test_an_edge_convolution_is_its_definition(widths):
    torch.manual_seed(0)
    conv = trained_a_little(EdgeConv(3, widths))
    x = clouds()
    near = nearest(x, 4)
    torch.testing.assert_close(conv(x, near), edge_by_edge(conv, x, near), atol=1e-5, rtol=0)


@pytest.mark.parametrize("width", [3, 16])
def test_the_nearest_points(width):
    x = torch.rand(3, 40, width, generator=torch.Generator().manual_seed(2))
    expected = torch.cdist(x, x).topk(6, largest=False).indices
    assert torch.equal(nearest(x, 6).sort().values, expected.sort().values)
    assert nearest(x[:, :4], 6).shape == (3, 4, 4)  # there are no more


def test_the_order_of_the_points_does_not_matter():
    torch.manual_seed(0)
    network = trained_a_little(DGCNN(16, 5))
    x, order = clouds(), torch.randperm(30, generator=torch.Generator().manual_seed(3))
    feature = network(x)
    assert feature.shape == (2, 16) and (feature[0] - feature[1]).abs().max() > 1e-3
    torch.testing.assert_close(network(x[:, order]), feature, atol=1e-5, rtol=0)


def test_once_trained_a_cloud_does_not_depend_on_its_batch():
    torch.manual_seed(0)
    x, network = clouds(3), DGCNN(16, 5)
    for alike in (False, True):
        network.train(not alike)
        off = (network(x)[:1] - network(x[:1])).abs().max()
        assert (off < 1e-5) == alike


def test_it_tells_a_cloud_from_its_smaller_copy():
    torch.manual_seed(0)
    network, x = trained_a_little(DGCNN(16, 5)), clouds(1)
    assert (network(x) - network(0.5 * x)).abs().max() > 1e-2


def test_gradients_reach_every_weight():
    torch.manual_seed(0)
    network = DGCNN(16, 5)
    network(clouds()).square().sum().backward()
    assert all(weight.grad.abs().max() > 0 for weight in network.parameters())


@pytest.mark.parametrize("given", [{"width": 0}, {"neighbours": 0}])
def test_what_makes_no_sense_is_refused(given):
    with pytest.raises(ValueError, match="expected at least 1 of each"):
        DGCNN(**given)
