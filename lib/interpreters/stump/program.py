"""A CSG-Stump: primitives O_k and three binary matrices, which say any solid in three layers.

    F_k = W_C[k] (1 - O_k) + (1 - W_C[k]) O_k      complement    (K)      not F_k: outside of primitive k
    S_c = min_k (W_I[k, c] F_k + 1 - W_I[k, c])    intersection  (K, C)   where all selected F_k are
    T   = max_c  W_U[c] S_c                        union         (C)      where any selected S_c is

O_k(x) is 1 inside primitive k, its surface included, else 0. Two edges follow from the formulas: an intersection of
nothing is the whole space, and a union of nothing is empty. (CSG-Stump Net, Ren et al. 2021, "CSG-Stump Structure".)
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from .errors import ProgramError
from .given import as_numbers, native
from .primitives import Primitive, distances

EVERYTHING, NOTHING = "everything", "nothing"  # an intersection, and a union, of nothing
Matrix = Tensor | np.ndarray | Sequence  # of 0 and 1, False and True
MOST = 1 << 26  # cells of the intersection matrix: 64 MB


@dataclass(frozen=True, eq=False)
class Stump:
    """primitives: one or more, each single, all of the plane or all of space; the matrices hold only 0 and 1.

    Raises ProgramError for anything else. `parse(stump.to_text()) == stump`.
    """

    primitives: Sequence[Primitive]  # becomes a tuple
    complement: Matrix  # (K), becomes a tensor of bools
    intersection: Matrix  # (K, C)
    union: Matrix  # (C)

    def __post_init__(self):
        if not isinstance(self.primitives, Iterable):
            found = f"the primitives are a {type(self.primitives).__name__}"
            raise ProgramError(found, expected="a sequence of them, such as [Sphere(0.5)]")
        object.__setattr__(self, "primitives", tuple(self.primitives))
        check_primitives(self.primitives)
        count = len(self.primitives)
        for key, shape in (("complement", (count,)), ("intersection", (count, None)), ("union", (None,))):
            object.__setattr__(self, key, _binary(key, getattr(self, key), shape))
        if len(self.union) != self.intersection.shape[1]:
            found = f"the union has {len(self.union)} nodes, the intersection {self.intersection.shape[1]}"
            raise ProgramError(found, expected="as many")

    def __repr__(self) -> str:
        used, nodes = (
            f"{n} {word}{'s' * (n != 1)}" for n, word in zip(self.intersection.shape, ("primitive", "node"))
        )
        return f"Stump({used}, {nodes}, {int(self.union.sum())} united)"

    def __eq__(self, other) -> bool:
        return (
            isinstance(other, Stump)
            and self.primitives == other.primitives
            and all(torch.equal(a.cpu(), b.cpu()) for a, b in zip(self.matrices, other.matrices))
        )

    def __hash__(self) -> int:
        return hash((self.primitives, *(tuple(matrix.flatten().tolist()) for matrix in self.matrices)))

    @property
    def matrices(self) -> tuple[Tensor, Tensor, Tensor]:
        """Complement (K), intersection (K, C), union (C)."""
        return self.complement, self.intersection, self.union

    @property
    def dimensions(self) -> int:
        """2 for a stump of the plane, 3 for one of space."""
        return self.primitives[0].dimensions

    def to_text(self) -> str:
        """The stump as a text; see `parsing` for the grammar."""
        from .writing import to_text

        return to_text(self)

    def to_openscad(self) -> str:
        """An OpenSCAD file; `openscad.read` gives the same stump."""
        from ..openscad import write

        return write(self)

    def parameters(self) -> Float[Tensor, " p"]:
        """All numbers of all primitives in text order: sizes, translation, rotation of each."""
        return torch.cat([primitive.numbers for primitive in self.primitives])

    def with_parameters(self, vector: Float[Tensor, " p"]) -> "Stump":
        """The same matrices with other numbers; gradients flow from its distances into the vector."""
        vector = as_numbers(vector)
        widths = [len(primitive.numbers) for primitive in self.primitives]
        if vector.shape != (sum(widths),):
            raise ProgramError(
                f"parameters of shape {tuple(vector.shape)}", expected=f"a vector of {sum(widths)}"
            )
        parts = vector.split(widths)
        return Stump(tuple(p.with_numbers(v) for p, v in zip(self.primitives, parts)), *self.matrices)

    @property
    def structure(self) -> tuple:
        """What is left without the parameters: comparable and hashable."""
        kinds = tuple((p.name, *p.written) for p in self.primitives)
        return kinds, *(tuple(map(tuple, m.view(len(m), -1).tolist())) for m in self.matrices)

    def to(self, *args) -> "Stump":
        """The same stump, its primitives with another dtype or on another device, as `Tensor.to`."""
        return Stump(tuple(p.to(*args) for p in self.primitives), *self.matrices)

    def distances(self, points: Float[Tensor, "m d"]) -> Float[Tensor, "k m"]:
        """Signed distance of each point to each primitive, negative inside; the matrices have no say here."""
        return distances(self.primitives, points)

    def pruned(self) -> "Stump":
        """Without the nodes that are not united, and the primitives that no united node selects. The same solid.

        Where nothing is left, one primitive stays.
        """
        nodes = self.union
        rows = self.intersection[:, nodes].any(1)
        rows[0] |= not rows.any()
        kept = tuple(p for p, keep in zip(self.primitives, rows.tolist()) if keep)
        return Stump(kept, self.complement[rows], self.intersection[rows][:, nodes], self.union[nodes])

    @staticmethod
    def from_tree(tree) -> "Stump":
        """The stump that is the same solid as a tree of operations; see `trees`."""
        from .trees import from_tree

        return from_tree(tree)

    @staticmethod
    def from_csg(program) -> "Stump":
        """The stump that is the same solid as a CSG program, in pixels, y down in the plane; see `converting`."""
        from .converting import csg_tree

        return Stump.from_tree(csg_tree(program))

    @staticmethod
    def from_shapeassembly(program) -> "Stump":
        """The stump that is the same solid as a ShapeAssembly program: one node for each leaf cuboid."""
        from .converting import shapeassembly_tree

        return Stump.from_tree(shapeassembly_tree(program))

    def to_tree(self):
        """A tree of operations that is the same solid; see `trees`."""
        from .trees import to_tree

        return to_tree(self)


def check_primitives(primitives: tuple) -> None:
    """Raises ProgramError unless these are one or more single primitives, all of the plane or all of space."""
    if not primitives:
        raise ProgramError("the stump has no primitives", expected="at least one")
    for place, primitive in enumerate(primitives, start=1):
        if not isinstance(primitive, Primitive):
            found = f"primitive {place} is a {type(primitive).__name__}"
            raise ProgramError(found, expected="a Primitive, such as Sphere(0.5)")
        if primitive.dimensions != primitives[0].dimensions:
            found = f"primitive {place} ({primitive.name}) has {primitive.dimensions} dimensions"
            raise ProgramError(found, expected=f"{primitives[0].dimensions}, as the first one has")
        if primitive.translation.ndim > 1:
            found = f"primitive {place} is a batch of shape {tuple(primitive.translation.shape[:-1])}"
            raise ProgramError(found, expected="a single one")
        if not primitive.numbers.isfinite().all():
            raise ProgramError(
                f"primitive {place} ({primitive.name}) has a number that is not finite",
                expected="finite ones",
            )
        if primitive.dimensions == 3 and not primitive.rotation.any():
            found = f"the rotation of primitive {place} ({primitive.name}) is zero"
            raise ProgramError(found, expected="a quaternion w, x, y, z with a length, such as 1, 0, 0, 0")


def _binary(key: str, given, shape: tuple) -> Bool[Tensor, "*n"]:
    """The matrix as bools of its own. Raises ProgramError for another shape, and for anything but 0 and 1."""
    expected = "(" + ", ".join(str(n or "C") for n in shape) + ") of 0 and 1"
    try:
        matrix = torch.as_tensor(native(given))
    except (TypeError, ValueError, RuntimeError):
        raise ProgramError(f"{key} is {given!r:.40}", expected=expected) from None
    fits = matrix.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, matrix.shape))
    if not fits:
        raise ProgramError(f"{key} has the shape {tuple(matrix.shape)}", expected=expected)
    if matrix.layout != torch.strided or matrix.is_meta:
        raise ProgramError(f"{key} is a sparse or a meta tensor", expected=expected)
    if matrix.numel() > MOST:
        raise ProgramError(f"{key} has {matrix.numel()} cells", expected=f"at most {MOST}")
    if not ((matrix == 0) | (matrix == 1)).all():
        raise ProgramError(f"{key} has other numbers than 0 and 1", expected=expected)
    return matrix.to(torch.bool, copy=True)
