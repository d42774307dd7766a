"""Which surfaces bound a common part of the solid: pieces, grown from single points.

A piece is what lies on given sides of some of the surfaces, all of it in the solid. At a point in the solid it begins
with the point's sides of all surfaces. Then one surface after the other is let go, each time the one that lets the
piece grow most, as long as hardly anything comes in from outside. What is left cannot spare any surface: the piece is
as large as it can be. (In two-level logic that is a prime implicant, made by the expansion of Brayton et al. 1984,
Logic Minimization Algorithms for VLSI Synthesis; there of truth tables.)
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from .probing import Probes
from .surfaces import Surface

Piece = frozenset[tuple[int, bool]]  # (which surface, on its inside)
IMPURE = 0.03  # share of what comes in that may come from outside
REST = 0.003  # share of the solid that may stay without a piece
MOST = 120  # seeds


def ends(surfaces: Sequence[Surface], points: Float[np.ndarray, "n 3"], tolerance: float) -> list[Surface]:
    """Planes across the axes of cylinders and cones where their points end, and no detected plane lies there. Without
    them a rod that ends in a ball would go on behind it."""
    found: list[Surface] = []
    for surface in surfaces:
        if surface.kind not in ("cylinder", "cone"):
            continue
        along = (points[surface.members] - surface.place) @ surface.axis
        for way, reach in ((-1, np.quantile(-along, 0.99)), (1, np.quantile(along, 0.99))):
            if way < 0 and surface.kind == "cone":
                reach = min(reach, 0.0)  # no farther than the apex
            center = surface.place + way * reach * surface.axis
            plane = Surface("plane", np.concatenate([way * surface.axis, center]), False, surface.members[:0])
            if not any(_alike(plane, other, tolerance) for other in (*surfaces, *found)):
                found.append(plane)
    return found


def _alike(one: Surface, other: Surface, tolerance: float) -> bool:
    """Whether two planes are nearly one near the first one's point."""
    if other.kind != "plane" or abs(one.axis @ other.axis) < 0.98:
        return False
    return abs(other.distance(one.place[None])[0]) < 2 * tolerance


def pieces(surfaces: Sequence[Surface], probes: Probes, seed: int) -> list[Piece]:
    """Pieces that together hold nearly all probes in the solid, the largest first, without repetition."""
    growth, rng = _Growth(surfaces, probes), np.random.default_rng(seed)
    missing, found = probes.inside.copy(), {}
    for _ in range(MOST):
        if missing.sum() <= REST * probes.inside.sum():
            break
        start = int(rng.choice(np.flatnonzero(missing)))
        piece, holds = growth.from_point(start)
        found[piece] = int((holds & probes.inside).sum())
        missing &= ~holds
        missing[start] = False
    return sorted(found, key=lambda piece: (-found[piece], sorted(piece)))


class _Growth:
    def __init__(self, surfaces: Sequence[Surface], probes: Probes):
        self.inside = probes.inside
        self.sides = np.stack([surface.distance(probes.points) <= 0 for surface in surfaces])  # (surfaces, n)

    def from_point(self, start: int) -> tuple[Piece, Bool[np.ndarray, " n"]]:
        """The piece grown from a probe, and the probes that it holds."""
        own = self.sides[:, start]
        differs = self.sides != own[:, None]
        kept = np.ones(len(own), bool)
        while (surface := self._spared(differs, kept)) is not None:
            kept[surface] = False
        piece = frozenset((int(k), bool(own[k])) for k in np.flatnonzero(kept))
        return piece, ~differs[kept].any(0)

    def _spared(self, differs: np.ndarray, kept: np.ndarray) -> int | None:
        """The surface whose absence lets most in, hardly any of it from outside; None where there is no such one."""
        once = differs[kept].sum(0) == 1  # probes that one surface alone keeps out
        out = differs[:, once] & kept[:, None]
        good, bad = (out & self.inside[once]).sum(1), (out & ~self.inside[once]).sum(1)
        free = kept & (bad <= IMPURE * good)
        if not free.any():
            return None
        return int(np.argmax(np.where(free, good, -1)))
