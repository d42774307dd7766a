"""How alike two shapes are, as images: overlap, distance between outlines, and the reward made of it (CSGNet).

Images are bool tensors [row y, column x], True inside the shape. Leading dimensions are a batch: one number a pair.
"""

from math import prod

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from .distances import distances_at
from .edges import PIXELS_AT_ONCE, check_images, edge_map, in_parts

BLANK_PX = 16.0  # the authors' distance to an image without edges
IMAGE_DIAGONAL = 64 * 2**0.5  # px, of their images


def iou(a: Bool[Tensor, "*shape"], b: Bool[Tensor, "*shape"], dims: int = 2) -> Float[Tensor, "..."]:
    """Intersection over union, |A and B| / |A or B|: 0 for disjoint shapes, 1 for equal ones, two empty ones included.

    dims    how many trailing dimensions are one shape: 2 for images, 3 for voxels; those before are a batch.
            So for voxels give dims=3: without it, two grids (64, 64, 64) are 64 pairs of images.
    (The CSGNet authors' program for voxels divides by |A or B| + 1.)
    Raises ValueError unless both are bool tensors of one shape, with at least `dims` dimensions.
    """
    check_images(a=a, b=b)
    if not (2 <= dims <= a.ndim and prod(a.shape[-dims:])):
        raise ValueError(f"expected shapes of {dims} dimensions, 2 or more, got tensors {tuple(a.shape)}")
    parts = (in_parts(x.reshape(-1, prod(x.shape[-dims:])), PIXELS_AT_ONCE) for x in (a, b))
    return torch.cat([_iou(*pairs) for pairs in zip(*parts)]).view(a.shape[:-dims])


def _iou(a: Bool[Tensor, "n cells"], b: Bool[Tensor, "n cells"]) -> Float[Tensor, " n"]:
    both, either = (a & b).sum(1), (a | b).sum(1)
    return torch.where(either > 0, both / either, 1.0)


def image_chamfer(
    a: Bool[Tensor, "*batch h w"], b: Bool[Tensor, "*batch h w"], distance: str = "octagonal"
) -> Float[Tensor, "*batch"]:
    """Chamfer distance between the outlines of two images, px: 0 for equal ones; swapping them changes nothing.

    The mean distance from the edge pixels of a to the nearest of b, the same from b to a, and the mean of both
    (paper, section 3.1; there it is divided by the image's diagonal, see `reward`).
    distance    "octagonal": as the authors' program computes it, and so what their tables and rewards contain. It
                adds 1 to 255 times the number of edge pixels before it divides by that.
                "euclidean": what the paper's formula says, exactly. The two differ by less than 5 %.
    If a or b has no edges, because it is all False or all True, either form gives the authors' 16 px, even for two
    equal images. No gradient. For images only: two grids of voxels (64, 64, 64) are 64 pairs of images, one distance
    each. Raises ValueError for an unknown distance, and unless a and b are bool tensors of one shape.
    """
    check_images(a=a, b=b)
    parts = (in_parts(x.reshape(-1, *x.shape[-2:]), PIXELS_AT_ONCE // 2) for x in (a, b))
    return torch.cat([_chamfer(*pairs, distance) for pairs in zip(*parts)]).view(a.shape[:-2])


def _chamfer(a: Bool[Tensor, "n h w"], b: Bool[Tensor, "n h w"], distance: str) -> Float[Tensor, " n"]:
    """Both ways at once: first from the edges of b to those of a, then from a to b."""
    edges = edge_map(torch.cat([a, b]))
    apart, image = distances_at(edges, edges.roll(len(a), 0), distance)
    total = torch.bincount(image, apart, minlength=len(edges))
    count = torch.bincount(image, minlength=len(edges))
    mean = 255 * total / (255 * count + 1) if distance == "octagonal" else total / count
    blank = (count == 0).view(2, -1).any(0)
    return mean.view(2, -1).mean(0).masked_fill(blank, BLANK_PX)


def reward(
    distance_px: Float[Tensor, "*batch"] | float, power: float = 20, diagonal: float = IMAGE_DIAGONAL
) -> Float[Tensor, "*batch"]:
    """What a program earns whose image lies `distance_px` from the target: (1 - distance / diagonal) ** power.

    distance_px a tensor, or one number, which gives a tensor () too
    diagonal    of the images, px. Beyond it the reward is 0; at distance 0 it is 1.
    A blank image, 16 px from everything, earns 0.02, and so does an invalid program in the authors' code; by the
    paper an invalid program earns 0. Raises ValueError for a power or diagonal that is not positive.
    """
    if not (power > 0 and diagonal > 0):
        raise ValueError(f"power and diagonal have to be positive, got {power} and {diagonal}")
    return (1 - torch.as_tensor(distance_px) / diagonal).clamp(0, 1) ** power
