"""The PointNet: order and place of points do not matter, a checkpoint is the network, and its training learns."""

import pytest
import torch

from data_scripts import train_point_net
from lib.models.point_net import PRETRAINED, PointNet, PointNetConfig
from lib.models.weights import load, save
from lib.training.point_net import PointNetSchedule, new_point_net, train_epochs

CONFIG = PointNetConfig(("ball", "cube", "rod"), widths=(16, 32, 64), transform_widths=(8, 16), head_width=32)


def cloud(kind: int, generator: torch.Generator, n: int = 96) -> torch.Tensor:
    """Points of a ball, a cube or a rod, anywhere."""
    points = 2 * torch.rand(n, 3, generator=generator) - 1
    if kind == 0:
        points /= points.norm(dim=1, keepdim=True)
    if kind == 2:
        points = points * torch.tensor([0.1, 1, 0.1])
    return points + torch.randn(3, generator=generator)


def clouds(count: int, seed: int):
    generator = torch.Generator().manual_seed(seed)
    labels = torch.arange(count) % 3
    return torch.stack([cloud(int(kind), generator) for kind in labels]), labels


@pytest.fixture(scope="module")
def trained():
    """A network after eight epochs, with its losses."""
    network = new_point_net(CONFIG, seed=0)
    points, labels = clouds(120, seed=1)
    losses = list(
        train_epochs(network, points, labels, PointNetSchedule(epochs=8, batch=12, points=64), seed=0)
    )
    return network.eval(), losses


def test_shapes_of_features_and_logits(trained):
    points, _ = clouds(4, 5)
    assert trained[0].features(points).shape == (4, 64)
    assert trained[0](points).shape == (4, 3)


def test_neither_order_nor_place_nor_repetition_of_points_matters(trained):
    points, _ = clouds(5, seed=2)
    features = trained[0].features(points)
    for same in (points.flip(1), points + torch.tensor([3.0, -2, 1]), torch.cat([points, points], 1)):
        torch.testing.assert_close(trained[0].features(same), features, rtol=1e-4, atol=1e-4)  # float32


def test_size_matters(trained):
    points, _ = clouds(5, seed=2)
    assert not torch.allclose(trained[0].features(2 * points), trained[0].features(points), atol=0.1)


def test_a_new_network_leaves_its_points_as_they_are():
    network = new_point_net(CONFIG, seed=0)
    assert not network.transform.weight.any() and not network.transform.bias.any()


def test_training_learns_to_tell_shapes_apart(trained):
    network, losses = trained
    points, labels = clouds(60, seed=3)
    assert losses[-1] < 0.5 * losses[0]
    assert (network(points).argmax(1) == labels).float().mean() > 0.9  # a third by chance


def test_the_same_seed_gives_the_same_weights():
    points, labels = clouds(24, seed=4)
    schedule = PointNetSchedule(epochs=1, batch=8, points=32)
    weights = []
    for seed in (0, 0, 1):
        network = new_point_net(CONFIG, seed)
        torch.rand(seed + 5)  # what others draw does not matter
        list(train_epochs(network, points, labels, schedule, seed))
        weights.append(torch.cat([tensor.flatten().double() for tensor in network.state_dict().values()]))
    assert torch.equal(weights[0], weights[1]) and not torch.equal(weights[0], weights[2])


def test_a_last_batch_of_one_is_left_out_and_one_cloud_is_refused():
    points, labels = clouds(9, seed=4)
    network = new_point_net(CONFIG, 0)
    assert len(list(train_epochs(network, points, labels, PointNetSchedule(epochs=2, batch=4), 0))) == 2
    with pytest.raises(ValueError, match="found 1 clouds"):
        next(train_epochs(network, points[:1], labels[:1], PointNetSchedule(), 0))


def test_a_saved_network_answers_the_same(trained, tmp_path):
    points, _ = clouds(3, seed=6)
    save(trained[0], tmp_path / "net")
    assert torch.equal(load(PointNet, tmp_path / "net")(points), trained[0](points))


def test_the_committed_weights_load_and_have_a_card():
    network = load(PointNet, PRETRAINED)
    assert network.features(torch.rand(2, 50, 3)).shape == (2, network.config.widths[-1])
    assert PRETRAINED.stat().st_size < 2e6
    card = PRETRAINED.with_suffix(".md").read_text()
    assert "Licence: " in card and "| seed |" in card and str(PRETRAINED.parents[1]) not in card


def test_the_quick_training_writes_weights_and_a_card(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "none"))
    out = tmp_path / "new" / "net.safetensors"
    assert train_point_net.main(["--quick", "--out", str(out)]) == 0
    labels = load(PointNet, out).config.labels
    assert labels[0].startswith("chair, up to ") and labels[-1].endswith(" or more leaf parts")
    assert "embedded" in out.with_suffix(".md").read_text()
    assert "kept in" in capsys.readouterr().out


def test_a_place_that_cannot_be_written_is_told_first(tmp_path, capsys):
    assert train_point_net.main(["--quick", "--out", str(tmp_path)]) == 1
    assert "is a folder" in capsys.readouterr().err
    (tmp_path / "net.md").mkdir()
    assert train_point_net.main(["--quick", "--out", str(tmp_path / "net.safetensors")]) == 1
    assert "net.md is a folder" in capsys.readouterr().err


def test_bad_options_are_told_before_training(tmp_path, capsys):
    out = tmp_path / "net.md"  # the card, which has this name, would replace the weights
    assert train_point_net.main(["--quick", "--out", str(out)]) == 1
    assert "where the card goes" in capsys.readouterr().err and not out.exists()
    assert train_point_net.main(["--quick", "--seed", "-1", "--out", str(tmp_path / "net.safetensors")]) == 1
    assert "--seed is -1; expected 0 to" in capsys.readouterr().err


def test_ranges_of_leaf_parts_have_names():
    names = train_point_net._names({"chair": [3, 6], "table": [5], "storage": [4]})
    assert names[:3] == (
        "chair, up to 3 leaf parts",
        "chair, 4 to 6 leaf parts",
        "chair, 7 or more leaf parts",
    )
    assert len(names) == 7
