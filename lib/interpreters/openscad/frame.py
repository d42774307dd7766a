"""The parameters of a file as a whole, for its reader: those that its helpers need are there, and say something."""

from .document import Name
from .errors import ScadError
from .evaluating import Contents, describe
from .helpers import used

SEGMENTS = 48  # corners of a circle: OpenSCAD's solids take seconds with many more
_WINDOWS = {"window": 3, "window_2d": 2}


def check_frame(file: Contents) -> None:
    """Raises ScadError where `$fn`, `height` or the window is missing, or is nothing that OpenSCAD can draw with."""
    helpers = used([*file.modules.values(), *file.calls])
    if "swollen" in helpers:
        expected = f"a whole number, at least 3, such as $fn = {SEGMENTS};"
        corners = _value(file, "$fn", expected)
        if not isinstance(corners, float) or corners < 3 or corners % 1:
            raise _wrong(file, "$fn", expected)
    if helpers & {"extruded", "plate"}:
        expected = "a number above 0, how high the plate is"
        height = _value(file, "height", expected)
        if not isinstance(height, float) or height <= 0:
            raise _wrong(file, "height", expected)
    for name in sorted(helpers & set(_WINDOWS)):
        _check_window(file, _WINDOWS[name])


def _check_window(file: Contents, dimensions: int) -> None:
    expected = f"a vector of {dimensions} numbers"
    for name in ("window_low", "window_high"):
        _value(file, name, expected)
    low, high = (file.numbers(Name(name), dimensions) for name in ("window_low", "window_high"))
    for axis, least, most in zip("xyz", low, high):
        if least > most:  # equal ones draw nothing, which may be what there is
            found = f"window_low is {least:.6g} in {axis}, window_high {most:.6g}"
            raise ScadError(found, *file.place(Name("window_low")), expected="window_high above it")


def _value(file: Contents, name: str, expected: str):
    if name not in file.parameters:
        raise ScadError(f"there is no parameter {name!r}", expected=expected)
    return file.parameters[name]


def _wrong(file: Contents, name: str, expected: str) -> ScadError:
    found = f"{name} is {describe(file.parameters[name])}"
    return ScadError(found, *file.place(Name(name)), expected=expected)
