"""How far generated shapes are from known ones and from one another (ShapeAssembly paper, Table 4).

    generalisation   mean distance from each generated shape to the nearest training shape       (low: copies)
    coverage         mean distance from each validation shape to the nearest generated shape     (low: none is missed)
    variety          mean distance from each generated shape to the nearest other generated one  (low: all alike)

Distance is the Chamfer distance of `points.chamfer_distance`, in world units: the sum of the two mean Euclidean
distances to the nearest point, between POINTS points on the faces of each shape's boxes, uniform by area. The paper
does not say which Chamfer distance it uses; this one gives its Validation row (PAPER) from the real programs. Even two
clouds of one shape are some 0.07 apart, because the points are drawn: so the number of points is part of the
definition, and so is that each shape has its own. The paper's "variety" row of validation shapes comes out where each
is compared with all others of the validation split; it shrinks as a set grows, so compare sets of one size.
"""

from dataclasses import asdict, dataclass

from jaxtyping import Float
from torch import Tensor

from ..interpreters.shapeassembly import Shapes
from .cloud_search import Nearest, nearest_clouds
from .clouds import surface_points_many

POINTS = 1_024  # on each shape


@dataclass(frozen=True)
class Novelty:
    """A row of Table 4, world units; None where the paper has no number."""

    generalisation: float
    coverage: float | None
    variety: float

    def as_row(self) -> dict[str, float | None]:
        """For tables: rounded to what the paper prints."""
        return {name: value and round(value, 4) for name, value in asdict(self).items()}


# Jones et al. 2020, Table 4: their model ("Ours") and the validation split in its place.
PAPER = {
    "chair": {"model": Novelty(0.108, 0.118, 0.104), "validation": Novelty(0.105, None, 0.114)},
    "table": {"model": Novelty(0.101, 0.108, 0.102), "validation": Novelty(0.09, None, 0.099)},
    "storage": {"model": Novelty(0.125, 0.129, 0.119), "validation": Novelty(0.11, None, 0.125)},
}


def novelty(generated: Shapes, train: Shapes, validation: Shapes | None = None, seed: int = 0) -> Novelty:
    """Generalisation, coverage (None without validation shapes) and variety of executed programs.

    seed   of the points on the shapes; the three sets get different ones, so that a copy is as far from its
           original as two clouds of one surface are, and not 0
    Raises ValueError for a shape without a surface, and for too few shapes (one to be nearest is needed each time).
    """
    sets = [generated, train] if validation is None else [generated, train, validation]
    clouds = [surface_points_many(shapes, POINTS, 3 * seed + i) for i, shapes in enumerate(sets)]
    return Novelty(
        generalisation=generalisation(clouds[0], clouds[1]),
        coverage=None if validation is None else coverage(clouds[0], clouds[2]),
        variety=variety(clouds[0]),
    )


def generalisation(generated: Float[Tensor, "generated n 3"], train: Float[Tensor, "train m 3"]) -> float:
    """Mean Chamfer distance from each generated cloud to the nearest training cloud, world units."""
    return _mean(nearest_clouds(generated, train))


def coverage(generated: Float[Tensor, "generated n 3"], validation: Float[Tensor, "validation m 3"]) -> float:
    """Mean Chamfer distance from each validation cloud to the nearest generated cloud, world units."""
    return _mean(nearest_clouds(validation, generated))


def variety(generated: Float[Tensor, "generated n 3"]) -> float:
    """Mean Chamfer distance from each generated cloud to the nearest other generated one, world units."""
    return _mean(nearest_clouds(generated))


def _mean(nearest: Nearest) -> float:
    return float(nearest.distance.mean())
