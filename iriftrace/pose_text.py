"""A camera pose in the forms that people carry on with: matrix, look-at, XML of the scene."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


@frozen
class PoseText:
    """A pose in words.

    Attributes
    ----------
    matrix : tuple of str
        Four rows, camera to world (x right, y down, z forward), mm.
    origin, target, up : str
        The look-at: "x, y, z", mm, world; a direction without unit.
    """

    matrix: tuple[str, ...]
    origin: str
    target: str
    up: str

    @property
    def look_at(self) -> str:
        """Origin, target and up in one line."""
        return f"origin ({self.origin}) mm, target ({self.target}) mm, up ({self.up})"

    @property
    def xml(self) -> tuple[str, ...]:
        """Lines that take the place of the sensor's transform in the scene file."""
        return (
            '<transform name="to_world">',
            f'    <lookat origin="{self.origin}" target="{self.target}" up="{self.up}"/>',
            "</transform>",
        )


def look_at_of(matrix: ArrayLike, distance_mm: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Origin, target (mm, world) and what is up in the picture, of a (4, 4) camera to world."""
    pose = np.asarray(matrix, dtype=np.float64)
    origin = pose[:3, 3]
    return origin, origin + distance_mm * pose[:3, 2], -pose[:3, 1]


def pose_text(matrix: ArrayLike, distance_mm: float) -> PoseText:
    """Write a pose.

    Parameters
    ----------
    matrix : (4, 4) array, mm, world
        Camera to world.
    distance_mm : float, mm
        From the camera to the point that it looks at.
    """
    rows = np.asarray(matrix, dtype=np.float64)
    return PoseText(
        tuple("  ".join(f"{value:12.6f}" for value in _clean(row)) for row in rows),
        *(
            ", ".join(f"{value:.6f}" for value in _clean(vector))
            for vector in look_at_of(matrix, distance_mm)
        ),
    )


def _clean(values: FloatArray) -> FloatArray:
    # Rounded first, so that -1e-17 becomes 0 and not -0.
    return np.asarray(np.round(values, 6) + 0.0)
