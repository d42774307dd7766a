"""The network of CSGNet: the paper's sizes, and the same numbers as with the paper's concatenation."""

from dataclasses import replace
from math import prod

import pytest
import torch

from lib.interpreters.csg import vocabulary_of
from lib.models.csgnet import CSGNet, CSGNetConfig
from lib.models.program_vae import ProgramVAE
from lib.models.weights import CheckpointError, load, save
from tests.conftest import unchecked

SIDE = 64
CLOSE = 1e-5  # sums in another order, in float32
SMALL = {
    2: CSGNetConfig(2, 9, (2, 3), (3, 4), (1, 4), (4, 1), "batch", 5, 7, 0.0, 4),
    3: CSGNetConfig(3, 11, (2, 2), (8, 3), (8, 1), (1, 2), "none", 4, 6, 0.0),
}
ONE = {"channels": (4,), "kernels": (3,), "strides": (1,), "pools": (2,)}  # lists of one convolution


def canvases_of(dimensions: int, count: int = 3) -> torch.Tensor:
    """Noise: another half of the pixels ON in each."""
    return torch.rand(count, *(SIDE,) * dimensions, generator=torch.Generator().manual_seed(1)) < 0.5


def tokens_of(config: CSGNetConfig, steps: int, count: int = 3) -> torch.Tensor:
    return torch.randint(config.tokens, (count, steps), generator=torch.Generator().manual_seed(2))


@pytest.fixture(params=[2, 3], ids=["plane", "space"])
def network(request) -> CSGNet:
    """Small, in evaluation mode, and with statistics in its batch norm that are not those of the start."""
    torch.manual_seed(3)
    network = CSGNet(SMALL[request.param])
    network(canvases_of(request.param), tokens_of(network.config, 2))
    return network.eval()


@pytest.fixture
def canvases(network) -> torch.Tensor:
    return canvases_of(network.config.dimensions)


def weights(module: torch.nn.Module) -> int:
    return sum(weight.numel() for weight in module.parameters())


@pytest.mark.parametrize(
    "dimensions, encoder, gru, head, scores, total",
    [
        (2, 5_888, 25_964_544, 4_196_352, 819_600, 31_037_712),
        (3, 3_010_720, 16_551_000, 2_251_500, 9_959_135, 32_621_763),
    ],
)
def test_the_sizes_are_the_papers(dimensions, encoder, gru, head, scores, total):
    """Tables 6 to 9. The authors' network of the plane has 31,037,840: 128 more, a bias of what stands for a token."""
    with torch.device("meta"):  # shapes without memory
        network = CSGNet(CSGNetConfig.paper(dimensions))
    found = [weights(each) for each in (network.encoder, network.gru, network.head, network.scores, network)]
    assert found == [encoder, gru, head, scores, total]


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("make, width", [(CSGNetConfig.paper, 2048), (CSGNetConfig.compact, 1024)])
def test_the_feature_is_as_wide_as_announced(make, width, dimensions):
    config = make(dimensions)
    with torch.device("meta"):
        feature = CSGNet(config).eval().encoder(torch.zeros(1, 1, *(SIDE,) * dimensions)).flatten(1)
    assert feature.shape[1] == config.feature == width
    assert config.tokens == len(vocabulary_of(dimensions))


@pytest.mark.parametrize("dimensions", [2, 3])
def test_compact_weights_fit_into_twelve_megabytes(dimensions):
    with torch.device("meta"):
        network = CSGNet(CSGNetConfig.compact(dimensions))
    of_a_number = 2  # they are kept with --half
    assert sum(of_a_number * prod(weight.shape) for weight in network.state_dict().values()) < 12e6


def test_it_equals_a_gru_on_feature_and_embedding(network, canvases):
    """The paper's words: at each step the GRU sees the feature and the token before, side by side."""
    tokens = tokens_of(network.config, 6)
    feature = network.encoder(canvases.unsqueeze(1).float()).flatten(1)
    hidden = torch.zeros(3, network.config.hidden)
    before, found = torch.full((3,), network.start), network(canvases, tokens)
    for step in range(6):
        seen = torch.cat([feature, network.embedding(before).relu()], 1)
        hidden = network.gru(seen, hidden)  # torch's own GRUCell
        expected = network.scores(network.head(hidden).relu())
        assert torch.allclose(found[:, step], expected, atol=CLOSE)
        before = tokens[:, step]


def test_all_steps_at_once_equal_one_after_another(network, canvases):
    tokens = tokens_of(network.config, 5)
    state, before = network.begin(canvases), torch.full((3, 1), network.start)
    for step, scores in enumerate(network(canvases, tokens).unbind(1)):
        alone, state = network.advance(state, before)
        assert torch.allclose(alone[:, 0], scores, atol=CLOSE)
        before = tokens[:, step : step + 1]


def test_a_token_is_scored_from_those_before_it_only(network, canvases):
    tokens = tokens_of(network.config, 6)
    changed = tokens.clone()
    changed[:, 3] = (tokens[:, 3] + 1) % network.config.tokens
    before, after = network(canvases, tokens), network(canvases, changed)
    assert torch.equal(before[:, :4], after[:, :4])
    assert not torch.allclose(before[:, 4:], after[:, 4:], atol=CLOSE)


def test_the_last_token_changes_nothing(network, canvases):
    """It is scored, and read by nothing."""
    tokens = tokens_of(network.config, 4)
    assert torch.equal(
        network(canvases, tokens), network(canvases, tokens.index_fill(1, torch.tensor([3]), 0))
    )


def test_shapes_are_read_together_as_alone(network, canvases):
    together = network(canvases, tokens_of(network.config, 4))
    for row in range(3):
        alone = network(canvases[row : row + 1], tokens_of(network.config, 4)[row : row + 1])
        assert torch.allclose(alone[0], together[row], atol=CLOSE)
    assert not torch.allclose(network.begin(canvases).feature[0], network.begin(canvases).feature[1])


def test_rows_of_a_state_are_taken_in_any_order(network, canvases):
    """Beam search goes on with some rows, some of them twice."""
    _, state = network.advance(network.begin(canvases), tokens_of(network.config, 2))
    rows, before = torch.tensor([2, 0, 2, 1]), tokens_of(network.config, 1)
    expected = network.advance(state, before)[0][rows]
    assert torch.allclose(network.advance(state[rows], before[rows])[0], expected, atol=CLOSE)


def test_axes_of_a_canvas_are_not_mixed_up(network, canvases):
    """A shape and the same shape with two axes swapped are different shapes."""
    swapped = canvases.transpose(1, 2)
    assert not torch.allclose(network.begin(canvases).feature, network.begin(swapped).feature, atol=CLOSE)


@pytest.mark.parametrize("norm, alone", [("none", True), ("batch", False)])
def test_only_batch_norm_looks_at_the_other_shapes(norm, alone):
    """In training; afterwards none does."""
    torch.manual_seed(0)
    network = CSGNet(replace(SMALL[2], norm=norm))
    canvases = canvases_of(2)
    canvases[1] = False
    for training in (True, False):
        network.train(training)
        same = torch.allclose(
            network.begin(canvases).feature[:1], network.begin(canvases[:1]).feature, atol=CLOSE
        )
        assert same == (alone or not training)


def test_what_is_dropped_does_not_reach_the_next_step():
    """The paper drops what comes out of the GRU, not what it hands on to itself (Table 7)."""
    torch.manual_seed(0)
    network = CSGNet(replace(SMALL[2], dropout=0.5)).eval()
    state, before = network.begin(canvases_of(2)), tokens_of(network.config, 4)
    scores, after = network.advance(state, before)
    scores_dropped, after_dropped = network.train().advance(state, before)
    assert torch.equal(after.hidden, after_dropped.hidden)
    assert not torch.allclose(scores, scores_dropped)


def test_dropout_is_in_encoder_and_decoder():
    with torch.device("meta"):
        plane, space = (CSGNet(CSGNetConfig.paper(dimensions)) for dimensions in (2, 3))
    dropping = [each.p for each in plane.modules() if isinstance(each, torch.nn.Dropout)]
    assert dropping == [0.2] * 4  # three convolutions; one module that the decoder uses twice
    names = [[type(each).__name__ for each in network.encoder[:5]] for network in (plane, space)]
    assert names[0] == ["Conv2d", "ReLU", "Dropout", "MaxPool2d", "Identity"]  # Table 6
    assert names[1] == ["Conv3d", "ReLU", "MaxPool3d", "Dropout", "BatchNorm3d"]  # Table 8


@pytest.mark.parametrize("tokens", [[[3, 400]], [[-1]], [[]], [[0], [0], [0]]])
def test_tokens_that_are_none_are_refused(network, canvases, tokens):
    with unchecked(), pytest.raises(ValueError, match="found tokens .*expected"):
        network(canvases[:1], torch.tensor(tokens, dtype=torch.long))


def test_all_weights_are_moved(network, canvases):
    tokens = torch.arange(network.config.tokens).repeat(3, 2)
    gradients = torch.autograd.grad(network(canvases, tokens).square().sum(), list(network.parameters()))
    assert all(gradient.abs().sum() > 0 for gradient in gradients)


def test_it_is_saved_and_loaded(network, canvases, tmp_path):
    save(network, tmp_path / "csgnet.safetensors")
    loaded = load(CSGNet, tmp_path / "csgnet.safetensors")
    assert loaded.config == network.config and not loaded.training
    tokens = tokens_of(network.config, 4)
    assert torch.equal(loaded(canvases, tokens), network(canvases, tokens))


def test_weights_of_another_network_are_not_loaded(network, tmp_path):
    save(network, tmp_path / "csgnet.safetensors")
    with pytest.raises(CheckpointError, match="CSGNet"):
        load(ProgramVAE, tmp_path / "csgnet.safetensors")


@pytest.mark.parametrize(
    "change",
    [
        lambda canvases: canvases.float(),
        lambda canvases: canvases[0],
        lambda canvases: canvases[:, :32],
        lambda canvases: canvases.unsqueeze(1),
        lambda canvases: canvases[..., :63],
    ],
    ids=["floats", "no batch", "half", "channels", "cut"],
)  # fmt: skip
@pytest.mark.usefixtures("unchecked_shapes")
def test_canvases_of_another_shape_or_type_are_refused(network, canvases, change):
    wrong = change(canvases)
    with pytest.raises(ValueError) as error:
        network.begin(wrong)
    assert f"{str(wrong.dtype)[6:]} {tuple(wrong.shape)}" in str(error.value)
    assert ", ".join(["expected a bool tensor (n", *["64"] * network.config.dimensions]) in str(error.value)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_network_of_the_plane_refuses_grids_and_the_other_way_round(dimensions):
    with pytest.raises(ValueError, match="expected a bool tensor"):
        CSGNet(SMALL[dimensions]).begin(canvases_of(5 - dimensions))


@pytest.mark.parametrize(
    "wrong, message",
    [
        ({"dimensions": 4}, "2 or 3 dimensions"),
        ({"channels": (8, 16)}, "lists of one length"),
        ({"channels": (), "kernels": (), "strides": (), "pools": ()}, "at least 1"),
        ({"channels": (8, 0, 32)}, "at least 1"),
        ({"strides": (0, 1, 1)}, "at least 1"),
        ({"tokens": 4}, "5 tokens"),  # three operations and `$`: nothing to draw
        ({"hidden": 0}, "at least 1"),
        ({"hidden": 12.5}, "whole sizes"),
        ({"pools": (2, 2.0, 2)}, "whole sizes"),
        ({"channels": (), "kernels": (), "strides": (), "pools": ()}, "at least 1"),
        ({"head": 0}, "at least 1"),
        ({"embedding": -1}, "at least 1"),
        ({**ONE, "kernels": (2,), "strides": (4,)}, "as wide as strides"),
        ({**ONE, "kernels": (3,), "strides": (2,)}, "even number"),
        ({**ONE, "pools": (3,)}, "divide 64"),
        ({**ONE, "strides": (128,), "kernels": (128,)}, "divide 64"),
        ({"norm": "layer"}, "'layer'; expected one of none, batch"),
        ({"dropout": 1.0}, "dropout of 1.0"),
        ({"dropout": -0.1}, "dropout of -0.1"),
    ],
)
@pytest.mark.usefixtures("unchecked_shapes")
def test_sizes_that_make_no_network_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        CSGNetConfig(**wrong)


@pytest.mark.parametrize("dimensions", [0, 1, 4, "2"])
@pytest.mark.usefixtures("unchecked_shapes")
def test_sizes_of_other_dimensions_are_refused(dimensions):
    for sizes in (CSGNetConfig.paper, CSGNetConfig.compact):
        with pytest.raises(ValueError, match=f"found {dimensions!r} dimensions; expected 2 or 3"):
            sizes(dimensions)


@pytest.mark.usefixtures("unchecked_shapes")
def test_canvases_that_are_no_tensor_are_refused(network, canvases):
    for wrong, kind in ((canvases.numpy(), "ndarray"), (canvases.tolist(), "list"), (None, "NoneType")):
        with pytest.raises(ValueError, match=f"found canvases as a {kind}; expected a bool tensor"):
            network.begin(wrong)
