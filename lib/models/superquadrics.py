"""Superquadrics, from boxes with round edges to balls and stars: a rival's primitive (Paschalidou et al. 2019).

Code that fits them to a cloud without learning (EMS, Liu et al. 2022) is a repository, not a package that pip finds; it
is not among the rivals. Here a network says them.

    F(p) = ((x / a_x)^(2 / e_2) + (y / a_y)^(2 / e_2))^(e_2 / e_1) + (z / a_z)^(2 / e_1)      1 on the surface
    distance = |p| (1 - F^(-e_1 / 2))                                                          along the ray to p

It is no primitive of the CSG-Stump language: what is made of it has no text and no exact mesh.
"""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ..interpreters.stump import Primitive
from ..interpreters.stump.distances import norm
from ..interpreters.stump.given import Numbers

TINY = 1e-4  # coordinates count as this at least: powers of 0 have no slope


@dataclass(frozen=True, eq=False)
class Superquadric(Primitive):
    """half: half of its sides, a; exponents: e_1 and e_2, small for a box, 1 for a ball."""

    half: Numbers
    exponents: Numbers
    translation: Numbers = None
    rotation: Numbers = None
    name: ClassVar[str] = "superquadric"
    counts: ClassVar[dict[str, int]] = {"half": 3, "exponents": 2}

    def _formula(self):
        return radial_distance


def radial_distance(points: Tensor, sizes: Tensor) -> Tensor:
    """Of points (*n, m, 3) in own coordinates; sizes (*n, 5): half of the sides, then the exponents."""
    half, (first, second) = sizes[..., :3].abs(), sizes[..., 3:].unsqueeze(-2).unbind(-1)
    x, y, z = (points.abs().clamp(min=TINY) / half.unsqueeze(-2)).log().unbind(-1)
    # In logarithms, in which nothing overflows.
    disc = torch.logaddexp(2 / second * x, 2 / second * y) * second / first
    log_f = torch.logaddexp(disc, 2 / first * z)
    return norm(points) * (1 - torch.exp(-first / 2 * log_f))
