"""Surfaces of decided fields: closed, where the formula says, and cut off where the cloud ends."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh

from lib.datasets.solid_sampling import by_winding
from lib.interpreters.stump import Box, Cylinder, Sphere
from lib.models.reconstructing import CELL, decided, reconstructed, surface
from lib.models.stump_net import StumpNet
from lib.models.ucsg import UCSG, UCSGConfig
from tests.conftest import unchecked
from tests.test_stump_net import TINY

LOW, HIGH = (
    torch.tensor([-0.3, -0.25, -0.17]),
    torch.tensor([0.28, 0.4, 0.2]),
)  # no symmetry, no two sides alike
CLOUD = torch.stack([LOW, HIGH])
PLACE = torch.tensor([0.05, 0.11, -0.02])
UCSG_TINY = UCSGConfig(each=3, layers=3, nodes=2, feature=8, widths=(8,), neighbours=3)
COARSE = 1 / 32


@pytest.fixture(autouse=True)
def quick():
    """No shape checks: the fields are asked thousands of times."""
    with unchecked():
        yield


def assert_closed(mesh: trimesh.Trimesh) -> None:
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0  # faces look outwards
    assert np.isfinite(mesh.vertices).all()


def test_a_ball_is_where_it_should_be():
    radius = 0.13
    mesh = surface(Sphere(radius, PLACE).distance, CLOUD)
    assert_closed(mesh)
    # A field that is not linear, interpolated: off by at most cell^2 / (8 radius), 0.015 cells.
    away = np.linalg.norm(mesh.vertices - PLACE.numpy(), axis=1) - radius
    assert np.abs(away).max() < CELL**2 / (8 * radius) * 1.05
    assert mesh.center_mass == pytest.approx(PLACE.numpy(), abs=CELL / 100)
    assert mesh.volume == pytest.approx(4 / 3 * math.pi * radius**3, rel=0.015)  # flat faces cut a ball's rim


def test_a_box_is_where_it_should_be():
    half = torch.tensor([0.2, 0.123, 0.07])
    mesh = surface(Box(half, PLACE).distance, CLOUD)
    assert_closed(mesh)
    expected = torch.stack([PLACE - half, PLACE + half]).numpy()
    assert mesh.bounds == pytest.approx(expected, abs=1e-5)  # linear across a face: only rounding is left
    assert mesh.center_mass == pytest.approx(
        PLACE.numpy(), abs=CELL / 20
    )  # edges are cut, by less than a cell
    edges = 8 * float(half.sum())
    assert 0 < 8 * float(half.prod()) - mesh.volume < edges * CELL**2 / 2


def test_with_half_the_cell_a_quarter_of_the_error_is_left():
    radius = 0.15
    off = [
        4 / 3 * math.pi * radius**3 - surface(Sphere(radius, PLACE).distance, CLOUD, cell).volume
        for cell in (COARSE, COARSE / 2, COARSE / 4)
    ]
    assert off[0] / off[1] == pytest.approx(4, rel=0.3) and off[1] / off[2] == pytest.approx(4, rel=0.3)


def test_what_has_no_end_is_closed_at_the_clouds_box():
    """A cylinder along z, and all of space."""
    mesh = surface(Cylinder(0.15, None, PLACE).distance, CLOUD)
    assert_closed(mesh)
    assert mesh.bounds[:, 2] == pytest.approx(CLOUD[:, 2].numpy(), abs=1e-5)
    around = np.array([[-0.15] * 2, [0.15] * 2]) + PLACE[:2].numpy()
    assert mesh.bounds[:, :2] == pytest.approx(around, abs=CELL / 50)
    height = float(HIGH[2] - LOW[2])
    assert mesh.volume == pytest.approx(math.pi * 0.15**2 * height, rel=0.015)  # as the ball's
    everything = surface(lambda points: torch.full((len(points),), -torch.inf), CLOUD)
    assert_closed(everything)
    assert everything.bounds == pytest.approx(CLOUD.numpy(), abs=1e-5)


@pytest.mark.parametrize(
    "field",
    [
        lambda points: torch.ones(len(points)),
        lambda points: torch.full((len(points),), torch.inf),
        Sphere(0.1, [2.0, 0.0, 0.0]).to(torch.float32).distance,
    ],
    ids=["positive", "infinite", "a ball beyond the box"],
)
def test_an_empty_field_has_an_empty_mesh(field):
    mesh = surface(field, CLOUD)
    assert mesh.is_empty and len(mesh.faces) == 0


@pytest.mark.parametrize(
    "cloud, cell, told",
    [
        (CLOUD[:0], 0.1, "without points"),
        (CLOUD * torch.nan, 0.1, "found a box of"),
        (CLOUD * 1e6, 1 / 64, "expected at most 33554432 cells"),
        *((CLOUD, cell, "and cells of") for cell in (0.0, -1.0, torch.nan, torch.inf, 1e-5)),
    ],
)
def test_clouds_and_cells_without_sense_are_told(cloud, cell, told):
    with pytest.raises(ValueError, match=told):
        surface(lambda points: torch.ones(len(points)), cloud, cell)


def test_a_field_that_is_no_number_is_told():
    with pytest.raises(ValueError, match="found a field that is no number"):
        surface(lambda points: torch.where(points[:, 0] > 0, torch.nan, -1.0), CLOUD)


def test_a_field_has_a_number_for_each_point():
    with pytest.raises(
        ValueError, match=r"found a field of shape \([0-9]+, 3\) at [0-9]+ points; expected a number each"
    ):
        surface(lambda points: points, CLOUD, COARSE)


def test_a_cloud_without_thickness_has_an_empty_mesh():
    assert surface(lambda points: -torch.ones(len(points)), CLOUD * torch.tensor([1.0, 1, 0])).is_empty


def test_faces_that_go_through_samples_are_no_problem():
    """Around a cube the samples are (k + 1/2) cells from its middle: 7 1/2 cells are the half of one."""
    cube = torch.tensor([[-0.25] * 3, [0.25] * 3])
    half, seen = 7.5 * CELL, []

    def field(points):
        values = points.abs().amax(1) - half
        seen.append(int((values == 0).sum()))
        return values

    mesh = surface(field, cube)
    assert sum(seen) == 16**3 - 14**3  # the samples on the cube's faces
    assert_closed(mesh)
    assert mesh.bounds == pytest.approx(np.array([[-half] * 3, [half] * 3]), abs=1e-6)
    assert mesh.volume == pytest.approx((2 * half) ** 3, rel=1e-5)
    assert mesh.area == pytest.approx(6 * (2 * half) ** 2, rel=1e-5)


def test_a_field_of_zeros_and_signs_is_closed():
    """0 is inside, as it is everywhere in the language."""
    for seed in range(20):
        generator = torch.Generator().manual_seed(seed)
        mesh = surface(
            lambda points, g=generator: torch.randint(-1, 2, (len(points),), generator=g).float(),
            CLOUD,
            1 / 16,
        )
        assert_closed(mesh)
    zeros = surface(lambda points: torch.zeros(len(points)), CLOUD)
    assert_closed(zeros)
    assert (np.abs(zeros.bounds - CLOUD.numpy()) <= CELL + 1e-6).all()


def test_boxes_that_touch_at_an_edge_are_closed():
    """Between the four samples around the edge the signs are those of a chessboard."""
    cube = torch.tensor([[-0.25] * 3, [0.25] * 3])
    pair = [Box(torch.full((3,), 0.1), torch.tensor([s, s, 0.0])) for s in (-0.1, 0.1)]
    mesh = surface(lambda points: torch.minimum(*(box.distance(points) for box in pair)), cube)
    assert_closed(mesh)
    assert mesh.volume == pytest.approx(2 * 0.2**3, rel=0.03)  # edges are cut


# Networks.


def clouds(count: int = 4, points: int = 60) -> torch.Tensor:
    """Of diagonal 1 around the origin, all different."""
    found = torch.rand(count, points, 3, generator=torch.Generator().manual_seed(1)) - 0.5
    found *= torch.tensor([[1.0, 0.8, 0.5], [0.4, 1.0, 0.7], [0.6, 0.6, 0.6], [1.0, 0.3, 1.0]])[:count, None]
    low, high = found.aminmax(dim=1, keepdim=True)
    return (found - (low + high) / 2) / (high - low).norm(dim=2, keepdim=True)


def untrained(kind: type, seed: int) -> torch.nn.Module:
    """Its primitives two or three times as large as a new network's, so that there is something inside them."""
    torch.manual_seed(seed)
    network = (StumpNet(TINY) if kind is StumpNet else UCSG(UCSG_TINY)).eval()
    with torch.no_grad():
        for head in network.primitives:
            head.numbers.bias.view(head.count, -1)[:, 7:] += 1.5  # after rotation and translation
        if kind is UCSG:
            network.margin.fill_(0.02)  # a new one's is 1: half of that around the primitives fills all space
    return network


@pytest.mark.parametrize("kind", [StumpNet, UCSG])
def test_untrained_networks_are_reconstructed_with_the_signs_of_what_they_say(kind):
    """Wherever the surface is surely farther away than a cell reaches."""
    compared = []
    for seed in range(3):
        network = untrained(kind, seed)
        for cloud in clouds():
            mesh = reconstructed(network, cloud)
            with torch.no_grad():
                said = network(cloud[None])
                low, high = cloud.aminmax(dim=0)
                points = low + (high - low) * torch.rand(
                    4000, 3, generator=torch.Generator().manual_seed(seed)
                )
                distances = said.distances(points[None])
                beyond = torch.maximum(low - points, points - high).amax(1)
                far = torch.maximum(said.signed(distances)[0], beyond).abs() > 2 * CELL
                inside = said.inside(distances)[0]
            found = np.zeros(len(points), bool) if mesh.is_empty else by_winding(mesh)(points.numpy())
            assert mesh.is_empty or mesh.is_watertight
            assert np.array_equal(found[far], inside[far].numpy())
            compared.append((int((inside & far).sum()), int((~inside & far).sum())))
    inside, outside = np.array(compared).sum(0)
    assert inside > 100 and outside > 1000


@pytest.mark.parametrize("kind", [StumpNet, UCSG])
def test_reconstructed_is_the_surface_of_the_decided_field(kind):
    network, cloud = untrained(kind, 0), clouds(1)[0]
    said = network(cloud[None])
    expected = surface(lambda points: said.signed(said.distances(points[None]))[0], cloud)
    found = reconstructed(network, cloud)
    assert np.array_equal(found.vertices, expected.vertices) and np.array_equal(found.faces, expected.faces)
    assert not found.is_empty
    low, high = cloud.aminmax(dim=0)
    assert (found.bounds[0] >= low.numpy() - 1e-5).all() and (found.bounds[1] <= high.numpy() + 1e-5).all()


def test_the_first_points_are_looked_at_and_all_say_where_the_box_ends():
    network, cloud = untrained(StumpNet, 0), clouds(1)[0]
    few = StumpNet(replace(network.config, points=30)).eval()
    few.load_state_dict(network.state_dict())
    expected = surface(decided(few(cloud[None, :30])), cloud)
    assert np.array_equal(reconstructed(few, cloud.double()).vertices, expected.vertices)
    assert not np.array_equal(reconstructed(network, cloud).vertices, expected.vertices)


@pytest.mark.parametrize(
    "cloud, told",
    [
        (torch.zeros(0, 3), "without points"),
        (torch.full((30, 3), torch.nan), "without points, or with some that are not finite"),
        (torch.zeros(10, 2), "found points of shape"),
        (3 * CLOUD, "box has diagonal 2.8[0-9] and a middle"),
        (
            CLOUD + 0.5,
            "a middle 0.9[0-9]* from the origin; expected diagonal 1 around the origin, as lib.datasets",
        ),
    ],
)
def test_clouds_that_networks_do_not_know_are_refused(cloud, told):
    with pytest.raises(ValueError, match=told):
        reconstructed(untrained(StumpNet, 0), cloud)


def test_networks_that_cannot_answer_are_refused():
    network, cloud = untrained(StumpNet, 0), clouds(1)[0]
    before = [each.clone() for each in network.state_dict().values()]
    with pytest.raises(ValueError, match="found a network in training mode; expected one after"):
        reconstructed(network.train(), cloud)
    assert all(map(torch.equal, network.state_dict().values(), before))
    with torch.no_grad():
        network.eval().to_union.bias.fill_(torch.nan)
    with pytest.raises(ValueError, match="found connections that are no numbers"):
        reconstructed(network, cloud)


def test_a_network_that_unites_nothing_says_nothing():
    network = untrained(StumpNet, 0)
    with torch.no_grad():
        network.to_union.weight.zero_()
        network.to_union.bias.fill_(-1.0)
    assert reconstructed(network, clouds(1)[0]).is_empty
