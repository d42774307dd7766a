"""The Chamfer distance to a few pictures, again and again: what depends on them alone is computed once.

The same numbers as `image_chamfer`, in three quarters of the time. Of the two ways, from the outline of a drawn picture
to that of its target only needs to be looked up in a table of the target; the way back depends on both.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from lib.interpreters.csg.packing import SIDE
from lib.metrics.distances import distance_transform, distances_at
from lib.metrics.edges import edge_map
from lib.metrics.images import BLANK_PX

AT_ONCE = 128  # pictures: what stays in the cache


@dataclass(frozen=True)
class Targets:
    """n pictures: their outlines, and how far each pixel is from them, px (infinite where there is no outline)."""

    outlines: Bool[Tensor, "n 64 64"]
    away: Float[Tensor, "n 64 64"]

    def rows(self, which: Int[Tensor, " some"]) -> "Targets":
        """Some of the pictures, also repeated."""
        return Targets(self.outlines[which], self.away[which])

    def chamfer(self, which: Int[Tensor, " k"], images: Bool[Tensor, "k 64 64"]) -> Float[Tensor, " k"]:
        """The distance of each image to the target that `which` names, px."""
        parts = zip(which.split(AT_ONCE), images.split(AT_ONCE))
        return torch.cat([self._chamfer(*part) for part in parts])

    def _chamfer(self, which: Tensor, images: Tensor) -> Float[Tensor, " k"]:
        edges = edge_map(images)
        image, row, column = edges.nonzero(as_tuple=True)
        there = _means(self.away[which[image], row, column], image, len(images))
        back = _means(*distances_at(edges, self.outlines[which], "octagonal"), len(images))
        blank = there.isinf() | ~edges.flatten(1).any(1)
        return torch.where(blank, BLANK_PX, (there + back) / 2)


def targets_of(images: Bool[Tensor, "n 64 64"]) -> Targets:
    """What has to be known of pictures to measure distances to them.

    Raises ValueError for anything but bool images of 64 x 64 pixels.
    """
    outlines = edge_map(check_images(images, 3)).cpu()
    return Targets(outlines, distance_transform(outlines) if len(images) else torch.zeros(images.shape))


def check_images(images: object, axes: int) -> Tensor:
    """The same: bool images of 64 x 64 pixels, (n, 64, 64) or one alone, (64, 64). Raises ValueError for all else."""
    right = isinstance(images, Tensor) and images.dtype == torch.bool and images.ndim == axes
    if not right or images.shape[-2:] != (SIDE, SIDE):
        found = (
            f"{images.dtype} {tuple(images.shape)}" if isinstance(images, Tensor) else type(images).__name__
        )
        raise ValueError(
            f"found images {found}; expected a bool tensor {'(n, 64, 64)' if axes == 3 else '(64, 64)'}"
        )
    return images


def _means(distance: Float[Tensor, " pixels"], image: Int[Tensor, " pixels"], n: int) -> Float[Tensor, " n"]:
    """The mean distance of each image's pixels, as the authors compute it: see `image_chamfer`."""
    total, count = torch.bincount(image, distance, minlength=n), torch.bincount(image, minlength=n)
    return 255 * total / (255 * count + 1)
