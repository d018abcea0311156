"""Effect of another wall, ambient air or pressure on what the air bends, by similarity.

For lines of sight through the laminar layer of a hot vertical wall. In Howarth's and Dorodnitsyn's
coordinate Y = int (rho / rho_a) dy the integral of n_a - n over the layer is proportional to
rho_a (dT / T_a) int theta dY, and Y scales with the Grashof number as x (Gr / 4)^(-1/4),
Gr = g (dT / T_a) x^3 / nu_a^2 (Ostrach, NACA Report 1111, 1953), so

    J ~ (rho_a mu_a)^(1/2) (dT / T_a)^(3/4).

It changes with p^(1/2): denser air makes a thinner layer. The integral of the normalised profile
theta changes little: for a plate of 1100 degC a solution with real properties has +1.19 % for 20 K
more at the wall (here +1.39 %), and -1.67 % for 5 K more in the room (here -1.79 %).
"""

from __future__ import annotations

from attrs import evolve

from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.air.thermophysics import viscosity

SOURCE = "similarity of a wall's layer, not solved again"


def layer(wall_k: float, air: Air) -> float:
    """The integral of n_a - n over a wall's layer, in any unit."""
    contrast = (wall_k - air.temperature_k) / air.temperature_k
    density = air.pressure_pa / air.temperature_k
    return float((density * viscosity(air.temperature_k)) ** 0.5 * contrast**0.75)


def relative_effects(inputs: Inputs, wall_k: float, air: Air) -> dict[str, float]:
    """Relative change of the air's effect by one standard uncertainty of each stated input."""
    now = layer(wall_k, air)
    found = {}
    if inputs.wall_k is not None:
        found["wall"] = layer(wall_k + inputs.wall_k, air) / now - 1.0
    if inputs.ambient_k is not None:
        warmer = evolve(air, temperature_k=air.temperature_k + inputs.ambient_k)
        found["ambient"] = layer(wall_k, warmer) / now - 1.0
    if inputs.pressure_pa is not None:
        denser = evolve(air, pressure_pa=air.pressure_pa + inputs.pressure_pa)
        found["pressure"] = layer(wall_k, denser) / now - 1.0
    return found


def humidity_effect(humidity: float, air: Air) -> float:
    """Relative change of the contrast by a change of the relative humidity."""
    sense = 1.0 if air.relative_humidity + humidity <= 1.0 else -1.0
    other = evolve(air, relative_humidity=air.relative_humidity + sense * humidity)
    return other.ambient_refractivity / air.ambient_refractivity - 1.0
