"""Clouds that were measured in one air and corrected with another one's field."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from attrs import evolve

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.flow.synthetic.field import synthetic_field
from iriftrace.flow.synthetic.model import synthetic_air
from iriftrace.measuring.features.fit import fit_feature
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.tracing.scene import Scene
from validation.inputs.scene_rays import loaded
from validation.inputs.solved_fields import SOLVED, camera_at
from validation.line import Line, Section

CAMERA, PROJECTOR = (-55.0, -275.0, 60.0), (55.0, -275.0, 60.0)
"""Those of the scene ``fringe_cylinder``, mm."""

CONTRAST = 1.05

LEFT_OF_CONTRAST = 0.1
"""Per cent of the error: of second order, what lines of sight change by where they are moved."""


def devices() -> tuple[Camera, Camera]:
    """Camera and projector, at an eighth of the resolution."""
    camera, projector = (
        evolve(camera_at(place), resolution=(306, 256)) for place in (CAMERA, PROJECTOR)
    )
    return camera, projector


def with_contrast(field: IndexField, factor: float) -> IndexField:
    """The field with another n - n of the ambient air everywhere."""
    ambient = field.ambient_refractivity
    return evolve(field, refractivity=ambient + factor * (field.refractivity - ambient))


def airs(folder: Path) -> Iterator[tuple[str, IndexField, float | None]]:
    """Fields with which the cloud is corrected: what they are, and the per cent that they leave."""
    same = SOLVED["cylinder_C"].field(folder)
    yield "the same field", same, 0.0
    more = 100.0 * (CONTRAST - 1.0)
    yield f"the same with {more:.0f} % more contrast", with_contrast(same, CONTRAST), more
    yield "a coarser flow solution (B)", SOLVED["cylinder_B"].field(folder), None
    yield "the coarsest one (A)", SOLVED["cylinder_A"].field(folder), None
    formulas = synthetic_field(synthetic_air(SOLVED["cylinder_C"].part))
    yield "air from formulas (`iriftrace field synthetic`)", formulas, None


def scene_of(folder: Path, field: IndexField) -> Scene:
    """The bundled cylinder in the air of a field."""
    return loaded(folder, SOLVED["cylinder_C"].part, contour_shells(field))


def root_mean_square(errors: FloatArray) -> float:
    """Root mean square of errors along the normal, mm, in um."""
    return 1e3 * float(np.sqrt(np.mean(errors**2)))


def _lines(folder: Path) -> list[Line]:
    camera, projector = devices()
    lines: list[Line] = []
    scan: Scan | None = None
    for number, (name, field, expected) in enumerate(airs(folder)):
        scene = scene_of(folder / str(number), field)
        if scan is None:
            scan = measure(scene, camera, projector, system="fringe")
            lines.append(Line("as measured", "", _said(scan.error_normal, scan, scan.points)))
        back = correct(scan.points, scene, camera, projector, system="fringe")
        left = np.einsum("ij,ij->i", back.points - scan.true, scan.normal)
        remaining = 100.0 * root_mean_square(left) / root_mean_square(scan.error_normal)
        obtained = f"{_said(left, scan, back.points)}: {remaining:.2g} % left"
        case = f"corrected with {name}"
        if expected is None:
            lines.append(Line(case, "", obtained))
        else:
            lines.append(
                Line(case, f"{expected:.0f} %", obtained, remaining - expected, LEFT_OF_CONTRAST)
            )
    return lines


def _said(errors: FloatArray, scan: Scan, points: FloatArray) -> str:
    measured, true = (fit_feature(cloud, "cylinder").size_mm for cloud in (points, scan.true))
    assert measured is not None
    assert true is not None
    return f"error {root_mean_square(errors):.2g} µm, diameter {1e3 * (measured - true):+.2f} µm"


SECTION = Section(
    "other-air",
    "A cloud corrected with another field",
    "The bundled cylinder, measured by fringe projection (camera and projector of the scene "
    "`fringe_cylinder`) in the air of flow solution C, and corrected with fields that are not that "
    "air. The error is that along the part's normal, root mean square; the diameter is that of the "
    "cylinder of best fit through the points less that through the true ones. A contrast that is "
    "5 % too large corrects 5 % too much. Less than half of the circumference is measured, so that "
    "errors that vary along it weigh more in the diameter than at the points: air from formulas "
    "takes out most of the points' error and nothing of the diameter's.",
    _lines,
    minutes=1.0,
)
