"""Air of a round refractivity, and a ray through its exact layers around a cylinder."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from iriftrace.medium.air.refractivity import Air
from iriftrace.scenes.closed_forms import RADIUS_MM, REFRACTIVITY


class RoundAir(Air):
    """Air whose refractivity is `REFRACTIVITY` exactly."""

    @property
    def ambient_refractivity(self) -> float:
        return REFRACTIVITY


def layered_cylinder_displacement_um(
    height: float, radii: Sequence[float], refractivities: Sequence[float]
) -> float:
    """Distance between the refracted and the straight hit of a ray across a cylinder's axis.

    By Snell's law at exact circles, between which the index is constant.

    Parameters
    ----------
    height : float
        b over the cylinder's radius.
    radii : sequence of float, mm
        From the outside.
    refractivities : sequence of float
        n - 1 of the layers from the outside, one more than radii.
    """
    b = height * RADIUS_MM
    ends = [*radii, RADIUS_MM]
    sweep = np.arcsin(b / RADIUS_MM) - np.arcsin(b / ends[0])
    for outer, inner, air in zip(radii, ends[1:], refractivities[1:], strict=True):
        nearest = (1 + refractivities[0]) * b / (1 + air)
        sweep -= np.arcsin(nearest / inner) - np.arcsin(nearest / outer)
    return float(2e3 * RADIUS_MM * np.sin(abs(sweep) / 2))
