"""The one exception of the ShapeAssembly language."""

from ..line_errors import LineError


class ProgramError(LineError):
    """A ShapeAssembly program that cannot be read or run: see LineError for what it tells."""
