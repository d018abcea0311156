"""The free-form solid of a wishbone: two swept arms, a brace and three hubs with bores."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.parts.blends import rounded_cylinder, smooth_difference, smooth_union

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

PIECES = ("arms", "brace", "ball hub", "bushes")

HALF_BUSH_MM = 15.0
"""Half the length of a bush."""

_STATIONS = 60
"""Ellipsoids that make up an arm."""

_ARM_FLATTENING, _BRACE_FLATTENING = 0.72, 0.7
_BRACE_RADIUS, _BRACE_HEIGHT, _BRACE_CURVATURE = 5.0, 5.0, 0.0016
_HUB_ENDS = (-12.0, 14.0)
_EDGE = 1.5
_FAR = 60.0


@frozen
class WishboneShape:
    """Signed distance of a wishbone, symmetric about x = 0; lengths in mm.

    Attributes
    ----------
    bush_distance
        Between the middles of the bushes, which lie along x.
    depth
        From the ball hub, whose axis is z, to the bushes' axis, along y.
    rise
        Height of the arms' control points above the hubs.
    thickness
        Factor on the arms' section.
    hub_radius, hub_bore, bush_radius, bush_bore
        Outer and bore radii.
    """

    bush_distance: float
    depth: float
    rise: float
    thickness: float
    hub_radius: float
    hub_bore: float
    bush_radius: float
    bush_bore: float

    @property
    def extent(self) -> tuple[tuple[float, float], ...]:
        """Lowest and highest x, y, z of a box around the solid, mm."""
        half, back = 0.5 * self.bush_distance, 0.5 * self.depth
        wide = half + HALF_BUSH_MM + 6.0
        across = back + max(self.hub_radius, self.bush_radius + 4.0) + 4.0
        low = max(-_HUB_ENDS[0], self.bush_radius) + 10.0
        high = max(_HUB_ENDS[1], self.bush_radius) + 5.0 + self.rise
        return (-wide, wide), (-across, across), (-low, high)

    def pieces(self, points: FloatArray) -> dict[str, FloatArray]:
        """Signed distance of each of `PIECES` at (..., 3) points, mm, bores not taken out."""
        x, y, z = np.abs(points[..., 0]), points[..., 1], points[..., 2]
        half, back = 0.5 * self.bush_distance, 0.5 * self.depth
        brace = np.hypot(y + 2.0 + _BRACE_CURVATURE * x**2, (z - _BRACE_HEIGHT) / _BRACE_FLATTENING)
        brace_end = half - 25.0
        return {
            "arms": self._arms(x, y, z),
            "brace": np.maximum(brace - _BRACE_RADIUS, x - brace_end),
            "ball hub": rounded_cylinder(
                np.hypot(x, y - back), z, self.hub_radius, _HUB_ENDS, _EDGE
            ),
            "bushes": rounded_cylinder(
                np.hypot(y + back, z),
                x - half,
                self.bush_radius,
                (-HALF_BUSH_MM, HALF_BUSH_MM),
                _EDGE,
            ),
        }

    def distance(self, points: FloatArray) -> FloatArray:
        """Signed distance of the solid at (..., 3) points, mm; exact only near its surface."""
        pieces = self.pieces(points)
        solid = smooth_union(pieces["arms"], pieces["brace"], 8.0)
        solid = smooth_union(solid, pieces["ball hub"], 6.0)
        solid = smooth_union(solid, pieces["bushes"], 6.0)
        for bore in self._bores(points):
            solid = smooth_difference(solid, bore, 1.0)
        return solid

    def _bores(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        x, y, z = np.abs(points[..., 0]), points[..., 1], points[..., 2]
        half, back = 0.5 * self.bush_distance, 0.5 * self.depth
        through = (-_FAR, _FAR)
        return (
            rounded_cylinder(np.hypot(x, y - back), z, self.hub_bore, through, _EDGE),
            rounded_cylinder(np.hypot(y + back, z), x - half, self.bush_bore, through, _EDGE),
        )

    def _arms(self, x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
        """Ellipsoids along a cubic Bezier curve from the ball hub to a bush."""
        half, back = 0.5 * self.bush_distance, 0.5 * self.depth
        share = np.linspace(0.0, 1.0, _STATIONS)
        rest = 1.0 - share
        control = np.array(
            [
                (0.0, back, 0.0),
                (34.0 / 75.0 * half, 40.0 / 44.0 * back, self.rise),
                (58.0 / 75.0 * half, 2.0 / 44.0 * back, self.rise),
                (half - 1.0, 2.0 - back, 0.0),
            ]
        )
        weights = np.stack((rest**3, 3 * rest**2 * share, 3 * rest * share**2, share**3))
        radii = self.thickness * (
            6.0 + 4.5 * rest**2 + 2.0 * share**3 - 1.2 * np.sin(np.pi * share)
        )
        nearest = np.full(np.shape(x), np.inf)
        for (px, py, pz), radius in zip(weights.T @ control, radii, strict=True):
            flat = ((z - pz) / _ARM_FLATTENING) ** 2
            distance = np.sqrt((x - px) ** 2 + (y - py) ** 2 + flat) - radius
            nearest = np.minimum(nearest, distance)
        return 0.9 * nearest
