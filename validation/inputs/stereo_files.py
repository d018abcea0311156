"""Calibrations of one stereo sensor, in the formats of common programs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

SIZE = (1280, 1024)
MATRICES = (
    np.array(((3653.8, 0.0, 650.5), (0.0, 3657.25, 498.0), (0.0, 0.0, 1.0))),
    np.array(((3601.2, 0.0, 631.0), (0.0, 3604.75, 520.5), (0.0, 0.0, 1.0))),
)
COEFFICIENTS = (
    np.array((-0.25, 0.1, 1e-3, -2e-3, -0.02)),
    np.array((-0.22, 0.15, -5e-4, 1e-3, 0.01)),
)
FOUR = tuple(np.append(values[:4], 0.0) for values in COEFFICIENTS)
"""Those of a lens model with four."""

ROTATION = cv2.Rodrigues(np.array((0.01, 0.35, -0.02)))[0]
TRANSLATION = np.array((-229.3, 3.1, 38.7))
"""Translation from camera 1 to camera 2, mm."""

NAMES = {
    "arguments": ("cameraMatrix{}", "distCoeffs{}"),
    "sample": ("M{}", "D{}"),
}
"""Names of matrix and distortion of one camera by its number."""


def opencv(path: Path, names: str = "sample", **changes: Any) -> Path:
    """Written by cv2.FileStorage: YAML, XML or JSON by the ending."""
    matrix, distortion = NAMES[names]
    values: dict[str, Any] = {"image_width": SIZE[0], "image_height": SIZE[1]}
    for number, (one, coefficients) in enumerate(zip(MATRICES, COEFFICIENTS, strict=True), 1):
        values |= {matrix.format(number): one, distortion.format(number): coefficients[None]}
    values |= {"R": ROTATION, "T": TRANSLATION[:, None], **changes}
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in values.items():
        if value is not None:
            storage.write(name, value)
    storage.release()
    return path


def kalibr(path: Path, **of_each: Any) -> Path:
    """Kalibr's camchain, in metres, with its four coefficients."""
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = ROTATION, 1e-3 * TRANSLATION
    chain = {}
    for number, (matrix, coefficients) in enumerate(zip(MATRICES, FOUR, strict=True)):
        chain[f"cam{number}"] = {
            "cam_overlaps": [1 - number],
            "camera_model": "pinhole",
            "distortion_coeffs": coefficients[:4].tolist(),
            "distortion_model": "radtan",
            "intrinsics": matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(),
            "resolution": list(SIZE),
            "rostopic": f"/cam{number}/image_raw",
            **of_each,
        }
    chain["cam1"]["T_cn_cnm1"] = motion.tolist()
    path.write_text(yaml.safe_dump(chain), encoding="utf-8")
    return path


def ros(folder: Path, *, message: bool = False) -> tuple[Path, Path]:
    """Files of ROS's camera_calibration, or its CameraInfo messages, of a rectified pair in m."""
    turns_and_projections = cv2.stereoRectify(
        MATRICES[0],
        COEFFICIENTS[0],
        MATRICES[1],
        COEFFICIENTS[1],
        SIZE,
        ROTATION,
        1e-3 * TRANSLATION[:, None],
    )
    paths = []
    for number, side in enumerate(("left", "right")):
        arrays = {
            "camera_matrix": MATRICES[number],
            "distortion_coefficients": COEFFICIENTS[number][None],
            "rectification_matrix": turns_and_projections[number],
            "projection_matrix": turns_and_projections[2 + number],
        }
        values: dict[str, Any] = {"distortion_model": "plumb_bob"}
        if message:
            values |= {"width": SIZE[0], "height": SIZE[1]}
            values |= {
                name: array.ravel().tolist()
                for name, array in zip("kdrp", arrays.values(), strict=True)
            }
        else:
            values |= {"image_width": SIZE[0], "image_height": SIZE[1]}
            values |= {"camera_name": f"narrow_stereo/{side}"}
            values |= {
                name: {
                    "rows": array.shape[0],
                    "cols": array.shape[1],
                    "data": array.ravel().tolist(),
                }
                for name, array in arrays.items()
            }
        paths.append(folder / f"{side}.yaml")
        paths[-1].write_text(yaml.safe_dump(values, sort_keys=False))
    return paths[0], paths[1]


def matlab(path: Path, *, old: bool) -> Path:
    """jsonencode(toStruct(stereoParams)) of MATLAB, before or since R2022b."""
    values: dict[str, Any] = {}
    for number, (matrix, coefficients) in enumerate(zip(MATRICES, COEFFICIENTS, strict=True)):
        counted_from_1 = matrix + np.outer((1.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        k1, k2, p1, p2, k3 = coefficients.tolist()
        values[f"CameraParameters{number + 1}"] = {
            "RadialDistortion": [k1, k2, k3],
            "TangentialDistortion": [p1, p2],
            "ImageSize": [SIZE[1], SIZE[0]],
            "WorldUnits": "centimeters",
            **(
                {"IntrinsicMatrix": counted_from_1.T.tolist()}
                if old
                else {"K": counted_from_1.tolist()}
            ),
        }
    shift = (0.1 * TRANSLATION).tolist()
    if old:
        values |= {"RotationOfCamera2": ROTATION.T.tolist(), "TranslationOfCamera2": shift}
    else:
        values["PoseCamera2"] = {
            "Dimensionality": 3,
            "R": ROTATION.tolist(),
            "Translation": shift,
        }
    path.write_text(json.dumps(values), encoding="utf-8")
    return path
