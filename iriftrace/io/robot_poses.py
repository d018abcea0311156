"""Orientations as the controllers of robots state them.

Next to x, y and z, each maker has its own three angles, a rotation vector or a quaternion:

===============  ==============  =====================================================
robot            columns         rotation, flange to base
===============  ==============  =====================================================
abb              q1 q2 q3 q4     quaternion, its scalar part first
fanuc            w p r           Rz(r) Ry(p) Rx(w), degrees
kawasaki         o a t           Rz(o) Ry(a) Rz(t), degrees
kuka             a b c           Rz(a) Ry(b) Rx(c), degrees
mitsubishi       a b c           Rz(c) Ry(b) Rx(a), degrees
staubli          rx ry rz        Rx(rx) Ry(ry) Rz(rz), degrees
universal        rx ry rz        rotation vector (axis times angle), radians
yaskawa          rx ry rz        Rz(rz) Ry(ry) Rx(rx), degrees
===============  ==============  =====================================================

Sources: Basler, rc_cube manual, appendix "Pose formats" (docs.baslerweb.com); for Staubli RoboDK's
``robomath.Staubli_2_Pose``.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn

RobotName = Literal[
    "abb", "fanuc", "kawasaki", "kuka", "mitsubishi", "staubli", "universal", "yaskawa"
]


@frozen
class RobotFormat:
    """How a robot's controller states an orientation.

    `rotation` is a sequence of axes of `scipy.spatial.transform.Rotation.from_euler` (capitals:
    each about the axes that the one before has turned), "vector" or, by the place of its scalar
    part, "quaternion, first" or "quaternion, last".
    """

    columns: tuple[str, ...]
    rotation: str
    angle_unit: str = "deg"

    @property
    def angles(self) -> tuple[str, ...]:
        """Columns with angles, or the components of a rotation vector; none of a quaternion."""
        return () if self.rotation.startswith("quaternion") else self.columns

    def matrices(self, values: FloatArray, angle_unit: str = "") -> FloatArray:
        """Rotations (n, 3, 3) of the values (n, 3 or 4) in the columns.

        `angle_unit` is "deg", "rad" or "" for the controller's own. Raises InputError for a
        rotation vector that is longer than a turn.
        """
        # Imported when needed, because the command line only needs the names of robots.
        from scipy.spatial.transform import Rotation

        degrees = (angle_unit or self.angle_unit) == "deg"
        if not self.angles:
            first = self.rotation == "quaternion, first"
            rotations = Rotation.from_quat(np.roll(values, -1, axis=1) if first else values)
        elif self.rotation == "vector":
            longest = np.linalg.norm(values, axis=1).max()
            if longest > (_TURN_DEG if degrees else math.radians(_TURN_DEG)):
                raise InputError(
                    f"a rotation vector has the length {longest:.4g} "
                    f"{'deg' if degrees else 'rad'}, which is more than a turn; if these are "
                    "angles, name the robot that has them.",
                    code="poses.rotation_vector",
                    argument="robot",
                )
            rotations = Rotation.from_rotvec(values, degrees=degrees)
        else:
            if not angle_unit and 0.0 < np.abs(values).max() < _HALF_TURN_RAD:
                warn(
                    f"All angles {', '.join(self.columns)} are below {_HALF_TURN_RAD}, as of "
                    "radians, and are read as degrees; state their unit in their names, such as "
                    f"{self.columns[0]} [rad] or {self.columns[0]} [deg]."
                )
            rotations = Rotation.from_euler(self.rotation, values, degrees=degrees)
        return np.asarray(rotations.as_matrix())


_TURN_DEG = 361.0
"""Length of a rotation vector by which a full turn is surely exceeded."""

_HALF_TURN_RAD = 3.15
"""Angles in radians are at most this large, those in degrees rarely all so small."""

_RX_RY_RZ = ("rx", "ry", "rz")

ROBOTS: dict[RobotName, RobotFormat] = {
    "abb": RobotFormat(("q1", "q2", "q3", "q4"), "quaternion, first"),
    "fanuc": RobotFormat(("w", "p", "r"), "xyz"),
    "kawasaki": RobotFormat(("o", "a", "t"), "ZYZ"),
    "kuka": RobotFormat(("a", "b", "c"), "ZYX"),
    "mitsubishi": RobotFormat(("a", "b", "c"), "xyz"),
    "staubli": RobotFormat(_RX_RY_RZ, "XYZ"),
    "universal": RobotFormat(_RX_RY_RZ, "vector", "rad"),
    "yaskawa": RobotFormat(_RX_RY_RZ, "xyz"),
}
"""Formats by the names of `RobotName`."""

QUATERNION = RobotFormat(("qx", "qy", "qz", "qw"), "quaternion, last")
"""The form of tables that are not of a robot."""
