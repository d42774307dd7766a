"""Stump -> text: one line a primitive, a node, and the shape. `parsing` has the grammar."""

from .poses import unturned
from .primitives import Primitive


def to_text(stump) -> str:
    """Read back by `parse`, every number to its last bit."""
    from .program import EVERYTHING, NOTHING

    lines = []
    for k, (primitive, outside) in enumerate(zip(stump.primitives, stump.complement.tolist()), start=1):
        lines.append(f"F{k} = {'not ' * outside}{primitive_text(primitive)}")
    for c, column in enumerate(stump.intersection.T.tolist(), start=1):
        selected = [f"F{k}" for k, one in enumerate(column, start=1) if one]
        lines.append(f"S{c} = {' & '.join(selected) or EVERYTHING}")
    united = [f"S{c}" for c, one in enumerate(stump.union.tolist(), start=1) if one]
    lines.append(f"T = {' | '.join(united) or NOTHING}")
    return "\n".join(lines) + "\n"


def primitive_text(primitive: Primitive) -> str:
    """Such as "box(half=(0.5, 0.5, 0.1), translation=(0.0, 0.0, 1.0))"; a pose that changes nothing is left out."""
    defaults = {"translation": [0.0] * primitive.dimensions, "rotation": unturned(primitive.dimensions)}
    arguments = []
    for key in primitive.written:
        numbers = getattr(primitive, key).detach().double().reshape(-1).tolist()
        if numbers != defaults.get(key):
            values = ", ".join(map(repr, numbers))
            arguments.append(f"{key}={values}" if len(numbers) == 1 else f"{key}=({values})")
    return f"{primitive.name}({', '.join(arguments)})"
