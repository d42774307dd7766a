"""How far is drawn what goes on for ever: a function at the end of a file, of the parameters above it.

    function endless() = 2 * norm(concat(window_low, window_high, F1_translation, F1_half, F2_translation, F2_radius));

`norm` is the root of the sum of the squares. What is seen lies in the window or in a finite primitive, no farther from
the origin than a corner, or than a translation and a size together; from another translation that is less than sqrt(3)
times this norm. So nobody sees an end, whatever the parameters are changed to.
"""

import math

from ..stump.primitives import POSE, Cone, Primitive
from .document import Application, Expression, Function, Name, Number, Operation
from .errors import ScadError
from .evaluating import Contents
from .helpers import used

NAME = "endless"
WINDOW = ("window_low", "window_high")
_HELPERS = {"endless_cylinder_of", "endless_cone_of", "half_plane_of"}
_FACTOR = Number(2)
_CLOSE = 1 - 1e-9  # sums may be rounded
_EXPECTED = "endless() = 2 * norm(concat(…)) of the window and of all translations and sizes"


def endless_function(primitives: tuple[Primitive, ...], helpers: set[str]) -> tuple[Function, ...]:
    """The function for a stump's file that uses these helpers, if it needs one. Raises ScadError for giants."""
    if not helpers & _HELPERS:
        return ()
    if not math.isfinite(math.hypot(*(n for primitive in primitives for n in _reach_numbers(primitive)))):
        raise ScadError("the shape reaches farther than any number", expected="a smaller one")
    names = [Name(name) for name in WINDOW] if _windowed(helpers) else []
    for k, primitive in enumerate(primitives, start=1):
        names += _reach(primitive, {key: Name(f"F{k}_{key}") for key in primitive.written})
    above = "How far what goes on for ever is drawn: farther than anything else, whatever the parameters."
    joined = Application("norm", (Application("concat", tuple(names)),))
    return (Function(NAME, (), Operation("*", _FACTOR, joined), above=above),)


def _windowed(helpers: set[str]) -> bool:
    return bool(helpers & {"window", "window_2d"})


def _reach(primitive: Primitive, names: dict[str, Name]) -> list[Expression]:
    sizes: list[Expression] = [name for key, name in names.items() if key not in POSE]
    if isinstance(primitive, Cone):  # a slope is no length; slope * height is a radius
        sizes = [names["height"], Operation("*", names["slope"], names["height"])] if len(sizes) == 2 else []
    return [names["translation"], *sizes]


def check_endless(file: Contents, primitives: list[Primitive]) -> None:
    """Raises ScadError where a file draws what goes on for ever, and its `endless` does not reach far enough."""
    helpers = used(file.modules.values())
    if not helpers & _HELPERS:
        return
    if NAME not in file.functions:
        raise ScadError("there is no function 'endless'", expected=f"function {_EXPECTED}")
    function = file.functions[NAME]
    dimensions = primitives[0].dimensions
    wanted = (
        [n for name in WINDOW for n in file.numbers(Name(name), dimensions)] if _windowed(helpers) else []
    )
    for primitive in primitives:
        wanted += _reach_numbers(primitive)
    if math.hypot(*_joined(file, function)) < _CLOSE * math.hypot(*wanted):
        raise ScadError("endless() leaves out a number of the shape", *function.at, NAME, _EXPECTED)


def _reach_numbers(primitive: Primitive) -> list[float]:
    sizes = primitive.sizes.tolist()
    if isinstance(primitive, Cone):
        sizes = [sizes[1], sizes[0] * sizes[1]] if len(sizes) == 2 else []
    return [*primitive.translation.tolist(), *sizes]


def _joined(file: Contents, function: Function) -> list[float]:
    """The numbers that stand in `2 * norm(concat(…))`."""
    match function.value:
        case Operation("*", factor, Application("norm", (Application("concat", joined),))) if (
            factor == _FACTOR
        ):
            values = [file.value(expression) for expression in joined]
        case _:
            values = [""]
    # A longer vector is nobody's size, and may be long.
    flat = [n for value in values for n in (value[:4] if isinstance(value, tuple) else (value,))]
    if function.parameters or not all(isinstance(number, float) for number in flat):
        raise ScadError("endless() is not as we write it", *function.at, NAME, _EXPECTED)
    return flat
