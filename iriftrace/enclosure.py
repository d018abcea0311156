"""Which points lie inside a closed triangle surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iriftrace.shell_mesh import FloatArray, IntArray

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
