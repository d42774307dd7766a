"""Pictures that do not quite lie on the grid of the primitives: moved and stretched a little, their programs unchanged.

Random programs draw with centers and sizes on a grid of 8 and 4 pixels; nothing that people draw does. The authors'
program shows all its training pictures of the plane like this: moved by up to 3 pixels, and stretched or shrunk by up
to 2 of 64 in each direction, every pixel taken from the nearest place. (The paper does not say so.)
"""

import torch
from jaxtyping import Bool, Int
from torch import Tensor

MOVED, STRETCHED = 3, 2 / 64


def jittered(
    images: Bool[Tensor, "n side side"], share: float, noise: torch.Generator
) -> Bool[Tensor, "n side side"]:
    """The images, about a share of them moved and stretched, each by random amounts in each direction.

    What comes in from outside repeats the pixels of the edge. noise: a generator on the CPU. Raises ValueError for what
    are no square images, and for a share that is not from 0 to 1.
    """
    if images.ndim != 3 or images.shape[1] != images.shape[2]:
        raise ValueError(f"found images {tuple(images.shape)}; expected (n, side, side)")
    if not 0 <= share <= 1:
        raise ValueError(f"found a share of {share}; expected 0 to 1")
    count, side = images.shape[:2]
    chosen = torch.rand(count, 1, generator=noise) < share
    rows, columns = (_places(chosen, side, noise).to(images.device) for _ in range(2))
    picture = torch.arange(count, device=images.device)
    return images[picture[:, None, None], rows[:, :, None], columns[:, None, :]]


def _places(chosen: Bool[Tensor, "n 1"], side: int, noise: torch.Generator) -> Int[Tensor, "n side"]:
    """Of each image, where along one direction each pixel is taken from."""
    middle = (side - 1) / 2
    moved, stretched = (
        most * (2 * torch.rand(len(chosen), 1, generator=noise) - 1) * chosen for most in (MOVED, STRETCHED)
    )
    places = (torch.arange(side) - middle - moved) / (1 + stretched) + middle
    return places.round().long().clamp(0, side - 1)
