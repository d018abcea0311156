"""Points that two devices triangulate through hot air, against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.scenes.analytic import concentric_cylinders, slab
from iriftrace.scenes.closed_forms import RADIUS_MM
from iriftrace.scenes.qualification import (
    CYLINDER_ANGLES,
    CYLINDER_TARGET,
    PLATE_ANGLES,
    PLATE_TARGET,
    above_plate,
    beside_cylinder,
    cylinder_pairs,
    plate_pairs,
)
from iriftrace.tracing.scene import Scene
from validation.inputs.cameras import camera_at
from validation.inputs.hot_air import (
    cylinder_grid,
    cylinder_medium,
    cylinder_values,
    formula_scene,
    slab_grid,
    slab_medium,
    slab_values,
)
from validation.inputs.parts import cylinder_fine_at
from validation.inputs.scene_rays import loaded
from validation.inputs.shell_fields import field_of
from validation.line import Line, Section, relative
from validation.oracles.exact_layers import RoundAir

FloatArray = NDArray[np.float64]

AIRS: dict[str, int | None] = {"13 shells": 13, "100 shells": 100, "cells engine": None}
"""Number of shells; None for the formula."""

BOUNDS = {"13 shells": 1.0, "100 shells": 0.1, "cells engine": 0.1}
"""Per cent."""

LEFT_NM = 10.0
"""Largest residual of a correction, nm."""


def device(origin: FloatArray, target: FloatArray, width: int = 5) -> Camera:
    """A camera or projector that sees 1 mm around its target."""
    distance = float(np.linalg.norm(np.subtract(origin, target)))
    return camera_at(
        origin,
        target,
        up=(1.0, 0.2, 0.3),
        focal_length_mm=distance,
        sensor_mm=(1.0, 1.0),
        resolution=(width, width),
    )


def above(angle_deg: float) -> Camera:
    """A device over the plate, at an angle to its normal in the x-z plane."""
    return device(above_plate(angle_deg), PLATE_TARGET)


def aside(angle_deg: float) -> Camera:
    """A device far from the cylinder, at an angle to the normal at (0.1, -R, 0)."""
    return device(beside_cylinder(angle_deg), CYLINDER_TARGET, width=1)


def plate_scene(folder: Path, air: str) -> Scene:
    """The plate under layers of hot air, by shells or by the formula; see `AIRS`."""
    part, shells = slab(AIRS[air] or 13, air=RoundAir(), size_mm=400.0)
    if AIRS[air] is not None:
        return loaded(folder, part, shells)
    field = field_of(slab_grid(), slab_values)
    return formula_scene(folder, part, shells, field, slab_medium())


def cylinder_scene(folder: Path, air: str) -> Scene:
    """The hot cylinder, fine where it is looked at, by shells or by the formula."""
    _, shells = concentric_cylinders(
        AIRS[air] or 13, air=RoundAir(), sections=4000, part_sections=12, length_mm=60.0
    )
    part = cylinder_fine_at(180.0 + 0.005, RADIUS_MM, 60.0)
    if AIRS[air] is not None:
        return loaded(folder, part, shells)
    field = field_of(cylinder_grid(20, 40), cylinder_values)
    return formula_scene(folder, part, shells, field, cylinder_medium())


def _lines(folder: Path) -> list[Line]:
    lines = []
    for air, bound in BOUNDS.items():
        plate = plate_scene(folder / f"plate {air}", air)
        left = []
        for angles, truth in zip(PLATE_ANGLES, 1e3 * plate_pairs().truth, strict=True):
            devices = [above(angle) for angle in angles]
            scan = measure(plate, *devices, system="stereo")
            middle = len(scan.points) // 2
            lateral, depth = float(truth[0]), -float(truth[2])
            case = f"plate, {air}, {angles[0]}° and {angles[1]}°"
            lines.append(
                relative(f"{case}: depth", depth, -1e3 * scan.error_normal[middle], "µm", bound)
            )
            if abs(lateral) > 0.1:
                found = 1e3 * scan.error[middle, 0]
                lines.append(relative(f"{case}: lateral", lateral, found, "µm", bound))
            back = correct(scan.points, plate, *devices, system="stereo")
            left.append(np.linalg.norm(back.points - scan.true, axis=1).max())
        worst = 1e6 * float(max(left))
        case = f"plate, {air}: left of the error by the correction, largest"
        lines.append(Line(case, "0", f"{worst:.2g} nm", worst, LEFT_NM, "nm"))
        cylinder = cylinder_scene(folder / f"cylinder {air}", air)
        for angles, truth in zip(CYLINDER_ANGLES, 1e3 * cylinder_pairs().truth, strict=True):
            scan = measure(cylinder, *(aside(angle) for angle in angles), system="stereo")
            normal, tangential = -float(truth[1]), float(truth[2])
            case = f"hot cylinder, {air}, {angles[0]}° and {angles[1]}°"
            lines.append(
                relative(f"{case}: normal", normal, 1e3 * scan.error_normal[0], "µm", bound)
            )
            if tangential:
                around = 1e3 * float(scan.error[0] @ np.cross(scan.normal[0], (1.0, 0.0, 0.0)))
                off = 100 * (around - tangential) / abs(normal)
                case = f"{case}: tangential (error in per cent of the normal one)"
                expected, obtained = (f"{value:.7g} µm" for value in (tangential, around))
                lines.append(Line(case, expected, obtained, off, bound))
    return lines


SECTION = Section(
    "triangulation",
    "What two devices measure",
    "Stereo cameras at two angles to the normal, above the slab of the first section and next to "
    "the hot cylinder: the difference between the intersection of their straight lines and the "
    "point on which their bent lines end. The devices above the plate stand 300 mm away, those "
    "next to the cylinder 20 m, and all lie in one plane with the normal. Expected by quadrature "
    "of Snell's and Bouguer's laws. Then the points are corrected (`iriftrace correct`), and the "
    "remaining error is their distance from the true ones.",
    _lines,
    minutes=0.5,
)
