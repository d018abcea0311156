"""Names under which programs write the values of a camera's calibration."""

from __future__ import annotations

import re
from collections.abc import Mapping

from attrs import evolve

from iriftrace.camera.calibration_file import CalibrationValues, folded
from iriftrace.core.files import is_number

# Case and punctuation do not count: camera_matrix is cameraMatrix and Camera_Matrix.
MATRIX = ("camera_matrix", "K", "M", "intrinsic_matrix", "camera_intrinsics", "mtx", "KK")
PINHOLE = ("intrinsics",)
"""Focal lengths and principal point in Kalibr, four numbers; a matrix in other files."""

DISTORTION = (
    "distortion_coefficients",
    "distortion_coeffs",
    "dist_coeffs",
    "dist_coeff",
    "dist_coefs",
    "dist_coef",
    "distortion_coefficient",
    "distortion",
    "dist",
    "kc",
    "D",
)
WIDTH = ("image_width", "width")
HEIGHT = ("image_height", "height")
SIZE = ("image_size", "img_size", "resolution", "size")
"""Width and height together."""

ROTATION = ("rvec", "rotation_vector", "R", "rotation", "rotation_matrix", "Rot", "om")
TRANSLATION = ("tvec", "translation_vector", "T", "t", "translation", "Trans")
PROJECTION = ("P", "projection_matrix")
LENS = ("distortion_model", "camera_model")
FISHEYE = ("fisheye_model", "fisheye")
_PINHOLE_SCALARS = ("fx", "fy", "cx", "cy")
_LENS_SCALARS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
_PART_OF_A_DISTORTION = re.compile("dist|coef|radial|tangential|kappa|^[kp][1-6]$")
OTHER_CAMERAS = ("skew", "alpha_c", "shear", "xi")
"""Skew under its names, and the parameter of OpenCV's omnidirectional cameras."""

_UNMODELLED = ("skew", "b1", "b2", "s1", "s2", "s3", "s4", "tau_x", "tau_y", "p3", "p4", "t1", "t2")
"""Numbers of lenses next to these, in OpenCV and Metashape."""


def without_scalars(values: CalibrationValues) -> CalibrationValues:
    """Values with `intrinsics` and coefficients in place of fx, fy, cx, cy and k1, k2, p1 ...

    The former may stand in a mapping under the name of the matrix, and this in one for all
    intrinsics, as Zivid writes them.
    """
    for _ in range(2):
        name = values.spelling((*MATRIX, *PINHOLE))
        inner = None if name is None else values.content[name]
        known = (*MATRIX, _PINHOLE_SCALARS[0])
        if isinstance(inner, Mapping) and evolve(values, content=inner).spelling(known):
            rest = {key: value for key, value in values.content.items() if key != name}
            values = evolve(values, content={**inner, **rest})
    content = dict(values.content)
    pinhole = [values.named((name,)) for name in _PINHOLE_SCALARS]
    scalars = all(isinstance(value, int | float) for value in pinhole)
    if scalars:
        content[PINHOLE[0]] = pinhole
    named = values.named(DISTORTION)
    source = values
    if isinstance(named, Mapping) and "data" not in named:
        source = evolve(values, content=named)
        said = {name: value for name, value in named.items() if isinstance(value, str)}
        content |= {f"distortion {name}": value for name, value in said.items()}
    lens = {name: source.named((name,)) for name in _LENS_SCALARS}
    # k1 to k4 without p1 are those of a fisheye lens.
    brown = isinstance(lens["k1"], int | float) and (lens["k4"] is None or lens["p1"] is not None)
    several = scalars or isinstance(lens["k2"], int | float)
    if brown and (source is not values or (named is None and several)):
        content[DISTORTION[0]] = [0.0 if value is None else value for value in lens.values()]
        unknown = [
            str(name)
            for name, value in source.content.items()
            if is_number(value) and re.search("radial|tangential", folded(str(name)))
        ]
        if unknown:
            raise values.wrong(
                f"next to k1 it has {', '.join(unknown)}, which is not known here; name the "
                "coefficients k1, k2, p1, p2, k3"
            )
        # Those of OpenCV's rational model come together; k4 alone is that of another polynomial.
        alone = ("k4",) if lens["k5"] is None else ()
        for name in (*_UNMODELLED, *alone):
            if is_number(source.named((name,))) and source.named((name,)) != 0:
                raise values.wrong(
                    f"it has {name} = {source.named((name,))}, which is not modelled; calibrate "
                    "with k1 to k3, p1 and p2 only"
                )
    return evolve(values, content=content)


def is_part_of_a_distortion(name: str) -> bool:
    """True for a name that could be that of distortion coefficients in an unknown format."""
    return folded(name) not in map(folded, LENS) and bool(
        _PART_OF_A_DISTORTION.search(folded(name))
    )


def refuse_different(values: CalibrationValues) -> None:
    """Refuse what the file has twice, with different numbers, in two spellings of a name."""
    spellings = ((str(name),) for name in values.content)
    for names in (MATRIX, DISTORTION, ROTATION, TRANSLATION, *spellings):
        values.refuse_different(names)
