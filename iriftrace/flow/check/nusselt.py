"""Natural convection from a horizontal cylinder: mean and local Nusselt numbers, and a field's."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, interp1d

from iriftrace.core.arrays import BoolArray, FloatArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.flow.check.finding import Finding, Grade
from iriftrace.flow.check.wall import WallState
from iriftrace.medium.air import thermophysics as gas
from iriftrace.medium.index_field import IndexField
from iriftrace.part.part import Part

RAYLEIGH_RANGE = (1e-6, 1e9)
"""Range of Churchill and Chu's laminar equation."""

ANGLES_DEG = np.arange(0.0, 181.0, 15.0)
"""Angles from the bottom of a horizontal cylinder, of `LOCAL_NUSSELT`."""

LOCAL_NUSSELT = {
    1e3: (3.782, 3.772, 3.743, 3.692, 3.616, 3.51, 3.361, 3.152, 2.864, 2.473, 1.979, 1.466, 1.218),
    1e4: (5.961, 5.946, 5.901, 5.826, 5.718, 5.575, 5.384, 5.125, 4.75, 4.173, 3.315, 2.225, 1.536),
    4.1e4: (
        *(8.015, 7.994, 7.931, 7.826, 7.678, 7.485, 7.24, 6.927, 6.496, 5.819, 4.676, 3.011),
        1.794,
    ),
    1e5: (
        *(9.715, 9.688, 9.608, 9.474, 9.287, 9.046, 8.745, 8.374, 7.889, 7.15, 5.839, 3.696),
        1.993,
    ),
}
"""Local Nusselt numbers by the Rayleigh number, both with the diameter, at `ANGLES_DEG`.

Own solutions of the equations of the plane steady flow of a Boussinesq fluid, Pr 0.7, in stream
function, vorticity and temperature on 81 x 61 points up to 20 diameters; within 0.6 % (1e4) and
1 % (1e3) of T. Saitoh, T. Sajiki and K. Maruhara, International Journal of Heat and Mass Transfer
36 (1993) 1251, whose numbers were quoted from memory.
"""

SECTORS = {"bottom": (0.0, 15.0), "side": (75.0, 105.0), "top": (165.0, 180.0)}
"""Angles from the bottom, degrees, over which the heat flux is averaged."""

SECTOR_TOLERANCES = (0.06, 0.12)
"""Tolerances for side and top over bottom; at the top, where the plume leaves, the flux is small.

Four simulations of the paper's cylinder, from coarse to fine, differ by at most 2 % at the side and
5 % at the top.
"""

_ROUND = 0.03
"""Largest relative difference of width, height and volume from a cylinder's."""


@frozen
class Convection:
    """Expected natural convection; both numbers are based on the diameter."""

    nusselt: float  # mean, with the conductivity at `reference_k`
    rayleigh: float
    reference_k: float  # temperature at which the air's properties are taken, K
    heat_flux: float  # mean from the wall, W/m2


def nusselt_horizontal_cylinder(
    diameter_mm: float, wall_k: float, ambient_k: float, pressure_pa: float = 101325.0
) -> Convection:
    """Heat from the lateral surface of a long horizontal cylinder in air at rest.

    The equation for laminar flow of S. W. Churchill and H. H. S. Chu, "Correlating equations for
    laminar and turbulent free convection from a horizontal cylinder", International Journal of Heat
    and Mass Transfer 18 (1975) 1049::

        Nu = 0.36 + 0.518 Ra^(1/4) / (1 + (0.559 / Pr)^(9/16))^(4/9)

    It was derived for small differences of temperature. For gas at a hot wall its properties are
    evaluated at Sparrow and Gregg's `reference_temperature`, with beta = 1 / T_ambient. Air is that
    of `iriftrace.medium.air.thermophysics`. Raises InputError if the wall is not hotter than the
    air, or the flow is not laminar.
    """
    if not (diameter_mm > 0.0 and wall_k > ambient_k > 0.0 and pressure_pa > 0.0):
        raise InputError(
            f"a cylinder of {diameter_mm:g} mm and {wall_k:g} K in air of {ambient_k:g} K and "
            f"{pressure_pa:g} Pa gives no natural convection by this rule; the wall must be the "
            "hotter one and all numbers positive.",
            code="cylinder.no_convection",
        )
    reference = gas.reference_temperature(wall_k, ambient_k)
    diameter = diameter_mm * 1e-3
    conductivity = float(gas.conductivity(reference))
    viscosity = float(gas.viscosity(reference))
    prandtl = viscosity * float(gas.heat_capacity(reference)) / conductivity
    kinematic = viscosity / float(gas.density(reference, pressure_pa))
    grashof = gas.GRAVITY * (wall_k - ambient_k) / ambient_k * diameter**3 / kinematic**2
    rayleigh = grashof * prandtl
    low, high = RAYLEIGH_RANGE
    if not low <= rayleigh <= high:
        raise InputError(
            f"the Rayleigh number {rayleigh:.3g} is outside the laminar range {low:g} to {high:g} "
            "of the rule; no Nusselt number can be given.",
            code="cylinder.rayleigh_number",
        )
    factor = (1.0 + (0.559 / prandtl) ** (9.0 / 16.0)) ** (4.0 / 9.0)
    nusselt = 0.36 + 0.518 * float(np.power(rayleigh, 0.25)) / factor
    return Convection(
        nusselt=nusselt,
        rayleigh=rayleigh,
        reference_k=reference,
        heat_flux=nusselt * conductivity * (wall_k - ambient_k) / diameter,
    )


def local_nusselt(angle_deg: ArrayLike, rayleigh: float) -> FloatArray:
    """Local Nusselt number of an isothermal horizontal cylinder at angles from its bottom, degrees.

    Interpolated in `LOCAL_NUSSELT`, linearly in the logarithms; raises InputError beyond it.
    """
    known = np.log(list(LOCAL_NUSSELT))
    if not known[0] <= np.log(rayleigh) <= known[-1]:
        raise InputError(
            f"local Nusselt numbers are known for Rayleigh numbers from {min(LOCAL_NUSSELT):g} to "
            f"{max(LOCAL_NUSSELT):g}, not for {rayleigh:.3g}.",
            code="cylinder.rayleigh_number",
        )
    logarithms = np.log(list(LOCAL_NUSSELT.values()))
    # Level at the bottom and the top, where the two sides meet.
    rows = CubicSpline(ANGLES_DEG, logarithms, axis=1, bc_type="clamped")(angle_deg)
    return np.asarray(np.exp(interp1d(known, rows, axis=0)(np.log(rayleigh))))


def sector_means(angle_deg: FloatArray, values: FloatArray, weights: FloatArray) -> FloatArray:
    """Weighted means (3,) of values by angle from the bottom, in `SECTORS`; NaN in an empty one."""
    within = [(angle_deg >= low) & (angle_deg <= high) for low, high in SECTORS.values()]
    return np.array(
        [np.average(values[at], weights=weights[at]) if at.any() else np.nan for at in within]
    )


def nusselt_finding(
    wall: WallState, part: Part, field: IndexField, diameter_mm: float | None
) -> Finding:
    """How the heat flux is distributed over a horizontal cylinder; its mean is not judged.

    The mean is compared with that of the part, if it is such a cylinder, or of `diameter_mm`. The
    distribution is that of still air, so nothing is judged in a draught.
    """
    own = horizontal_cylinder_diameter(part)
    diameter = diameter_mm or own
    wall_k = float(np.median(wall.temperature_k))
    ambient = field.air.temperature_k
    if diameter is None:
        why = (
            "the part is not a horizontal cylinder, for which a correlation exists; compare with "
            "one of its size by giving a diameter"
        )
        return Finding("Nusselt number", "n/a", "-", why, {})
    try:
        rule = nusselt_horizontal_cylinder(diameter, wall_k, ambient, field.air.pressure_pa)
    except InputError as error:
        return Finding("Nusselt number", "n/a", "-", str(error), {"diameter_mm": diameter})
    # The correlation is for the lateral surface; end faces are those that look along the axis.
    axis = int(np.argmax(np.ptp(part.bounds, axis=0)[:2]))
    lateral = np.abs(wall.normals[:, axis]) < (0.5 if diameter_mm is None else np.inf)
    flux = float(np.average(wall.flux[lateral], weights=wall.areas[lateral]))
    counted = field.source.wall_heat_w
    if counted is not None:
        flux *= counted / wall.heat_w
    conductivity = float(gas.conductivity(rule.reference_k))
    scale = diameter * 1e-3 / (conductivity * (wall_k - ambient))
    found = flux * scale
    of_cells = scale * float(np.average(wall.flux_of_cells[lateral], weights=wall.areas[lateral]))
    numbers = {
        "nusselt": found,
        "nusselt_of_cells": of_cells,
        "rule": rule.nusselt,
        "rayleigh": rule.rayleigh,
        "diameter_mm": diameter,
        "reference_k": rule.reference_k,
    }
    source = "the gradient" if counted is None else "the heat that the solver counted"
    mean = (
        f"mean {found:.2f} from {source} ({of_cells:.2f} from the mean of the wall's cells), "
        f"{found / rule.nusselt - 1.0:+.1%} against {rule.nusselt:.2f} of Churchill and Chu for a "
        f"horizontal cylinder of {diameter:.3g} mm, which is 10 to 20 % off for walls this hot and "
        "is not judged"
    )
    if (wind := field.source.facts.draught_m_s) is not None:
        numbers["draught_m_s"] = float(np.linalg.norm(wind))
        mean += (
            f"; its distribution is not judged either in the draught of {numbers['draught_m_s']:g} "
            "m/s that the field states, as the one to compare with is that of still air"
        )
        return Finding("Nusselt number", f"{found:.2f}", "-", mean, numbers)
    if own is None or diameter_mm is not None:
        return Finding("Nusselt number", f"{found:.2f}", "-", mean, numbers)
    return _judged(wall, lateral, rule.rayleigh, mean, numbers)


def _judged(
    wall: WallState, lateral: BoolArray, rayleigh: float, mean: str, numbers: dict[str, float]
) -> Finding:
    """The ratios of the fluxes at bottom, side and top, which hardly depend on the air."""
    angle = np.degrees(np.arccos(np.clip(-wall.normals[lateral, 2], -1.0, 1.0)))
    sectors = sector_means(angle, wall.flux[lateral], wall.areas[lateral])
    ratios = sectors / sectors[0]
    value = _text(ratios)
    try:
        expected = sector_ratios(rayleigh)
    except InputError as error:
        return Finding("Nusselt number", value, "-", f"{error} {mean}", numbers)
    # In tolerances; bad if NaN, which happens if so few faces leave a sector empty.
    off = float(np.max(np.abs(ratios / expected - 1.0)[1:] / SECTOR_TOLERANCES))
    verdict: Grade = "good" if off <= 1.0 else "doubtful" if off <= 2.0 else "bad"
    side, top = SECTOR_TOLERANCES
    return Finding(
        "Nusselt number",
        value,
        verdict,
        f"heat flux of bottom : side : top, 30 degrees each, against {_text(expected)} at a "
        f"Rayleigh number of {rayleigh:.3g}; side within {side:.0%}, top within {top:.0%}; {mean}",
        {
            **numbers,
            "sectors_w_m2": dict(zip(SECTORS, sectors.tolist(), strict=True)),
            "ratios": ratios.tolist(),
            "expected_ratios": expected.tolist(),
        },
    )


def _text(ratios: FloatArray) -> str:
    bottom, side, top = ratios
    return f"{bottom:g} : {side:.2f} : {top:.2f}"


def sector_ratios(rayleigh: float) -> FloatArray:
    """Fluxes at bottom, side and top over that at the bottom, (3,), of an isothermal cylinder."""
    angle = np.linspace(0.0, 180.0, 721)
    means = sector_means(angle, local_nusselt(angle, rayleigh), np.ones_like(angle))
    return as_float64(means / means[0])


def horizontal_cylinder_diameter(part: Part) -> float | None:
    """Diameter, mm, of a part that is a horizontal cylinder; None for another shape."""
    low, high = part.bounds
    x, y, z = (high - low).tolist()
    length, across = (x, y) if x > y else (y, x)
    diameter = 0.5 * (across + z)
    round_enough = abs(across - z) < _ROUND * diameter
    full = abs(part.volume / (0.25 * np.pi * diameter**2 * length) - 1.0) < _ROUND
    return diameter if round_enough and full and length > 2.0 * diameter else None
