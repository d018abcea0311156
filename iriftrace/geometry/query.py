"""The nearest point of a triangle surface, and the triangle in which it lies."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import pyvista as pv
from attrs import field, frozen
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
from vtkmodules.vtkCommonCore import mutable
from vtkmodules.vtkCommonDataModel import vtkStaticCellLocator

from iriftrace.core.arrays import AnyIntArray, FloatArray, IntArray
from iriftrace.geometry.topology import area_vectors
from iriftrace.geometry.triangles import unit_vectors


@frozen(eq=False)
class NearestFace:
    """A triangle surface that is asked for its points nearest to others.

    Parameters
    ----------
    vertices : (n, 3) array, mm
    faces : (m, 3) array
    """

    vertices: FloatArray
    faces: IntArray
    _locator: vtkStaticCellLocator = field(init=False, repr=False)

    @_locator.default
    def _built(self) -> vtkStaticCellLocator:
        faces = np.insert(self.faces, 0, 3, axis=1).ravel()
        locator = vtkStaticCellLocator()
        locator.SetDataSet(pv.PolyData(np.asarray(self.vertices, dtype=np.float64), faces))
        locator.BuildLocator()
        return locator

    def find(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """Nearest points of the surface, and where they lie.

        Parameters
        ----------
        points : (k, 3) array, mm

        Returns
        -------
        foot : (k, 3) array, mm
        face : (k,) array
        """
        foot = np.empty((len(points), 3))
        face = np.empty(len(points), dtype=np.int64)
        # VTK's own types of numbers that a call changes are unknown to its stubs.
        find: Any = self._locator.FindClosestPoint
        point, square = [0.0] * 3, mutable(0.0)
        cell, piece = mutable(0), mutable(0)
        for i, place in enumerate(np.asarray(points, dtype=np.float64).tolist()):
            find(place, point, cell, piece, square)
            foot[i], face[i] = point, int(cell)
        return foot, face

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance (k,), mm, of points (k, 3), mm, from the surface."""
        places = np.asarray(points, dtype=np.float64)
        distance: FloatArray = np.linalg.norm(places - self.find(places)[0], axis=1)
        return distance


# MERGE enclosure: Which points lie inside a closed triangle surface.

_CHUNK = 1_000_000


def inside_closed(points: FloatArray, vertices: FloatArray, faces: IntArray) -> NDArray[np.bool_]:
    """Whether points lie inside a closed surface.

    Counts the triangles above each point: an odd number means inside. Points below an edge or a
    corner are decided in the same way for all triangles there, so none is counted twice or not at
    all. Triangles are looked up in a grid of columns, along the axis on which they cover the
    fewest.

    Parameters
    ----------
    points : (k, 3) array, mm
    vertices : (n, 3) array, mm
    faces : (m, 3) array

    Returns
    -------
    (k,) array of bool
    """
    points, vertices = np.asarray(points, dtype=np.float64), np.asarray(vertices, dtype=np.float64)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    inside = np.zeros(len(points), dtype=bool)
    near = np.flatnonzero(np.all((points >= low) & (points <= high), axis=1))
    if len(near) == 0:
        return inside
    extent = np.ptp(vertices[faces], axis=1)
    shadow = [np.sum(extent[:, (k + 1) % 3] * extent[:, (k + 2) % 3]) for k in range(3)]
    up = int(np.argmin(shadow * (high - low)))
    axes = np.array([(up + 1) % 3, (up + 2) % 3, up])
    columns = _Columns(vertices[:, axes], faces)
    for start in range(0, len(near), _CHUNK):
        chunk = near[start : start + _CHUNK]
        inside[chunk] = columns.crossings_above(points[np.ix_(chunk, axes)]) % 2 == 1
    return inside


class _Columns:
    """Triangles sorted into the columns of a square grid in x and y."""

    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        self.vertices, self.faces = vertices, faces
        self.low = vertices[:, :2].min(axis=0)
        size = np.maximum(np.ptp(vertices[:, :2], axis=0), 1e-12)
        self.count = np.clip((np.sqrt(4 * len(faces) / size.prod()) * size).astype(int), 1, 2000)
        self.width = size / self.count
        corners = vertices[faces][:, :, :2]
        first, last = self._column(corners.min(axis=1)), self._column(corners.max(axis=1))
        span = last - first + 1
        number = np.prod(span, axis=1)
        face = np.repeat(np.arange(len(faces)), number)
        step = np.arange(len(face)) - np.repeat(np.cumsum(number) - number, number)
        column = first[face] + np.stack(np.divmod(step, span[face, 1]), axis=1)
        key = column[:, 0] * self.count[1] + column[:, 1]
        order = np.argsort(key, kind="stable")
        self.face = face[order]
        self.start = np.searchsorted(key[order], np.arange(self.count.prod() + 1))

    def _column(self, position: FloatArray) -> IntArray:
        column: IntArray = np.clip(
            ((position - self.low) / self.width).astype(np.int64), 0, self.count - 1
        )
        return column

    def crossings_above(self, points: FloatArray) -> IntArray:
        """Number of triangles above each point."""
        column = self._column(points[:, :2])
        key = column[:, 0] * self.count[1] + column[:, 1]
        number = self.start[key + 1] - self.start[key]
        point = np.repeat(np.arange(len(points)), number)
        step = np.arange(len(point)) - np.repeat(np.cumsum(number) - number, number)
        face = self.face[self.start[key][point] + step]
        hit = _is_above(points[point], self.vertices, self.faces[face])
        return np.bincount(point[hit], minlength=len(points))


def _is_above(points: FloatArray, vertices: FloatArray, faces: IntArray) -> NDArray[np.bool_]:
    """Whether each triangle lies above its point (one triangle a point)."""
    weight = np.empty((3, len(points)))
    side = np.empty((3, len(points)), dtype=bool)
    for corner in range(3):
        start, end = faces[:, (corner + 1) % 3], faces[:, (corner + 2) % 3]
        # The same arithmetic whichever way a triangle runs along the edge.
        low, high = vertices[np.minimum(start, end)], vertices[np.maximum(start, end)]
        dx, dy = (points - low)[:, :2].T
        ex, ey = (high - low)[:, :2].T
        cross = ex * dy - ey * dx
        # A point on the line is decided as if it were moved by a little in x and less in y.
        tie = (ey < 0.0) | ((ey == 0.0) & (ex > 0.0))
        side[corner] = ((cross > 0.0) | ((cross == 0.0) & tie)) == (start < end)
        weight[corner] = np.where(start < end, cross, -cross)
    covers = (side[0] == side[1]) & (side[1] == side[2])
    total = weight.sum(axis=0)
    heights = vertices[faces.T, 2]
    with np.errstate(invalid="ignore", divide="ignore"):
        height = np.einsum("ij,ij->j", weight, heights) / total
    above: NDArray[np.bool_] = covers & (height > points[:, 2])
    return above


# MERGE surface_distance: Smallest distance between two triangle surfaces.


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
