"""Images and their outlines: laws first, then distances known by hand or by brute force, then the authors' numbers."""

import math

import numpy as np
import pytest
import torch

from lib.interpreters.csg import execute, parse
from lib.metrics.distances import DIAGONAL, STRAIGHT, distance_transform
from lib.metrics.edges import edge_map
from lib.metrics.images import BLANK_PX, image_chamfer, iou, reward

FORMS = pytest.mark.parametrize("distance", ["octagonal", "euclidean"])
ROUNDING = 1e-4  # px: single precision, means of a few hundred distances below 100


def disc(y: float, x: float, r: float, shape: tuple[int, int] = (64, 64)) -> torch.Tensor:
    rows, columns = torch.meshgrid(*map(torch.arange, shape), indexing="ij")
    return (rows - y) ** 2 + (columns - x) ** 2 < r**2


def square(top: int, left: int, side: int, size: int = 64) -> torch.Tensor:
    image = torch.zeros(size, size, dtype=torch.bool)
    image[top : top + side, left : left + side] = True
    return image


def shapes(seed: int, count: int, shape: tuple[int, int] = (64, 64)) -> torch.Tensor:
    """Unions of discs; never blank or full."""
    rng = np.random.default_rng(seed)
    low, high = np.zeros(2), np.array(shape)
    images = torch.zeros(count, *shape, dtype=torch.bool)
    for image in images:
        for center in rng.uniform(low, high, (3, 2)):
            image |= disc(*center, rng.uniform(0.1, 0.3) * min(shape), shape)
    assert all(image.any() and not image.all() for image in images)
    return images


def noise(seed: int, *shape: int, share: float = 0.5) -> torch.Tensor:
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed)) < share


def brute_force(edges: torch.Tensor, distance: str) -> torch.Tensor:
    """From each pixel to every edge pixel, one image."""
    pixels, ends = torch.ones_like(edges).nonzero().double(), edges.nonzero().double()
    if distance == "euclidean":
        return torch.cdist(pixels, ends).amin(1).view(edges.shape)
    steps = (pixels[:, None] - ends).abs()
    longer, shorter = steps.amax(-1), steps.amin(-1)
    return (STRAIGHT * longer + (DIAGONAL - STRAIGHT) * shorter).amin(1).view(edges.shape)


def mean_both_ways(a: torch.Tensor, b: torch.Tensor) -> float:
    """The paper's formula, literally: point sets and all distances between them."""
    apart = torch.cdist(edge_map(a).nonzero().double(), edge_map(b).nonzero().double())
    return float(apart.amin(1).mean() + apart.amin(0).mean()) / 2


# --- laws


@FORMS
def test_chamfer_is_a_symmetric_distance(distance):
    a, b = shapes(1, 20), shapes(2, 20)
    there, back = image_chamfer(a, b, distance), image_chamfer(b, a, distance)
    assert torch.equal(there, back) and (there > 0).all()
    assert (image_chamfer(a, a, distance) == 0).all()


@FORMS
def test_chamfer_does_not_change_with_both_images(distance):
    """Under a turn by 90° it does, a little: of two equal peaks, thinning keeps the left or upper one."""
    a, b = (shapes(seed, 10)[:, 12:52, 12:52] for seed in (3, 4))
    a, b = (torch.nn.functional.pad(x & disc(20, 20, 18, (40, 40)), (12, 12, 12, 12)) for x in (a, b))
    before = image_chamfer(a, b, distance)
    moved = image_chamfer(a.roll((5, -7), (1, 2)), b.roll((5, -7), (1, 2)), distance)
    assert torch.equal(before, moved)
    turned = image_chamfer(a.rot90(1, (1, 2)), b.rot90(1, (1, 2)), distance)
    assert torch.allclose(before, turned, atol=0.5)  # px: half the width of an edge


def test_a_batch_gives_the_same_as_one_by_one():
    a, b = shapes(5, 6), noise(6, 6, 64, 64)
    for function in (image_chamfer, iou):
        together = function(a, b)
        assert torch.equal(together, torch.stack([function(x, y) for x, y in zip(a, b)]))
        assert torch.equal(function(a.view(2, 3, 64, 64), b.view(2, 3, 64, 64)), together.view(2, 3))
        assert function(a[:0], b[:0]).shape == (0,) and function(a[0], b[0]).shape == ()
    for function in (edge_map, distance_transform):
        together = function(b)
        assert torch.equal(together, torch.stack([function(y) for y in b]))
        assert torch.equal(function(b.view(3, 2, 64, 64)), together.view(3, 2, 64, 64))
        assert function(b[:0]).shape == (0, 64, 64)


def test_more_pairs_than_are_handled_at_once():
    a, b = shapes(7, 10), shapes(8, 10)
    many = image_chamfer(a.repeat(30, 1, 1), b.repeat(30, 1, 1))
    assert torch.equal(many, image_chamfer(a, b).repeat(30))
    assert torch.equal(iou(a.repeat(30, 1, 1), b.repeat(30, 1, 1)), iou(a, b).repeat(30))


def test_images_need_not_lie_in_one_piece_of_memory():
    a, b = shapes(9, 4), shapes(10, 4)
    a_mirrored, b_mirrored = a.mT.contiguous().mT, b.mT.contiguous().mT
    assert torch.equal(image_chamfer(a_mirrored, b_mirrored), image_chamfer(a, b))
    assert torch.equal(iou(a_mirrored, b_mirrored), iou(a, b))


def test_iou_lies_between_0_and_1():
    a, b = noise(11, 50, 16, 16, share=0.3), noise(12, 50, 16, 16, share=0.6)
    found = iou(a, b)
    assert torch.equal(found, iou(b, a)) and (found > 0).all() and (found < 1).all()
    assert (iou(a, a) == 1).all() and (iou(a, ~a) == 0).all()
    assert torch.equal(iou(a & b, a), (a & b).sum((1, 2)) / a.sum((1, 2)))  # of a part and the whole


def test_the_reward_falls_with_the_distance():
    found = reward(torch.linspace(0, 64 * math.sqrt(2), 50))
    assert found[0] == 1 and found[-1] == 0 and (found.diff() <= 0).all()
    assert reward(torch.tensor([-1.0, 100])).tolist() == [1, 0]


def test_the_reward_of_one_number():
    found = reward(4.0)
    assert found.shape == () and torch.equal(found, reward(torch.tensor(4.0))) and reward(0) == 1


# --- edges


def test_edges_of_a_square():
    """On the left and above the outline is just outside, on the right and below just inside: the first equal peak."""
    edges = edge_map(square(2, 2, 4, 8)).int()
    assert edges.tolist() == [
        [0, 0, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 1, 1, 0, 0, 0],
        [0, 0, 1, 0, 0, 1, 0, 0],
        [0, 1, 0, 0, 0, 1, 0, 0],
        [0, 1, 0, 0, 0, 1, 0, 0],
        [0, 0, 1, 1, 1, 1, 0, 0],
        [0, 0, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 0, 0, 0, 0, 0],
    ]


@pytest.mark.parametrize("value", [False, True])
def test_blank_and_full_images_have_no_edges(value):
    image = torch.full((5, 7), value)
    assert not edge_map(image).any()
    assert distance_transform(edge_map(image)).isinf().all()
    assert image_chamfer(image, image) == BLANK_PX  # equal, and yet: that is the authors' rule


def test_the_direction_rule_is_cannys():
    """OpenCV compares fixed-point tangents; for all gradients that a black-and-white image can have, halves do."""
    for ax in range(5):
        for ay in range(5):
            tan_22 = ax * 13573
            assert ((ay << 15) < tan_22) == (2 * ay < ax)
            assert ((ay << 15) > tan_22 + (ax << 16)) == (2 * ax < ay)


@pytest.mark.parametrize("name", ["a", "b"])
def test_edges_are_the_authors(pairs, name):
    assert torch.equal(edge_map(pairs[name]), pairs[f"edges_{name}"])


# --- distances


@FORMS
@pytest.mark.parametrize("shape", [(64, 64), (1, 1), (1, 9), (9, 1), (30, 85), (86, 20), (5, 200)])
def test_distances_agree_with_brute_force(distance, shape):
    edges = torch.stack([noise(seed, *shape, share=0.01) for seed in range(4)])
    edges[:, shape[0] // 2, 0] = True
    edges[0] = False
    edges[0, -1, -1] = True  # one far corner: the longest distances there are
    expected = torch.stack([brute_force(image, distance) for image in edges])
    assert torch.allclose(distance_transform(edges, distance).double(), expected, atol=ROUNDING, rtol=0)


def test_the_octagonal_distance_is_nearly_euclidean():
    edges = noise(13, 10, 64, 64, share=0.002)
    ratio = distance_transform(edges, "octagonal") / distance_transform(edges, "euclidean")
    ratio = ratio[~edges]
    assert ratio.min() >= STRAIGHT - 1e-6 and ratio.max() <= math.hypot(STRAIGHT, DIAGONAL - STRAIGHT) + 1e-6


def test_distances_are_the_authors(pairs):
    expected = pairs["distance_a_first30"]
    assert torch.allclose(distance_transform(pairs["edges_a"][:30]), expected, atol=ROUNDING, rtol=0)


# --- Chamfer distance


def test_chamfer_by_hand():
    """A step in 8 x 8: each image one straight edge, 3 columns apart; and a horizontal one against them."""
    a, b = torch.zeros(2, 8, 8, dtype=torch.bool)
    a[:, :2], b[:, :5] = True, True  # edges: columns 1 and 4
    assert edge_map(a).nonzero()[:, 1].tolist() == [1] * 8 and edge_map(b).nonzero()[:, 1].tolist() == [4] * 8
    assert image_chamfer(a, b, "euclidean") == 3
    octagonal = 3 * STRAIGHT * 255 * 8 / (255 * 8 + 1)
    assert image_chamfer(a, b) == pytest.approx(octagonal, abs=1e-6)
    # From (i, 1) to row 1: |i - 1|, mean 22 / 8; from (1, j) to column 1 the same.
    assert image_chamfer(a, a.T, "euclidean") == 22 / 8


def test_chamfer_of_two_dots_by_hand():
    """In 8 x 8: the outline of a dot is the ring of its 8 neighbours. The second dot lies 4 rows and 3 columns on."""
    a, b = square(1, 1, 1, 8), square(5, 4, 1, 8)
    ring = [[0, 0], [0, 1], [0, 2], [1, 0], [1, 2], [2, 0], [2, 1], [2, 2]]
    assert edge_map(a).nonzero().tolist() == ring
    # All of a's ring is nearest to the corner (4, 3) of b's; turned by 180 degrees, b sees the same of a.
    steps = [(4, 3), (4, 2), (4, 1), (3, 3), (3, 1), (2, 3), (2, 2), (2, 1)]
    euclidean = sum(math.hypot(*step) for step in steps) / 8
    assert image_chamfer(a, b, "euclidean") == pytest.approx(euclidean, abs=1e-6)
    octagonal = sum(STRAIGHT * max(step) + (DIAGONAL - STRAIGHT) * min(step) for step in steps) / 8
    assert image_chamfer(a, b) == pytest.approx(octagonal * 255 * 8 / (255 * 8 + 1), abs=1e-5)


@pytest.mark.parametrize("by", [1, 2, 5])
def test_a_shifted_square(by):
    """The vertical sides move by `by`; of the others, all but `by` pixels lie on the old ones."""
    a, b = square(20, 20, 24), square(20, 20 + by, 24)
    found = float(image_chamfer(a, b, "euclidean"))
    assert found == pytest.approx(mean_both_ways(a, b), abs=ROUNDING)
    # Half of the outline moved by all of it, ends of the other half a bit.
    assert by / 2 < found < by / 2 + 0.25 * by


def test_the_euclidean_form_is_the_papers_formula():
    a, b = shapes(14, 20), torch.cat([shapes(15, 10), noise(16, 10, 64, 64)])
    expected = [mean_both_ways(x, y) for x, y in zip(a, b)]
    assert image_chamfer(a, b, "euclidean").tolist() == pytest.approx(expected, abs=ROUNDING)


@FORMS
def test_images_of_another_size(distance):
    a, b = shapes(17, 5, (40, 100)), shapes(18, 5, (40, 100))
    expected = [mean_both_ways(x, y) for x, y in zip(a, b)]
    assert image_chamfer(a, b, distance).tolist() == pytest.approx(
        expected, rel=0.05 if distance == "octagonal" else 1e-5
    )


@FORMS
def test_a_blank_image_is_16_px_from_everything(distance):
    blank, full, shape = torch.zeros(64, 64).bool(), torch.ones(64, 64).bool(), shapes(19, 1)[0]
    a = torch.stack([blank, full, blank, blank, shape, shape])
    b = torch.stack([shape, shape, full, blank, blank, shape])
    assert image_chamfer(a, b, distance).tolist() == [BLANK_PX] * 5 + [0]
    # As the authors round it:
    assert reward(image_chamfer(a, b, distance))[0] == pytest.approx(0.0204, abs=5e-5)


def test_chamfer_and_reward_are_the_authors(pairs):
    found = image_chamfer(pairs["a"], pairs["b"])
    assert torch.allclose(found.double(), pairs["chamfer"], atol=ROUNDING, rtol=0)
    # 20 / 90 of that at most:
    assert torch.allclose(reward(found).double(), pairs["reward"], atol=1e-5, rtol=0)


def test_the_authors_form_is_close_to_the_papers(pairs):
    """Octagons for circles: off by a few hundredths of a pixel on average."""
    octagonal, euclidean = (
        image_chamfer(pairs["a"], pairs["b"], each) for each in ("octagonal", "euclidean")
    )
    assert (octagonal - euclidean).mean().abs() < 0.1
    assert ((octagonal - euclidean).abs() <= 0.045 * euclidean + ROUNDING).all()


# --- overlap


def test_iou_by_hand():
    a, b = square(0, 0, 4, 8), square(2, 2, 4, 8)
    assert iou(a, b) == pytest.approx(4 / 28)
    assert iou(a, square(4, 4, 4, 8)) == 0
    blank = torch.zeros_like(a)
    assert iou(blank, a) == 0 and iou(blank, blank) == 1  # nothing differs


def test_iou_of_voxels():
    a, b = torch.zeros(2, 2, 4, 4, 4, dtype=torch.bool)
    a[0, :2], b[0, 1:3] = True, True
    assert iou(a, b, dims=3).tolist() == pytest.approx([1 / 3, 1])
    assert iou(a, b, dims=4) == pytest.approx(1 / 3)
    assert iou(a[0], b[0]).shape == image_chamfer(a[0], b[0]).shape == (4,)  # a batch of images, unless told


# --- errors


@pytest.fixture
def images():
    return square(1, 1, 3, 8)


@pytest.mark.parametrize("function", [iou, image_chamfer])
def test_two_images_have_to_fit(function, images, unchecked_shapes):
    with pytest.raises(ValueError, match=r"one shape, got a \(8, 8\) and b \(2, 8, 8\); `expand_as`"):
        function(images, images.expand(2, 8, 8))
    with pytest.raises(ValueError, match=r"b has to be bool, got torch.float32; `b > 0.5`"):
        function(images, images.float())
    with pytest.raises(ValueError, match=r"a has to be images .* got \(8,\)"):
        function(images[0], images[0])


@pytest.mark.parametrize("function", [iou, image_chamfer])
@pytest.mark.parametrize(
    "text, kind, how", [("c(8,8,8)", "Picture", "shape.image"), ("sp(8,8,8,8)", "Solid", "shape.grid")]
)
def test_shapes_are_asked_for_their_pixels(function, text, kind, how, unchecked_shapes):
    shape = execute(parse(text))
    expected = rf"a: found a {kind}; expected a bool tensor \(…, h, w\), such as {how}"
    with pytest.raises(ValueError, match=expected):
        function(shape, shape)


@pytest.mark.parametrize("function", [edge_map, distance_transform, lambda image: iou(image, image)])
def test_arrays_are_to_become_tensors(function, images, unchecked_shapes):
    with pytest.raises(ValueError, match=r"found a ndarray; expected a bool tensor .* torch.as_tensor\("):
        function(images.numpy())
    with pytest.raises(ValueError, match="found a list; expected a bool tensor"):
        function(images.tolist())


@pytest.mark.parametrize("function, name", [(edge_map, "images"), (distance_transform, "edges")])
def test_one_image_has_to_be_one(function, name, images, unchecked_shapes):
    with pytest.raises(ValueError, match=f"{name} has to be bool, got torch.uint8"):
        function(images.byte())
    with pytest.raises(ValueError, match=rf"{name} has to be images .* got \(8, 0\)"):
        function(images[:, :0])


def test_unknown_distances_name_the_known(images):
    for function in (lambda: image_chamfer(images, images, "l1"), lambda: distance_transform(images, "l1")):
        with pytest.raises(ValueError, match="unknown distance 'l1', expected one of octagonal, euclidean"):
            function()


@pytest.mark.parametrize("dims", [1, 3])
def test_iou_needs_as_many_dimensions(images, dims):
    with pytest.raises(ValueError, match=rf"shapes of {dims} dimensions, 2 or more, got tensors \(8, 8\)"):
        iou(images, images, dims)


@pytest.mark.parametrize("power, diagonal", [(0, 90), (20, 0)])
def test_rewards_need_positive_numbers(power, diagonal):
    with pytest.raises(ValueError, match=f"have to be positive, got {power} and {diagonal}"):
        reward(torch.zeros(1), power, diagonal)


@pytest.fixture(scope="module")
def pairs(shared) -> dict[str, torch.Tensor]:
    """500 pairs of images, and what the authors' programs made of them."""
    path = shared / "goldens" / "csg_chamfer.npz"
    if not path.is_file():
        pytest.skip(f"no {path}")
    with np.load(path) as golden:
        found = {name: torch.from_numpy(golden[name]) for name in golden}
    for name in ("a", "b", "edges_a", "edges_b"):
        bits = np.unpackbits(found[name].numpy(), axis=-1)
        found[name] = torch.from_numpy(bits.reshape(-1, 64, 64).astype(bool))
    return found


def test_very_wide_images_are_refused_instead_of_filling_the_memory(unchecked_shapes):
    wide = torch.zeros(1, 1, 8193, dtype=torch.bool)
    with pytest.raises(ValueError, match="found images 8193 pixels wide; expected at most 8192"):
        distance_transform(wide)
