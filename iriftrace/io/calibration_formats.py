"""Formats of camera calibrations: one table of names for each, and values found by it.

A file is of a format if its cameras have the values that mark it. Case and punctuation in names do
not count. Whatever is of none of these formats is refused with what to write instead.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from attrs import evolve, field, frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.units import LENGTH_UNITS
from iriftrace.io.calibration_text import calibration_text, named_values
from iriftrace.io.refusals import not_read


@frozen(kw_only=True)
class Format:
    """Names and conventions of a program's calibrations.

    Attributes
    ----------
    name : str
    marks : tuple of str
        Values that every camera of this format has; together, no camera of the formats below.
    fields : dict
        Names of each value.
    cameras : tuple of str
        Of two cameras in a file, and of a third, which is one too many: the names of their
        mappings, or else ends of the names of their values.
    transpose : tuple of str
        Names of matrices that multiply rows.
    pixel_origin : float, px
        Coordinates of the first pixel's centre; OpenCV's are 0.
    length_unit : str
        Unit of translations in a file that states none.
    """

    name: str
    marks: tuple[str, ...]
    fields: Mapping[str, tuple[str, ...]] = field(repr=False)
    cameras: tuple[str, ...] = ()
    transpose: tuple[str, ...] = ()
    pixel_origin: float = 0.0
    length_unit: str = "mm"


# Parameters of cameraParameters and stereoParameters as jsonencode(toStruct(params)) writes them,
# before and since R2022b, and those of cameraIntrinsics.
MATLAB = Format(
    name="MATLAB",
    marks=("radial",),
    fields={
        "matrix": ("K", "IntrinsicMatrix"),
        "focal": ("FocalLength",),
        "centre": ("PrincipalPoint",),
        "skew": ("Skew",),
        "radial": ("RadialDistortion",),
        "tangential": ("TangentialDistortion",),
        "rows_and_columns": ("ImageSize",),
        "motion": ("PoseCamera2",),
        "rotation": ("RotationOfCamera2", "R"),
        "translation": ("TranslationOfCamera2", "Translation"),
        "length_unit": ("WorldUnits",),
    },
    cameras=("CameraParameters1", "CameraParameters2", "CameraParameters3"),
    transpose=("IntrinsicMatrix", "RotationOfCamera2"),
    pixel_origin=1.0,
)
# Chains of cameras.
KALIBR = Format(
    name="Kalibr",
    marks=("camera_model", "pinhole"),
    fields={
        "camera_model": ("camera_model",),
        "pinhole": ("intrinsics",),
        "distortion": ("distortion_coeffs",),
        "model": ("distortion_model",),
        "size": ("resolution",),
        "motion": ("T_cn_cnm1",),
    },
    cameras=("cam0", "cam1", "cam2"),
    length_unit="m",
)
# Files of camera_calibration, and the message CameraInfo of ROS 1 and 2.
ROS = Format(
    name="ROS",
    marks=("matrix", "rectification", "projection"),
    fields={
        "matrix": ("camera_matrix", "K"),
        "distortion": ("distortion_coefficients", "D"),
        "model": ("distortion_model",),
        "width": ("image_width", "width"),
        "height": ("image_height", "height"),
        "rectification": ("rectification_matrix", "R"),
        "projection": ("projection_matrix", "P"),
    },
    length_unit="m",
)
# Names of its samples calibration and stereo_calib, and of the arguments of calibrateCamera and
# stereoCalibrate.
OPENCV = Format(
    name="OpenCV",
    marks=("matrix",),
    fields={
        "matrix": ("camera_matrix", "M"),
        "distortion": ("distortion_coefficients", "dist_coeffs", "D"),
        "model": ("distortion_model",),
        "fisheye": ("fisheye_model",),
        "xi": ("xi",),
        "width": ("image_width",),
        "height": ("image_height",),
        "size": ("image_size",),
        "rotation": ("rvec", "R"),
        "translation": ("tvec", "T"),
        "views": ("extrinsic_parameters",),
        "rectification": ("R",),
        "projection": ("P",),
        "length_unit": ("length_unit", "unit", "units"),
    },
    cameras=("1", "2", "3"),
)
FORMATS = (MATLAB, KALIBR, ROS, OPENCV)

INSTEAD = (
    "write OpenCV's YAML: camera_matrix and, for a pose, R (both row by row), T and length_unit; "
    "distortion_coefficients [k1, k2, p1, p2, k3], image_width and image_height"
)
_OTHERS = {
    r"(?i)\bppx\b": "a RealSense camera (rotations column by column, translations in m)",
    r"^\d+\s+[A-Z][A-Z_]+\s+[-+.\deE\s]+$|^#.*QW, QX, QY, QZ": "COLMAP",
    r"\bCameraIntrinsics\b": "a Zivid camera",
    r"^\[(?:LEFT|RIGHT)_CAM_": "a ZED camera",
    r"\bFocus:\s*foc\b": "HALCON",
    r"^\s*fc(?:_left)?\s*=\s*\[": "Bouguet's toolbox",
    r"<projection>|<chunk\b": "Agisoft Metashape, which also exports OpenCV's format",
}
"""Programs whose files are often given, by what their text has."""


def folded(name: str) -> str:
    """A name without case and punctuation: camera_matrix and cameraMatrix are the same."""
    return "".join(letter for letter in name.casefold() if letter.isalnum())


@frozen(eq=False)
class Values:
    """Values of one camera, or of what is between two, by the fields of their format."""

    path: Path
    format: Format
    content: Mapping[str, object]
    camera: str = ""  # which of two, for messages

    @property
    def called(self) -> str:
        """File and camera, for messages."""
        return f"{self.path}, {self.camera}" if self.camera else str(self.path)

    @property
    def length_unit(self) -> str:
        """Unit of lengths that the file states, or else the format's, as `length_factor` takes."""
        unit = str(self.value("length_unit") or self.format.length_unit).casefold()
        if unit not in LENGTH_UNITS:
            raise InputError(
                f"The calibration {self.called}: its unit {unit!r} is not known here; give the "
                "unit of translations.",
                code="units.unknown",
                argument="calibration_length_unit",
            )
        return LENGTH_UNITS[unit]

    def names(self, field: str) -> list[str]:
        """Names under which the file has a value, as it writes them."""
        known = set(map(folded, self.format.fields.get(field, ())))
        there = (name for name, value in self.content.items() if value is not None)
        return [name for name in there if folded(name) in known]

    def has(self, *fields: str) -> bool:
        """True if the file has the values."""
        return all(map(self.names, fields))

    def value(self, field: str) -> object:
        """The value as the file has it; None without it; InputError if it has two names."""
        names = self.names(field)
        if len(names) > 1:
            raise InputError(
                f"The calibration {self.called}: {' and '.join(names)} are names of one value; "
                "leave out the one that is not meant.",
                code="calibration.twice",
            )
        return self.content[names[0]] if names else None

    def array(self, field: str, *counts: int) -> FloatArray:
        """Numbers, flat and row by row; how many there may be (any when empty)."""
        value = self.value(field)
        name, *_ = self.names(field) or self.format.fields[field]
        if value is None:
            raise InputError(
                f"The calibration {self.called}: {name} is missing, without which there are no "
                "rays; add it.",
                code="calibration.missing_value",
            )
        try:
            numbers = np.asarray(
                value.get("data") if isinstance(value, Mapping) else value, dtype=np.float64
            ).ravel()
        except (TypeError, ValueError, OverflowError):
            numbers = np.array((np.nan,))
        if not np.isfinite(numbers).all():
            raise InputError(
                f"The calibration {self.called}: {name} has entries that are not finite numbers; "
                "write it again.",
                code="calibration.not_finite",
            )
        if counts and len(numbers) not in counts:
            allowed = " or ".join(map(str, counts))
            raise InputError(
                f"The calibration {self.called}: {name} has {len(numbers)} numbers instead of "
                f"{allowed}.",
                code="calibration.count",
            )
        if len(numbers) == 9 and folded(name) in map(folded, self.format.transpose):
            return numbers.reshape(3, 3).T.ravel()
        return numbers


def content_of(path: Path) -> Mapping[str, object]:
    """Named values of a file that is not of a program which is known not to be read."""
    text = calibration_text(path)
    for pattern, program in _OTHERS.items():
        if re.search(pattern, text, re.MULTILINE):
            raise not_read(path, f"the format of {program}", INSTEAD)
    return named_values(path, text)


def single_camera(path: Path, content: object) -> Values | None:
    """Values of a mapping that has the marks of a camera in one of the formats."""
    cameras = (_camera(path, one, content) for one in FORMATS)
    return next(filter(None, cameras), None)


def numbered_cameras(path: Path, content: Mapping[str, object]) -> list[Values]:
    """Values of each of several cameras in a file; InputError for more than two."""
    for one in FORMATS:
        parts = (
            _with_end(one, content, name) if one is OPENCV else content.get(name)
            for name in one.cameras
        )
        found = [camera for part in parts if (camera := _camera(path, one, part))]
        if len(found) > 2:
            raise InputError(
                f"The calibration {path}: it has more than two cameras; write a file with the two "
                "that measured.",
                code="calibration.three_cameras",
            )
        if found:
            return [
                evolve(camera, camera=f"camera {number}")
                for number, camera in enumerate(found, start=1)
            ]
    return []


def _camera(path: Path, one: Format, content: object) -> Values | None:
    """Values of a mapping, if it has the marks of a camera in this format."""
    if not isinstance(content, Mapping):
        return None
    values = Values(path, one, {str(name): value for name, value in content.items()})
    return values if values.has(*one.marks) else None


def _with_end(one: Format, content: Mapping[str, object], end: str) -> dict[str, object]:
    """Values whose names have an end, without it, and those that both cameras have in common."""
    shared = ("model", "fisheye", "xi", "width", "height", "size")
    common = {folded(name) for field in shared for name in one.fields[field]}
    known = {folded(name) for names in one.fields.values() for name in names}
    values = {name: value for name, value in content.items() if folded(name) in common}
    own = ((name.removesuffix(end), name) for name in content if name.endswith(end))
    return values | {base: content[name] for base, name in own if folded(base) in known}


def listed(content: Mapping[str, object]) -> str:
    """Names in a file, for messages."""
    return ", ".join(list(content)[:12]) or "none"
