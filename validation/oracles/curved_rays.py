r"""Rays through air that is known at every point, by Runge and Kutta's rule in double precision.

With the unit direction u and the length s the ray equation is
:math:`d\mathbf{u}/ds = (\nabla n - (\nabla n \cdot \mathbf{u})\,\mathbf{u}) / n`. Air outside the
data of a field bends nothing, as for both engines.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.flow.synthetic.model import SyntheticAir
from iriftrace.medium.air.refractivity import Air
from iriftrace.part.part import Part

FloatArray = NDArray[np.float64]
Medium = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""n - 1 and its gradient, 1/mm, at points (k, 3), mm."""

STEP_MM = 0.25
"""A thirtieth of the thinnest boundary layer: the rule's error is a millionth of the bending."""

LAST_MM = 0.2
"""Rays are straight within this distance of the part; the air bends them by 1e-6 mm at most."""

HITS_AT_A_TIME = 50


@frozen(eq=False)
class RoundCylinderAir:
    """A boundary layer around an exactly round cylinder about the x axis, and a plume.

    `SyntheticAir` of a part of facets has the facets' edges in it, which no mesh of a solver that
    was made for a cylinder resolves; the formula is the same.
    """

    like: SyntheticAir
    radius_mm: float
    half_length_mm: float

    @property
    def ambient_k(self) -> float:
        """Ambient temperature, K."""
        return self.like.ambient_k

    def at(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Temperature and its gradient, as `SyntheticAir.at`."""
        x, y, z = points.T
        radius = np.hypot(y, z)
        off = np.column_stack((np.abs(x) - self.half_length_mm, radius - self.radius_mm)).clip(0)
        distance = np.hypot(*off.T)
        outside = distance > 0
        to_end, to_side = off.T / np.where(outside, distance, 1.0)
        # On the wall itself the outward direction is along the radius.
        to_side = np.where(outside, to_side, 1.0)
        away = np.column_stack((to_end * np.sign(x), to_side * y / radius, to_side * z / radius))
        left = np.maximum(1.0 - distance / self.like.boundary_layer_mm, 0.0)
        layer, slope = left**2, (-2.0 * left / self.like.boundary_layer_mm)[:, None] * away
        plume, plume_slope = self.like.plume.excess(points)
        share = 1.0 - (1.0 - layer) * (1.0 - plume)
        gradient = (1.0 - plume)[:, None] * slope + (1.0 - layer)[:, None] * plume_slope
        excess = self.like.wall_k - self.like.ambient_k
        return self.like.ambient_k + excess * share, excess * gradient


def medium_of(air: SyntheticAir | RoundCylinderAir, light: Air, bounds: FloatArray) -> Medium:
    """The index of a synthetic air within bounds, (2, 3), mm; n - 1 falls with 1 / T."""

    def at(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        temperature, slope = air.at(points)
        refractivity = light.ambient_refractivity * air.ambient_k / temperature
        within = ((points >= bounds[0]) & (points <= bounds[1])).all(axis=1)
        factor = np.where(within, -refractivity / temperature, 0.0)
        return refractivity, factor[:, None] * slope

    return at


def first_hits(part: Part, origin: FloatArray, direction: FloatArray) -> FloatArray:
    """Distance to the part along each straight line, mm; inf where it misses."""
    a, b, c = part.vertices[part.faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    distance = np.full(len(origin), np.inf)
    for start in range(0, len(origin), HITS_AT_A_TIME):
        chunk = slice(start, start + HITS_AT_A_TIME)
        o, d = origin[chunk, None], direction[chunk, None]
        slope = (normal * d).sum(axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((a - o) * normal).sum(axis=-1) / slope
            point = o + t[..., None] * d
            inside = t > 0
            for corner, following in ((a, b), (b, c), (c, a)):
                side = np.cross(following - corner, point - corner)
                inside &= (side * normal).sum(axis=-1) >= 0
        distance[chunk] = np.where(inside, t, np.inf).min(axis=1)
    return distance


def displacements(
    part: Part,
    medium: Medium,
    origin: FloatArray,
    direction: FloatArray,
    way_mm: float,
    step_mm: float = STEP_MM,
) -> FloatArray:
    """Refracted minus straight hit, (r, 3), mm; NaN where one of both rays misses.

    Parameters
    ----------
    part : Part
    medium : callable
    origin, direction : (r, 3) arrays, mm and unit vectors
    way_mm : float
        Length of the paths before the part on which there is hot air.
    step_mm : float
        Where the gradient jumps, its error is that of one step there.
    """
    length = first_hits(part, origin, direction)
    straight = origin + length[:, None] * direction
    met = np.isfinite(length)
    place, heading = straight[met] - way_mm * direction[met], direction[met].copy()

    def rate(point: FloatArray, along: FloatArray) -> FloatArray:
        refractivity, gradient = medium(point)
        across = gradient - (gradient * along).sum(axis=1)[:, None] * along
        return np.asarray(across / (1 + refractivity)[:, None])

    steps = int(np.ceil((way_mm - LAST_MM) / step_mm))
    h = (way_mm - LAST_MM) / steps
    for _ in range(steps):
        k1 = rate(place, heading)
        k2 = rate(place + h / 2 * heading, heading + h / 2 * k1)
        k3 = rate(place + h / 2 * heading + h * h / 4 * k1, heading + h / 2 * k2)
        k4 = rate(place + h * heading + h * h / 2 * k2, heading + h * k3)
        place = place + h * heading + h * h / 6 * (k1 + k2 + k3)
        heading = heading + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        heading /= np.linalg.norm(heading, axis=1)[:, None]
    reached = first_hits(part, place, heading)
    found = np.full_like(origin, np.nan)
    # A ray that passes the edge it met straight may hit what lies far behind.
    near = reached < way_mm
    found[np.flatnonzero(met)[near]] = (place + reached[:, None] * heading - straight[met])[near]
    return found
