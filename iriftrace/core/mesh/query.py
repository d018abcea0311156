"""Nearest points, the inside and the gaps of triangle surfaces."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import field, frozen
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray, as_float64
from iriftrace.core.blocks import blocks
from iriftrace.core.mesh.triangles import area_vectors, polydata, unit_vectors, used_vertices
from iriftrace.core.sampling import r2_sequence

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkStaticCellLocator

_ON_SURFACE_MM = 1e-9
"""Closer than this, the direction to the nearest point is rounding; the face's normal holds."""

GAP_SAMPLE = 10_000
"""Vertices of each surface between which the smallest gap is looked for."""

_CHUNK = 1 << 18
"""Triangles that are sorted into columns, and points whose triangles above are counted, at once."""


def _int64(values: ArrayLike) -> IntArray:
    return np.asarray(values, dtype=np.int64)


@frozen(eq=False)
class Places:
    """Points on the faces of a surface; all points of a face stand for equal parts of its area."""

    face: IntArray  # (n,) ascending
    position: FloatArray  # (n, 3), mm


@frozen(eq=False)
class Surface:
    """A triangle surface for queries of distances and of inside or outside.

    Parameters
    ----------
    vertices : (n, 3) array_like, mm
    faces : (m, 3) array_like
        Vertex numbers.
    """

    vertices: FloatArray = field(converter=as_float64)
    faces: IntArray = field(converter=_int64)

    @cached_property
    def areas(self) -> FloatArray:
        """(m,) areas of the triangles, mm^2."""
        return as_float64(np.linalg.norm(area_vectors(self.vertices, self.faces), axis=1))

    @cached_property
    def normals(self) -> FloatArray:
        """(m, 3) unit normals of the triangles."""
        return unit_vectors(area_vectors(self.vertices, self.faces))

    @cached_property
    def corners(self) -> FloatArray:
        """(c, 3) vertices that the triangles use, mm."""
        return self.vertices[used_vertices(len(self.vertices), self.faces)[0]]

    def even_places(self, count: int) -> tuple[FloatArray, IntArray]:
        """Points on the surface, as many on every area, (count, 3), mm, and their faces (count,).

        Within the triangles by Roberts' R2 sequence (2018); always the same.
        """
        number = np.arange(count)
        area = np.cumsum(self.areas)
        face = np.searchsorted(area, (number + 0.5) / count * area[-1])
        return self._within(face), face

    def places_on_faces(self, fewest: int) -> Places:
        """At least so many places, as even as `even_places`, but on every face at least one."""
        area = np.cumsum(self.areas)
        # The numbers of the faces differ from their areas by less than one, also when added up.
        ends = np.floor(area * (fewest / (area[-1] or 1.0)) + 0.5)
        face = np.repeat(
            np.arange(len(area)), np.maximum(np.diff(ends, prepend=0.0), 1.0).astype(np.int64)
        )
        return Places(face, self._within(face))

    def _within(self, face: IntArray) -> FloatArray:
        """Points (n, 3), mm, within triangles (n,), spread evenly where a triangle has several."""
        u, v = r2_sequence(len(face), 0.5).T
        over = u + v > 1.0
        weights = np.stack((np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)), axis=1)
        corners = self.vertices[self.faces[face]]
        edges = corners[:, 1:] - corners[:, :1]
        return as_float64(corners[:, 0] + np.einsum("ij,ijk->ik", weights, edges))

    @cached_property
    def _locator(self) -> vtkStaticCellLocator:
        from vtkmodules.vtkCommonDataModel import vtkStaticCellLocator

        locator = vtkStaticCellLocator()
        locator.SetDataSet(polydata(self.vertices, self.faces))
        locator.BuildLocator()
        return locator

    def nearest(self, points: ArrayLike) -> tuple[FloatArray, IntArray]:
        """Nearest points of the surface to points (k, 3), mm: (k, 3), mm, and their faces (k,).

        The face is one of the triangles that are nearest; never one without an area.
        """
        from vtkmodules.vtkCommonCore import mutable

        places = as_float64(points)
        foot = np.empty((len(places), 3))
        face = np.empty(len(places), dtype=np.int64)
        # VTK's own types of numbers that a call changes are unknown to its stubs.
        find: Any = self._locator.FindClosestPoint
        cell: Any = mutable(0)
        point, square, piece = [0.0] * 3, mutable(0.0), mutable(0)
        for rows in blocks(len(places)):
            feet, cells = [], []
            # Coordinates by axis: a list for each point would be counted by the garbage collector.
            for place in zip(*places[rows].T.tolist(), strict=True):
                find(place, point, cell, piece, square)
                feet += point
                cells.append(cell.get())
            foot[rows], face[rows] = np.reshape(feet, (-1, 3)), cells
        return foot, face

    def within(self, points: FloatArray, limit: float, rows: IntArray) -> BoolArray:
        """Mask (m,) of the rows (m,) of points, mm, that are at most a limit, mm, away."""
        from vtkmodules.vtkCommonCore import mutable
        from vtkmodules.vtkCommonDataModel import vtkGenericCell

        find: Any = self._locator.FindClosestPointWithinRadius
        rest = [0.0] * 3, vtkGenericCell(), mutable(0), mutable(0), mutable(0.0)
        low, high = self.corners.min(axis=0) - limit, self.corners.max(axis=0) + limit
        near = np.zeros(len(rows), dtype=bool)
        for block in blocks(len(rows)):
            places = points[rows[block]]
            in_box = ((places >= low) & (places <= high)).all(axis=1)
            found = [
                find(place, limit, *rest) for place in zip(*places[in_box].T.tolist(), strict=True)
            ]
            near[block][in_box] = found
        return near

    def distance(self, points: ArrayLike) -> FloatArray:
        """Distance (k,), mm, of points (k, 3), mm, from the surface."""
        return as_float64(np.linalg.norm(as_float64(points) - self.nearest(points)[0], axis=1))

    def distance_gradient(self, points: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Distance (k,), mm, of points (k, 3), mm, from the surface, and its gradient.

        The points are outside a closed surface or on it. The gradient (k, 3) are unit vectors from
        the nearest point of the surface; on the surface its normal. Where several points of the
        surface are equally near, that of one of them.
        """
        foot, face = self.nearest(points)
        offset = as_float64(points) - foot
        distance = np.linalg.norm(offset, axis=1)
        away = distance > _ON_SURFACE_MM
        gradient = self.normals[face]
        gradient[away] = offset[away] / distance[away, None]
        return distance, gradient

    def gap(self, other: Surface) -> float:
        """Smallest distance between two surfaces, mm.

        The smallest distance from a vertex of either, of every so many where there are more than
        `GAP_SAMPLE`, to the triangles of the other. Two edges may pass each other still closer; on
        finely meshed surfaces that differs by a small part of a triangle's size.
        """
        pairs = (self, other.corners), (other, self.corners)
        least = math.inf
        for one, points in pairs:
            chosen = points[:: max(1, len(points) // GAP_SAMPLE)]
            least = one._distance_below(chosen, least)
        return least

    def _distance_below(self, points: FloatArray, limit: float) -> float:
        """The smallest distance of the points from the surface, if it is below a limit, mm."""
        from vtkmodules.vtkCommonCore import mutable
        from vtkmodules.vtkCommonDataModel import vtkGenericCell

        find: Any = self._locator.FindClosestPointWithinRadius
        corners, point = vtkGenericCell(), [0.0] * 3
        square: Any = mutable(0.0)
        cell, piece = mutable(0), mutable(0)
        limit = min(limit, float(self.distance(points[:1])[0]))
        for place in points.tolist():
            if find(place, limit, point, corners, cell, piece, square):
                limit = math.sqrt(square)
        return limit

    def inside(self, points: ArrayLike) -> BoolArray:
        """True, (k,), for points (k, 3), mm, inside the surface, which has to be closed.

        Counts the triangles above each point: an odd number means inside. Points below an edge or a
        corner are decided in the same way for all triangles there, so none is counted twice or not
        at all. (VTK's tests by random rays and by the sign of the distance are wrong near the edges
        of a gear's teeth, and are 7 and 40 times slower for the points of a mesh.)
        """
        places = as_float64(points)
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        inside = np.zeros(len(places), dtype=bool)
        near = np.flatnonzero(np.all((places >= low) & (places <= high), axis=1))
        for some in blocks(len(near), _CHUNK):
            chunk = near[some]
            inside[chunk] = self._columns.crossings_above(places[chunk]) % 2 == 1
        return inside

    @cached_property
    def _columns(self) -> _Columns:
        return _Columns(self.vertices, self.faces)


class _Columns:
    """Triangles sorted into columns along the axis on which they cover the fewest of them."""

    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        shadow = np.zeros(3)
        for chunk in blocks(len(faces), _CHUNK):
            extent = np.ptp(vertices[faces[chunk]], axis=1)
            shadow += [np.sum(extent[:, (k + 1) % 3] * extent[:, (k + 2) % 3]) for k in range(3)]
        up = int(np.argmin(shadow * np.ptp(vertices, axis=0)))
        self.axes = np.array([(up + 1) % 3, (up + 2) % 3, up])
        self.vertices, self.faces = vertices[:, self.axes], faces
        self.low = self.vertices[:, :2].min(axis=0)
        size = np.maximum(np.ptp(self.vertices[:, :2], axis=0), 1e-12)
        self.count = np.clip((np.sqrt(4 * len(faces) / size.prod()) * size).astype(int), 1, 1000)
        self.width = size / self.count
        keys, owners = [np.zeros(0, dtype=np.int32)], [np.zeros(0, dtype=np.int32)]
        for chunk in blocks(len(faces), _CHUNK):
            corners = self.vertices[faces[chunk], :2]
            first, last = self._column(corners.min(axis=1)), self._column(corners.max(axis=1))
            span = last - first + 1
            face, step = runs(span.prod(axis=1))
            column = first[face] + np.stack(np.divmod(step, span[face, 1]), axis=1)
            keys.append(self._key(column).astype(np.int32))
            owners.append((face + chunk.start).astype(np.int32))
        places = np.concatenate(keys), np.concatenate(owners)
        of_columns = csr_array(
            (np.ones(len(places[0]), dtype=bool), places),
            shape=(int(self.count.prod()), len(faces)),
        )
        self.face, self.start = of_columns.indices, of_columns.indptr

    def _column(self, position: FloatArray) -> IntArray:
        column: IntArray = ((position - self.low) / self.width).astype(np.int64)
        return column.clip(0, self.count - 1)

    def _key(self, column: IntArray) -> IntArray:
        return np.asarray(column[:, 0] * self.count[1] + column[:, 1])

    def crossings_above(self, points: FloatArray) -> IntArray:
        """Number of triangles above each point."""
        places = points[:, self.axes]
        key = self._key(self._column(places[:, :2]))
        point, step = runs(self.start[key + 1] - self.start[key])
        faces = self.faces[self.face[self.start[key][point] + step]]
        above = self._is_above(places[point], faces)
        return np.bincount(point[above], minlength=len(points))

    def _is_above(self, points: FloatArray, faces: IntArray) -> BoolArray:
        """True for each triangle above its point (one triangle a point)."""
        weight = np.empty((3, len(points)))
        side = np.empty((3, len(points)), dtype=bool)
        for corner in range(3):
            start, end = faces[:, (corner + 1) % 3], faces[:, (corner + 2) % 3]
            # The same arithmetic whichever way a triangle runs along the edge.
            low, high = self.vertices[np.minimum(start, end)], self.vertices[np.maximum(start, end)]
            dx, dy = (points - low)[:, :2].T
            ex, ey = (high - low)[:, :2].T
            cross = ex * dy - ey * dx
            # A point on the line is decided as if it were moved by a little in x and less in y.
            tie = (ey < 0.0) | ((ey == 0.0) & (ex > 0.0))
            side[corner] = ((cross > 0.0) | ((cross == 0.0) & tie)) == (start < end)
            weight[corner] = np.where(start < end, cross, -cross)
        covers = (side[0] == side[1]) & (side[1] == side[2])
        with np.errstate(invalid="ignore", divide="ignore"):
            heights = self.vertices[faces.T, 2]
            height = np.einsum("ij,ij->j", weight, heights) / weight.sum(axis=0)
        return np.asarray(covers & (height > points[:, 2]))


def runs(lengths: IntArray) -> tuple[IntArray, IntArray]:
    """For runs of given lengths one after the other: number of the run, and place in it."""
    run = np.repeat(np.arange(len(lengths)), lengths)
    return run, np.arange(len(run)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
