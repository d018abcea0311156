"""Plugin properties, read with their types and ranges checked: single values, and cameras.

Mitsuba's loader accepts a ``<string>`` where a number belongs, so every plugin reads through here.
"""

from __future__ import annotations

import math
from pathlib import Path

import mitsuba as mi
import numpy as np

from iriftrace.camera.calibration import Calibration
from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import ORDER, Distortion
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.units import length_factor
from iriftrace.io.calibration import read_calibration
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.projection import flip_axes


def number(props: mi.Properties, name: str, default: float | None = None) -> float:
    """Read a finite number from plugin properties in double precision."""
    if name not in props:
        if default is None:
            raise InputError(
                f'"{name}" is missing; give it as <float name="{name}" value="..."/>.',
                code="scene.no_property",
            )
        return float(default)
    value = props[name]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(
            f'"{name}" is {value!r}, not a number; write <float name="{name}" value="..."/>.',
            code="scene.wrong_property",
        )
    if not math.isfinite(value):
        raise InputError(f'"{name}" is {value}; give a finite number.', code="scene.wrong_property")
    return float(value)


def whole_number(props: mi.Properties, name: str, default: int) -> int:
    """Read a whole number of at least one, small enough for 32 bits."""
    value = number(props, name, default)
    if not (value.is_integer() and 1 <= value < 2**32):
        raise InputError(
            f'"{name}" is {value:g}; write <integer name="{name}" value="..."/> with a whole '
            "number of at least 1.",
            code="scene.wrong_property",
        )
    return int(value)


MOST_REVERSE_PASSES = 65_536
"""Entries of an array that Dr.Jit keeps for each ray."""


def passes(props: mi.Properties, name: str, default: int) -> int:
    """Read the passes of a tracing loop that derivatives in reverse mode go back through."""
    value = whole_number(props, name, default)
    if value > MOST_REVERSE_PASSES:
        raise InputError(
            f'"{name}" is {value:,}, but Dr.Jit stores at most {MOST_REVERSE_PASSES:,} states of a '
            "ray; give fewer, as a ray through a fine mesh takes some thousand.",
            code="scene.wrong_property",
        )
    return value


def flag(props: mi.Properties, name: str, default: bool) -> bool:
    """Read a boolean from plugin properties."""
    value = props.get(name, default)
    if not isinstance(value, bool):
        raise InputError(
            f'"{name}" is {value!r}, not a truth value; '
            f'write <boolean name="{name}" value="true"/> or "false".',
            code="scene.wrong_property",
        )
    return value


def word(props: mi.Properties, name: str, default: str) -> str:
    """Read a text from plugin properties."""
    value = props.get(name, default)
    if not isinstance(value, str):
        raise InputError(
            f'"{name}" is {value!r}; write <string name="{name}" value="{default}"/>.',
            code="scene.wrong_property",
        )
    return value


def file_beside(props: mi.Properties, name: str, default: str) -> Path:
    """Read a file's name from plugin properties; it is in the folder of the scene's file."""
    # Mitsuba's resolver knows the folder of the scene's file while that is read.
    resolver = mi.file_resolver()  # type: ignore[operator]  # a function that the stubs do not know
    return Path(str(resolver.resolve(word(props, name, default)))).absolute()


def choice(props: mi.Properties, name: str, allowed: tuple[str, ...]) -> str:
    """Read one of several words from plugin properties; the first is the default."""
    value = props.get(name, allowed[0])
    if value not in allowed:
        raise InputError(
            f'"{name}" is {value!r}; write <string name="{name}" value="..."/> with one of '
            f"{', '.join(allowed)}.",
            code="scene.wrong_property",
        )
    return str(value)


_UNPLACED = flip_axes(np.eye(4))
"""Mitsuba's pose of what has no ``to_world``."""

_SAID_BY_A_CALIBRATION = (
    *("focal_length", "sensor_width", "sensor_height", "principal_point_x", "principal_point_y"),
    *ORDER,
)


def camera_of(props: mi.Properties, resolution: tuple[int, int]) -> Camera:
    """The camera that plugin properties describe, at its full resolution, that of the film.

    InputError if a property is missing or wrong, or the calibration cannot be read, is of another
    resolution than the film, or says what a property says too.
    """
    focus = (
        number(props, "focus_near", 0.0),
        number(props, "focus_far") if "focus_far" in props else math.inf,
    )
    if "calibration" in props:
        return _calibrated(props, resolution, focus)
    for name in ("pixel_size", "length_unit"):
        if name in props:
            raise InputError(
                f'"{name}" belongs to a calibration, and there is none; add <string '
                'name="calibration" value="camera.yaml"/> or leave it out.',
                code="calibration.not_given",
            )
    pose = _pose(props)
    return Camera(
        focal_length_mm=number(props, "focal_length"),
        sensor_mm=(number(props, "sensor_width"), number(props, "sensor_height")),
        resolution=resolution,
        principal_point_px=(
            number(props, "principal_point_x", resolution[0] / 2) - 0.5,
            number(props, "principal_point_y", resolution[1] / 2) - 0.5,
        ),
        focus_mm=focus,
        matrix=_UNPLACED if pose is None else pose,
        distortion=Distortion(**{name: number(props, name, 0.0) for name in ORDER}),
    )


def _pose(props: dt.Properties) -> FloatArray | None:
    """Camera to world, (4, 4) array, mm, where the properties have one."""
    return flip_axes(props["to_world"].matrix) if "to_world" in props else None


def _calibrated(
    props: mi.Properties, resolution: tuple[int, int], focus: tuple[float, float]
) -> Camera:
    for name in _SAID_BY_A_CALIBRATION:
        if name in props:
            raise InputError(
                f'"calibration" says "{name}" too; leave one of them out.',
                code="calibration.two_values",
            )
    path = file_beside(props, "calibration", "camera.yaml")
    if path.is_dir():
        raise InputError(
            f'"calibration" names the folder {path}; name the file that OpenCV wrote, such as '
            "camera.yaml.",
            code="calibration.folder",
        )
    unit = length_factor(word(props, "length_unit", "mm"))
    calibration = read_calibration(path, length_mm=unit)
    if calibration.resolution != resolution:
        width, height = calibration.resolution
        raise InputError(
            f"The calibration {path} is of pictures of {width} x {height} pixels, but the film has "
            f'{resolution[0]} x {resolution[1]}; write <integer name="width" value="{width}"/> and '
            f'<integer name="height" value="{height}"/> into the film, and "scale" for fewer.',
            code="calibration.other_resolution",
        )
    if "pixel_size" not in props:
        raise InputError(
            f'{path} knows lengths in pixels only; write <float name="pixel_size" value="0.00274"/>'
            ", the width of a pixel in mm (no ray depends on it, only the focal length and the "
            "sensor's size that results state).",
            code="calibration.no_pixel_size",
        )
    return calibration.camera(
        pixel_size_mm=number(props, "pixel_size"),
        focus_mm=focus,
        matrix=_calibrated_pose(props, calibration, path),
    )


def _calibrated_pose(props: mi.Properties, calibration: Calibration, path: Path) -> FloatArray:
    """Camera to world, (4, 4) array, mm: that of the scene, or else that of the calibration."""
    own = _pose(props)
    if "length_unit" in props and (own is not None or calibration.matrix is None):
        raise InputError(
            f'"length_unit" is that of the pose in {path}, which is not used; leave it out.',
            code="calibration.unused_unit",
        )
    pose = calibration.matrix if own is None else own
    if pose is None:
        views = calibration.views
        has = f"{views} views of a calibration board, which are none" if views else "none"
        raise InputError(
            f'The camera needs a pose, and {path} has {has}; add <transform name="to_world"> with '
            "<lookat> to the sensor.",
            code="calibration.no_pose",
        )
    return pose
