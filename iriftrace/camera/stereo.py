"""Calibrations of two cameras in one file, or one file each: lenses, and R and T between them.

Programs name the values of two cameras in three ways: with a number or a side at the name (``M1``,
``cameraMatrixLeft``), in a mapping for each camera (``cam0``, ``left``), or in two files. All three
become the named values of two cameras and the rest, and then every value is found by its name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from attrs import evolve, frozen

from iriftrace.camera.calibration import (
    Calibration,
    calibration_of,
    exact_rotation,
    rotation_in,
    to_world,
)
from iriftrace.camera.calibration_file import CalibrationValues, calibration_content, folded
from iriftrace.camera.calibration_matlab import is_matlab, matlab_motion
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
from iriftrace.camera.stereo_checks import (
    check_axes,
    refuse_contradiction,
    refuse_other_baseline,
)
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import text_in
from iriftrace.core.units import length_factor
from iriftrace.geometry.transform import leads

BASELINES_MM = (3.0, 20_000.0)
"""Distances of two cameras outside of which the unit of T is wrong: metres read as mm or back."""

_SIDES = (("1", "2"), ("left", "right"), ("l", "r"), ("0", "1"), ("cam", "proj"))
_BACK = leads(
    r"(?:cam(?:era)?[\s_-]*[12]|right(?:[\s_-]+cam(?:era)?)?)",
    r"(?:cam(?:era)?[\s_-]*[01]|left)",
)
_OF_A_CAMERA = ("", "cam", "camera", "cameraparameters", "cameraparams", "sensor", "intrinsics")
_RECTIFICATION = ("R", "rectification_matrix", "rectification")
_KALIBR = ("T_cn_cnm1",)
_MATLABS_ROTATION = ("rotationOfCamera2",)
_SHARED = (*WIDTH, *HEIGHT, *SIZE, *LENS, *FISHEYE)
_NAMES = tuple(
    map(
        folded,
        (*MATRIX, *PINHOLE, *DISTORTION, *OTHER_CAMERAS, *_RECTIFICATION, *PROJECTION, *_SHARED),
    )
)


@frozen(eq=False, kw_only=True)
class StereoCalibration:
    """Two calibrated cameras, and how the second one stands to the first.

    Attributes
    ----------
    first, second : Calibration
        Without poses.
    rotation : (3, 3) array
        From the frame of camera 1 to that of camera 2, as ``R`` of OpenCV's stereoCalibrate.
    translation_mm : (3,) array, mm
        ``T`` of stereoCalibrate.
    length_unit : str
        Unit in which T was read.
    """

    first: Calibration
    second: Calibration
    rotation: FloatArray
    translation_mm: FloatArray
    length_unit: str

    @property
    def baseline_mm(self) -> float:
        """Distance of the two cameras, mm."""
        return float(np.linalg.norm(self.translation_mm))

    @property
    def angle_deg(self) -> float:
        """Angle between the axes of the two cameras, degrees."""
        return float(np.degrees(np.arccos(np.clip(self.rotation[2, 2], -1.0, 1.0))))

    @property
    def side(self) -> str:
        """Where camera 2 stands, such as "to the right of", as camera 1 sees it."""
        centre = -self.rotation.T @ self.translation_mm
        axis = int(np.abs(centre).argmax())
        sides = ("to the left of", "to the right of"), ("above", "below"), ("behind", "in front of")
        return sides[axis][int(centre[axis] > 0.0)]

    def placed(self, matrix: FloatArray) -> tuple[Calibration, Calibration]:
        """Both calibrations with their poses, where camera 1 has the pose (4, 4), to world, mm."""
        rotation = matrix[:3, :3].T
        translation = -rotation @ matrix[:3, 3]
        second = to_world(
            self.rotation @ rotation, self.rotation @ translation + self.translation_mm
        )
        return (
            evolve(self.first, matrix=to_world(rotation, translation)),
            evolve(self.second, matrix=second),
        )


def read_stereo_calibration(
    *paths: str | Path, length_unit: str | None = None
) -> StereoCalibration:
    """Read a calibration of two cameras.

    Read are the values of OpenCV's stereoCalibrate (``M1 D1 M2 D2 R T`` and their other names),
    ROS's pairs (the baseline is that of the projection matrices), Kalibr's camchain, and MATLAB's
    stereoParameters, as YAML, XML or JSON.

    Parameters
    ----------
    *paths : path
        One file; or two, of which each has one camera, the first being camera 1, or which hold
        intrinsics and extrinsics.
    length_unit : str, optional
        Unit of the translation. When left out, what MATLAB states, metre for Kalibr and ROS, and
        else mm.

    Raises
    ------
    InputError
        A file is missing, cannot be read, or has other lens models; it has not two cameras or not
        their relative pose; the baseline is impossible, as its unit is another.

    Warns
    -----
    IriftraceWarning
        The rotation is rounded to few digits; four coefficients could be those of a fisheye lens;
        the right camera stands to the left of the left one.
    """
    if len(paths) not in (1, 2):
        raise InputError(
            f"{len(paths)} files are given as the calibration of two cameras; give one or two."
        )
    first, second, rest, sides = _cameras_in(paths)
    rotation, translation, usual = _motion(first, second, rest)
    if said := next(filter(None, map(_BACK.search, map(text_in, map(Path, paths)))), None):
        raise rest.wrong(
            f"it says {said[0]!r}, but R and T are read as leading from camera 1 to camera 2; "
            "invert them"
        )
    unit = length_unit or rest.length_unit or usual
    shift = translation * length_factor(unit)
    baseline, (low, high) = float(np.linalg.norm(shift)), BASELINES_MM
    if not low <= baseline <= high:
        raise rest.wrong(
            f"its two cameras are {baseline:.4g} mm apart where T is in {unit}; give the unit of T "
            "(--calibration-length-unit)"
        )
    refuse_other_baseline(rest, baseline)
    if sides[0] in ("left", "l") and (-rotation.T @ shift)[0] < 0.0:
        warn(
            f"In {rest.path} the right camera stands to the left of the left one. If that is "
            "wrong, R and T lead from right to left: invert them."
        )
    else:
        check_axes(rest, rotation, shift)
    return StereoCalibration(
        first=calibration_of(_lens(first), 1.0),
        second=calibration_of(_lens(second), 1.0),
        rotation=rotation,
        translation_mm=shift,
        length_unit=unit,
    )


def _cameras_in(
    paths: Sequence[str | Path],
) -> tuple[CalibrationValues, CalibrationValues, CalibrationValues, tuple[str, str]]:
    """Values of each camera, those of neither, and what the one or two files call the two."""
    files = [CalibrationValues(Path(path), calibration_content(Path(path))) for path in paths]
    if len(files) == 2 and all(map(_is_camera, files)):
        named = [str(file.content.get("camera_name", "")) for file in files]
        sides = ("left", "right") if "left" in named[0] and "right" in named[1] else ("1", "2")
        return files[0], files[1], evolve(files[0], content={}), sides
    values = evolve(files[0], content={**files[0].content, **files[-1].content})
    inner = values.named(PINHOLE)
    if isinstance(inner, Mapping) and "data" not in inner:
        values = evolve(values, content={**inner, **values.content})
    first, second, sides = _two_cameras(values)
    return first, second, values, sides


def _is_camera(values: CalibrationValues) -> bool:
    """True if the values are those of a single camera."""
    values = without_scalars(values)
    return is_matlab(values) or isinstance(values.named((*MATRIX, *PINHOLE)), (list, Mapping))


def _is_shared(name: str) -> bool:
    """True for values that may hold for both cameras, and for unknown ones of a distortion."""
    known = folded(name) in map(folded, _SHARED)
    return known or (folded(name) not in _NAMES and is_part_of_a_distortion(name))


def _lens(values: CalibrationValues) -> CalibrationValues:
    """The values without the pose, which a relative one would be taken for."""
    pose = set(map(folded, (*ROTATION, *TRANSLATION)))
    content = {name: value for name, value in values.content.items() if folded(name) not in pose}
    return without_scalars(evolve(values, content=content))


def _two_cameras(
    values: CalibrationValues,
) -> tuple[CalibrationValues, CalibrationValues, tuple[str, str]]:
    """The values of each camera, and what the file calls the two."""
    shared = {name: value for name, value in values.content.items() if _is_shared(str(name))}
    if values.named(_MATLABS_ROTATION) is not None and values.named(SIZE) is not None:
        # What stereoParametersToOpenCV returns is OpenCV's, but for rows before columns.
        shared[str(values.spelling(SIZE))] = values.array(SIZE, (2,))[::-1]
    for sides in _SIDES:
        found = [_camera_of(values, side) for side in sides]
        if all(map(_is_camera, found)):
            first, second = (
                evolve(values, content={**shared, **camera.content}, camera=f"camera {number}")
                for number, camera in enumerate(found, start=1)
            )
            others = {"1": ("0", "3"), "0": ("2",)}.get(sides[0], ())
            if any(_is_camera(_camera_of(values, other)) for other in others):
                raise values.wrong(
                    "it has more than two cameras; write a file with the two that measured"
                )
            return first, second, sides
    raise values.wrong(
        "it has not two camera matrices under names known here, such as M1 and M2, "
        "cameraMatrixLeft and cameraMatrixRight, or cam0 and cam1 (its names are "
        f"{_listed(values)}); rename them, or give a file for each camera"
    )


def _listed(values: CalibrationValues) -> str:
    return ", ".join(map(str, list(values.content)[:12])) or "none"


def _camera_of(values: CalibrationValues, side: str) -> CalibrationValues:
    """Values of one side: its mapping, or the values whose names start or end with it."""
    by_name = {folded(str(name)): value for name, value in values.content.items()}
    for word in _OF_A_CAMERA:
        for name in (word + side, side + word):
            value = by_name.get(name)
            if isinstance(value, Mapping) and "data" not in value:  # no matrix
                return evolve(values, content=value)
    found = {}
    for base in _NAMES:
        for name in (base + side, side + base, f"cam{side}{base}", f"camera{side}{base}"):
            if name in by_name:
                found[base] = by_name[name]
    return evolve(values, content=found)


def _motion(
    first: CalibrationValues, second: CalibrationValues, rest: CalibrationValues
) -> tuple[FloatArray, FloatArray, str]:
    """Rotation and translation from camera 1 to camera 2, and the unit usual for these."""
    if is_matlab(first) or rest.named(_MATLABS_ROTATION) is not None:
        motion = matlab_motion(rest, rows=is_matlab(first))
        if motion is not None:
            unit = first.length_unit or "mm"
            return exact_rotation(rest, motion[0]), motion[1], unit
    if second.named(_KALIBR) is not None:
        matrix = second.array(_KALIBR, (16,)).reshape(4, 4)
        return exact_rotation(second, matrix[:3, :3]), matrix[:3, 3], "m"
    # What is between the cameras may have a mapping, such as ``extrinsics``.
    parts = [
        evolve(rest, content=value)
        for name, value in rest.content.items()
        if isinstance(value, Mapping) and folded(str(name)).startswith(("stereo", "extrinsic"))
    ]
    for values in (rest, *parts, second):
        if values.named(ROTATION) is not None and values.named(TRANSLATION) is not None:
            if _stands_elsewhere(first, turned=values is second):
                raise first.wrong(
                    "both cameras have a pose of their own; write a file for each and read these "
                    "(--calibration and --second-calibration)"
                )
            refuse_different(values)
            rotation, shift = rotation_in(values), values.array(TRANSLATION, (3,))
            if values is not second:
                both = _is_rectified(first) and _is_rectified(second)
                # Cameras that were calibrated one by one have no baseline there.
                both = both and bool(second.array(PROJECTION, (12,))[3::4].any())
                other = _motion_of_rectified(first, second) if both else None
                refuse_contradiction(values, (rotation, shift), other)
            return rotation, shift, values.length_unit or "mm"
    if _is_rectified(first) and _is_rectified(second):
        rotation, shift = _motion_of_rectified(first, second)
        return rotation, shift, "m" if first.named(LENS) is not None else "mm"
    raise rest.wrong(
        "R and T from camera 1 to camera 2 are missing, as stereoCalibrate gives them (its names "
        f"are {_listed(rest if rest.content else second)}); add both, x2 = R x1 + T, since what is "
        "called R_12 or R_lr may lead back"
    )


def _stands_elsewhere(first: CalibrationValues, *, turned: bool) -> bool:
    """True if camera 1 has a pose other than the identity.

    Its rotation counts only if `turned`, as it is the rectification in files with R and T.
    """
    moved = first.named(TRANSLATION) is not None and first.array(TRANSLATION, (3,)).any()
    if moved or not turned or first.named(ROTATION) is None:
        return bool(moved)
    return not np.allclose(rotation_in(first), np.eye(3), atol=1e-6)


def _is_rectified(camera: CalibrationValues) -> bool:
    """True for a camera with a rectification and a projection."""
    return camera.named(_RECTIFICATION) is not None and camera.named(PROJECTION) is not None


def _motion_of_rectified(
    first: CalibrationValues, second: CalibrationValues
) -> tuple[FloatArray, FloatArray]:
    """Motion from camera 1 to camera 2 of rectifications R and projections P.

    A point has the places R1 x1 and R2 x2 in the two rectified frames, which differ by the
    baseline along x alone: P[0, 3] / P[0, 0].
    """
    turns, shifts = [], []
    for camera in (first, second):
        turns.append(exact_rotation(camera, camera.array(_RECTIFICATION, (9,)).reshape(3, 3)))
        projection = camera.array(PROJECTION, (12,)).reshape(3, 4)
        shifts.append(projection[:, 3] / projection[0, 0])
    shift = turns[1].T @ (shifts[1] - shifts[0])
    if not np.isfinite(shift).all() or not shift.any():
        raise first.wrong(
            "its projection matrices have no baseline (P[0, 3] is 0 in both), as of cameras that "
            "were calibrated one by one; calibrate the pair"
        )
    return turns[1].T @ turns[0], shift
