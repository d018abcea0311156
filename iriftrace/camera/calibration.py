"""Camera calibrations written by OpenCV or similar programs, as YAML, XML or JSON.

OpenCV knows lengths in pixels only: a focal length of 3650 px is that of a 10 mm lens before pixels
of 2.74 um as well as of any other with the same ratio. All rays are the same; only the size of a
pixel turns them into the focal length and the sensor's size that results state.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike

from iriftrace.camera.calibration_file import CalibrationValues, calibration_content, folded
from iriftrace.camera.calibration_matlab import is_matlab, matlab_camera
from iriftrace.camera.calibration_names import (
    DISTORTION,
    FISHEYE,
    HEIGHT,
    LENS,
    MATRIX,
    OTHER_CAMERAS,
    PINHOLE,
    PROJECTION,
    ROTATION,
    SIZE,
    TRANSLATION,
    WIDTH,
    is_part_of_a_distortion,
    refuse_different,
    without_scalars,
)
from iriftrace.camera.calibration_pixels import check_order, check_pixels
from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import Distortion
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import text_in
from iriftrace.core.units import length_factor
from iriftrace.geometry.transform import nearest_rotations, stated_direction

LARGEST_PIXEL_MM = 0.5
"""Larger than for any camera; a number of this size is in micrometres."""

LARGEST_ROUNDING = 1.5e-3
"""Largest relative change of lengths by a rotation matrix that has three decimals."""

_VIEWS = ("extrinsic_parameters",)
_OF_A_POSE = re.compile(
    "extrinsic|pose|world|position|orientation|transform|quaternion|euler|c2w|w2c"
    "|^[rt](wc|cw|vecs)$"
)
_RADTAN = {"radtan", "radialtangential"}
"""Names of k1, k2, p1, p2 in Kalibr and its like, folded."""

_MODELS = {"plumbbob", "rationalpolynomial", "brown", "brownconrady", "opencv", *_RADTAN}
_OTHER_LENS = re.compile(
    "fisheye|equidistant|kannala|division|omni|sphere|unified|inverse|telecentric|orthographic"
    "|line.?scan",
    re.IGNORECASE,
)
"""In the names of lens models, which entries of any name with "model", "type" ... may have."""
_OF_A_LENS = re.compile("model|type|lens|projection|distortion")
_OF_TWO = re.compile("(cameramatrix|intrinsicmatrix|mtx|k|m)(2|r|right)|(camera|cam)1|right")
"""Names of one of two cameras, folded."""


@frozen(eq=False, kw_only=True)
class Calibration:
    """Camera as a calibration file describes it.

    Attributes
    ----------
    focal_px : (2,) float, px
        Focal length in pixel widths and heights.
    centre_px : (2,) float, px
        Principal point as OpenCV counts: the first pixel's centre is (0, 0).
    resolution : (2,) int
        Pixels across and down of the pictures that were calibrated with.
    distortion : Distortion
    matrix : (4, 4) array or None
        Camera to world, mm, where the file has one pose.
    views : int
        Poses of a calibration board in the file; the camera's own pose is known only from one.
    """

    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    resolution: tuple[int, int]
    distortion: Distortion
    matrix: FloatArray | None
    views: int

    def camera(
        self,
        *,
        pixel_size_mm: float,
        focus_mm: tuple[float, float] = (0.0, math.inf),
        matrix: ArrayLike | None = None,
    ) -> Camera:
        """The calibrated camera.

        Parameters
        ----------
        pixel_size_mm : float, mm
            Width of a pixel. Its height follows from the two focal lengths, which belong to one
            lens.
        focus_mm, matrix
            As in :class:`iriftrace.camera.camera.Camera`; by default the calibration's own pose, or
            that of the world's axes, with a warning, if it has none.
        """
        if not 0 < pixel_size_mm < LARGEST_PIXEL_MM:
            raise InputError(
                f"Pixel size is {pixel_size_mm} mm (--pixel-size); give the width of a pixel, such "
                "as 0.00274 mm."
            )
        pose = self.matrix if matrix is None else matrix
        if pose is None:
            warn(
                "The calibration has no pose, so its camera is at (0, 0, 0), along +z; give matrix."
            )
        across, down = self.focal_px
        width, height = self.resolution
        return Camera(
            focal_length_mm=across * pixel_size_mm,
            sensor_mm=(width * pixel_size_mm, height * pixel_size_mm * across / down),
            resolution=self.resolution,
            principal_point_px=self.centre_px,
            distortion=self.distortion,
            focus_mm=focus_mm,
            matrix=np.eye(4) if pose is None else pose,
        )


def read_calibration(path: str | Path, *, length_mm: float | None = None) -> Calibration:
    """Read a camera calibration written by OpenCV's FileStorage or a similar program.

    Reads ``camera_matrix``, ``distortion_coefficients`` (4, 5 or 8 in OpenCV's order; more if the
    others are 0), ``image_width``, ``image_height``, and optionally ``rvec`` and ``tvec``
    (world to camera) or one row of ``extrinsic_parameters``; matrices as OpenCV writes them or as
    plain lists. Their other names in OpenCV, ROS, Kalibr and MATLAB are known, too.

    Parameters
    ----------
    path : path
        YAML, XML or JSON.
    length_mm : float, optional
        Length unit of the translation, mm; that which the file states, else 1, when left out.

    Raises
    ------
    InputError
        The file is missing, cannot be read, has another lens model or two cameras, or one of the
        values is missing.

    Warns
    -----
    IriftraceWarning
        The rotation is rounded to few digits; four coefficients could be those of a fisheye lens.
    """
    values = without_scalars(CalibrationValues(Path(path), calibration_content(Path(path))))
    _refuse_two_cameras(values)
    if length_mm is None:
        length_mm = length_factor(values.length_unit or "mm")
    calibration = calibration_of(values, length_mm)
    said = stated_direction(text_in(Path(path)), to_camera=False)
    if said and calibration.matrix is not None:
        raise values.wrong(
            f"it says {said!r}, but its pose is read as leading from the part's frame to the "
            "camera's; write R and T of the inverse, or leave out these words"
        )
    unread = [name for name in map(str, values.content) if _OF_A_POSE.search(folded(name))]
    if unread and calibration.matrix is None and not calibration.views and not is_matlab(values):
        warn(
            f"The calibration {path} has {', '.join(unread)}, which is not read as the camera's "
            "pose; write rvec and tvec (or R and T), from the part's frame to the camera's."
        )
    return calibration


def calibration_of(values: CalibrationValues, length_mm: float) -> Calibration:
    """Calibration of one camera's named values; see `read_calibration`."""
    values = matlab_camera(values)
    refuse_different(values)
    _refuse_other_models(values)
    matrix = _matrix(values)
    width, height = _resolution(values)
    check_pixels(values, matrix, np.array((width, height)))
    return Calibration(
        focal_px=(float(matrix[0, 0]), float(matrix[1, 1])),
        centre_px=(float(matrix[0, 2]), float(matrix[1, 2])),
        resolution=(width, height),
        distortion=_distortion(values),
        matrix=_pose(values, length_mm),
        views=_views(values),
    )


def to_world(rotation: FloatArray, translation: FloatArray) -> FloatArray:
    """Camera to world, (4, 4), of the rotation (3, 3) and translation (3,) world to camera."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.T
    matrix[:3, 3] = -rotation.T @ translation
    return matrix


def rotation_in(values: CalibrationValues, names: tuple[str, ...] = ROTATION) -> FloatArray:
    """A rotation, (3, 3), of a rotation vector in radians or a rotation matrix.

    A matrix of three or more decimals is replaced by the nearest rotation, with a warning.
    """
    from scipy.spatial.transform import Rotation

    numbers = values.array(names, (3, 9))
    if len(numbers) == 9:
        return exact_rotation(values, numbers.reshape(3, 3))
    if np.linalg.norm(numbers) > 2 * np.pi:
        raise values.wrong(
            f"its rotation vector {numbers.tolist()} turns by {np.linalg.norm(numbers):.4g} "
            "rad, more than a whole turn, so it is in degrees or no rotation vector; give "
            "radians (axis times angle, as of OpenCV's Rodrigues), or the rotation matrix"
        )
    if np.linalg.norm(numbers) > 1.01 * np.pi:
        warn(
            f"The rotation vector {numbers.tolist()} in {values.called} turns by more than half a "
            "turn, as OpenCV's Rodrigues never gives; if it is in degrees, give radians."
        )
    rotation: FloatArray = Rotation.from_rotvec(numbers).as_matrix()
    return rotation


def exact_rotation(values: CalibrationValues, matrix: FloatArray) -> FloatArray:
    """The rotation, (3, 3), that a matrix of rounded numbers is; see `rotation_in`."""
    off = float(np.abs(np.linalg.svd(matrix, compute_uv=False) - 1.0).max())
    if np.linalg.det(matrix) < 0 or off > LARGEST_ROUNDING:
        raise values.wrong(
            "its rotation does not turn, but stretches or mirrors (lengths change by up to "
            f"{100 * off:.2g} %); give a rotation, with four digits or more"
        )
    if off > 1e-6:
        warn(
            f"The rotation matrix in {values.called} is rounded to few digits; the nearest "
            f"rotation is used, and directions are uncertain by about {off:.1g} rad."
        )
    (rotation,) = nearest_rotations(matrix[None])
    return np.asarray(rotation, dtype=np.float64)


def _matrix(values: CalibrationValues) -> FloatArray:
    """Camera matrix, (3, 3), px."""
    names = MATRIX if values.named(MATRIX) is not None else (MATRIX[0], *PINHOLE)
    numbers = values.array(names, (9, 4) if names[1:] == PINHOLE else (9,))
    if len(numbers) == 4:
        across, down, x, y = numbers
        numbers = np.array((across, 0.0, x, 0.0, down, y, 0.0, 0.0, 1.0))
    matrix = numbers.reshape(3, 3)
    if np.allclose(matrix[:, 2], (0, 0, 1)) and not np.allclose(matrix[2], (0, 0, 1)):
        raise values.wrong(
            f"{matrix.tolist()} is a camera matrix column by column (transposed); write it and the "
            "rotations of the same program row by row"
        )
    if matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or not np.allclose(matrix[2], (0, 0, 1)):
        raise values.wrong(
            f"{matrix.tolist()} is not a camera matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"
        )
    there = [name for name in OTHER_CAMERAS if values.named((name,))]
    stated = {name: values.array((name,), (1,))[0] for name in there}
    for name, number in {"": matrix[0, 1], **stated}.items():
        if abs(number) > 1e-9 * matrix[0, 0] or matrix[1, 0] != 0:
            raise values.wrong(
                f"the camera matrix has the {'xi' if name == 'xi' else 'skew'} {number:g}, which "
                "is not modelled; calibrate without it"
            )
    return matrix


def _resolution(values: CalibrationValues) -> tuple[int, int]:
    """Pixels across and down."""
    size = values.named(SIZE)
    if isinstance(size, Mapping) and "data" not in size:
        values = evolve(values, content=size)
    elif values.named(WIDTH) is None and size is not None:
        width, height = values.array(SIZE, (2,))
        values = evolve(values, content={WIDTH[0]: width, HEIGHT[0]: height})
    if values.named(WIDTH) is None and values.named(HEIGHT) is None:
        raise values.wrong(
            f"{WIDTH[0]} and {HEIGHT[0]} are missing, the pixels of the pictures; add both lines"
        )
    return values.whole(WIDTH), values.whole(HEIGHT)


def _distortion(values: CalibrationValues) -> Distortion:
    models = _models(values)
    given = values.named(DISTORTION)
    if "none" in models:
        if given is not None and values.array(DISTORTION).any():
            raise values.wrong(
                "its lens model is 'none', but it has distortion coefficients; leave out either"
            )
        return Distortion()
    if given is None:
        parts = [name for name in values.content if is_part_of_a_distortion(str(name))]
        raise values.wrong(
            f"{DISTORTION[0]} is missing; "
            + (
                f"if {', '.join(parts)} describes the distortion, write {DISTORTION[0]}: [k1, k2, "
                "p1, p2, k3] with these values in OpenCV's order"
                if parts
                else f"for a lens without distortion write {DISTORTION[0]}: [0, 0, 0, 0]"
            )
        )
    numbers = values.array(DISTORTION)
    if models.keys() & _RADTAN and len(numbers) != 4:
        raise values.wrong(
            f"the lens model {', '.join(models.keys() & _RADTAN)!r} has four coefficients, k1, k2, "
            f"p1, p2, but the file has {len(numbers)}; name the model of these"
        )
    if numbers[8:].any():
        raise values.wrong(
            f"{len(numbers)} distortion coefficients with thin prism or tilt terms are given, "
            "which are not modelled; calibrate with k1 to k6, p1 and p2 only"
        )
    named = models.keys() & _MODELS or values.named(FISHEYE) is not None
    if len(numbers) == 4 and numbers.any() and not named:
        warn(
            f"{values.called} has four distortion coefficients and names no lens model; they are "
            "read as k1, k2, p1, p2. If they are k1 to k4 of a fisheye lens (cv2.fisheye), "
            "calibrate with cv2.calibrateCamera; if not, add distortion_model: plumb_bob."
        )
    check_order(values, numbers)
    try:
        return Distortion.of_sequence(numbers[:8])
    except InputError as error:
        raise values.wrong(str(error).rstrip(".")) from error


def _models(values: CalibrationValues) -> dict[str, str]:
    """Lens models that the file names, folded, and as it writes them in lower case."""
    found = (values.named((name,)) for name in LENS)
    return {folded(str(model)): str(model).lower() for model in found if model}


def _refuse_other_models(values: CalibrationValues) -> None:
    if str(values.named(FISHEYE) or 0).lower() not in ("0", "false"):
        raise values.wrong(
            "it is of OpenCV's fisheye model, which is not modelled; calibrate with the one of "
            "Brown and Conrady"
        )
    for name, model in _models(values).items():
        if name not in {*_MODELS, "pinhole", "none"}:
            raise values.wrong(
                f"the lens model {model!r} is not the one of Brown and Conrady (plumb_bob, "
                "rational_polynomial, radtan, opencv); calibrate with that"
            )
    for name, value in values.content.items():
        of_a_lens = _OF_A_LENS.search(folded(str(name)))
        if of_a_lens and isinstance(value, str) and _OTHER_LENS.search(value):
            raise values.wrong(
                f"its {name} {value!r} is another lens model than the one of Brown and Conrady, "
                "which alone is modelled; calibrate with that"
            )


def _refuse_two_cameras(values: CalibrationValues) -> None:
    two = [
        str(name)
        for name, value in values.content.items()
        if _OF_TWO.fullmatch(folded(str(name))) and not isinstance(value, int | float | str)
    ]
    if two and values.named((*MATRIX, *PINHOLE)) is None:
        raise values.wrong(
            f"it is of two cameras ({', '.join(two)}); read it with read_stereo_calibration "
            "(--stereo-calibration)"
        )


def _views(values: CalibrationValues) -> int:
    return 0 if values.named(_VIEWS) is None else len(values.array(_VIEWS)) // 6


def _pose(values: CalibrationValues, length_mm: float) -> FloatArray | None:
    """Camera to world, (4, 4) array, mm."""
    turn, shift = values.named(ROTATION), values.named(TRANSLATION)
    if shift is None and values.named(PROJECTION) is not None:
        # The R of a CameraInfo message of ROS is its rectification.
        turn = None
    if (turn is None) != (shift is None):
        raise values.wrong("it has only one of rvec and tvec, which is not a pose; give both")
    if turn is not None:
        return to_world(rotation_in(values), values.array(TRANSLATION, (3,)) * length_mm)
    if _views(values) == 1:
        row = values.array(_VIEWS, (6,))
        view = CalibrationValues(values.path, {"rvec": row[:3]})
        return to_world(rotation_in(view), row[3:] * length_mm)
    return None
