"""Where a primitive stands and how it is turned: world points into its own coordinates.

    p = R(rotation) (x - translation)

In space a rotation is a quaternion (w, x, y, z) of any length but nearly none (1e-150), which turns world axes into
the primitive's own (p = q (x - t) q*, the convention of the paper's program). In the plane it is one angle in radians:
the primitive itself stands turned by it, counter-clockwise where y points up.
"""

import torch
from jaxtyping import Float
from torch import Tensor

ANGLES = {2: 1, 3: 4}  # numbers that a rotation has, by dimension


def unturned(dimensions: int) -> list[float]:
    """The rotation that turns nothing."""
    return [1.0, 0.0, 0.0, 0.0] if dimensions == 3 else [0.0]


def matrices(rotation: Float[Tensor, "*n angles"]) -> Float[Tensor, "*n d d"]:
    """R of each rotation: (3, 3) of four numbers, (2, 2) of one."""
    if rotation.shape[-1] == 1:
        cos, sin = rotation[..., 0].cos(), rotation[..., 0].sin()
        return torch.stack([cos, sin, -sin, cos], -1).unflatten(-1, (2, 2))
    tiny = torch.finfo(
        rotation.dtype
    ).tiny  # the default would leave quaternions shorter than 1e-12 as they are
    w, x, y, z = torch.nn.functional.normalize(rotation, dim=-1, eps=tiny).unbind(-1)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return torch.stack([torch.stack(row, -1) for row in rows], -2)


def quaternion(matrix: Float[Tensor, "3 3"]) -> Float[Tensor, "4"]:
    """The quaternion (w, x, y, z) of length 1, w >= 0, whose `matrices` is this rotation matrix.

    It is the eigenvector, of the largest eigenvalue, of a symmetric matrix made of the entries, which is exact to
    rounding at every angle (Bar-Itzhack 2000).
    """
    (a, b, c), (d, e, f), (g, h, i) = matrix.double().tolist()
    symmetric = torch.tensor(
        [
            [a + e + i, h - f, c - g, d - b],
            [h - f, a - e - i, d + b, c + g],
            [c - g, d + b, e - a - i, h + f],
            [d - b, c + g, h + f, i - a - e],
        ],
        dtype=torch.float64,
    )
    vector = torch.linalg.eigh(symmetric).eigenvectors[:, -1]
    return vector if vector[0] >= 0 else -vector
