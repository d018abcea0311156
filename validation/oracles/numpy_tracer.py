"""An independent tracer in float64 NumPy: brute force over all triangles, facet normals.

Shares no code with the plugins: its own PLY reading (through trimesh), intersection (Moeller and
Trumbore 1997) and refraction (angles and tangents instead of the vector form).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh

CORRIDOR_MM = 1.0
"""Triangles farther from a ray's straight line are looked at only if the ray strays that far."""


@dataclass
class Ending:
    """End of one ray."""

    point: np.ndarray | None
    crossings: int
    edge_distance: float  # smallest distance of a crossing to an edge of its triangle, mm
    strayed: float  # largest distance of a crossing from the straight line, mm


class NumpyTracer:
    """All triangles of a scene folder, part last."""

    def __init__(self, xml: Path) -> None:
        corners, outside, inside = [], [], []
        self.part_first = 0
        shapes = sorted(
            ElementTree.parse(xml).getroot().iter("shape"), key=lambda s: s.get("id") == "part"
        )
        for shape in shapes:
            values = {child.get("name"): child.get("value") for child in shape.iter()}
            mesh = trimesh.load(xml.parent / values["filename"], process=False)
            triangles = np.asarray(mesh.vertices, dtype=np.float64)[mesh.faces]
            if shape.get("id") == "part":
                self.part_first = sum(len(c) for c in corners)
            corners.append(triangles)
            outside.append(np.full(len(triangles), float(values.get("ext_ior", 1))))
            inside.append(np.full(len(triangles), float(values.get("int_ior", 1))))
        self.corners = np.concatenate(corners)
        self.outside, self.inside = np.concatenate(outside), np.concatenate(inside)
        self.edge1 = self.corners[:, 1] - self.corners[:, 0]
        self.edge2 = self.corners[:, 2] - self.corners[:, 0]
        self.centre = self.corners.mean(axis=1)
        self.radius = np.linalg.norm(self.corners - self.centre[:, None], axis=2).max(axis=1) + 1e-6

    def corridor(self, origin, direction, width):
        """Numbers of all triangles that come within `width` of a straight line."""
        to_centre = self.centre - origin
        squared = (to_centre**2).sum(axis=1) - (to_centre @ direction) ** 2
        return np.flatnonzero(squared <= (self.radius + width) ** 2)

    def nearest(self, origin, direction, candidates):
        """Triangle, distance and barycentric coordinates of the first hit."""
        e1, e2 = self.edge1[candidates], self.edge2[candidates]
        p = np.cross(direction, e2)
        determinant = (e1 * p).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = origin - self.corners[candidates, 0]
            u = (s * p).sum(axis=1) / determinant
            q = np.cross(s, e1)
            v = (q @ direction) / determinant
            t = (e2 * q).sum(axis=1) / determinant
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-9)
        if not hit.any():
            return None
        first = np.flatnonzero(hit)[np.argmin(t[hit])]
        return candidates[first], t[first], u[first], v[first]

    def trace(self, origin, direction, limit=200) -> Ending:
        """Follow one ray to the part, or out of the scene."""
        ending = self._trace(
            origin, direction, self.corridor(origin, direction, CORRIDOR_MM), limit
        )
        if ending.strayed > CORRIDOR_MM:
            return self._trace(origin, direction, np.arange(len(self.corners)), limit)
        return ending

    def _trace(self, origin, direction, candidates, limit) -> Ending:
        start, heading = origin, direction
        skip, crossings, closest, strayed = -1, 0, np.inf, 0.0
        while crossings < limit:
            found = self.nearest(origin, direction, candidates[candidates != skip])
            if found is None:
                return Ending(None, crossings, closest, strayed)
            skip, distance, u, v = found
            origin = origin + distance * direction
            strayed = max(strayed, float(np.linalg.norm(np.cross(origin - start, heading))))
            closest = min(closest, self._edge_distance(skip, u, v))
            if skip >= self.part_first:
                return Ending(origin, crossings, closest, strayed)
            direction = self._bend(skip, direction)
            crossings += 1
        return Ending(None, crossings, closest, strayed)

    def _edge_distance(self, triangle, u, v):
        a, b, c = self.corners[triangle]
        area2 = np.linalg.norm(np.cross(b - a, c - a))
        lengths = np.linalg.norm([c - b, c - a, b - a], axis=1)
        return float(np.min(np.array([1 - u - v, u, v]) * area2 / lengths))

    def _bend(self, triangle, direction):
        normal = np.cross(self.edge1[triangle], self.edge2[triangle])
        normal /= np.linalg.norm(normal)
        inward = direction @ normal < 0
        n1, n2 = self.outside[triangle], self.inside[triangle]
        if not inward:
            n1, n2, normal = n2, n1, -normal
        tangential = direction + (-(direction @ normal)) * normal
        sine = np.linalg.norm(tangential)
        if sine < 1e-300:
            return direction
        tangent = tangential / sine
        cosine = -(direction @ normal)
        # The angles, and not their cosines, are subtracted: nothing cancels.
        angle = np.arctan2(sine, cosine)
        sine_out = n1 / n2 * sine
        if sine_out > 1:
            return direction + 2 * cosine * normal
        out = np.arctan2(sine_out, np.sqrt((1 - sine_out) * (1 + sine_out)))
        turn = out - angle
        along = np.sin(angle + turn) * tangent - np.cos(angle + turn) * normal
        return along / np.linalg.norm(along)
