"""Where a picture is taken from, and where in it a point of the world falls.

World: x right, y up, z to the front. Picture: u right, v up, in world units at the camera's target, so that lines
and text can be drawn over a picture with matplotlib in the same coordinates.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

UNIT_BOUNDS = ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))


@dataclass(frozen=True)
class Camera:
    """A camera that looks at the middle of `bounds` from outside, in mild perspective.

    azimuth    degrees around the y axis; 0 looks at the front (from +z), positive goes to the right (towards +x).
    elevation  degrees above the horizon.
    bounds     (2, 3) lowest and highest corner of what must be in the picture, world units.
    """

    azimuth: float = 32.0
    elevation: float = 22.0
    bounds: ArrayLike = UNIT_BOUNDS

    @cached_property
    def corners(self) -> np.ndarray:
        """(8, 3) the corners of the bounds."""
        low, high = np.asarray(self.bounds, dtype=float)
        return np.array(
            [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
        )

    @cached_property
    def target(self) -> np.ndarray:
        return self.corners.mean(axis=0)

    @cached_property
    def radius(self) -> float:
        """Of the ball around the bounds, world units; positive also where the bounds are one point."""
        return max(float(np.linalg.norm(self.corners[0] - self.target)), 1e-6)

    @cached_property
    def frame(self) -> np.ndarray:
        """(3, 3) rows: the unit vectors right, up and back (from the target to the eye)."""
        a, e = np.radians([self.azimuth, self.elevation])
        back = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
        right = np.array([np.cos(a), 0.0, -np.sin(a)])
        return np.stack([right, np.cross(back, right), back])

    @cached_property
    def distance(self) -> float:
        """From the eye to the target: six radii are far enough for parallel lines to look nearly parallel."""
        return 6.0 * self.radius

    @cached_property
    def eye(self) -> np.ndarray:
        return self.target + self.distance * self.frame[2]

    def project(self, points: ArrayLike) -> np.ndarray:
        """Where (n, 3) world points fall in the picture: (n, 2), u right and v up, world units at the target."""
        seen = (np.asarray(points, dtype=float).reshape(-1, 3) - self.eye) @ self.frame.T
        return seen[:, :2] * (self.distance / -seen[:, 2:])

    def depth(self, points: ArrayLike) -> np.ndarray:
        """How far (n, 3) world points lie from the eye along the view: (n,), larger is farther."""
        return (self.eye - np.asarray(points, dtype=float).reshape(-1, 3)) @ self.frame[2]

    @cached_property
    def window(self) -> tuple[float, float, float, float]:
        """(left, right, bottom, top): the square of the picture plane that holds the bounds and a small margin."""
        flat = self.project(self.corners)
        middle, half = (flat.max(axis=0) + flat.min(axis=0)) / 2, 0.53 * np.ptp(flat, axis=0).max() + 1e-9
        return (middle[0] - half, middle[0] + half, middle[1] - half, middle[1] + half)

    def directions(self, resolution: int) -> np.ndarray:
        """(resolution**2, 3) vectors from the eye through the middle of each sample, top row first.

        Their length is 1 along the view, so a point at `eye + t * direction` has the depth t.
        """
        left, right_edge, bottom, top = self.window
        step = (np.arange(resolution) + 0.5) / resolution
        right, up, back = self.frame
        u = np.outer((left + (right_edge - left) * step) / self.distance, right)
        v = np.outer((top + (bottom - top) * step) / self.distance, up)
        return (v[:, None] + u[None] - back).reshape(-1, 3).astype(np.float32)
