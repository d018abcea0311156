"""Effect of another wall, ambient air or pressure on what the air bends, by similarity.

For lines of sight through the laminar layer of a hot vertical wall. In Howarth's and Dorodnitsyn's
coordinate Y = int (rho / rho_a) dy the integral of n_a - n over the layer is proportional to
rho_a (dT / T_a) int theta dY, and Y scales with the Grashof number as x (Gr / 4)^(-1/4),
Gr = g (dT / T_a) x^3 / nu_a^2 (Ostrach, NACA Report 1111, 1953), so

    J ~ (rho_a mu_a)^(1/2) (dT / T_a)^(3/4).

It changes with p^(1/2): denser air makes a thinner layer. The integral of the normalised profile
theta changes little: for a plate of 1100 degC a solution with real properties has +1.19 % for 20 K
more at the wall (here +1.39 %), and -1.67 % for 5 K more in the room (here -1.80 %).
"""

from __future__ import annotations

from attrs import evolve

from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.air.thermophysics import SUTHERLAND_TS

SOURCE = "similarity of a wall's layer, not solved again"


def relative_effects(inputs: Inputs, wall_k: float, air: Air) -> dict[str, float]:
    """Relative change of the air's effect by one standard uncertainty of each stated input.

    To first order, by the logarithmic derivatives of J; that of mu ~ T^(3/2) / (T + S) is
    3 / (2 T) - 1 / (T + S) (Sutherland).
    """
    ambient_k = float(air.temperature_k)
    heating_k = wall_k - ambient_k
    found = {}
    if inputs.wall_k is not None:
        found["wall"] = 0.75 * inputs.wall_k / heating_k
    if inputs.ambient_k is not None:
        viscous = 1.5 / ambient_k - 1.0 / (ambient_k + SUTHERLAND_TS)
        own = 0.5 * (viscous - 1.0 / ambient_k) - 0.75 * (1.0 / heating_k + 1.0 / ambient_k)
        found["ambient"] = own * inputs.ambient_k
    if inputs.pressure_pa is not None:
        found["pressure"] = 0.5 * inputs.pressure_pa / float(air.pressure_pa)
    return found


def humidity_effect(humidity: float, air: Air) -> float:
    """Relative change of the contrast by a change of the relative humidity, to first order."""
    step = 0.01 if air.relative_humidity < 0.5 else -0.01
    other = evolve(air, relative_humidity=float(air.relative_humidity) + step)
    slope = (other.ambient_refractivity / air.ambient_refractivity - 1.0) / step
    return slope * humidity
