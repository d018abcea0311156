"""The heat of a horizontal cylinder, for which there is a rule to compare it with."""

from __future__ import annotations

import numpy as np

from iriftrace import air_properties as gas
from iriftrace.convection import Convection, nusselt_horizontal_cylinder
from iriftrace.errors import InputError
from iriftrace.field_check.finding import Finding, Verdict
from iriftrace.field_check.wall_state import WallState
from iriftrace.index_field import IndexField
from iriftrace.part import Part

NUSSELT_TOLERANCE = 0.15

_ROUND = 0.03
"""How much width, height and volume may differ from a cylinder's, as a share."""


def nusselt_finding(
    wall: WallState, part: Part, field: IndexField, diameter_mm: float | None
) -> Finding:
    """The wall's mean heat flux against that of a horizontal cylinder, `diameter_mm` or its own."""
    diameter = diameter_mm or horizontal_cylinder_diameter(part)
    wall_k = float(np.median(wall.temperature_k))
    ambient = field.air.temperature_k
    if diameter is None:
        return Finding(
            "Nusselt number",
            "n/a",
            "-",
            "the part is no horizontal cylinder, for which there is a rule; compare with one of "
            "its size by --diameter",
            {},
        )
    try:
        rule: Convection = nusselt_horizontal_cylinder(
            diameter, wall_k, ambient, field.air.pressure_pa
        )
    except InputError as error:
        return Finding("Nusselt number", "n/a", "-", str(error), {"diameter_mm": diameter})
    # The rule is for the lateral surface; heads are the faces that look along the axis.
    axis = int(np.argmax(np.ptp(part.bounds, axis=0)[:2]))
    lateral = np.abs(wall.normals[:, axis]) < 0.5 if diameter_mm is None else slice(None)
    flux = float(np.average(wall.flux[lateral], weights=wall.areas[lateral]))
    counted = field.source.wall_heat_w
    if counted is not None:
        flux *= counted / wall.heat_w
    conductivity = float(gas.conductivity(rule.reference_k))
    scale = diameter * 1e-3 / (conductivity * (wall_k - ambient))
    found = flux * scale
    of_cells = scale * float(np.average(wall.flux_of_cells[lateral], weights=wall.areas[lateral]))
    off = found / rule.nusselt - 1.0
    verdict: Verdict = (
        "good"
        if abs(off) <= NUSSELT_TOLERANCE
        else "doubtful"
        if abs(off) <= 2 * NUSSELT_TOLERANCE
        else "bad"
    )
    return Finding(
        "Nusselt number",
        f"{found:.2f}",
        verdict,
        f"{off:+.1%} against {rule.nusselt:.2f} (horizontal cylinder of {diameter:.3g} mm, Sparrow "
        f"and Gregg's reference temperature {rule.reference_k:.0f} K), at most "
        f"{NUSSELT_TOLERANCE:.0%}; from "
        + ("the gradient" if counted is None else f"the {counted:.4g} W that the solver counted")
        + f", and {of_cells:.2f} from the mean of the wall's cells",
        {
            "nusselt": found,
            "nusselt_of_cells": of_cells,
            "rule": rule.nusselt,
            "rayleigh": rule.rayleigh,
            "diameter_mm": diameter,
            "reference_k": rule.reference_k,
        },
    )


def horizontal_cylinder_diameter(part: Part) -> float | None:
    """Diameter, mm, of a part that is a horizontal cylinder; None for another shape."""
    low, high = part.bounds
    x, y, z = (high - low).tolist()
    length, across = (x, y) if x > y else (y, x)
    diameter = 0.5 * (across + z)
    round_enough = abs(across - z) < _ROUND * diameter
    full = abs(part.volume / (0.25 * np.pi * diameter**2 * length) - 1.0) < _ROUND
    return diameter if round_enough and full and length > 2.0 * diameter else None
