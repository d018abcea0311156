"""Natural convection from a horizontal cylinder in gas: what heat flow is to be expected."""

from __future__ import annotations

import numpy as np
from attrs import frozen

from iriftrace import air_properties as air
from iriftrace.errors import InputError

GRAVITY = 9.81
"""m/s2."""

RAYLEIGH_RANGE = (1e-6, 1e9)
"""Where Churchill's and Chu's laminar equation holds."""

_SPARROW_GREGG = 0.38


@frozen
class Convection:
    """Expected natural convection.

    Attributes
    ----------
    nusselt
        Mean Nusselt number with the diameter, of the conductivity at `reference_k`.
    rayleigh
        Rayleigh number with the diameter.
    reference_k
        Temperature at which the air's properties are taken, K.
    heat_flux
        Mean heat flux from the wall, W/m2.
    """

    nusselt: float
    rayleigh: float
    reference_k: float
    heat_flux: float


def reference_temperature(wall_k: float, ambient_k: float) -> float:
    """Temperature, K, at which gas at a hot wall is as good as one of constant properties.

    E. M. Sparrow and J. L. Gregg, "The variable fluid-property problem in free convection",
    Transactions of the ASME 80 (1958) 879.
    """
    return wall_k - _SPARROW_GREGG * (wall_k - ambient_k)


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
    taken at the reference temperature of E. M. Sparrow and J. L. Gregg, "The variable
    fluid-property problem in free convection", Transactions of the ASME 80 (1958) 879::

        T_ref = T_wall - 0.38 (T_wall - T_ambient),    beta = 1 / T_ambient

    which they drew from solutions of the boundary layer in gases with variable properties, for
    ratios of T_wall to T_ambient from 1/4 to 4; a wall of 1100 degC in a room has 4.7. Air as in
    `iriftrace.air_properties`.

    Parameters
    ----------
    diameter_mm
    wall_k, ambient_k
        Temperatures, K; the wall is the hotter one.
    pressure_pa

    Returns
    -------
    Convection

    Raises
    ------
    InputError
        The wall is not hotter than the air, or the flow is not laminar.
    """
    if not (diameter_mm > 0.0 and wall_k > ambient_k > 0.0 and pressure_pa > 0.0):
        raise InputError(
            f"a cylinder of {diameter_mm:g} mm and {wall_k:g} K in air of {ambient_k:g} K and "
            f"{pressure_pa:g} Pa gives no natural convection by this rule; the wall must be the "
            "hotter one and all numbers positive."
        )
    reference = reference_temperature(wall_k, ambient_k)
    diameter = diameter_mm * 1e-3
    conductivity = float(air.conductivity(reference))
    viscosity = float(air.viscosity(reference))
    prandtl = viscosity * float(air.heat_capacity(reference)) / conductivity
    kinematic = viscosity / float(air.density(reference, pressure_pa))
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
