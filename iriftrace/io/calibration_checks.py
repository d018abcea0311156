"""Checks of calibrations: numbers that are plausible for a lens, a rotation or a pair of cameras.

`called` is the file, and which of its cameras, in messages.
"""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.mesh.transform import nearest_rotations

FOCAL = (0.15, 200.0)
"""In widths of a picture: lenses without fisheye see 0.3 to 147 degrees."""

NEAR_CORNER = 0.05
"""Fraction of a picture's width and height; offsets from the middle are smaller, places larger."""

LARGEST_ROUNDING = 1.5e-3
"""Largest relative change of lengths by a rotation matrix that has three decimals."""

BASELINES_MM = (3.0, 20_000.0)
"""Distances of two cameras outside of which the unit of T is wrong: metres read as mm or back."""

LARGEST_ANGLE_DEG, LEAST_ANGLE_DEG = 120.0, 3.0
"""Angles of two axes above which cameras face each other, and below which they are parallel."""

NEAREST_CROSSING_MM = 40.0
"""Distance in front of camera 1 below which axes that meet have a T of another unit."""

SAME_MOTION = 0.03
"""Angle, rad, below which two rotations or directions differ by rounding alone."""


def checked_matrix(called: str, matrix: FloatArray, skew: float) -> FloatArray:
    """A camera matrix, (3, 3), px, if it is one; `skew` is what the file states next to it."""
    if np.allclose(matrix[:, 2], (0, 0, 1)) and not np.allclose(matrix[2], (0, 0, 1)):
        raise InputError(
            f"The calibration {called}: {matrix.tolist()} is a camera matrix column by column "
            "(transposed); write it and the rotations of the same program row by row.",
            code="calibration.transposed",
        )
    if matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or not np.allclose(matrix[2], (0, 0, 1)):
        raise InputError(
            f"The calibration {called}: {matrix.tolist()} is not a camera matrix [[fx, 0, cx], [0, "
            "fy, cy], [0, 0, 1]].",
            code="calibration.matrix",
        )
    for number in (matrix[0, 1], skew):
        if abs(number) > 1e-9 * matrix[0, 0] or matrix[1, 0] != 0:
            raise InputError(
                f"The calibration {called}: the camera matrix has the skew {number:g}, which is "
                "not modelled; calibrate without it.",
                code="calibration.skew",
            )
    return matrix


def check_pixels(called: str, matrix: FloatArray, resolution: tuple[int, int]) -> None:
    """Refuse a camera matrix that is not of pictures of this size (width, height), in px."""
    size = np.array(resolution)
    focal, centre = matrix[0, 0], matrix[:2, 2]
    if not FOCAL[0] * size[0] <= focal <= FOCAL[1] * size[0]:
        raise InputError(
            f"The calibration {called}: the focal length is {focal:.4g} px for pictures {size[0]} "
            "px wide, which no such lens has; give the camera matrix and the size of the pictures "
            "in pixels.",
            code="calibration.focal_length",
        )
    off, swapped = (np.abs(centre / one - 0.5).max() for one in (size, size[::-1]))
    if swapped < 0.05 < off - swapped:
        raise InputError(
            f"The calibration {called}: its pictures are {size[0]} px wide and {size[1]} px high, "
            f"but its principal point ({centre[0]:.0f}, {centre[1]:.0f}) px is the middle of "
            f"pictures {size[1]} px wide; give the width first.",
            code="calibration.swapped",
        )
    across, down = centre / size
    if max(abs(across), abs(down)) < NEAR_CORNER:
        raise InputError(
            f"The calibration {called}: its principal point ({centre[0]:.4g}, {centre[1]:.4g}) px "
            "is at the corner of the pictures, so it is counted from their middle; add half of "
            "their width and height.",
            code="calibration.principal_point",
        )
    if off > 0.5:
        warn(
            f"The principal point ({centre[0]:.0f}, {centre[1]:.0f}) px in {called} lies "
            f"outside the pictures of {size[0]} x {size[1]} px; if this is not a projector, the "
            "camera matrix is of another resolution."
        )
    elif abs(across - down) < 0.05 and min(abs(across - 0.5), abs(down - 0.5)) > 0.15:
        warn(
            f"The principal point ({centre[0]:.0f}, {centre[1]:.0f}) px in {called} is the "
            f"middle of pictures of about {2 * centre[0]:.0f} x {2 * centre[1]:.0f} px, and not of "
            f"{size[0]} x {size[1]} px; if the pictures were not cropped, the camera matrix is of "
            "another resolution."
        )


def rotation_of(called: str, numbers: FloatArray) -> FloatArray:
    """The rotation, (3, 3), of a rotation vector in radians, (3,), or of a matrix of 9 numbers."""
    from scipy.spatial.transform import Rotation

    if len(numbers) == 9:
        return exact_rotation(called, numbers.reshape(3, 3))
    length = float(np.linalg.norm(numbers))
    if length > 2 * np.pi:
        raise InputError(
            f"The calibration {called}: its rotation vector {numbers.tolist()} turns by "
            f"{length:.4g} rad, more than a whole turn, so it is in degrees or no rotation vector; "
            "give radians (axis times angle, as of OpenCV's Rodrigues), or the rotation matrix.",
            code="calibration.rotation_vector",
        )
    if length > 1.01 * np.pi:
        warn(
            f"The rotation vector {numbers.tolist()} in {called} turns by more than half a "
            "turn, as OpenCV's Rodrigues never gives; if it is in degrees, give radians."
        )
    rotation: FloatArray = Rotation.from_rotvec(numbers).as_matrix()
    return rotation


def exact_rotation(called: str, matrix: FloatArray) -> FloatArray:
    """The nearest rotation, (3, 3), to a matrix of rounded numbers, with a warning."""
    off = float(np.abs(np.linalg.svd(matrix, compute_uv=False) - 1.0).max())
    if np.linalg.det(matrix) < 0 or off > LARGEST_ROUNDING:
        raise InputError(
            f"The calibration {called}: its rotation does not turn, but stretches or mirrors "
            f"(lengths change by up to {100 * off:.2g} %); give a rotation, with four digits or "
            "more.",
            code="calibration.rotation",
        )
    if off > 1e-6:
        warn(
            f"The rotation matrix in {called} is rounded to few digits; the nearest "
            f"rotation is used, and directions are uncertain by about {off:.1g} rad."
        )
    (rotation,) = nearest_rotations(matrix[None])
    return np.asarray(rotation, dtype=np.float64)


def refuse_contradiction(
    called: str,
    motion: tuple[FloatArray, FloatArray],
    rectified: tuple[FloatArray, FloatArray],
) -> None:
    """Refuse R and T other than those of the rectification next to them."""
    rotation, shift = motion
    if _is_same(motion, rectified):
        return
    inverse = rotation.T, -rotation.T @ shift
    led = ", as they lead from camera 2 to camera 1; invert them"
    remedy = led if _is_same(inverse, rectified) else "; export the calibration again"
    raise InputError(
        f"The calibration {called}: its R and T contradict its R1, R2, P1 and P2{remedy}.",
        code="calibration.contradiction",
    )


def _is_same(one: tuple[FloatArray, FloatArray], other: tuple[FloatArray, FloatArray]) -> bool:
    """True for the same rotation, (3, 3), and direction of the translation, (3,)."""
    lengths = float(np.linalg.norm(one[1]) * np.linalg.norm(other[1]))
    turn = float(np.linalg.norm(one[0] - other[0]))
    return turn < SAME_MOTION and float(one[1] @ other[1]) > (1 - SAME_MOTION**2 / 2) * lengths


def check_baseline(called: str, shift_mm: FloatArray, unit: str) -> None:
    """Refuse a T, in mm, that was read in a wrong unit."""
    baseline, (low, high) = float(np.linalg.norm(shift_mm)), BASELINES_MM
    if not low <= baseline <= high:
        raise InputError(
            f"The calibration {called}: its two cameras are {baseline:.4g} mm apart where T is in "
            f"{unit}; give the unit of T.",
            code="calibration.baseline",
            argument="calibration_length_unit",
        )


def check_axes(called: str, rotation: FloatArray, shift_mm: FloatArray) -> None:
    """Refuse cameras that face each other; warn of axes that lead apart or meet too near."""
    centre, axis = -rotation.T @ shift_mm, rotation[2]
    angle = np.degrees(np.arccos(np.clip(axis[2], -1.0, 1.0)))
    if angle > LARGEST_ANGLE_DEG:
        raise InputError(
            f"The calibration {called}: the axes of its two cameras are {angle:.0f} degrees apart, "
            "so that they see no surface in common; R is a rotation vector in degrees, or of other "
            "frames.",
            code="calibration.axes",
        )
    if angle <= LEAST_ANGLE_DEG:
        return
    # Where the axis of camera 2 is nearest to that of camera 1, the z axis.
    along = np.cross(np.cross((0.0, 0.0, 1.0), axis), (0.0, 0.0, 1.0))
    to_nearest = -(centre @ along) / (axis @ along)
    meeting_mm = (centre + to_nearest * axis)[2]
    if 0.0 < meeting_mm < NEAREST_CROSSING_MM:
        warn(
            f"The axes of the two cameras in {called} meet {meeting_mm:.3g} mm in front of "
            "them. If they stand farther from what they see, T is in another unit: state it, or "
            "multiply T by the size of a square if the target's points were given in squares.",
            argument="calibration_length_unit",
        )
    if to_nearest < 0.0:
        warn(
            f"The axes of the two cameras in {called} lead apart by {angle:.0f} degrees; if "
            "they meet, R is transposed, or R and T are of different directions."
        )
