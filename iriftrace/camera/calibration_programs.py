"""Calibrations of programs whose files are not those of OpenCV: read, or named in the refusal."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from iriftrace.core.errors import InputError

_COLMAP = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
}
"""Parameters of COLMAP's camera models, whose first pixel has its centre at (0.5, 0.5)."""

_COLMAPS_LINE = re.compile(
    r"^\d+\s+(?P<model>[A-Z][A-Z_]+)\s+(?P<rest>[-+.\deE\s]+)$", re.MULTILINE
)

_IN_OPENCVS = (
    "write camera_matrix, distortion_coefficients [k1, k2, p1, p2, k3], image_width and "
    "image_height into a YAML file"
)
_METASHAPE = "save the camera calibration there in the format of OpenCV"
_OTHERS = (
    (r"<projection>|<chunk\b", "Agisoft Metashape", _METASHAPE),
    (r'"ptr_wrapper"', "calib.io's Calibrator", _IN_OPENCVS),
    (
        r"^#.*QW, QX, QY, QZ",
        "COLMAP and lists images, whose poses have no scale",
        "give its cameras.txt, and place the camera with --origin and --target",
    ),
    (r"^\[(?:LEFT|RIGHT)_CAM_", "a ZED camera", _IN_OPENCVS),
    (r"\bFocus:\s*foc\b", "HALCON", _IN_OPENCVS),
    (r"^\s*fc(?:_left)?\s*=\s*\[", "Bouguet's toolbox", _IN_OPENCVS),
    (
        r"(?is)\A(?=.*\bppx\b).*\brotation\b",
        "a RealSense camera with extrinsics, whose rotation is column by column (transposed) and "
        "whose translation is in metres",
        "write width, height, ppx, ppy, fx, fy, model and coeffs alone, and the pose from the "
        "part's frame to the camera's as R (row by row), T and length_unit: m",
    ),
)


def refuse_other_programs(path: Path, text: str) -> None:
    """An InputError that names the program of a file that is not read."""
    for pattern, program, advice in _OTHERS:
        if re.search(pattern, text, re.MULTILINE):
            raise InputError(f"{path} is of {program}, and is not read; {advice}.")


def colmap_values(path: Path, text: str) -> dict[str, object] | None:
    """Named values of COLMAP's cameras.txt; None for another file, InputError for two cameras."""
    found = list(_COLMAPS_LINE.finditer(text))
    if not found:
        return None
    if len(found) > 1:
        raise InputError(
            f"{path} lists {len(found)} cameras of COLMAP; write a file with the line of the one "
            "that measured."
        )
    model, rest = found[0]["model"], found[0]["rest"].split()
    names = ["width", "height", *_COLMAP.get(model, "").split()]
    if model in _COLMAP and len(rest) != len(names):
        raise InputError(
            f"{path} has {len(rest)} numbers for the camera model {model} instead of "
            f"{len(names)} ({', '.join(names)}); export it again."
        )
    values = dict(zip(names, map(float, rest), strict=False))
    # Another model is refused by its name.
    lens = "opencv" if "k1" in values else "none" if model in _COLMAP else model
    focal = values.pop("f", None)
    if focal is not None:
        values |= {"fx": focal, "fy": focal}
    centre: dict[str, float] = {name: values[name] - 0.5 for name in ("cx", "cy") if name in values}
    return {**values, **centre, "distortion_model": lens}


def realsense_values(content: Mapping[str, object]) -> Mapping[str, object]:
    """Values of librealsense's intrinsics under OpenCV's names; other ones as they are."""
    if not {"ppx", "ppy", "coeffs"} <= content.keys():
        return content
    model = str(content.get("model", "")).lower().removeprefix("distortion.").replace(" ", "_")
    return {
        **content,
        "cx": content["ppx"],
        "cy": content["ppy"],
        "distortion_coefficients": content["coeffs"],
        "distortion_model": model or "none",
    }
