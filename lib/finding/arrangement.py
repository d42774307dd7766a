"""What a search for matrices needs to know of its points: the cells of the arrangement, and the literals.

Points that lie in the same primitives are one cell: no stump can tell them apart, so a cell is in or out as a whole.
Its value is the weight of its points that should be in, less that of those that should be out: what it is worth to
have it in. A literal is one way to use a primitive: literal g is "inside of row g", literal g + G "outside of row g".
A term, an intersection node, is a tuple of literals; several of them united are the shape.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

Term = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Arrangement:
    """G different rows, M cells. Rows that are equal, or each other's complements, are one row; one that holds all
    points or none is left out, for it can tell nothing apart.

    literals  (2G, M) which cells each literal holds
    value     (M) weight for having a cell in; less than 0: it should be out
    coupled   (G) the row stands for one primitive only, whose complement is chosen once for all nodes
    floor     weight that is wrong whatever the matrices are: points of one cell that should be in and out
    total     weight of all points
    step      every sum of values is a multiple of this; None where weights have no common measure
    """

    literals: Bool[np.ndarray, "l m"]
    value: Float[np.ndarray, " m"]
    coupled: Bool[np.ndarray, " g"]
    floor: float
    total: float
    step: float | None
    primitives: Int[np.ndarray, " g 2"]  # which primitive is literal g, and which literal g + G
    turned: Bool[np.ndarray, " g 2"]  # whether the primitive is complemented for it
    count: int  # primitives, K

    @staticmethod
    def of(
        inside: Bool[np.ndarray, "k n"], target: Bool[np.ndarray, " n"], weights: Float[np.ndarray, " n"]
    ) -> "Arrangement":
        """The cells of N points in K primitives: inside[k, n], and which points should be in."""
        columns, cell = distinct(inside.T)
        wanted = np.bincount(cell, weights * target, len(columns))
        unwanted = np.bincount(cell, weights * ~target, len(columns))
        rows, primitives, turned = _rows(columns.T)
        value = wanted - unwanted
        return Arrangement(
            literals=np.concatenate([rows, ~rows]),
            value=value,
            coupled=primitives[:, 0] == primitives[:, 1],
            floor=float(np.minimum(wanted, unwanted).sum()),
            total=float(weights.sum()),
            step=_step(value),
            primitives=primitives,
            turned=turned,
            count=len(inside),
        )

    @property
    def rows(self) -> int:
        """G"""
        return len(self.coupled)

    @cached_property
    def held(self) -> Float[np.ndarray, "m l"]:
        """The literals as numbers, for products of matrices: counts of cells are exact up to 2^24."""
        return np.ascontiguousarray(self.literals.T, np.float32)

    def opposite(self, literal: int) -> int:
        """The same row used the other way."""
        return (literal + self.rows) % (2 * self.rows)

    def extent(self, term: Term) -> Bool[np.ndarray, " m"]:
        """The cells that a term holds; the empty term holds all."""
        return self.literals[list(term)].all(0)

    def extents(self, terms: Sequence[Term]) -> Bool[np.ndarray, "t m"]:
        return np.array([self.extent(term) for term in terms], bool).reshape(len(terms), len(self.value))

    def error(self, terms: Sequence[Term]) -> float:
        """Weight of the points that are wrong when these terms are united."""
        covered = self.extents(terms).any(0)
        return self.floor + float(
            self.value[~covered].clip(min=0).sum() - self.value[covered].clip(max=0).sum()
        )

    def rank(self, terms: Sequence[Term]) -> tuple[float, int]:
        """Less is better: the error as a share of the total, then the number of literals and nodes."""
        # Sums in another order differ in their last digits, which must not decide.
        return round(self.error(terms) / self.total, 12), sum(len(term) + 1 for term in terms)

    def fits(self, terms: Sequence[Term]) -> bool:
        """Whether no coupled row is used both ways."""
        used = {literal for term in terms for literal in term}
        return not any(self.opposite(x) in used and self.coupled[x % self.rows] for x in used)

    def matrices(self, terms: Sequence[Term]) -> tuple[np.ndarray, np.ndarray]:
        """Complement (K) and intersection (K, C) of terms that fit, all of them united."""
        complement = np.zeros(self.count, bool)
        intersection = np.zeros((self.count, len(terms)), bool)
        for node, term in enumerate(terms):
            for literal in term:
                way, row = divmod(literal, self.rows)
                complement[self.primitives[row, way]] = self.turned[row, way]
                intersection[self.primitives[row, way], node] = True
        return complement, intersection


def distinct(rows: Bool[np.ndarray, "n k"]) -> tuple[Bool[np.ndarray, "m k"], Int[np.ndarray, " n"]]:
    """(the different rows, which of them each row is)."""
    if not rows.shape[1]:
        return rows[:1], np.zeros(len(rows), int)
    packed = np.packbits(rows, axis=1)
    keys = np.ascontiguousarray(packed).view(np.dtype((np.void, packed.shape[1])))[:, 0]
    _, first, which = np.unique(keys, return_index=True, return_inverse=True)
    return rows[first], which.reshape(-1)


def _rows(inside: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(rows (G, M), primitives (G, 2), turned (G, 2)) of the primitives (K, M)."""
    groups: dict[bytes, list[int]] = {}
    for k, row in enumerate(inside):
        if row.any() and not row.all():
            groups.setdefault((row ^ row[0]).tobytes(), []).append(k)
    primitives = np.array([[same[0], same[-1]] for same in groups.values()], int).reshape(-1, 2)
    rows = inside[primitives[:, 0]]
    # The second primitive may be the first one's complement already.
    alike = (inside[primitives[:, 1]] == rows).all(1)
    return rows, primitives, np.stack([np.zeros(len(rows), bool), alike], 1)


def _step(value: np.ndarray) -> float | None:
    """The greatest common measure, by Euclid; None where it is tiny, as for weights that are any numbers."""
    sizes = np.unique(np.abs(value))
    sizes = sizes[sizes > 1e-9 * sizes.max(initial=0.0)].tolist()
    step = sizes[0] if sizes else 0.0
    for size in sizes:
        while size > 1e-7 * sizes[-1]:
            step, size = size, abs(step - round(step / size) * size)
    return step if step > 1e-4 * sum(sizes[:1]) else None
