"""Thermophysical properties of hot air: density, heat capacity, viscosity, conductivity.

A perfect gas at ambient pressure. Heat capacities are the polynomials of nitrogen and oxygen of
Gordon and McBride (NASA SP-273, 1971, "JANAF" in OpenFOAM), mixed 0.79 to 0.21, for 200 to 5000 K;
the viscosity is Sutherland's (1893) with the constants of the U.S. Standard Atmosphere (1976); the
conductivity is Eucken's as modified for gases whose molecules rotate (Poling, Prausnitz and
O'Connell, The Properties of Gases and Liquids, 2001, section 10-3), which OpenFOAM uses with it.
The refractive index is in `iriftrace.medium.air.refractivity`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray, as_float64

MOLAR_MASS = 28.85
"""g/mol."""
GAS_CONSTANT = 8.314462618
"""J/(mol K), CODATA 2018; `iriftrace.medium.air` has the one that its equations were made with."""
SPECIFIC_GAS_CONSTANT = GAS_CONSTANT / (MOLAR_MASS * 1e-3)
"""J/(kg K)."""
SUTHERLAND_AS = 1.458e-06
"""Pa s / K^(1/2)."""
SUTHERLAND_TS = 110.4
"""K."""

GRAVITY = 9.81
"""m/s2."""

COMMON_K = 1000.0
"""Temperature at which the two polynomials of the heat capacity meet."""
_NITROGEN = (
    (2.926640, 1.4879768e-3, -5.684760e-7, 1.0097038e-10, -6.753351e-15, -922.7977, 5.980528),
    (3.298677, 1.4082404e-3, -3.963222e-6, 5.641515e-9, -2.444854e-12, -1020.8999, 3.950372),
)
_OXYGEN = (
    (
        *(3.28253784, 1.48308754e-3, -7.57966669e-7, 2.09470555e-10, -2.16717794e-14),
        *(-1088.45772, 5.45323129),
    ),
    (
        *(3.78245636, -2.99673416e-3, 9.84730201e-6, -9.68129509e-9, 3.24372837e-12),
        *(-1063.94356, 3.65767573),
    ),
)
HEAT_CAPACITY_ABOVE, HEAT_CAPACITY_BELOW = (
    tuple(float(f"{0.79 * n + 0.21 * o:.9g}") for n, o in zip(*pair, strict=True))
    for pair in zip(_NITROGEN, _OXYGEN, strict=True)
)
"""Coefficients a1 to a7 of Gordon and McBride above and below `COMMON_K`."""


def density(temperature_k: ArrayLike, pressure_pa: float) -> FloatArray:
    """Density, kg/m3, of air at a temperature and a pressure."""
    return pressure_pa / (SPECIFIC_GAS_CONSTANT * np.asarray(temperature_k, dtype=np.float64))


def temperature_of_density(density_kg_m3: ArrayLike, pressure_pa: float) -> FloatArray:
    """Temperature of air that has a density at a pressure, K."""
    # The perfect gas is its own inverse.
    return density(density_kg_m3, pressure_pa)


def heat_capacity(temperature_k: ArrayLike) -> FloatArray:
    """Heat capacity at constant pressure, J/(kg K); 200 to 5000 K."""
    return _of_polynomials(temperature_k, lambda c: c[4::-1])


def enthalpy(temperature_k: ArrayLike) -> FloatArray:
    """Enthalpy, J/kg, up to a constant: the integral of `heat_capacity`; 200 to 5000 K."""
    return _of_polynomials(temperature_k, lambda c: as_float64(np.polyint(c[4::-1], k=c[5])))


def _of_polynomials(
    temperature_k: ArrayLike, terms: Callable[[tuple[float, ...]], Sequence[float] | FloatArray]
) -> FloatArray:
    """Polynomials with terms of the coefficients, highest power first, times the gas constant."""
    kelvin = np.asarray(temperature_k, dtype=np.float64)
    low, high = (np.polyval(terms(c), kelvin) for c in (HEAT_CAPACITY_BELOW, HEAT_CAPACITY_ABOVE))
    return np.where(kelvin < COMMON_K, low, high) * SPECIFIC_GAS_CONSTANT


def heat_content(temperature_k: ArrayLike, ambient_k: float, pressure_pa: float) -> FloatArray:
    """Heat that air holds more than ambient air, J/m3: density times difference in enthalpy."""
    more = enthalpy(temperature_k) - enthalpy(ambient_k)
    return density(temperature_k, pressure_pa) * more


def heat_content_slope(temperature_k: ArrayLike, ambient_k: float) -> FloatArray:
    """Derivative of `heat_content` with respect to the density at constant pressure, J/kg.

    For a perfect gas d(rho (h - h_a))/d rho = h - h_a - c_p T, which is the constant -c_p T_a where
    the heat capacity is constant: then the heat content is linear in the density.
    """
    kelvin = np.asarray(temperature_k, dtype=np.float64)
    return enthalpy(kelvin) - enthalpy(ambient_k) - heat_capacity(kelvin) * kelvin


def viscosity(temperature_k: ArrayLike) -> FloatArray:
    """Dynamic viscosity, Pa s."""
    kelvin = np.asarray(temperature_k, dtype=np.float64)
    return SUTHERLAND_AS * kelvin**1.5 / (kelvin + SUTHERLAND_TS)


def conductivity(temperature_k: ArrayLike) -> FloatArray:
    """Thermal conductivity, W/(m K), by the modified Eucken relation."""
    at_constant_volume = heat_capacity(temperature_k) - SPECIFIC_GAS_CONSTANT
    eucken = 1.32 * at_constant_volume + 1.77 * SPECIFIC_GAS_CONSTANT
    return viscosity(temperature_k) * eucken


def reference_temperature(wall_k: float, ambient_k: float) -> float:
    """Temperature, K, at which gas at a hot wall behaves like one of constant properties.

    E. M. Sparrow and J. L. Gregg, "The variable fluid-property problem in free convection",
    Transactions of the ASME 80 (1958) 879; from solutions of the boundary layer in gases with
    variable properties, for ratios of T_wall to T_ambient from 1/4 to 4. A wall of 1100 degC in a
    room has 4.7.
    """
    return wall_k - 0.38 * (wall_k - ambient_k)
