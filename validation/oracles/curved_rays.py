"""Air around an exactly round cylinder, and exact rays to a part that is hit by brute force."""

from __future__ import annotations

from functools import partial

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.flow.synthetic.model import SyntheticAir
from iriftrace.measuring.uncertainty.known_air import Known
from iriftrace.measuring.uncertainty.known_air import displacements as displacements_of
from iriftrace.part.part import Part

FloatArray = NDArray[np.float64]

STEP_MM = 0.25
"""A thirtieth of the thinnest boundary layer: the rule's error is a millionth of the bending."""

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
    medium: Known,
    origin: FloatArray,
    direction: FloatArray,
    way_mm: float,
    step_mm: float = STEP_MM,
) -> FloatArray:
    """`known_air.displacements` with the hits of `first_hits`."""
    return displacements_of(partial(first_hits, part), medium, origin, direction, way_mm, step_mm)
