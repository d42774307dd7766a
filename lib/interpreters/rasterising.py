"""Silhouettes: what a shape hides of the light, from the front and from the side, as 64x64 images of yes and no.

    silhouettes(triangles)      (2, 64, 64) bool: what VIEWS names, in its order; image[row, column], rows go down
    box_triangles(cuboids)      the twelve triangles of every box

World axes as everywhere here: x right, y up, z to the front. "front" looks along -z: x grows to the right of the image.
"side" looks along x: z grows to the right, so that what faces the front faces right. Each view has its own scale: the
longer side of what is seen takes 56 of the 64 pixels, and its middle is the middle of the image. (CSGNet, section 4.1,
has 64x64 masks of furniture "from their front and side views" and says no more. With one scale for both views, a long
table seen from the side would be a dozen pixels wide, about the size of CSGNet's smallest square.)

A pixel is on where half of it is covered. That is told from 4x4 samples a pixel: small squares, each of them covered
where a triangle touches it, even one seen edge-on. What is thinner than a pixel is widened until it covers half of
one, wherever between two pixels it falls: a chair's legs neither vanish nor break into dots. (So a thin part shows one
or two pixels wide.)
"""

import numpy as np
from jaxtyping import Bool, Float

from .cuboids import Cuboids
from .shapeassembly.meshing import TRIANGLES

SIZE = 64  # pixels, both ways
FILL = 56  # pixels that the longer side of what is seen takes
SAMPLES = 4  # a pixel, both ways
VIEWS = {"front": (0, 1), "side": (2, 1)}  # the world axes that are seen as right and up
NEAR = 1e-6  # samples: what touches a sample but for rounding touches it


def silhouettes(triangles: Float[np.ndarray, "t 3 3"]) -> Bool[np.ndarray, "2 64 64"]:
    """Both views of the surface that the triangles (corners, axes) make. Raises ValueError for what cannot be seen:
    no triangles, corners that are not finite, or all of them in one point."""
    if not len(triangles):
        raise ValueError("found no triangles; expected at least one")
    if not np.isfinite(triangles).all():
        raise ValueError("found a corner that is not finite")
    extent = np.ptp(triangles, axis=(0, 1)).max()
    if not 0 < extent < np.inf:
        raise ValueError(f"found an extent of {extent:g}; expected a shape larger than a point")
    return np.stack([pixels(covered(placed(triangles[..., axes]))) for axes in VIEWS.values()])


def placed(points: Float[np.ndarray, "t 3 2"]) -> Float[np.ndarray, "t 3 2"]:
    """(right, up) in world units -> (column, row) in samples, of a scale and at a place that fills the image."""
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    extent = (high - low).max()
    # A line seen along itself is a point, and stays one.
    centred = (points - (low + high) / 2) / (extent or 1)
    return centred * (FILL * SAMPLES) * (1, -1) + SIZE * SAMPLES / 2


def box_triangles(cuboids: Cuboids) -> Float[np.ndarray, "t 3 3"]:
    """Twelve triangles a box, whichever way round: a silhouette has no inside and outside faces."""
    corners = cuboids.detach().corners().cpu().double().numpy()  # (n, 8, 3)
    return corners[:, TRIANGLES].reshape(-1, 3, 3)


def covered(triangles: Float[np.ndarray, "t 3 2"]) -> Bool[np.ndarray, "s s"]:
    """Which samples a triangle touches; corners are (column, row) in samples, all of them on the canvas.

    A triangle's share of a row of samples is convex: one run, as wide as what the row cuts out of its three edges.
    """
    side = SIZE * SAMPLES
    top, bottom = triangles[..., 1].min(axis=1), triangles[..., 1].max(axis=1)
    first = np.ceil(top - NEAR).astype(int) - 1
    count = np.floor(bottom + NEAR).astype(int) - first + 1  # rows that each triangle touches
    number = np.repeat(np.arange(len(triangles)), count)  # a triangle and a row, for all such pairs
    row = np.arange(len(number)) - np.repeat(np.cumsum(count) - count - first, count)
    left, right = np.full(len(number), np.inf), np.full(len(number), -np.inf)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        a, b = _cut(triangles[number, start], triangles[number, end], row)
        left, right = np.fmin(left, np.fmin(a, b)), np.fmax(right, np.fmax(a, b))
    begin, stop = np.ceil(left - NEAR).astype(int) - 1, np.floor(right + NEAR).astype(int) + 1
    cells = side * (side + 1)
    changes = np.bincount(row * (side + 1) + begin, minlength=cells) - np.bincount(
        row * (side + 1) + stop, minlength=cells
    )
    return changes.reshape(side, side + 1).cumsum(axis=1)[:, :side] > 0


def _cut(start: Float[np.ndarray, "k 2"], end: Float[np.ndarray, "k 2"], row) -> tuple:
    """The columns where each edge enters and leaves its row, which lies between `row` and `row` + 1; else NaN."""
    (x, y), (dx, dy) = start.T, (end - start).T
    low, high = np.minimum(y, y + dy), np.maximum(y, y + dy)
    flat = high - low < NEAR
    slope = dx / np.where(flat, 1, dy)
    enters = np.where(flat, x, x + (np.clip(row, low, high) - y) * slope)
    leaves = np.where(flat, x + dx, x + (np.clip(row + 1, low, high) - y) * slope)
    outside = (low > row + 1 + NEAR) | (high < row - NEAR)
    return np.where(outside, np.nan, enters), np.where(outside, np.nan, leaves)


def pixels(samples: Bool[np.ndarray, "s s"]) -> Bool[np.ndarray, "p p"]:
    """Pixels of which half the samples are covered, after what is thinner than a pixel was widened."""
    samples = _widened(_widened(samples)) | _widened(_widened(samples.T)).T  # 1 sample -> 3 -> 5
    high, wide = (side // SAMPLES for side in samples.shape)
    count = samples.reshape(high, SAMPLES, wide, SAMPLES).sum(axis=(1, 3))
    return 2 * count >= SAMPLES**2


def _widened(samples: Bool[np.ndarray, "s s"]) -> Bool[np.ndarray, "s s"]:
    """With the runs in each row that are shorter than a pixel longer by a sample at both ends, as a mirror has it too.
    Twice, and no run is shorter than a pixel: even where it moves on from row to row, half of some pixel is covered."""
    windows = np.lib.stride_tricks.sliding_window_view(samples, SAMPLES, axis=1).all(axis=-1)
    long = np.zeros_like(samples)
    for shift in range(SAMPLES):
        long[:, shift : shift + windows.shape[1]] |= windows
    short = samples & ~long
    wider = samples.copy()
    wider[:, 1:] |= short[:, :-1]
    wider[:, :-1] |= short[:, 1:]
    return wider
