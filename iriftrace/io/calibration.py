"""Camera calibrations of OpenCV, ROS, Kalibr and MATLAB: lenses, poses and pairs of cameras."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from attrs import evolve

from iriftrace.camera.calibration import Calibration, StereoCalibration, to_world
from iriftrace.camera.distortion import Distortion
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.units import length_factor
from iriftrace.io.calibration_checks import (
    check_axes,
    check_baseline,
    check_pixels,
    checked_matrix,
    exact_rotation,
    refuse_contradiction,
    rotation_of,
)
from iriftrace.io.calibration_formats import (
    FORMATS,
    INSTEAD,
    KALIBR,
    MATLAB,
    OPENCV,
    ROS,
    Values,
    content_of,
    folded,
    listed,
    numbered_cameras,
    single_camera,
)
from iriftrace.io.refusals import not_read

_FOUR = {"radtan", "radialtangential"}
"""Lens models of k1, k2, p1, p2 alone, folded."""

_MODELS = {"plumbbob", "rationalpolynomial", *_FOUR}
_OF_A_POSE = re.compile("extrinsic|pose|transform|quaternion|c2w|w2c|[rt]vec|^[rt](wc|cw)?$")
_RECTIFIED = ("rectification", "projection")
_PROGRAMS = ", ".join(one.name for one in FORMATS)


def read_calibration(path: str | Path, *, length_mm: float | None = None) -> Calibration:
    """Read a camera calibration of OpenCV, ROS, Kalibr or MATLAB.

    OpenCV's files may have a pose, from the world to the camera: ``rvec`` and ``tvec``, ``R`` and
    ``T``, or one row of ``extrinsic_parameters``.

    Parameters
    ----------
    path : path
        YAML, XML or JSON.
    length_mm : float, optional
        Length unit of the translation, mm; that which the file states, else 1, when left out.

    Raises
    ------
    InputError
        The file is missing, cannot be read, is of another format or lens model or of two cameras,
        or one of the values is missing or implausible.

    Warns
    -----
    IriftraceWarning
        The rotation is rounded to few digits; four coefficients could be those of a fisheye lens;
        the principal point is that of other pictures; a pose is not read.
    """
    values = _one_camera(Path(path))
    unit = length_factor(values.length_unit) if length_mm is None else length_mm
    views = values.array("views") if values.has("views") else np.zeros(0)
    calibration = evolve(_lens(values), matrix=_pose(values, unit), views=len(views) // 6)
    known = {folded(name) for names in values.format.fields.values() for name in names}
    rest = (name for name in values.content if folded(name) not in known)
    unread = [name for name in rest if _OF_A_POSE.search(folded(name))]
    if unread and calibration.matrix is None and not calibration.views:
        warn(
            f"The calibration {path} has {', '.join(unread)}, which is not read as the camera's "
            "pose; write rvec and tvec (or R and T) of OpenCV, from the part's frame to the "
            "camera's."
        )
    return calibration


def read_stereo_calibration(
    *paths: str | Path, length_unit: str | None = None
) -> StereoCalibration:
    """Read a calibration of two cameras.

    Read are the values of OpenCV's stereoCalibrate (``M1 D1 M2 D2 R T`` or the names of its
    arguments), ROS's pairs (the baseline is that of the projection matrices), Kalibr's camchain,
    and MATLAB's stereoParameters, as YAML, XML or JSON.

    Parameters
    ----------
    *paths : path
        One file; or OpenCV's intrinsics and extrinsics; or ROS's files of camera 1 and camera 2.
    length_unit : str, optional
        Unit of the translation. When left out, what the file states, else metre for Kalibr and ROS
        and mm for OpenCV and MATLAB.

    Raises
    ------
    InputError
        A file is missing, cannot be read, or has other lens models; it has not two cameras or not
        their relative pose; the baseline is impossible, as its unit is another.

    Warns
    -----
    IriftraceWarning
        The rotation is rounded to few digits; four coefficients could be those of a fisheye lens;
        the axes of the cameras lead apart or meet in front of them.
    """
    if len(paths) not in (1, 2):
        raise InputError(
            f"{len(paths)} files are given as the calibration of two cameras; give one or two.",
            code="calibration.three_files",
        )
    first, second, rest = _two_cameras([Path(path) for path in paths])
    rotation, translation = _motion(first, second, rest)
    # MATLAB states it for each camera.
    unit = length_unit or (first if first.has("length_unit") else rest).length_unit
    shift = translation * length_factor(unit)
    check_baseline(rest.called, shift, unit)
    check_axes(rest.called, rotation, shift)
    return StereoCalibration(
        first=_lens(first),
        second=_lens(second),
        rotation=rotation,
        translation_mm=shift,
        length_unit=unit,
    )


def _one_camera(path: Path) -> Values:
    """Values of a file of one camera."""
    content = content_of(path)
    if values := single_camera(path, content):
        return values
    match numbered_cameras(path, content):
        case [values] if values.format is KALIBR:
            return evolve(values, camera="")
        case [_, _]:
            raise InputError(
                f"The calibration {path}: it is of two cameras; read it with "
                "read_stereo_calibration.",
                code="calibration.two_cameras",
                argument="stereo_calibration",
            )
    raise not_read(path, f"other names than {_PROGRAMS} ({listed(content)})", INSTEAD)


def _two_cameras(paths: list[Path]) -> tuple[Values, Values, Values]:
    """Values of each camera, and those of neither."""
    contents = [content_of(path) for path in paths]
    singles = [single_camera(*each) for each in zip(paths, contents, strict=True)]
    match singles:
        case [Values() as first, Values() as second] if first.format is second.format is ROS:
            return first, second, evolve(first, content={})
    content = {**contents[0], **contents[-1]}
    match numbered_cameras(paths[0], content):
        case [first, second]:
            return first, second, Values(paths[0], first.format, content)
    if any(singles):
        raise InputError(
            f"The calibration {paths[0]}: it has one camera; give a file with M1, D1, M2, D2, R "
            "and T of OpenCV, or read cameras that have poses of their own one by one.",
            code="calibration.one_camera",
        )
    raise InputError(
        f"The calibration {paths[0]}: it has not two cameras of {_PROGRAMS} (its names are "
        f"{listed(content)}); write OpenCV's YAML: M1, D1, M2 and D2 (row by row), R and T from "
        "camera 1 to camera 2, image_width and image_height.",
        code="calibration.no_cameras",
    )


def _matrix(values: Values) -> FloatArray:
    """Camera matrix, (3, 3), px, for the first pixel's centre at (0, 0)."""
    if values.has("pinhole") or (values.has("focal") and not values.has("matrix")):
        across, down, x, y = (
            values.array("pinhole", 4)
            if values.has("pinhole")
            else np.append(values.array("focal", 2), values.array("centre", 2))
        )
        matrix = np.array(((across, 0.0, x), (0.0, down, y), (0.0, 0.0, 1.0)))
    else:
        matrix = values.array("matrix", 9).reshape(3, 3).copy()
    skew = float(values.array("skew", 1)[0]) if values.has("skew") else 0.0
    matrix = checked_matrix(values.called, matrix, skew)
    matrix[:2, 2] -= values.format.pixel_origin
    return matrix


def _resolution(values: Values) -> tuple[int, int]:
    """Pixels across and down."""
    if values.has("rows_and_columns"):
        size = values.array("rows_and_columns", 2)[::-1]
    elif values.has("size"):
        size = values.array("size", 2)
    elif values.has("width") or values.has("height"):
        size = np.append(values.array("width", 1), values.array("height", 1))
    else:
        raise InputError(
            f"The calibration {values.called}: image_width and image_height are missing, the "
            "pixels of the pictures; add both lines.",
            code="calibration.no_resolution",
        )
    if (size % 1).any() or (size < 1).any():
        raise InputError(
            f"The calibration {values.called}: its pictures are {size[0]:g} x {size[1]:g} px, but "
            "pixels are whole numbers from 1 on.",
            code="calibration.resolution",
        )
    return int(size[0]), int(size[1])


def _lens(values: Values) -> Calibration:
    """Calibration without a pose."""
    models = _models(values)
    matrix, resolution = _matrix(values), _resolution(values)
    check_pixels(values.called, matrix, resolution)
    return Calibration(
        focal_px=(float(matrix[0, 0]), float(matrix[1, 1])),
        centre_px=(float(matrix[0, 2]), float(matrix[1, 2])),
        resolution=resolution,
        distortion=_distortion(values, models),
    )


def _models(values: Values) -> set[str]:
    """Lens models that the file names, folded; InputError for one that is not modelled."""
    found = [str(values.value(name)) for name in ("model", "camera_model") if values.has(name)]
    if str(values.value("fisheye") or 0).lower() not in ("0", "false"):
        found.append("fisheye")
    if values.has("xi"):
        found.append("omnidirectional (xi)")
    for model in found:
        if folded(model) not in {*_MODELS, "pinhole", "none"}:
            raise InputError(
                f"The calibration {values.called}: the lens model {model!r} is not the one of "
                "Brown and Conrady (plumb_bob, rational_polynomial, radtan); calibrate with that.",
                code="calibration.model",
            )
    return set(map(folded, found))


def _distortion(values: Values, models: set[str]) -> Distortion:
    if values.format is MATLAB:
        radial = values.array("radial", 2, 3)
        return Distortion.of_sequence((*radial[:2], *values.array("tangential", 2), *radial[2:]))
    if "none" in models:
        if values.has("distortion") and values.array("distortion").any():
            raise InputError(
                f"The calibration {values.called}: its lens model is 'none', but it has distortion "
                "coefficients; leave out either.",
                code="calibration.model_contradicts",
            )
        return Distortion()
    if not values.has("distortion"):
        raise InputError(
            f"The calibration {values.called}: {values.format.fields['distortion'][0]} is missing; "
            "add [k1, k2, p1, p2, k3], with zeros only for a lens without distortion.",
            code="calibration.no_distortion",
        )
    numbers = values.array("distortion")
    if models & _FOUR and len(numbers) != 4:
        raise InputError(
            f"The calibration {values.called}: its lens model has four coefficients, k1, k2, p1, "
            f"p2, but the file has {len(numbers)}; name the model of these.",
            code="calibration.coefficients",
        )
    if numbers[8:].any():
        raise InputError(
            f"The calibration {values.called}: it has {len(numbers)} distortion coefficients with "
            "thin prism or tilt terms, which are not modelled; calibrate with k1 to k6, p1 and p2 "
            "only.",
            code="calibration.coefficients",
        )
    named = models & _MODELS or values.has("fisheye")
    if len(numbers) == 4 and numbers.any() and not named:
        warn(
            f"{values.called} has four distortion coefficients and names no lens model; they are "
            "read as k1, k2, p1, p2. If they are k1 to k4 of a fisheye lens (cv2.fisheye), "
            "calibrate with cv2.calibrateCamera; if not, add distortion_model: plumb_bob."
        )
    try:
        return Distortion.of_sequence(numbers[:8])
    except InputError as error:
        raise InputError(
            f"The calibration {values.called}: {str(error).rstrip('.')}.",
            code=error.code,
            argument=error.argument,
        ) from error


def _pose(values: Values, length_mm: float) -> FloatArray | None:
    """Camera to world, (4, 4) array, mm, of an OpenCV file that has one."""
    if values.format is not OPENCV:
        return None
    turn, shift = values.has("rotation"), values.has("translation")
    if turn != shift:
        raise InputError(
            f"The calibration {values.called}: it has only one of rvec and tvec, which is not a "
            "pose; give both.",
            code="calibration.half_pose",
        )
    if turn:
        numbers = np.append(values.array("rotation", 3, 9), values.array("translation", 3))
    elif values.has("views") and len(values.array("views")) == 6:
        numbers = values.array("views")
    else:
        return None
    return to_world(rotation_of(values.called, numbers[:-3]), numbers[-3:] * length_mm)


def _motion(first: Values, second: Values, rest: Values) -> tuple[FloatArray, FloatArray]:
    """Rotation, (3, 3), and translation, (3,), from camera 1 to camera 2."""
    if first.format is ROS:
        return _motion_of_rectified(first, second)
    if first.format is KALIBR:
        matrix = second.array("motion", 16).reshape(4, 4)
        return exact_rotation(second.called, matrix[:3, :3]), matrix[:3, 3]
    pose = rest.value("motion")
    values = evolve(rest, content=pose) if isinstance(pose, Mapping) else rest
    if not values.has("rotation", "translation"):
        raise InputError(
            f"The calibration {rest.called}: R and T from camera 1 to camera 2 are missing, as "
            f"stereoCalibrate gives them (its names are {listed(rest.content)}); add both, x2 = R "
            "x1 + T.",
            code="calibration.no_motion",
        )
    rotation = rotation_of(rest.called, values.array("rotation", 3, 9))
    motion = rotation, values.array("translation", 3)
    # Cameras that were calibrated one by one have no baseline in their projections.
    rectified = first.has(*_RECTIFIED) and second.has(*_RECTIFIED)
    if rectified and second.array("projection", 12)[3::4].any():
        refuse_contradiction(rest.called, motion, _motion_of_rectified(first, second))
    return motion


def _motion_of_rectified(first: Values, second: Values) -> tuple[FloatArray, FloatArray]:
    """Motion from camera 1 to camera 2 of rectifications R and projections P.

    A point has the places R1 x1 and R2 x2 in the two rectified frames, which differ by the
    baseline along x alone: P[0, 3] / P[0, 0].
    """
    turns, shifts = [], []
    for camera in (first, second):
        matrix = camera.array("rectification", 9).reshape(3, 3)
        turns.append(exact_rotation(camera.called, matrix))
        projection = camera.array("projection", 12).reshape(3, 4)
        shifts.append(projection[:, 3] / projection[0, 0])
    shift = turns[1].T @ (shifts[1] - shifts[0])
    if not np.isfinite(shift).all() or not shift.any():
        raise InputError(
            f"The calibration {first.called}: its projection matrices have no baseline (P[0, 3] is "
            "0 in both), as of cameras that were calibrated one by one; calibrate the pair.",
            code="calibration.no_baseline",
        )
    return turns[1].T @ turns[0], shift
