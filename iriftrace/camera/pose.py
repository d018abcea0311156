"""Poses of a camera: 4 x 4 matrices from its frame (x right, y down, z forward) to the world's,
and the forms in which people carry on with them: look-at and the XML of a scene."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError


def look_at(origin: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> FloatArray:
    """Pose of a camera that looks from one point at another.

    Parameters
    ----------
    origin, target : (3,) array, mm, world
    up : (3,) array, world
        Direction that is up in the picture. When it is parallel to the line of sight, +y takes its
        place (the limit of a camera that looks along +y while it rises).

    Returns
    -------
    (4, 4) array
        Camera to world; columns x right, y down, z forward, origin.

    Raises
    ------
    InputError
        If origin and target coincide or a value is not finite.
    """
    eye, aim, upward = (np.asarray(v, dtype=np.float64).reshape(3) for v in (origin, target, up))
    if not all(np.isfinite(v).all() for v in (eye, aim, upward)):
        raise InputError(
            "A camera pose has a value that is not finite; give three numbers each.",
            code="poses.not_finite",
        )
    forward = aim - eye
    distance = np.linalg.norm(forward)
    if distance == 0.0:
        raise InputError(
            f"Camera origin and target are the same point {eye.tolist()}, so there is no line of "
            "sight; move one of them.",
            code="poses.on_target",
        )
    forward = forward / distance
    right = np.cross(forward, upward)
    if np.linalg.norm(right) < 1e-9 * max(float(np.linalg.norm(upward)), 1e-300):
        right = np.cross(forward, (0.0, 1.0, 0.0))
    right = right / np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0] = right
    matrix[:3, 1] = np.cross(forward, right)
    matrix[:3, 2] = forward
    matrix[:3, 3] = eye
    return matrix


@frozen
class PoseText:
    """A pose in words."""

    matrix: tuple[str, ...]  # four rows, camera to world (x right, y down, z forward), mm
    # The look-at: "x, y, z", mm, world; a direction without unit.
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
    """Write a pose, (4, 4) camera to world, mm, that looks at a point `distance_mm` away."""
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
