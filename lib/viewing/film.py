"""A block as a strip of film: the state after each of its statements (ShapeAssembly paper, Figures 4 and 15)."""

import textwrap

import numpy as np
from matplotlib.figure import Figure

from lib.interpreters.shapeassembly import Attach, Block, Shape, trace
from lib.viewing.figure import film_strip

SOURCE, TARGET = "#1d3557", "#d62839"  # the point on the cuboid that moved, and the point it was brought to


def film(
    block: Block, *, first: int = 1, columns: int | None = None, size: float = 2.3, width: int = 26, **options
) -> Figure:
    """One frame a statement, from statement `first` on (0: the bbox line). The bounding box is the dashed frame.

    After an attach its two points are marked: red where the still cuboid wants it, blue where the moved cuboid's
    point came to lie; only red is seen where they meet. `width` is that of a caption, in characters; `options` are
    those of `film_strip`.
    """
    states = trace(block)[first:]
    statements = block.statements[first:]
    details = [
        {"ghost": state.boxes[:1], "points": _marks(state, s)}
        for state, s in zip(states, statements, strict=True)
    ]
    captions = [_wrapped(statement.to_text(), width) for statement in statements]
    return film_strip(
        states, captions, columns=columns or min(4, len(states)), size=size, details=details, **options
    )


def _wrapped(text: str, width: int) -> str:
    return "\n".join(textwrap.wrap(text, width, subsequent_indent="  "))


def _marks(state: Shape, statement) -> dict[str, np.ndarray]:
    if not isinstance(statement, Attach):
        return {}
    box = {path.rpartition("/")[2]: number for number, path in enumerate(state.box_names)}
    box["bbox"] = 0
    ends = {
        SOURCE: (statement.moved, statement.numbers[:3]),
        TARGET: (statement.still, statement.numbers[3:]),
    }
    return {
        color: state.boxes[[box[name]]].world(state.boxes.size.new_tensor([q])).numpy()
        for color, (name, q) in ends.items()
    }
