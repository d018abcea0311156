"""Parameters of MATLAB's Camera Calibrator and Stereo Camera Calibrator, as text.

What ``jsonencode(toStruct(stereoParams))`` or a writer of YAML puts out. MATLAB multiplies rows by
matrices where its names are ``IntrinsicMatrix`` and ``RotationOfCamera2``, so these are transposed;
``K`` and ``PoseCamera2`` of newer versions are not. Its first pixel's centre is (1, 1).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from attrs import evolve

from iriftrace.camera.calibration_file import CalibrationValues, folded
from iriftrace.camera.calibration_names import ROTATION, TRANSLATION
from iriftrace.core.arrays import FloatArray

_RADIAL, _TANGENTIAL = ("RadialDistortion",), ("TangentialDistortion",)
_OLD_MATRIX, _MATRIX = ("IntrinsicMatrix",), ("K",)
_FOCAL, _CENTRE, _SKEW = ("FocalLength",), ("PrincipalPoint",), ("Skew",)
"""Those of cameraIntrinsics."""

_SIZE = ("ImageSize",)
_ROTATION, _TRANSLATION = ("RotationOfCamera2",), ("TranslationOfCamera2",)


def is_matlab(values: CalibrationValues) -> bool:
    """True for the struct of MATLAB's cameraParameters."""
    return values.named(_RADIAL) is not None


def matlab_camera(values: CalibrationValues) -> CalibrationValues:
    """The values of one camera under OpenCV's names and conventions; others as they are.

    A pose under OpenCV's names has been added, and is OpenCV's.
    """
    if not is_matlab(values):
        return values
    inner = values.named(("Intrinsics",))
    if isinstance(inner, Mapping):
        values = evolve(values, content={**inner, **values.content})
    radial, tangential = values.array(_RADIAL, (2, 3)), values.array(_TANGENTIAL, (2,))
    if values.named(_MATRIX) is not None:
        matrix = values.array(_MATRIX, (9,)).reshape(3, 3).copy()
    elif values.named(_FOCAL) is not None:
        matrix = np.diag((*values.array(_FOCAL, (2,)), 1.0))
        matrix[:2, 2] = values.array(_CENTRE, (2,))
        matrix[0, 1] = values.array(_SKEW, (1,))[0] if values.named(_SKEW) is not None else 0.0
    else:
        matrix = values.array(_OLD_MATRIX, (9,)).reshape(3, 3).T.copy()
    matrix[:2, 2] -= 1.0
    height, width = values.array(_SIZE, (2,))
    pose = set(map(folded, (*ROTATION, *TRANSLATION)))
    return evolve(
        values,
        content={
            **{name: value for name, value in values.content.items() if folded(name) in pose},
            "camera_matrix": matrix,
            "distortion_model": "brown",
            "distortion_coefficients": (*radial[:2], *tangential, *radial[2:]),
            "image_width": width,
            "image_height": height,
        },
    )


def matlab_motion(values: CalibrationValues, *, rows: bool) -> tuple[FloatArray, FloatArray] | None:
    """Rotation (3, 3) and translation (3,) from camera 1 to camera 2; None where it has none.

    `rows` is true for stereoParameters, whose rotation multiplies rows, and false for what
    stereoParametersToOpenCV returns.
    """
    pose = values.named(("PoseCamera2",))
    if isinstance(pose, Mapping):
        pose = evolve(values, content=pose)
        return pose.array(("R",), (9,)).reshape(3, 3), pose.array(("Translation",), (3,))
    if pose is not None:
        matrix = values.array(("PoseCamera2",), (16,)).reshape(4, 4)
        return matrix[:3, :3], matrix[:3, 3]
    if values.named(_ROTATION) is None:
        return None
    rotation = values.array(_ROTATION, (9,)).reshape(3, 3)
    return rotation.T if rows else rotation, values.array(_TRANSLATION, (3,))
