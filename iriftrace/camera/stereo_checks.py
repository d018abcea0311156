"""Motions from camera 1 to camera 2 that cannot be, or that contradict the rest of their file."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import numpy as np

from iriftrace.camera.calibration_file import CalibrationValues, folded
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import warn
from iriftrace.core.units import length_factor

LARGEST_ANGLE_DEG, LEAST_ANGLE_DEG = 120.0, 3.0
"""Angles of two axes above which cameras face each other, and below which they are parallel."""

NEAREST_CROSSING_MM = 40.0
"""Distance in front of camera 1 below which axes that meet have a T of another unit."""

SAME_BASELINE = 0.01
"""Decimal logarithm of two lengths, 2 %, of which one may be that along one axis alone."""

_BASELINE = re.compile("baseline(um|mm|cm|m|inch|in)?")
_ESSENTIAL = ("E", "essential_matrix")
_SAME_MOTION = 0.999
"""Product of two essential matrices of length 1 from which on they differ by rounding alone."""


def refuse_contradiction(
    values: CalibrationValues,
    motion: tuple[FloatArray, FloatArray],
    rectified: tuple[FloatArray, FloatArray] | None,
) -> None:
    """Refuse R and T other than those of the rectification or essential matrix next to them."""
    if rectified is not None:
        expected, names = _essential(*rectified), "R1, R2, P1 and P2"
    elif values.named(_ESSENTIAL) is not None:
        expected, names = _of_length_1(values.array(_ESSENTIAL, (9,)).reshape(3, 3)), "E"
        # Its sign is open, too.
        expected = expected * np.sign((_essential(*motion) * expected).sum())
    else:
        return
    rotation, shift = motion
    if (_essential(rotation, shift) * expected).sum() > _SAME_MOTION:
        return
    inverse = (_essential(rotation.T, -rotation.T @ shift) * expected).sum()
    raise values.wrong(
        f"its R and T contradict its {names}"
        + (
            ", as they lead from camera 2 to camera 1; invert them"
            if abs(inverse) > _SAME_MOTION
            else "; export the calibration again"
        )
    )


def _essential(rotation: FloatArray, shift: FloatArray) -> FloatArray:
    """The essential matrix [T]x R, (3, 3), of length 1."""
    return _of_length_1(np.cross(shift, rotation.T).T)


def _of_length_1(matrix: FloatArray) -> FloatArray:
    length = float(np.linalg.norm(matrix))
    return matrix / length if length else matrix


def refuse_other_baseline(values: CalibrationValues, baseline_mm: float) -> None:
    """Refuse a baseline that the file states, and that is not the length of T.

    One without a unit may be in any.
    """
    for content in (values.content, *values.content.values()):
        for name, number in content.items() if isinstance(content, Mapping) else ():
            match = _BASELINE.fullmatch(folded(str(name)))
            if not match or not isinstance(number, int | float) or not 0.0 < abs(number) < np.inf:
                continue
            factor = length_factor(match[1]) if match[1] else 1.0
            decades = math.log10(baseline_mm / abs(number * factor))
            if abs(decades - (0 if match[1] else round(decades))) > SAME_BASELINE:
                raise values.wrong(
                    f"its T is {baseline_mm:.5g} mm long, but its {name} is {number:g}; if T is in "
                    "another unit, state it (--calibration-length-unit), else leave out either"
                )


def check_axes(values: CalibrationValues, rotation: FloatArray, shift_mm: FloatArray) -> None:
    """Refuse cameras that face each other; warn of axes that lead apart or meet too near."""
    centre, axis = -rotation.T @ shift_mm, rotation[2]
    angle = np.degrees(np.arccos(np.clip(axis[2], -1.0, 1.0)))
    if angle > LARGEST_ANGLE_DEG:
        raise values.wrong(
            f"the axes of its two cameras are {angle:.0f} degrees apart, so that they see no "
            "surface in common; R is a rotation vector in degrees, or of other frames"
        )
    # Where the axis of camera 2 is nearest to that of camera 1, the z axis.
    along = np.cross(np.cross((0.0, 0.0, 1.0), axis), (0.0, 0.0, 1.0))
    if angle <= LEAST_ANGLE_DEG:
        return
    to_nearest = -(centre @ along) / (axis @ along)
    meeting_mm = (centre + to_nearest * axis)[2]
    if 0.0 < meeting_mm < NEAREST_CROSSING_MM:
        warn(
            f"The axes of the two cameras in {values.path} meet {meeting_mm:.3g} mm in front of "
            "them. If they stand farther from what they see, T is in another unit: state it "
            "(--calibration-length-unit), or multiply T by the size of a square if the target's "
            "points were given in squares."
        )
    if to_nearest < 0.0:
        warn(
            f"The axes of the two cameras in {values.path} lead apart by {angle:.0f} degrees; if "
            "they meet, R is transposed, or R and T are of different directions."
        )
