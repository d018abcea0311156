"""Poses around a pose of a sweep: the camera keeps its target, and turns, recedes and rolls."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen
from scipy.spatial.transform import Rotation

from iriftrace.core.arrays import FloatArray

if TYPE_CHECKING:
    import xarray as xr


# Range of the directions: as far as the next pose of the sweep, within these limits.
_REACH_DEG = (2.0, 30.0)
# Range of the distance, a factor in both directions, and of the roll, an angle in both directions.
_FACTOR, _ROLL_DEG = 1.25, 45.0


@frozen(eq=False)
class Around:
    """Poses around a pose, by four numbers in -1..1: turns about two axes, distance, roll."""

    start: FloatArray
    start_mm: float
    reach_deg: float

    def turn(self, place: FloatArray) -> FloatArray:
        """Rotation vector, rad, world, about the camera's x- and y-axis through its target."""
        return math.radians(self.reach_deg) * (self.start[:3, :2] @ place[:2])

    def roll_deg(self, place: FloatArray) -> float:
        """Roll of the camera, degree, clockwise as it looks."""
        return _ROLL_DEG * float(place[3])

    def distance(self, place: FloatArray) -> float:
        """From camera to target, mm."""
        return self.start_mm * float(_FACTOR ** place[2])

    def matrix(self, place: FloatArray) -> FloatArray:
        """(4, 4) array, camera to world, mm."""
        target = self.start[:3, 3] + self.start_mm * self.start[:3, 2]
        roll = Rotation.from_rotvec((0.0, 0.0, math.radians(_ROLL_DEG) * place[3]))
        pose = np.eye(4)
        turn = Rotation.from_rotvec(self.turn(place))
        pose[:3, :3] = turn.as_matrix() @ self.start[:3, :3] @ roll.as_matrix()
        pose[:3, 3] = target - self.distance(place) * pose[:3, 2]
        return pose


def around_pose(dataset: xr.Dataset, pose: int) -> Around:
    """Poses around one of a sweep, as far as its next direction."""
    matrices = np.asarray(dataset["matrix"].values, dtype=np.float64)
    cosines = np.delete(matrices[:, :3, 2], pose, axis=0) @ matrices[pose, :3, 2]
    angles = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    # Other cameras of the same direction do not show how far the next direction is.
    others = angles[angles > _REACH_DEG[0]]
    reach = float(others.min()) if len(others) else _REACH_DEG[1]
    return Around(
        matrices[pose], float(dataset["distance"].values[pose]), float(np.clip(reach, *_REACH_DEG))
    )
