"""CSG-Stump Net's rivals: superquadrics against balls and boxes, UCSG's layers against the tree that they choose."""

import pytest
import torch

from lib.interpreters.stump import Box, Sphere
from lib.models.soft_stump import SoftStump
from lib.models.stump_net import StumpNet, StumpNetConfig
from lib.models.superquadrics import Superquadric
from lib.models.ucsg import UCSG, SoftTree, UCSGConfig
from lib.models.weights import load, save

TINY = UCSGConfig(each=3, layers=3, nodes=2, feature=8, widths=(8,), neighbours=3)


def points(count: int = 300, seed: int = 0) -> torch.Tensor:
    return torch.rand(count, 3, generator=torch.Generator().manual_seed(seed)).double() - 0.5


def test_with_exponents_of_1_it_is_a_ball():
    place = [0.1, -0.2, 0.05]
    found = Superquadric([0.3] * 3, [1.0, 1.0], place).distance(points())
    torch.testing.assert_close(found, Sphere(0.3, place).distance(points()), atol=1e-3, rtol=0)


def test_with_small_exponents_it_is_nearly_a_box():
    half, turn = [0.3, 0.2, 0.35], [0.9, 0.1, 0.3, -0.2]
    box = Box(half, rotation=turn).distance(points(4000))
    found = Superquadric(half, [0.1, 0.1], rotation=turn).distance(points(4000))
    away = box.abs() > 0.02
    assert ((found <= 0) == (box <= 0))[away].all()


def test_an_ellipsoid_by_its_equation():
    half = torch.tensor([0.4, 0.2, 0.1]).double()
    found = Superquadric(half, [1.0, 1.0]).distance(points(2000))
    assert torch.equal(found <= 0, ((points(2000) / half) ** 2).sum(1) <= 1)


def test_gradients_are_finite_also_in_the_middle_and_on_axes():
    numbers = torch.tensor([0.3, 0.2, 0.1, 0.2, 1.8]).requires_grad_()
    places = torch.tensor([[0.0, 0, 0], [0.2, 0, 0], [0, 0, 1e-9], [0.5, 0.5, 0.5]]).requires_grad_()
    distance = Superquadric(numbers[:3], numbers[3:]).distance(places)
    assert distance.isfinite().all()
    for gradient in torch.autograd.grad(distance.sum(), (numbers, places)):
        assert gradient.isfinite().all()


def test_a_network_of_superquadrics():
    torch.manual_seed(0)
    config = StumpNetConfig(
        5, 5, ("superquadric",), "own", complement=False, feature=8, widths=(8,), neighbours=3
    )
    said = StumpNet(config)(points(2 * 30).float().view(2, 30, 3))
    assert isinstance(said, SoftStump) and [type(batch) for batch in said.primitives] == [Superquadric]
    exponents = said.primitives[0].exponents
    assert exponents.shape == (2, 5, 2) and (exponents > 0.1).all() and (exponents < 2).all()
    distances = said.distances(points(40).float().expand(2, -1, -1))
    assert torch.equal(said.inside(distances), (distances <= 0).any(1))
    assert said.occupancy(distances).isfinite().all()


def hand_made(temperature: float = 1e-3, margin: float = 1e-4) -> SoftTree:
    """Layer 1: node 0 is A with B, node 1 is B with C. The last: (A without B) or (B and C)."""
    place = torch.zeros(1, 1, 3)
    primitives = (
        Box(torch.tensor([[[0.4, 0.4, 0.1]]]), place),
        Sphere(torch.tensor([[0.25, 0.3]]), torch.tensor([[[0.0, 0, 0], [0.2, 0, 0]]])),
    )
    first, last = torch.zeros(1, 2, 3, 2), torch.zeros(1, 2, 4 * 2 + 3, 1)
    for node, (left, right) in enumerate([(0, 1), (1, 2)]):
        first[0, 0, left, node] = first[0, 1, right, node] = 1
    last[0, 0, 2 * 2 + 0, 0] = 1  # l - r of node 0
    last[0, 1, 1 * 2 + 1, 0] = 1  # l and r of node 1
    return SoftTree(primitives, (first, last), torch.tensor(margin), torch.full((2,), temperature), None)


def test_layers_choose_and_combine():
    said, places = hand_made(), points(2000).float()
    distances = said.distances(places[None])
    a, b, c = distances[0] <= said.margin / 2
    expected = a & ~b | b & c
    assert torch.equal(said.inside(distances)[0], expected)
    assert said.used().tolist() == [[True, True, True]]
    said.choices[1][0, 1] = said.choices[1][0, 0]  # left and right the same: A without B
    assert said.used().tolist() == [[True, True, False]]
    said = hand_made()
    soft = said.occupancy(distances)[0]
    far = distances[0].abs().amin(0) > 1e-3
    torch.testing.assert_close(soft[far], expected[far].float(), atol=1e-4, rtol=0)


def test_signed_distances_are_min_and_max_along_the_tree():
    said, places = hand_made(), points(2000).float()
    distances = said.distances(places[None])
    a, b, c = distances[0] - said.margin / 2
    expected = torch.minimum(torch.maximum(a, -b), torch.maximum(b, c))
    assert torch.equal(said.signed(distances), expected[None])


def test_a_decided_primitive_ends_where_the_soft_one_is_one_half():
    said, places = hand_made(margin=0.2), points(2000).float()
    distances = said.distances(places[None])
    a, b, c = (1 - distances[0] / 0.2).clamp(0, 1) >= 0.5
    expected = a & ~b | b & c
    assert torch.equal(said.inside(distances)[0], expected)
    assert 20 < (expected != hand_made().inside(distances)[0]).sum()  # without the margin it is another solid
    below = hand_made(margin=-0.2)  # a step of the training may go too far
    assert torch.equal(below.inside(distances), hand_made().inside(distances))


def decided(said: SoftTree, inside: torch.Tensor, row: int) -> torch.Tensor:
    """The tree of one cloud with yes and no: what each layer's nodes make of what they choose, one by one."""
    found = list(inside)
    for logits in said.choices:
        numbers = logits[row].argmax(1).T.tolist()
        pairs = [(found[left], found[right]) for left, right in numbers]
        ways = (lambda p, q: p | q, lambda p, q: p & q, lambda p, q: p & ~q, lambda p, q: q & ~p)
        found = [way(p, q) for way in ways for p, q in pairs] + list(inside)
    return found[0]


def test_signs_are_what_the_decided_tree_says_with_yes_and_no():
    found = []
    for seed in range(20):
        torch.manual_seed(seed)
        said = UCSG(TINY).eval()(points(60).float().view(2, 30, 3))
        distances = (
            said.distances(points(1000).float().expand(2, -1, -1)).detach() + 0.4
        )  # smaller ones: the margin is 1
        signed, half = said.signed(distances), said.margin.detach() / 2
        expected = torch.stack([decided(said, distances[row] - half <= 0, row) for row in range(2)])
        assert torch.equal(signed <= 0, expected) and torch.equal(said.inside(distances), expected)
        found.append(expected.float().mean().item())
    assert sum(0.05 < share < 0.95 for share in found) > 10


@pytest.fixture
def network() -> UCSG:
    torch.manual_seed(0)
    return UCSG(TINY)


def test_noise_is_off_unless_it_is_given(network):
    clouds, places = points(60).float().view(2, 30, 3), points(50).float().expand(2, -1, -1)

    def asked(noise):
        said = network(clouds, noise)
        return said.occupancy(said.distances(places))

    assert torch.equal(asked(None), asked(None))
    first, same, other = (asked(torch.Generator().manual_seed(seed)) for seed in (0, 0, 1))
    assert torch.equal(first, same) and not torch.equal(first, other)


def test_the_network(network, tmp_path):
    clouds, places = points(60).float().view(2, 30, 3), points(50).float().expand(2, -1, -1)
    said = network(clouds)
    assert len(said) == 2
    assert [tuple(each.shape) for each in said.choices] == [(2, 2, 6, 2), (2, 2, 14, 2), (2, 2, 14, 1)]
    distances = said.distances(places)
    assert distances.shape == (2, 6, 50) and said.inside(distances).shape == (2, 50)
    (said.occupancy(distances) - 0.3).square().mean().backward()
    assert all(weight.grad is not None for weight in network.parameters())
    save(network, tmp_path / "net")
    assert torch.equal(load(UCSG, tmp_path / "net")(clouds).choices[1], network.eval()(clouds).choices[1])


def test_too_many_layers_are_refused():
    with pytest.raises(ValueError, match="found 65 layers; expected at most 64"):
        UCSGConfig(layers=65)


@pytest.mark.parametrize("wrong", [{"layers": 0}, {"nodes": 1.5}, {"widths": ()}])
@pytest.mark.usefixtures("unchecked_shapes")
def test_sizes_that_make_no_sense_are_refused(wrong):
    with pytest.raises(ValueError, match="expected whole sizes of at least 1"):
        UCSGConfig(**wrong)
