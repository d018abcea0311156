"""A part on a turntable before a sensor that stands still, as poses around the part."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from iriftrace.camera.pose_set import PoseSet
from iriftrace.core.errors import InputError

_AXES = ("x", "y", "z")


def turntable_poses(matrix: ArrayLike, table: str, centre: ArrayLike) -> PoseSet:
    """Poses of a camera as a part sees them that turns before it.

    The air turns with the part, which it does where the axis is vertical and there is no draught.
    `matrix` (4, 4), mm, is the camera's pose with the part unturned. The table ``"z:0:360:30"`` has
    the axis, and start, stop and step of the part's angle in degrees, counter-clockwise seen from
    the tip of the axis; a full turn's end is its start and counts once. The centre (3,), mm, world,
    is a point on the axis. Raises InputError for other texts.
    """
    axis, *numbers = table.split(":")
    try:
        start, stop, step = map(float, numbers)
        count = int(np.floor((stop - start) / step + 1e-9)) + 1
        if axis not in _AXES or count < 1 or not np.isfinite((start, stop, step)).all():
            raise ValueError
    except (ValueError, ZeroDivisionError, OverflowError):
        raise InputError(
            f"{table!r} is not a turntable; give its axis and start, stop and step of its angle in "
            'degrees, such as "z:0:360:30".'
        ) from None
    angles = start + step * np.arange(count)
    if count > 1 and np.isclose(angles[-1] - angles[0], 360.0):
        angles = angles[:-1]
    # If the part turns in one direction, the camera moves in the other one relative to it.
    around = np.eye(3)[_AXES.index(axis)]
    turns = Rotation.from_rotvec(np.outer(-angles, around), degrees=True).as_matrix()
    pose, point = np.asarray(matrix, dtype=np.float64), np.asarray(centre, dtype=np.float64)
    poses = np.tile(np.eye(4), (len(turns), 1, 1))
    poses[:, :3, :3] = turns @ pose[:3, :3]
    poses[:, :3, 3] = point + turns @ (pose[:3, 3] - point)
    return PoseSet(poses)
