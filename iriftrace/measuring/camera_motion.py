"""A small motion of the camera between two pictures, from the shifts it causes in them.

Also called resectioning of a small change, or visual servoing's interaction matrix (F. Chaumette
and S. Hutchinson, IEEE Robot. Autom. Mag. 13 (2006) 82). A motion of the camera by v and w, in its
own frame, moves a point X of that frame by ``-v - w x X``, and its picture by the derivative
of the projection, lens distortion included.
"""

from __future__ import annotations

import numpy as np
from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import jacobian
from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.statistics import rms

FEWEST_POINTS = 4
"""Three points determine the six numbers, but leave no residual to judge them by."""

OUTLIER = 6.0
"""Multiple of the standard deviation beyond which a point is left out of the fit."""

_LARGEST_CONDITION = 1e7
_RAYLEIGH_MEDIAN = 1.1774  # Median length of a vector of two normal components of deviation 1.


@frozen(eq=False)
class CameraMotion:
    """A rigid motion of the camera in its own frame (x right, y down, z forward)."""

    translation_mm: FloatArray  # (3,)
    rotation_rad: FloatArray  # (3,) rotation vector
    covariance: FloatArray  # (6, 6) of both, as if the points' residuals were independent
    shifts: FloatArray  # (n, 2), px: shift of each point's picture by the motion
    used: BoolArray  # (n,) points that the fit used; the others are outliers
    # Root mean square residual of the used points without and with the motion.
    rms_before_px: float
    rms_after_px: float

    @property
    def deviations(self) -> FloatArray:
        """(6,) standard deviations of translation, mm, and rotation, rad."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def explained(self) -> float:
        """Fraction of the mean square residual that the motion explains."""
        if self.rms_before_px == 0.0:
            return 0.0
        return 1.0 - (self.rms_after_px / self.rms_before_px) ** 2


def interaction_matrix(camera: Camera, points: FloatArray) -> FloatArray:
    """Derivative of the image positions of points (n, 3), mm, world, by a motion of the camera.

    (n, 2, 6) array, px per mm and px per rad.
    """
    x, y, z = np.ascontiguousarray(camera.to_camera(points).T)
    moved = np.zeros((len(x), 3, 6))
    moved[:, (0, 1, 2), (0, 1, 2)] = -1.0
    moved[:, 0, 4], moved[:, 0, 5] = -z, y
    moved[:, 1, 3], moved[:, 1, 5] = z, -x
    moved[:, 2, 3], moved[:, 2, 4] = -y, x
    projected = np.zeros((len(x), 2, 3))
    if camera.projection == "orthographic":
        projected[:, (0, 1), (0, 1)] = 1.0 / np.array(camera.pixel_pitch_mm)
        return projected @ moved
    projected[:, 0, 0] = projected[:, 1, 1] = 1.0 / z
    projected[:, 0, 2], projected[:, 1, 2] = -x / z**2, -y / z**2
    if camera.distortion is not None:
        xx, xy, yy = jacobian(x / z, y / z, camera.distortion.coefficients)
        bent = np.stack((np.stack((xx, xy), axis=1), np.stack((xy, yy), axis=1)), axis=1)
        projected = bent @ projected
    return (np.array(camera.focal_px)[:, None] * projected) @ moved


def fit_camera_motion(camera: Camera, points: FloatArray, shifts: FloatArray) -> CameraMotion:
    """Find the motion that explains shifts best, by linear least squares without outliers.

    The shifts (n, 2), px, are those of the pictures of points (n, 3), mm, world, by the motion of
    the camera. Raises InputError if the points are too few, or lie so that they do not determine
    the motion.
    """
    if len(points) < FEWEST_POINTS:
        raise InputError(
            f"{len(points)} points do not determine a motion of the camera; {FEWEST_POINTS} are "
            "needed.",
            code="motion.too_few_points",
        )
    matrix = interaction_matrix(camera, points)
    # Rotations in units of the motion that they cause at the points' distance, for like sizes.
    distance = float(np.median(np.linalg.norm(camera.to_camera(points), axis=1)))
    units = np.array((1.0, 1.0, 1.0, *(1.0 / distance,) * 3))
    matrix = matrix * units
    used = np.ones(len(points), dtype=np.bool_)
    for _ in range(50):
        motion = _solved(matrix[used], shifts[used])
        lengths = np.linalg.norm(shifts - matrix @ motion, axis=1)
        spread = float(np.median(lengths[used])) / _RAYLEIGH_MEDIAN
        inside = lengths <= max(OUTLIER * spread, 1e-9)
        if inside.sum() < FEWEST_POINTS or np.array_equal(inside, used):
            break
        used = inside
    rest = (shifts - matrix @ motion)[used]
    freedom = max(2 * int(used.sum()) - 6, 1)
    rows = matrix[used].reshape(-1, 6)
    normal = np.linalg.inv(rows.T @ rows)
    return CameraMotion(
        translation_mm=motion[:3] * units[:3],
        rotation_rad=motion[3:] * units[3:],
        covariance=np.outer(units, units) * normal * float((rest**2).sum()) / freedom,
        shifts=matrix @ motion,
        used=used,
        rms_before_px=rms(shifts[used]),
        rms_after_px=rms(rest),
    )


def _solved(matrix: FloatArray, shifts: FloatArray) -> FloatArray:
    """(6,) array: least squares over (n, 2, 6) and (n, 2)."""
    rows = matrix.reshape(-1, 6)
    solution, _, _, singular = np.linalg.lstsq(rows, shifts.ravel(), rcond=None)
    if singular[-1] * _LARGEST_CONDITION < singular[0]:
        raise InputError(
            "the points do not determine the motion of the camera (they lie on one line, "
            "or the projection is parallel); measure more of the picture.",
            code="motion.undetermined",
        )
    return np.asarray(solution, dtype=np.float64)
