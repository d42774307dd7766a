"""Where the outline of a black-and-white image runs: the edge map of CSGNet's authors, pixel for pixel.

They call OpenCV's Canny with thresholds 1 and 3 on the image as 0 and 255. Every change of brightness is far above
both, so only two of Canny's steps matter:

    gradient    gx, gy by Sobel's 3 x 3 masks; beyond the border the image repeats its outermost pixels.
                Its size is m = |gx| + |gy|, and 0 beyond the border.
    thinning    a pixel is an edge if m has a peak there, looked at across the edge: left and right, up and down, or
                along one of the diagonals, whichever is closest to the direction of the gradient.

Images are [row y, column x], y grows downwards. With 0 and 1 as brightness all numbers are whole and at most 8, so
bytes do. Canny takes the neighbours left and right where |gy| / |gx| < tan 22.5° = 0.414. Here < 1/2 says the same: no
two whole numbers up to 4 have a ratio from 0.414 up to 1/2. Likewise up and down.
"""

from math import prod

import torch
from jaxtyping import Bool, Int8, Shaped
from torch import Tensor
from torch.nn.functional import pad

PIXELS_AT_ONCE = 1 << 19  # 128 images of 64 x 64: enough work for a call of torch, and still in the cache
MORE_ON_GPU = 64  # times as much at once, to keep all of it busy


def edge_map(images: Bool[Tensor, "*batch h w"]) -> Bool[Tensor, "*batch h w"]:
    """True on the outline: a line about one pixel thick, some of it just inside the shape, some just outside.

    The same as OpenCV's `Canny(255 * image, 1, 3)` (aperture 3, L1 gradient). An image that is all False or all True
    has no edges: beyond the border the shape goes on. Leading dimensions are a batch.
    Raises ValueError for anything but bool images with at least one pixel.
    """
    check_images(images=images)
    if not images.numel():
        return images.clone()
    parts = in_parts(images.reshape(-1, *images.shape[-2:]), PIXELS_AT_ONCE)
    return torch.cat([_edges(part) for part in parts]).view(images.shape)


def check_images(**images: Tensor) -> None:
    """Raises ValueError, with the argument's name, unless these are bool images (..., h, w), all of one shape."""
    for name, image in images.items():
        if not isinstance(image, Tensor):
            raise ValueError(f"{name}: {_no_tensor(name, image)}")
        if image.dtype != torch.bool:
            raise ValueError(f"{name} has to be bool, got {image.dtype}; `{name} > 0.5` makes it so")
        if image.ndim < 2 or not prod(image.shape[-2:]):
            raise ValueError(
                f"{name} has to be images (..., height, width) with pixels, got {tuple(image.shape)}"
            )
    shapes = {name: tuple(image.shape) for name, image in images.items()}
    if len({*shapes.values()}) > 1:
        found = " and ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ValueError(f"images have to have one shape, got {found}; `expand_as` repeats an image")


def _no_tensor(name: str, thing) -> str:
    """What was found instead of a tensor, and how to make one of it."""
    how = "shape.grid" if hasattr(type(thing), "grid") else "shape.image"
    if hasattr(thing, "__array__"):
        how = f"torch.as_tensor({name})"
    return f"found a {type(thing).__name__}; expected a bool tensor (…, h, w), such as {how}"


def in_parts(batch: Tensor, cells: int) -> tuple[Tensor, ...]:
    """The batch cut along its first dimension: parts of about so many cells on the CPU, more on a GPU."""
    if batch.device.type != "cpu":
        cells *= MORE_ON_GPU
    return batch.split(max(1, cells // prod(batch.shape[1:])))


def _edges(images: Bool[Tensor, "n h w"]) -> Bool[Tensor, "n h w"]:
    """All images lie in one long row of pixels, framed, one after another: there a neighbour is always the same number
    of places away, and torch is at its quickest. What comes out in the frames has no meaning and is cut off."""
    n, h, w = images.shape
    row = w + 2

    def inside(x: Tensor) -> Tensor:
        return pad(x, [row + 1, row + 1]).view(n, h + 2, row)[:, 1:-1, 1:-1]

    gx, gy = _gradient(_framed(images, repeat=True).view(-1), row)
    size = _framed(inside(gx.abs().add_(gy.abs()))).view(-1)
    return inside(_thinned(gx, gy, size, row))


def _gradient(x: Int8[Tensor, " pixels"], row: int) -> tuple[Int8[Tensor, " inner"], Int8[Tensor, " inner"]]:
    """Sobel's gx and gy, from -4 to 4. The pixel below is `row` places away, so the first and last row + 1 drop out."""
    above, here, below = x[: -2 * row], x[row:-row], x[2 * row :]
    smooth = (above + below).add_(here, alpha=2)
    change = below - above
    return smooth[2:] - smooth[:-2], (change[:-2] + change[2:]).add_(change[1:-1], alpha=2)


def _thinned(
    gx: Int8[Tensor, " inner"], gy: Int8[Tensor, " inner"], size: Int8[Tensor, " pixels"], row: int
) -> Bool[Tensor, " inner"]:
    """Is the gradient's size a peak? Of two equal ones the left or upper one counts; along a diagonal, neither."""
    above, here, below = size[: -2 * row], size[row:-row], size[2 * row :]
    left, middle, right = slice(None, -2), slice(1, -1), slice(2, None)
    m, ax, ay = here[middle], gx.abs(), gy.abs()
    sideways, upright = 2 * ay < ax, 2 * ax < ay  # the gradient's direction, not the edge's
    falling = (gx + gy).abs_() == m  # same signs: the gradient runs from upper left to lower right, or back
    edge = _all(m > here[left], m >= here[right], sideways)
    edge |= _all(m > above[middle], m >= below[middle], upright)
    diagonal = _all(m > above[left], m > below[right], falling)
    diagonal |= _all(m > above[right], m > below[left], ~falling)
    return edge.bitwise_or_(_all(diagonal, ~sideways, ~upright))


def _all(first: Bool[Tensor, " inner"], *others: Bool[Tensor, " inner"]) -> Bool[Tensor, " inner"]:
    """Logical and, written over the first: quicker than new memory each time."""
    for other in others:
        first &= other
    return first


def _framed(x: Shaped[Tensor, "n h w"], repeat: bool = False) -> Int8[Tensor, "n h+2 w+2"]:
    """With a frame around each image: of zeros, or a repetition of its outermost pixels."""
    n, h, w = x.shape
    frame = torch.zeros(n, h + 2, w + 2, dtype=torch.int8, device=x.device)
    frame[:, 1:-1, 1:-1] = x.view(torch.int8)
    if repeat:
        frame[:, 0], frame[:, -1] = frame[:, 1], frame[:, -2]
        frame[:, :, 0], frame[:, :, -1] = frame[:, :, 1], frame[:, :, -2]
    return frame
