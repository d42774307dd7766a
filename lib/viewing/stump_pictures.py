"""What the three layers of a CSG-Stump look like, node by node: pictures that figures and the widget show.

A picture of the plane is image[row, column] of booleans, row 0 above: x grows right and y grows UP, as on paper. A
stump of space is cut through by a plane: nothing else shows what is outside of a box.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from lib.interpreters.stump import Stump
from lib.interpreters.stump.bounds import REACH, primitive_bounds
from lib.interpreters.stump.layers import binary

# Of each kind of primitive; told apart by colour-blind readers too. A box has the colour of a square, and so on.
COLORS = {
    "circle": "#d55e00", "square": "#0072b2", "triangle": "#009e73", "halfplane": "#b5588f",
    "sphere": "#d55e00", "box": "#0072b2", "cone": "#009e73", "cylinder": "#b5588f",
}  # fmt: skip
MARGIN = 0.15  # of the widest side of what is shown, on each side: what lies outside shall be seen, too


@dataclass(frozen=True)
class Pictures:
    """The values of all nodes: primitives O and complement layer F (K, r, r), nodes S (C, r, r), the shape T (r, r)."""

    primitives: Bool[np.ndarray, "k r r"]
    complements: Bool[np.ndarray, "k r r"]
    nodes: Bool[np.ndarray, "c r r"]
    shape: Bool[np.ndarray, "r r"]


def pictures_of(
    stump: Stump,
    resolution: int = 96,
    window: Float[Tensor, "2 2"] | Sequence | None = None,
    plane: str = "xy",
    at: float = 0.0,
) -> Pictures:
    """All nodes of a stump as pictures of resolution x resolution.

    window  lowest and highest coordinates to show, to the right and up; that of `picture_window` if left out.
    plane   for a stump of space: which axes go right and up; `at` says where the third one is cut, such as "xz" and the
            y of the cut. Raises ValueError for what are not two axes of the stump.
    """
    stump = stump.to("cpu")
    points = picture_points(stump, resolution, window, plane, at)
    inside = stump.distances(points).detach() <= 0
    w_c, w_i, w_u = (matrix.cpu() for matrix in stump.matrices)
    nodes, shape = binary(inside, w_c, w_i, w_u)
    layers = (inside, inside ^ w_c.unsqueeze(-1), nodes, shape)
    return Pictures(*(layer.unflatten(-1, (resolution, resolution)).numpy() for layer in layers))


def picture_points(
    stump: Stump,
    resolution: int,
    window: Float[Tensor, "2 2"] | Sequence | None = None,
    plane: str = "xy",
    at: float = 0.0,
) -> Float[Tensor, "m d"]:
    """The centers of a picture's pixels, row by row from above; arguments as in `pictures_of`."""
    right, up = _axes(stump, plane)
    low, high = torch.as_tensor(
        picture_window(stump, plane) if window is None else window, dtype=torch.float64
    )
    share = (torch.arange(resolution) + 0.5).to(low) / resolution
    rows, columns = torch.meshgrid(
        high[1] - share * (high - low)[1], low[0] + share * (high - low)[0], indexing="ij"
    )
    points = torch.full((resolution, resolution, stump.dimensions), float(at), dtype=torch.float64)
    points[..., right], points[..., up] = columns, rows
    return points.flatten(0, 1)


def _axes(stump: Stump, plane: str) -> tuple[int, int]:
    """The numbers of the axes that go right and up."""
    names = "xyz"[: stump.dimensions]
    if not isinstance(plane, str) or len(plane) != 2 or not set(plane) <= set(names) or plane[0] == plane[1]:
        raise ValueError(
            f"found the plane {plane!r:.40}; expected two axes of {', '.join(names)}, such as 'xy'"
        )
    return names.index(plane[0]), names.index(plane[1])


def picture_window(stump: Stump, plane: str = "xy") -> Float[Tensor, "2 2"]:
    """A square around all primitives, whatever the matrices do with them, and a margin.

    A primitive that goes on for ever, in some direction, has no say in it; if all do, -REACH to REACH is shown.
    """
    boxes = torch.stack([primitive_bounds(primitive) for primitive in stump.primitives])
    boxes = boxes[..., _axes(stump, plane)]
    low = torch.where(boxes[:, 0].isfinite(), boxes[:, 0], torch.inf).amin(0)
    high = torch.where(boxes[:, 1].isfinite(), boxes[:, 1], -torch.inf).amax(0)
    low, high = torch.where(low.isfinite(), low, -REACH), torch.where(high.isfinite(), high, REACH)
    half = (0.5 + MARGIN) * (high - low).max().clamp(min=1e-6)
    return torch.stack([(low + high) / 2 - half, (low + high) / 2 + half])


def color_of(primitive) -> str:
    """The colour in which a primitive is drawn."""
    return COLORS[primitive.name]
