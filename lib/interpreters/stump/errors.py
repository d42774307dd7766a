"""The one exception of the CSG-Stump language."""

from ..line_errors import LineError


class ProgramError(LineError):
    """A CSG-Stump that cannot be read, built or run: see LineError for what it tells."""
