"""Check that a camera can form a picture."""

from __future__ import annotations

import math

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError

PROJECTIONS = ("pinhole", "orthographic")


def check_camera(
    projection: str,
    focal_length_mm: float,
    sensor_mm: tuple[float, float],
    resolution: tuple[int, int],
    focus_mm: tuple[float, float],
    matrix: FloatArray,
    *,
    distorted: bool,
) -> None:
    """Refuse a camera that cannot form a picture."""
    if projection not in PROJECTIONS:
        raise InputError(f"Unknown projection '{projection}'; use one of {PROJECTIONS}.")
    if projection == "pinhole" and not (math.isfinite(focal_length_mm) and focal_length_mm > 0):
        raise InputError(
            f"Focal length is {focal_length_mm} mm, so no picture forms; give a positive length."
        )
    if not all(math.isfinite(s) and s > 0 for s in sensor_mm):
        raise InputError(
            f"Sensor size is {sensor_mm[0]} x {sensor_mm[1]} mm, so no picture "
            "forms; both must be positive."
        )
    if min(resolution) < 1:
        raise InputError(
            f"Resolution is {resolution[0]} x {resolution[1]} pixels; both must be at least 1."
        )
    near, far = focus_mm
    if not 0 <= near < far:
        raise InputError(
            f"Focus interval {near} to {far} mm is empty; the near distance must be at least 0 "
            "and smaller than the far one."
        )
    rotation = matrix[:3, :3] if matrix.shape == (4, 4) else np.zeros((3, 3))
    rigid = np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-6)
    if not (rigid and np.linalg.det(rotation) > 0 and np.isfinite(matrix).all()):
        raise InputError(
            "The camera pose is not a rigid motion (4 x 4, rotation and translation only); "
            "remove scale and mirroring."
        )
    if distorted:
        if projection != "pinhole":
            raise InputError(
                f"A lens distortion is given for an {projection} camera, for which it is "
                "not defined; leave it out."
            )
