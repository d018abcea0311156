"""A tracer in float64 NumPy that shares no code with the engines: the reference for single rays.

It tests every triangle near a ray (Moeller and Trumbore, Journal of Graphics Tools 2 (1997) 21) and
refracts at the facets of the shells, by angles and tangents instead of the vector form.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.image.aov_image import Status

CORRIDOR_MM = 1.0
"""Triangles farther from a ray's straight line are tested only if the ray strays that far."""

LIMIT = 1000
"""Number of crossings at which a ray is given up, as in the shells engine."""


@frozen(eq=False)
class FacetSurface:
    """Triangles (m, 3, 3), mm, world, and the index outside and inside; opaque ones have none."""

    corners: FloatArray
    index: tuple[float, float] | None = None


@frozen(eq=False)
class FacetPath:
    """Path of one ray.

    Attributes
    ----------
    points : (k, 3) array, mm, world
        Start, crossings, and the hit if there is one.
    triangle : int
        Triangle of the opaque surfaces that was hit, counted over all of them; -1 for none.
    crossings : int
    edge_distance : float, mm
        Smallest distance of a crossing or hit to an edge of its triangle.
    strayed : float, mm
        Largest distance of a crossing from the straight line; of a ray that meets nothing more,
        also of what lies ahead of it.
    gave_up : bool
        The ray reached the limit of crossings.
    """

    points: FloatArray
    triangle: int
    crossings: int
    edge_distance: float
    strayed: float
    gave_up: bool = False

    @property
    def point(self) -> FloatArray | None:
        """(3,) array, mm: the hit; None without one."""
        return None if self.triangle < 0 else self.points[-1]


class FacetTracer:
    """Rays through shells onto opaque surfaces, of which the first one is the part."""

    def __init__(self, shells: Sequence[FacetSurface], opaque: Sequence[FacetSurface]) -> None:
        surfaces = [*shells, *opaque]
        self._corners = np.concatenate([surface.corners for surface in surfaces])
        counts = [len(surface.corners) for surface in surfaces]
        self._first = sum(counts[: len(shells)])
        self._part = len(opaque[0].corners)
        pairs = [surface.index or (1.0, 1.0) for surface in surfaces]
        self._outside, self._inside = (np.repeat(side, counts) for side in zip(*pairs, strict=True))
        self._centre = self._corners.mean(axis=1)
        to_corner = np.linalg.norm(self._corners - self._centre[:, None], axis=2)
        self._radius = to_corner.max(axis=1) + 1e-6
        self._size = float(np.linalg.norm(np.ptp(self._corners, axis=(0, 1))))

    def trace(self, origin: FloatArray, direction: FloatArray, limit: int = LIMIT) -> FacetPath:
        """Follow a ray, (3,) mm and unit vector, to an opaque surface or out of the scene."""
        near = self._corridor(origin, direction, CORRIDOR_MM)
        path = self._trace(origin, direction, near, limit)
        if path.strayed > CORRIDOR_MM:
            return self._trace(origin, direction, np.arange(len(self._corners)), limit)
        return path

    def status(self, origin: FloatArray, direction: FloatArray, path: FacetPath) -> Status:
        """Status of a path, as that of the engines without focus and without their index check."""
        if path.gave_up:
            return Status.GAVE_UP
        opaque = np.arange(self._first, len(self._corners))
        straight = self._nearest(origin, direction, opaque)
        first = -1 if straight is None else straight[0] - self._first
        if max(first, path.triangle) >= self._part:
            return Status.BLOCKED
        if first < 0:
            return Status.MISSED if path.triangle < 0 else Status.ONLY_REFRACTED
        return Status.REFRACTED_MISSED if path.triangle < 0 else Status.GOOD

    def _corridor(self, origin: FloatArray, direction: FloatArray, width: float) -> IntArray:
        """Numbers of all triangles that come within `width` of a straight line."""
        to_centre = self._centre - origin
        squared = (to_centre**2).sum(axis=1) - (to_centre @ direction) ** 2
        return np.flatnonzero(squared <= (self._radius + width) ** 2)

    def _nearest(
        self, origin: FloatArray, direction: FloatArray, candidates: IntArray
    ) -> tuple[int, float, float, float] | None:
        """Triangle, distance and barycentric coordinates of the first hit."""
        a, b, c = self._corners[candidates].transpose(1, 0, 2)
        e1, e2 = b - a, c - a
        p = np.cross(direction, e2)
        determinant = (e1 * p).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = origin - a
            u = (s * p).sum(axis=1) / determinant
            q = np.cross(s, e1)
            v = (q @ direction) / determinant
            t = (e2 * q).sum(axis=1) / determinant
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-9)
        if not hit.any():
            return None
        first = np.flatnonzero(hit)[np.argmin(t[hit])]
        return int(candidates[first]), float(t[first]), float(u[first]), float(v[first])

    def _trace(
        self, origin: FloatArray, direction: FloatArray, candidates: IntArray, limit: int
    ) -> FacetPath:
        start, heading, points = origin, direction, [origin]
        skip, closest, strayed = -1, np.inf, 0.0
        for crossings in range(limit):
            found = self._nearest(origin, direction, candidates[candidates != skip])
            if found is None:
                strayed = max(
                    strayed, float(np.linalg.norm(np.cross(direction, heading))) * self._size
                )
                return FacetPath(np.array(points), -1, crossings, closest, strayed)
            skip, distance, u, v = found
            origin = origin + distance * direction
            points.append(origin)
            strayed = max(strayed, float(np.linalg.norm(np.cross(origin - start, heading))))
            closest = min(closest, self._edge_distance(skip, u, v))
            if skip >= self._first:
                end = skip - self._first
                return FacetPath(np.array(points), end, crossings, closest, strayed)
            direction = self._bent(skip, direction)
        return FacetPath(np.array(points), -1, limit, closest, strayed, gave_up=True)

    def _edge_distance(self, triangle: int, u: float, v: float) -> float:
        a, b, c = self._corners[triangle]
        area2 = np.linalg.norm(np.cross(b - a, c - a))
        lengths = np.linalg.norm([c - b, c - a, b - a], axis=1)
        return float(np.min(np.array([1 - u - v, u, v]) * area2 / lengths))

    def _bent(self, triangle: int, direction: FloatArray) -> FloatArray:
        a, b, c = self._corners[triangle]
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        n1, n2 = self._outside[triangle], self._inside[triangle]
        if direction @ normal >= 0:
            n1, n2, normal = n2, n1, -normal
        tangential = direction - (direction @ normal) * normal
        sine = np.linalg.norm(tangential)
        if sine < 1e-300:
            return direction
        tangent = tangential / sine
        cosine = -(direction @ normal)
        # The angles, and not their cosines, are subtracted: nothing cancels.
        angle = np.arctan2(sine, cosine)
        sine_out = n1 / n2 * sine
        if sine_out > 1:
            return np.asarray(direction + 2 * cosine * normal)
        out = np.arctan2(sine_out, np.sqrt((1 - sine_out) * (1 + sine_out)))
        turn = out - angle
        along = np.sin(angle + turn) * tangent - np.cos(angle + turn) * normal
        return np.asarray(along / np.linalg.norm(along))
