"""Smallest distance between two triangle surfaces."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from attrs import field, frozen
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from iriftrace.shell_mesh import AnyIntArray, FloatArray, IntArray, area_vectors
from iriftrace.triangles import unit_vectors


def _float64(values: ArrayLike) -> FloatArray:
    return np.asarray(values, dtype=np.float64)


# Vertices whose distance is computed exactly, and triangles tried for each.
_CANDIDATES = 1024
_TRIANGLES = 8


@frozen(eq=False, slots=False)
class Surface:
    """A triangle surface that is asked for distances.

    Parameters
    ----------
    vertices : (n, 3) array, mm
    faces : (m, 3) array
    """

    vertices: FloatArray = field(converter=_float64)
    faces: AnyIntArray

    @cached_property
    def _area_vectors(self) -> FloatArray:
        return area_vectors(self.vertices, self.faces)

    @cached_property
    def areas(self) -> FloatArray:
        """(m,) areas of the triangles, mm^2."""
        areas: FloatArray = np.linalg.norm(self._area_vectors, axis=1)
        return areas

    @cached_property
    def normals(self) -> FloatArray:
        """(m, 3) unit normals of the triangles."""
        return unit_vectors(self._area_vectors)

    @cached_property
    def samples(self) -> tuple[cKDTree, IntArray]:
        """Tree of points all over the surface, and the triangle of each.

        The centres of the triangles, which are first halved at their longest edge where they are
        much larger than the others, so that the long strips of CAD surfaces have points everywhere.
        """
        corners = self.vertices[self.faces]
        limit = 16.0 * self.areas.sum() / max(len(corners), 20_000)
        owner = np.arange(len(corners))
        done, owners = [], []
        while len(corners):
            longest, square = _longest_edges(corners)
            short = square <= limit
            done.append(corners[short].sum(axis=1) / 3.0)
            owners.append(owner[short])
            long = ~short
            corners, owner = _halved(corners[long], longest[long]), np.tile(owner[long], 2)
        return cKDTree(np.concatenate(done), balanced_tree=False), np.concatenate(owners)

    def distance(self, points: FloatArray) -> float:
        """Smallest distance of any of the points to the triangles around them, mm."""
        tree, owner = self.samples
        faces = owner[tree.query(points, k=min(_TRIANGLES, len(owner)))[1].reshape(len(points), -1)]
        a, b, c = (self.vertices[self.faces[faces.ravel(), corner]] for corner in range(3))
        repeated = np.repeat(points, faces.shape[1], axis=0)
        return float(point_triangle_distance(repeated, a, b, c).min())


def gap(one: Surface, other: Surface) -> float:
    """Smallest distance between two surfaces, mm.

    The smallest of vertex-to-triangle distances both ways, exact at the vertices where the surfaces
    are closest by a quick estimate. Two edges may pass each other still closer; on finely meshed
    surfaces that differs by a small part of a triangle's size.
    """
    return min(_smallest_distance(one, other), _smallest_distance(other, one))


def _smallest_distance(one: Surface, other: Surface) -> float:
    """Smallest distance from the vertices of one surface to the triangles of another."""
    tree, owner = other.samples
    # Vertices much farther away than the nearest of a few need no search.
    size = np.sqrt(other.areas)
    farthest = tree.query(one.vertices[::16])[0].min() + 4.0 * size.mean()
    rough, sample = tree.query(one.vertices, distance_upper_bound=farthest, workers=-1)
    found = np.flatnonzero(np.isfinite(rough))
    points, rough, sample = one.vertices[found], rough[found], sample[found]
    # A triangle's centre may be much farther than its plane; but beyond the border of a surface a
    # vertex may lie in the plane of a triangle and yet be far from it.
    face = owner[sample]
    height = np.abs(np.einsum("ij,ij->i", points - tree.data[sample], other.normals[face]))
    beside = np.sqrt(np.maximum(rough**2 - height**2, 0.0)) - 2.0 * size[face]
    estimate = np.hypot(height, np.maximum(beside, 0.0))
    if len(points) > _CANDIDATES:
        points = points[np.argpartition(estimate, _CANDIDATES)[:_CANDIDATES]]
    return other.distance(points)


def point_triangle_distance(
    points: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray
) -> FloatArray:
    """Distances (k,) of points to triangles, all (k, 3) arrays, mm."""
    best = np.full(len(points), np.inf)
    inside = np.ones(len(points), dtype=bool)
    normal = np.cross(b - a, c - a)
    for start, end in ((a, b), (b, c), (c, a)):
        edge, to_point = end - start, points - start
        length = np.maximum(np.einsum("ij,ij->i", edge, edge), np.finfo(float).tiny)
        along = np.clip(np.einsum("ij,ij->i", to_point, edge) / length, 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(to_point - along[:, None] * edge, axis=1))
        inside &= np.einsum("ij,ij->i", np.cross(edge, to_point), normal) >= 0.0
    area = np.linalg.norm(normal, axis=1)
    height = np.abs(np.einsum("ij,ij->i", points - a, normal)) / np.where(area > 0.0, area, 1.0)
    return np.where(inside & (area > 0.0), height, best)


def _longest_edges(corners: FloatArray) -> tuple[IntArray, FloatArray]:
    """Corner at which each triangle's longest edge starts, and its squared length."""
    edge = np.roll(corners, -1, axis=1) - corners
    square = np.einsum("ijk,ijk->ij", edge, edge)
    return np.argmax(square, axis=1), square.max(axis=1)


def _halved(corners: FloatArray, longest: IntArray) -> FloatArray:
    """Both halves of triangles cut at the middle of the edge that starts at a given corner."""
    turn = (longest[:, None] + np.arange(3)) % 3
    start, end, apex = np.take_along_axis(corners, turn[:, :, None], axis=1).transpose(1, 0, 2)
    middle = 0.5 * (start + end)
    halves = ((start, middle, apex), (middle, end, apex))
    return np.concatenate([np.stack(half, axis=1) for half in halves])
