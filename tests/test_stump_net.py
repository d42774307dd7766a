"""CSG-Stump Net: the paper's sizes, what a new network says, and that decided stumps are what it meant."""

from dataclasses import replace

import pytest
import torch

from lib.interpreters.stump import Box, Cone, Cylinder, Sphere, execute, execute_many, layers
from lib.models.program_vae import ProgramVAE
from lib.models.soft_stump import SoftStump
from lib.models.stump_net import LowRank, StumpNet, StumpNetConfig
from lib.models.weights import CheckpointError, load, save

TINY = StumpNetConfig(8, 6, rank=5, feature=12, widths=(10, 14), neighbours=4)
CONFIGS = {
    "low_rank": TINY,
    "linear": replace(TINY, head="linear"),
    "plain": replace(TINY, complement=False),
}


def clouds(count: int = 3, points: int = 40) -> torch.Tensor:
    return torch.rand(count, points, 3, generator=torch.Generator().manual_seed(1)) - 0.5


@pytest.fixture(params=CONFIGS)
def network(request) -> StumpNet:
    """Small, in evaluation mode, and with outputs that differ from cloud to cloud."""
    torch.manual_seed(3)
    network = StumpNet(CONFIGS[request.param])
    with torch.no_grad():
        for _ in range(20):  # batch norms take the statistics of these clouds
            network(clouds())
        network.eval()
        for name, weight in network.named_parameters():
            if name.startswith(("primitives", "to_")) and weight.ndim == 2:
                weight *= 3
        network.to_union.bias.clamp_(-1, 1)
    return network


def weights(module: torch.nn.Module) -> int:
    return sum(weight.numel() for weight in module.parameters())


def test_the_sizes_are_the_papers():
    """The authors' has 1,536 more in the encoder: two norms that it never uses."""
    with torch.device("meta"):
        network = StumpNet(StumpNetConfig(head="linear", complement=False))
    assert weights(network.encoder) == 76_800 - 1_536
    assert weights(network.decoder) == 2_756_096
    assert weights(network.primitives) == 4_458_624
    assert weights(network.to_intersection) + weights(network.to_union) == 134_807_808
    assert weights(network) == 142_099_328 - 1_536


def test_the_low_rank_head_has_less_than_a_hundredth_of_the_weights():
    with torch.device("meta"):
        linear, low_rank = (StumpNet(StumpNetConfig(head=head)) for head in ("linear", "low_rank"))
    assert 100 * weights(low_rank.to_intersection) < weights(linear.to_intersection)
    assert weights(linear) - weights(low_rank) == weights(linear.to_intersection) - weights(
        low_rank.to_intersection
    )


def test_low_rank_logits_are_the_sum_of_the_formula():
    torch.manual_seed(0)
    head, code = LowRank(7, 4, 3, 5), torch.rand(2, 7)
    p, n, g = (each.detach() for each in (head.of_primitives, head.of_nodes, head.weights(code)))
    expected = [
        [[sum(p[k, d] * g[b, d] * n[c, d] for d in range(5)) for c in range(3)] for k in range(4)]
        for b in range(2)
    ]
    torch.testing.assert_close(head(code).detach(), torch.tensor(expected))


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS)
def test_a_new_network_says_something_sensible(config):
    torch.manual_seed(0)
    said = StumpNet(config).eval()(clouds())
    assert [type(batch) for batch in said.primitives] == [Box, Cylinder, Sphere, Cone]
    for batch in said.primitives:
        assert batch.translation.shape == (3, 2, 3) and batch.translation.abs().max() < 0.5
        assert (0.02 < batch.sizes).all() and (batch.sizes < 0.5).all()
        assert (batch.rotation.norm(dim=-1) > 0.5).all()
    kept = torch.eye(8)[:, :6].bool()
    kept[[0, 1], [2, 3]] = True  # boxes 0 and 1 cut cylinders 2 and 3
    assert torch.equal(said.intersection > 0, kept.expand(3, 8, 6)) and not (said.complement > 0).any()
    assert (said.union > 2).all()


def test_distances_are_those_of_the_primitives_one_by_one(network):
    said, points = network(clouds()), clouds(3, 20)
    distances = said.distances(points)
    for i in range(3):
        singles = [batch[i][k] for batch in said.primitives for k in range(2)]
        expected = torch.stack([primitive.distance(points[i]) for primitive in singles])
        torch.testing.assert_close(distances[i], expected)


def test_decided_stumps_are_what_the_network_decides(network):
    """Also without the primitives and nodes that they do not use."""
    said, points = network(clouds()), clouds(1, 3000)[0]
    inside = said.inside(said.distances(points.expand(3, -1, -1)))
    assert 5 < inside.sum() < 0.9 * inside.numel()
    stumps = said.stumps()
    assert torch.equal(execute_many(stumps).occupancy(points), inside)
    assert all(torch.equal(execute(stump).occupancy(points), row) for stump, row in zip(stumps, inside))
    assert not any(stump.parameters().requires_grad for stump in stumps)
    if network.to_complement is None:
        assert not any(stump.complement.any() for stump in stumps)


def test_signed_distances_are_those_of_the_decided_stumps(network):
    """Negative where `inside` says yes; unused primitives and nodes have no say."""
    said, points = network(clouds()), clouds(1, 2000)[0]
    distances = said.distances(points.expand(3, -1, -1))
    signed = said.signed(distances)
    assert signed.shape == (3, 2000) and torch.equal(signed <= 0, said.inside(distances))
    assert 5 < (signed <= 0).sum() < 0.9 * signed.numel()
    for stump, row in zip(said.stumps(), signed):
        torch.testing.assert_close(layers.signed(stump.distances(points), *stump.matrices), row.detach())


def test_the_steeper_the_nearer_to_the_decided(network):
    said, points = network(clouds()), clouds(3, 300)
    distances = said.distances(points)
    far = distances.abs().amin(1) > 0.05  # from every surface
    off = [
        (said.occupancy(distances, steepness, power=None) - said.inside(distances).float())[far].abs().mean()
        for steepness in (1.0, 4.0, 1000.0)
    ]
    assert off == sorted(off, reverse=True) and off[2] < 0.02


@pytest.mark.parametrize("how", [{"power": 8.0}, {"power": None, "temperature": 20.0}])
def test_gradients_reach_every_weight(how):
    torch.manual_seed(0)
    network = StumpNet(TINY)
    said = network(clouds())
    said.occupancy(said.distances(clouds(3, 50)), **how).square().mean().backward()
    silent = [name for name, weight in network.named_parameters() if not weight.grad.abs().max() > 0]
    assert not silent


def test_the_fields_of_a_soft_stump(network):
    said = network(clouds())
    assert isinstance(said, SoftStump) and len(said) == 3
    assert [tuple(each.shape) for each in said.logits] == [(3, 8), (3, 8, 6), (3, 6)]


def test_saved_and_loaded(network, tmp_path):
    save(network, tmp_path / "net.safetensors")
    again = load(StumpNet, tmp_path / "net.safetensors")
    assert again.config == network.config
    for before, after in zip(network(clouds()).logits, again(clouds()).logits):
        assert torch.equal(before, after)
    with pytest.raises(CheckpointError, match="expected 'ProgramVAE'"):
        load(ProgramVAE, tmp_path / "net.safetensors")


@pytest.mark.parametrize(
    "given, told",
    [
        ({"head": "diagonal"}, "found the head 'diagonal'; expected one of low_rank, linear"),
        ({"primitives": 6}, "found 6 primitives of 4 kinds, .* expected as many of each kind"),
        ({"kinds": ()}, "expected some of box"),
        ({"kinds": ("box", "circle")}, "expected some of box, cylinder, sphere, cone"),
        ({"head": "own", "nodes": 8}, "with the head 'own' as many nodes"),
        ({"nodes": 0}, "sizes of at least 1"),
        ({"widths": (0,)}, "sizes of at least 1"),
        ({"widths": ()}, "one width or more"),
        ({"rank": 1.5}, "whole sizes"),
        ({"neighbours": 0}, "whole sizes"),
    ],
)
@pytest.mark.usefixtures("unchecked_shapes")
def test_configs_that_make_no_sense_are_refused(given, told):
    with pytest.raises(ValueError, match=told):
        StumpNetConfig(**given)


def test_a_union_of_boxes_is_one_of_its_configs():
    """Volumetric primitives: whatever the code says, node c is primitive c."""
    torch.manual_seed(0)
    network = StumpNet(replace(TINY, nodes=8, kinds=("box",), head="own", complement=False)).eval()
    assert network.to_intersection is None
    said, points = network(clouds()), clouds(3, 200)
    distances = said.distances(points)
    assert [type(batch) for batch in said.primitives] == [Box] and distances.shape == (3, 8, 200)
    with torch.no_grad():
        said.union.fill_(1.0)
    assert torch.equal(said.inside(distances), (distances <= 0).any(1))
    expected = (torch.sigmoid(-150 * distances) * torch.sigmoid(said.union[:1, :1, None])).amax(1)
    torch.testing.assert_close(said.occupancy(distances, power=None), expected)
    stump = said.stumps()[0]
    assert (stump.intersection.sum(0) == 1).all()
