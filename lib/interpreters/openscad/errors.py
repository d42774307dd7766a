"""The one exception of the OpenSCAD reader and writer."""

from ..line_errors import LineError


class ScadError(LineError):
    """A text that is not among the OpenSCAD files we write, or a shape that none can hold: see LineError."""
