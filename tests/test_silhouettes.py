"""Silhouettes and the sets they come in: geometry seen from two sides, files read back, and what is refused."""

import numpy as np
import pytest
import torch
from scipy import ndimage

from lib import datasets
from lib.datasets import DataError, logos
from lib.datasets import images as dataset_images
from lib.datasets.images import COLUMNS, ImageSet, fault, in_one_split, split_of
from lib.furniture import make
from lib.interpreters.cuboids import Cuboids
from lib.interpreters.rasterising import FILL, SIZE, VIEWS, box_triangles, silhouettes

EDGE = (SIZE - FILL) // 2
TOUCHING = np.ones((3, 3))  # pixels that meet at a corner belong together


def boxes(*rows):
    """Triangles of upright boxes, each (width, height, depth, x, y, z of its middle)."""
    numbers = torch.tensor(rows, dtype=torch.float64)
    axes = torch.eye(3, dtype=torch.float64).expand(len(rows), 3, 3)
    return box_triangles(Cuboids(numbers[:, :3], numbers[:, 3:], axes))


def turned(triangles, degrees):
    """Turned about the z axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return triangles @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def furniture():
    return [box_triangles(make(category, 3).leaves) for category in ("chair", "table", "storage")]


# ---- seeing ----


def test_a_cube_is_a_square_from_everywhere():
    expected = np.zeros((SIZE, SIZE), bool)
    expected[EDGE:-EDGE, EDGE:-EDGE] = True
    assert (silhouettes(boxes([1, 1, 1, 5, -3, 2])) == expected).all()


def test_each_view_fills_the_image_by_itself():
    front, side = silhouettes(boxes([2, 1, 0.25, 0, 0, 0]))
    assert front[18:46, EDGE:-EDGE].all() and front.sum() == 28 * 56  # twice as wide as high
    assert side[EDGE:-EDGE, 25:39].all() and side.sum() == 56 * 14  # four times as high as deep


def test_which_way_round():
    """A block with a small one on its upper, right, front corner."""
    front, side = silhouettes(boxes([4, 4, 4, 0, 0, 0], [1, 1, 1, 1.5, 2.5, 1.5]))
    assert front[EDGE, 40:].any() and not front[EDGE, :32].any()  # x right and y up
    assert side[EDGE, 40:].any() and not side[EDGE, :32].any()  # z right: the front faces right


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_mirrored_shapes_have_mirrored_masks(axis):
    for triangles in furniture():
        mirrored = triangles.copy()
        mirrored[..., axis] *= -1
        for view, mask, other in zip(VIEWS, silhouettes(triangles), silhouettes(mirrored)):
            right, up = VIEWS[view]
            expected = mask[:, ::-1] if axis == right else mask[::-1] if axis == up else mask
            assert (other == expected).all()


def test_size_and_place_do_not_matter():
    for triangles in furniture():
        assert (silhouettes(7 * triangles + (3, -20, 0.1)) == silhouettes(triangles)).all()


def test_front_and_side_change_places_with_x_and_z():
    for triangles in furniture():
        assert (silhouettes(triangles[..., [2, 1, 0]]) == silhouettes(triangles)[::-1]).all()


def test_areas_agree_with_the_formula():
    angle = np.linspace(0, 2 * np.pi, 201)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    fan = np.stack([np.zeros_like(rim[1:]), rim[1:], rim[:-1]], axis=1)
    front, side = silhouettes(fan)
    assert front.sum() == pytest.approx(
        np.pi * 28**2, rel=0.015
    )  # samples that are touched: 1/8 pixel all round
    assert fault(side) == "blank" and side.any()  # without thickness, and seen all the same


def test_overlapping_triangles_are_one_shape():
    triangles = furniture()[0]
    assert (silhouettes(np.concatenate([triangles, triangles[::-1, ::-1]])) == silhouettes(triangles)).all()


@pytest.mark.parametrize("thickness", [0, 0.001, 0.004, 0.01, 0.017])  # 0 to 1 pixel
@pytest.mark.parametrize("degrees", [0, 3, 20, 45, 60, 87, 90])
def test_thin_parts_stay_whole(thickness, degrees):
    """Three rods in a row, at places that differ between pixels, and far enough apart to stay three."""
    rods = boxes(*([thickness, 1, thickness, x, 0, 0] for x in (-0.31, 0, 0.2371)))
    front = silhouettes(turned(rods, degrees))[0]
    pieces, count = ndimage.label(front, TOUCHING)
    assert count == 3
    for piece in range(1, 4):
        rows, columns = np.nonzero(pieces == piece)
        length = np.hypot(np.ptp(rows) + 1, np.ptp(columns) + 1)
        assert length > 35 and 0.7 < len(rows) / max(np.ptp(rows), np.ptp(columns)) < 3.1  # one to three wide


def test_parts_of_a_pixel_and_more_keep_their_width():
    for pixels in (1.0, 2.0, 3.0, 5.0):
        for place in np.linspace(0, 1, 9) / FILL:
            front = silhouettes(boxes([1, 0.1, 0.1, 0, 0.5, 0], [pixels / FILL, 1, 0.1, place, 0, 0]))[0]
            assert abs(front[EDGE + 10 : -EDGE - 2].sum(axis=1) - pixels).max() <= 1


@pytest.mark.parametrize(
    "triangles, message",
    [
        (np.zeros((0, 3, 3)), "no triangles"),
        (np.full((1, 3, 3), np.nan), "not finite"),
        (np.ones((2, 3, 3)), "extent of 0"),
        (np.array([[[-1e308] * 3, [1e308] * 3, [0.0] * 3]]), "extent of inf"),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow")
def test_what_cannot_be_seen(triangles, message):
    with pytest.raises(ValueError, match=message):
        silhouettes(triangles)


def test_faults():
    mask = np.zeros((SIZE, SIZE), bool)
    assert fault(mask) == "blank"
    mask[EDGE:-EDGE, 10:12] = True
    assert fault(mask) == "blank"  # a line, two pixels wide
    mask[EDGE, 12] = True
    assert fault(mask) == ""
    mask[EDGE:-EDGE, EDGE:-EDGE] = True
    assert fault(mask) == "full"
    mask[20:28, 20:28] = False
    assert fault(mask) == ""


# ---- splits ----


def test_splits_are_told_by_the_name_alone_and_have_their_shares():
    names = [f"chair-{k:06d}" for k in range(4000)]
    splits = [split_of(name) for name in names]
    assert splits[:5] == [split_of(name) for name in names[:5]]
    for split, share in (("train", 10 / 16), ("val", 3 / 16), ("test", 3 / 16)):
        assert splits.count(split) / 4000 == pytest.approx(share, abs=0.03)  # 4 standard deviations
    assert "test" not in {split_of(name, (10, 3, 0)) for name in names}


def test_a_mask_stays_in_the_last_split_that_has_it():
    packed = np.array([[1], [1], [2], [2], [2], [3], [3]], np.uint8)
    splits = ["train", "test", "val", "train", "val", "train", "train"]
    assert in_one_split(packed, splits).tolist() == [False, True, True, False, True, True, True]


# ---- sets ----


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path))
    (tmp_path / "silhouettes").mkdir()
    return tmp_path / "silhouettes"


def arrays(numbers=(1, 2, 3), splits=("train", "val", "test"), **other):
    """What a file of masks holds: one mask a number."""
    masks = np.zeros((len(numbers), 512), np.uint8)
    masks[:, 0] = numbers
    columns = (
        [f"chair/{k}" for k in numbers],
        ["front"] * len(numbers),
        list(splits),
        ["chair"] * len(numbers),
    )
    return {"masks": masks} | {name: np.array(c) for name, c in zip(COLUMNS, columns)} | other


def test_embedded_masks_are_the_same_every_time(folder):
    images = datasets.silhouettes()
    assert images.source == "embedded" and "made on the spot" in images.describe()
    made = dataset_images.made.__wrapped__  # not the one kept from before
    first, again = made(5), made(5)
    assert first.ids == again.ids and (first.packed == again.packed).all()
    images.packed[:], images.images[:] = 255, True  # does not come back the next time
    assert (datasets.silhouettes("embedded").packed != 255).any()
    assert not datasets.silhouettes("embedded").images.all()
    assert images.images.shape == (len(images), 64, 64) and images.images.dtype == torch.bool
    assert set(images.categories) == {"chair", "table", "storage"} and set(images.views) == set(VIEWS)


def test_no_shape_and_no_mask_is_in_two_embedded_splits(folder):
    parts = [datasets.silhouettes(split=split) for split in ("train", "val", "test")]
    assert sum(map(len, parts)) == len(datasets.silhouettes()) and min(map(len, parts)) > 20
    for of in (lambda part: part.ids, lambda part: map(bytes, part.packed)):
        whole = [set(of(part)) for part in parts]
        assert not (whole[0] & whole[1] or whole[0] & whole[2] or whole[1] & whole[2])


def test_a_set_is_a_sequence_of_masks(folder):
    images = datasets.silhouettes("embedded")
    assert images[0].shape == (64, 64) and (images[-1] == images.images[-1]).all()
    few = images[2:8:2]
    assert isinstance(few, ImageSet) and few.ids == images.ids[2:8:2] and (few[1] == images[4]).all()
    chairs = images.select(view="side", category="chair")
    assert set(chairs.views) == {"side"} and set(chairs.categories) == {"chair"}
    assert len(images[:0]) == 0 and images[:0].images.shape == (0, 64, 64)
    assert "0 masks" in repr(images.select(category="piano"))
    assert len(list(few)) == 3


def test_files_are_read_and_joined_without_a_mask_in_two_splits(folder):
    np.savez_compressed(folder / "furniture.npz", **arrays())
    np.savez_compressed(folder / "sweethome3d.npz", **arrays((2, 4), ("test", "train")))
    one = datasets.silhouettes("furniture")
    assert one.source == "furniture" and one.ids == ("chair/1", "chair/2", "chair/3")
    assert one[0][0, 7] and one[0].sum() == 1  # the bits of a byte, first to last
    both = datasets.silhouettes()
    assert both.source == "furniture + sweethome3d" and both.splits == ("train", "test", "test", "train")
    assert datasets.silhouettes(split="val").ids == () and len(datasets.silhouettes("furniture", "val")) == 1
    assert both.describe().startswith("4 masks of 4 shapes (2 train, 2 test), source: furniture + sweet")


def test_logos_are_for_testing(folder):
    with pytest.raises(DataError, match="logos.npz; make it: python -m data_scripts.make_logos"):
        logos()
    np.savez_compressed(folder / "logos.npz", **arrays(splits=["test"] * 3))
    assert len(logos()) == len(logos("test")) == 3 and len(logos("train")) == 0
    assert logos().source == "logos"


@pytest.mark.parametrize(
    "change, message",
    [
        ({"masks": np.zeros((3, 511), np.uint8)}, r"masks uint8 \(3, 511\), expected uint8 \(n, 512\)"),
        ({"masks": np.zeros((3, 512))}, "masks float64"),
        ({"ids": np.array(["a", "b"])}, r"ids <U1 \(2,\), expected 3 texts"),
        ({"views": np.array([1, 2, 3])}, "views int64"),
        ({"splits": np.array(["train", "dev", "test"])}, "the split 'dev', expected train, val, test"),
        ({"ids": np.array(["a", "b", None], dtype=object)}, "damaged"),  # it would have to be unpickled
    ],
)
def test_wrong_files(folder, change, message):
    np.savez_compressed(folder / "furniture.npz", **arrays(**change))
    with pytest.raises(DataError, match=message) as error:
        datasets.silhouettes("furniture")
    assert "make it again: python -m data_scripts.make_silhouettes --source furniture" in str(error.value)
    assert str(folder / "furniture.npz") in str(error.value)


def test_damaged_files(folder):
    path = folder / "furniture.npz"
    np.savez_compressed(path, masks=arrays()["masks"])
    with pytest.raises(DataError, match="no masks as the data scripts write them"):
        datasets.silhouettes()
    np.savez_compressed(path, **arrays())
    whole = path.read_bytes()
    for content in (
        b"",
        b"no archive",
        whole[:200],
        whole[: len(whole) // 2],
        whole[:60] + b"?????" + whole[65:],
    ):
        path.write_bytes(content)
        with pytest.raises(DataError, match="damaged"):
            datasets.silhouettes()
    path.unlink()
    path.mkdir()
    with pytest.raises(DataError, match="cannot be read"):
        datasets.silhouettes()


def test_unknown_names(folder):
    with pytest.raises(DataError, match="unknown source 'shapenet': choose one of shapeassembly, furniture"):
        datasets.silhouettes("shapenet")
    with pytest.raises(DataError, match="unknown split 'dev': choose one of train, val, test"):
        datasets.silhouettes(split="dev")
    with pytest.raises(DataError, match="unknown split"):
        logos("dev")
    with pytest.raises(
        DataError, match="make it: python -m data_scripts.make_silhouettes --source sweethome3d"
    ):
        datasets.silhouettes("sweethome3d")
