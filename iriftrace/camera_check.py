"""Refuses what is no camera: lengths, focus interval, pose and projection that form no picture."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.camera import Camera

PROJECTIONS = ("pinhole", "orthographic")


def check_camera(camera: Camera) -> None:
    """Refuse a camera that cannot form a picture.

    Raises
    ------
    InputError
        If a length is not positive, the focus interval is empty, the pose is not a rigid motion, or
        a distortion is given for another projection than the pinhole's.
    """
    if camera.projection not in PROJECTIONS:
        raise InputError(f"Unknown projection '{camera.projection}'; use one of {PROJECTIONS}.")
    if camera.projection == "pinhole" and not (
        math.isfinite(camera.focal_length_mm) and camera.focal_length_mm > 0
    ):
        raise InputError(
            f"Focal length is {camera.focal_length_mm} mm, so no picture forms; "
            "give a positive length."
        )
    if not all(math.isfinite(s) and s > 0 for s in camera.sensor_mm):
        raise InputError(
            f"Sensor size is {camera.sensor_mm[0]} x {camera.sensor_mm[1]} mm, so no picture "
            "forms; both must be positive."
        )
    if min(camera.resolution) < 1:
        raise InputError(
            f"Resolution is {camera.resolution[0]} x {camera.resolution[1]} pixels; "
            "both must be at least 1."
        )
    near, far = camera.focus_mm
    if not 0 <= near < far:
        raise InputError(
            f"Focus interval {near} to {far} mm is empty; the near distance must be at least 0 "
            "and smaller than the far one."
        )
    rotation = camera.matrix[:3, :3] if camera.matrix.shape == (4, 4) else np.zeros((3, 3))
    rigid = np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-6)
    if not (rigid and np.linalg.det(rotation) > 0 and np.isfinite(camera.matrix).all()):
        raise InputError(
            "The camera pose is not a rigid motion (4 x 4, rotation and translation only); "
            "remove scale and mirroring."
        )
    if camera.distortion is not None:
        if camera.projection != "pinhole":
            raise InputError(
                f"A lens distortion is given for an {camera.projection} camera, for which it is "
                "not defined; leave it out."
            )
