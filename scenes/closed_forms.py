r"""Displacements of rays in air of one coordinate, by conserved quantities and quadrature.

In plane layers :math:`n \sin\theta` is the same everywhere, around an axis or a centre
:math:`n r \sin\theta` (Bouguer). Temperature falls linearly through the slab, with the logarithm of
the radius around the cylinder and with its reciprocal around the sphere; n - 1 falls with 1 / T.
Gauss-Legendre's rule leaves less than 1e-9 of every value here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

FloatArray = NDArray[np.float64]
Profile = Callable[[FloatArray], FloatArray]
"""n - 1 at distances in mm."""

AMBIENT_K, WALL_K = 293.15, 1373.15
REFRACTIVITY = 2.718e-4
"""n - 1 of the ambient air."""

SLAB_MM = 20.0
LAYER_MM = 8.0
RADIUS_MM, OUTER_MM = 13.5, 60.0

NODES, WEIGHTS = np.polynomial.legendre.leggauss(600)
NODES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2


def refractivity(temperature: FloatArray) -> FloatArray:
    """n - 1 at temperatures in K."""
    return REFRACTIVITY * AMBIENT_K / temperature


def above(height: FloatArray) -> FloatArray:
    """n - 1 in the slab at heights above the wall in mm."""
    return _at(height / SLAB_MM)


def in_layer(height: FloatArray) -> FloatArray:
    """n - 1 in a boundary layer of parabolic excess temperature at heights above the wall in mm."""
    return _at(1 - (1 - np.clip(height / LAYER_MM, 0, 1)) ** 2)


def around(radius: FloatArray) -> FloatArray:
    """n - 1 around the cylinder at radii in mm."""
    return _at(np.log(radius / RADIUS_MM) / np.log(OUTER_MM / RADIUS_MM))


def around_sphere(radius: FloatArray) -> FloatArray:
    """n - 1 around the sphere at radii in mm."""
    return _at((1 / RADIUS_MM - 1 / radius) / (1 / RADIUS_MM - 1 / OUTER_MM))


def _at(share: FloatArray) -> FloatArray:
    """n - 1 at fractions of the fall of the temperature from the wall to the ambient air."""
    return refractivity(WALL_K + (AMBIENT_K - WALL_K) * np.clip(share, 0, 1))


def slab_shift_um(angle_deg: float, air: Profile = above, thickness_mm: float = SLAB_MM) -> float:
    r"""Shift on the wall of a ray through plane layers against the straight one.

    :math:`\int (\tan\theta - \tan\theta_0)\,dz` with :math:`n \sin\theta = n_0 \sin\theta_0`.

    Parameters
    ----------
    angle_deg : float
        Angle of incidence in the ambient air.
    air : callable
        n - 1 at heights in mm.
    thickness_mm : float
        Height at which the hot air ends.
    """
    sine = np.sin(np.radians(angle_deg))
    inside = (1 + REFRACTIVITY) * sine / (1 + air(thickness_mm * NODES))
    tangent = inside / np.sqrt((1 - inside) * (1 + inside))
    return float(1e3 * thickness_mm * WEIGHTS @ (tangent - np.tan(np.radians(angle_deg))))


def _apart_um(angle: float) -> float:
    """Chord between two points of the cylinder."""
    return float(2e3 * RADIUS_MM * np.sin(abs(angle) / 2))


def cylinder_displacement_um(height: float) -> float:
    r"""Distance between the refracted and the straight hit of a ray across the axis.

    The ray's angle about the axis grows by :math:`C / (r \sqrt{n^2 r^2 - C^2})\,dr` with
    :math:`C = n_0 b`; the straight ray's by the same with n = 1, C = b. Radii are taken as
    :math:`R + (R_1 - R) t^2`, since the integrand has nearly a root at the wall.

    Parameters
    ----------
    height : float
        b over the cylinder's radius.
    """
    return _apart_um(_sweep(height * RADIUS_MM))


def round_displacement_um(height: float, air: Profile = around) -> tuple[float, float]:
    """The same displacement, along the ray and away from the axis or the sphere's centre.

    Parameters
    ----------
    height : float
        Distance of the ray from the axis or centre, over the radius.
    air : callable
        n - 1 at radii in mm.
    """
    straight = np.arcsin(height)
    bent = straight + _sweep(height * RADIUS_MM, air)
    # As products, since the angles differ by little.
    half, middle = np.sin((bent - straight) / 2), (bent + straight) / 2
    return (
        float(2e3 * RADIUS_MM * half * np.sin(middle)),
        float(2e3 * RADIUS_MM * half * np.cos(middle)),
    )


def _sweep(b: float, air: Profile = around) -> float:
    """Angle about the axis by which a ray at distance b, mm, goes beyond a straight one."""
    r = RADIUS_MM + (OUTER_MM - RADIUS_MM) * NODES**2
    nr, c = (1 + air(r)) * r, (1 + REFRACTIVITY) * b
    sweep = c / (r * np.sqrt((nr - c) * (nr + c))) - b / (r * np.sqrt((r - b) * (r + b)))
    return float(WEIGHTS @ (sweep * 2 * (OUTER_MM - RADIUS_MM) * NODES))


def slab_pair_error_um(first: float, second: float) -> tuple[float, float]:
    """Depth and lateral error of a point of the plate that two devices triangulate.

    Each device's straight line misses the point on the plate by the slab's shift; the lines meet
    below it.

    Parameters
    ----------
    first, second : float
        Tangents of the devices' angles to the normal, signed, in one plane with it.
    """
    shifts = [np.sign(t) * slab_shift_um(np.degrees(np.arctan(abs(t)))) for t in (first, second)]
    height = (shifts[0] - shifts[1]) / (second - first)
    return -float(height), float(shifts[0] + first * height)


def cylinder_pair_error_um(first: float, second: float) -> tuple[float, float]:
    """Normal and tangential error of a point of the cylinder that two devices triangulate.

    Parameters
    ----------
    first, second : float, rad
        Angles to the outward normal, signed, across the axis, of devices far away.
    """

    def height(angle: float) -> float:
        """Distance from the axis of the straight line whose bent ray ends on the point."""

        def turned(b: float) -> float:
            return float(np.arcsin(b / RADIUS_MM) + _sweep(b)) - abs(angle)

        most = RADIUS_MM * np.sin(abs(angle))
        return float(np.sign(angle) * brentq(turned, 0.9 * most, most, xtol=1e-15, rtol=1e-15))

    lines = np.array([(np.sin(angle), -np.cos(angle)) for angle in (first, second)])
    point = np.linalg.solve(lines, (height(first), height(second)))
    return float(1e3 * (point[0] - RADIUS_MM)), float(1e3 * point[1])


def of_each(form: Callable[[float], float], values: Sequence[float]) -> dict[float, float]:
    """Values of a closed form by its argument."""
    return {value: form(value) for value in values}


SLAB_SHIFT_UM = of_each(slab_shift_um, (15, 60, 85))
"""Shift by angle of incidence, degrees."""

CYLINDER_UM = of_each(cylinder_displacement_um, (0.25, 0.75, 0.95, 0.999))
"""Displacement by height over the axis, in radii."""
