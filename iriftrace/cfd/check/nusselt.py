"""Natural convection from a horizontal cylinder, and a field's Nusselt number beside it."""

from __future__ import annotations

import numpy as np
from attrs import frozen

from iriftrace.air import thermophysics as gas
from iriftrace.cfd.check.finding import Finding, Verdict
from iriftrace.cfd.check.wall import WallState
from iriftrace.core.errors import InputError
from iriftrace.field.index_field import IndexField
from iriftrace.part.part import Part

GRAVITY = 9.81
"""m/s2."""

RAYLEIGH_RANGE = (1e-6, 1e9)
"""Where Churchill's and Chu's laminar equation holds."""

NUSSELT_TOLERANCE = 0.15

_ROUND = 0.03
"""Largest difference of width, height and volume from a cylinder's, as a share."""


@frozen
class Convection:
    """Expected natural convection; both numbers are with the diameter."""

    nusselt: float  # mean, of the conductivity at `reference_k`
    rayleigh: float
    reference_k: float  # temperature at which the air's properties are taken, K
    heat_flux: float  # mean from the wall, W/m2


def reference_temperature(wall_k: float, ambient_k: float) -> float:
    """Temperature, K, at which gas at a hot wall is as good as one of constant properties.

    E. M. Sparrow and J. L. Gregg, "The variable fluid-property problem in free convection",
    Transactions of the ASME 80 (1958) 879; from solutions of the boundary layer in gases with
    variable properties, for ratios of T_wall to T_ambient from 1/4 to 4. A wall of 1100 degC in a
    room has 4.7.
    """
    return wall_k - 0.38 * (wall_k - ambient_k)


def nusselt_horizontal_cylinder(
    diameter_mm: float,
    wall_k: float,
    ambient_k: float,
    pressure_pa: float = 101325.0,
) -> Convection:
    """Heat from the lateral surface of a long horizontal cylinder in air at rest.

    The equation for laminar flow of S. W. Churchill and H. H. S. Chu, "Correlating equations for
    laminar and turbulent free convection from a horizontal cylinder", International Journal of Heat
    and Mass Transfer 18 (1975) 1049::

        Nu = 0.36 + 0.518 Ra^(1/4) / (1 + (0.559 / Pr)^(9/16))^(4/9)

    It was made for small differences of temperature. For gas with a hot wall its properties are
    taken at Sparrow's and Gregg's `reference_temperature`, with beta = 1 / T_ambient. Air as in
    `iriftrace.air.thermophysics`. An InputError if the wall is not hotter than the air, or the flow
    is not laminar.
    """
    if not (diameter_mm > 0.0 and wall_k > ambient_k > 0.0 and pressure_pa > 0.0):
        raise InputError(
            f"a cylinder of {diameter_mm:g} mm and {wall_k:g} K in air of {ambient_k:g} K and "
            f"{pressure_pa:g} Pa gives no natural convection by this rule; the wall must be the "
            "hotter one and all numbers positive."
        )
    reference = reference_temperature(wall_k, ambient_k)
    diameter = diameter_mm * 1e-3
    conductivity = float(gas.conductivity(reference))
    viscosity = float(gas.viscosity(reference))
    prandtl = viscosity * float(gas.heat_capacity(reference)) / conductivity
    kinematic = viscosity / float(gas.density(reference, pressure_pa))
    grashof = GRAVITY * (wall_k - ambient_k) / ambient_k * diameter**3 / kinematic**2
    rayleigh = grashof * prandtl
    low, high = RAYLEIGH_RANGE
    if not low <= rayleigh <= high:
        raise InputError(
            f"the Rayleigh number {rayleigh:.3g} is outside the laminar range {low:g} to {high:g} "
            "of the rule; no Nusselt number can be given."
        )
    factor = (1.0 + (0.559 / prandtl) ** (9.0 / 16.0)) ** (4.0 / 9.0)
    nusselt = 0.36 + 0.518 * float(np.power(rayleigh, 0.25)) / factor
    return Convection(
        nusselt=nusselt,
        rayleigh=rayleigh,
        reference_k=reference,
        heat_flux=nusselt * conductivity * (wall_k - ambient_k) / diameter,
    )


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
        rule = nusselt_horizontal_cylinder(diameter, wall_k, ambient, field.air.pressure_pa)
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
    limit = NUSSELT_TOLERANCE
    verdict: Verdict = (
        "good" if abs(off) <= limit else "doubtful" if abs(off) <= 2 * limit else "bad"
    )
    return Finding(
        "Nusselt number",
        f"{found:.2f}",
        verdict,
        f"{off:+.1%} against {rule.nusselt:.2f} (horizontal cylinder of {diameter:.3g} mm, Sparrow "
        f"and Gregg's reference temperature {rule.reference_k:.0f} K), at most "
        f"{NUSSELT_TOLERANCE:.0%}; from "
        + ("the gradient" if counted is None else "the heat that the solver counted")
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
