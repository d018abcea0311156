"""Camera calibrations in the formats of OpenCV and other programs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np

MATRIX = np.array(((3653.8, 0.0, 1209.5), (0.0, 3657.25, 1030.0), (0.0, 0.0, 1.0)))
COEFFICIENTS = np.array((-0.25, 0.1, 1e-3, -2e-3, -0.02))
RVEC, TVEC = np.array((0.4, -0.2, 2.9)), np.array((10.0, -20.0, 300.0))
PLAIN: dict[str, Any] = {
    "camera_matrix": MATRIX.tolist(),
    "distortion_coefficients": COEFFICIENTS.tolist(),
    "image_width": 2448,
    "image_height": 2048,
}


def written_by_opencv(path: Path, **more: np.ndarray) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Thu Jan  1 12:00:00 2026")
    storage.write("image_width", 2448)
    storage.write("image_height", 2048)
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", COEFFICIENTS[:, None])
    for name, value in more.items():
        storage.write(name, value)
    storage.release()
    return path


def plain(path: Path, **changes: Any) -> Path:
    values = {key: value for key, value in {**PLAIN, **changes}.items() if value is not None}
    path.write_text(json.dumps(values), encoding="utf-8")
    return path
