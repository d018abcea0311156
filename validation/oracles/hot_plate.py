"""Rays along a hot vertical plate, by other equations and numerics than `scenes.generators.plate`.

Boundary layer of a perfect gas in the variable of L. Howarth (1948) and A. A. Dorodnitsyn (1942),
Y = integral of rho / rho_a dy, with eta = c Y / x^(1/4)::

    c = (g (T_w - T_a) / T_a / 4 nu_a^2)^(1/4)
    (C f'')' + 3 f f'' - 2 f'^2 + theta = 0,   (K theta')' + 3 Pr cp / cp_a f theta' = 0

C = rho mu and K = rho k over their ambient values. With C = K = 1 it is the problem of S. Ostrach,
NACA Report 1111 (1953). The ray is a solution of the ordinary differential equation of its path.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from attrs import frozen
from scipy.integrate import cumulative_trapezoid, solve_bvp, solve_ivp
from scipy.interpolate import CubicSpline, PPoly

from iriftrace.core.arrays import FloatArray
from iriftrace.medium.air import thermophysics as gas
from iriftrace.medium.air.refractivity import Air

Ratio = Callable[[FloatArray], FloatArray]

END = 12.0
"""Largest eta, where the air is still and cold."""


def similarity(prandtl: float, viscous: Ratio, conducting: Ratio, capacity: Ratio) -> PPoly:
    """Functions f, f', C f'', theta, K theta' of eta; the ratios C, K and cp / cp_a of theta."""

    def slopes(_: FloatArray, y: FloatArray) -> FloatArray:
        f, u, stress, theta, flux = y
        bent, fall = stress / viscous(theta), flux / conducting(theta)
        cooling = -3.0 * prandtl * capacity(theta) * f * fall
        return np.stack((u, bent, 2.0 * u**2 - 3.0 * f * bent - theta, fall, cooling))

    def ends(wall: FloatArray, far: FloatArray) -> FloatArray:
        return np.array((wall[0], wall[1], wall[3] - 1.0, far[1], far[3]))

    e = END * np.linspace(0.0, 1.0, 400) ** 1.5
    guess = (0.4 * (1 - np.exp(-e)), 0.5 * e * np.exp(-e), 0.6 * np.exp(-e) * (1 - e))
    heat = (np.exp(-0.6 * e), -0.5 * np.exp(-0.6 * e))
    found = solve_bvp(slopes, ends, e, np.stack((*guess, *heat)), tol=1e-6, max_nodes=40_000)
    assert found.success, found.message
    return found.sol


@frozen(eq=False)
class Profile:
    """Air at one height: temperature, K, and n - 1 by the distance from the wall, mm."""

    kelvin: CubicSpline
    refractivity: CubicSpline
    end_mm: float

    def bending(self, start_mm: float, width_mm: float) -> float:
        """Angle, rad, by which a ray that starts parallel to the wall is bent along the width."""

        def slopes(_: float, state: FloatArray) -> tuple[float, float]:
            place, slope = state
            inside = min(place, self.end_mm)
            index = 1.0 + float(self.refractivity(inside))
            return slope, float(self.refractivity(inside, 1)) / index * (1.0 + slope**2)

        found = solve_ivp(slopes, (0.0, width_mm), (start_mm, 0.0), rtol=1e-10, atol=1e-13)
        return float(np.arctan(found.y[1, -1]))


def profile(wall_k: float, height_mm: float, air: Air, gravity: float = 9.81) -> Profile:
    """Air at a height above the lower edge of a plate."""
    ambient, pressure = air.temperature_k, air.pressure_pa

    def kelvin(theta: FloatArray) -> FloatArray:
        return ambient + (wall_k - ambient) * np.clip(theta, 0.0, 1.0)

    def ratio(of: Callable[[FloatArray], FloatArray], power: int) -> Ratio:
        return lambda theta: of(kelvin(theta)) / of(ambient) * (ambient / kelvin(theta)) ** power

    prandtl = float(gas.viscosity(ambient) * gas.heat_capacity(ambient) / gas.conductivity(ambient))
    solution = similarity(
        prandtl, ratio(gas.viscosity, 1), ratio(gas.conductivity, 1), ratio(gas.heat_capacity, 0)
    )
    kinematic = float(gas.viscosity(ambient) / gas.density(ambient, pressure))
    c = (gravity * (wall_k - ambient) / ambient / (4.0 * kinematic**2)) ** 0.25
    eta = np.linspace(0.0, END, 24_001)
    hot = kelvin(solution(eta)[3])
    away = 1e3 * cumulative_trapezoid(hot / ambient, eta, initial=0.0)
    away *= (height_mm * 1e-3) ** 0.25 / c
    return Profile(
        CubicSpline(away, hot), CubicSpline(away, air.refractivity(hot)), float(away[-1])
    )
