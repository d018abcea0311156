"""Cells of a field cut smaller, without any new information about the air."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.medium.index_field import IndexField

# Corner numbers 0 to 3 are the tetrahedron's own, 4 to 9 the middles of these edges.
_EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
_EIGHTHS = (
    *((0, 4, 5, 6), (4, 1, 7, 8), (5, 7, 2, 9), (6, 8, 9, 3)),
    # The octahedron in the middle, about the diagonal from edge 0-1 to edge 2-3.
    *((4, 9, 5, 6), (4, 9, 6, 8), (4, 9, 8, 7), (4, 9, 7, 5)),
)


def as_tetrahedra(field: IndexField) -> IndexField:
    """The same points and values with every cell divided into tetrahedra with common faces.

    On tetrahedra the index is linear, on other cells it is not: surfaces of equal index differ
    between the two by the second order of the cells' size.
    """
    divided = field.grid.triangulate()
    corners = np.asarray(divided.cell_connectivity, dtype=np.int64).reshape(-1, 4)
    return _field(field, np.asarray(divided.points), field.refractivity, corners)


def split_tetrahedra(field: IndexField) -> IndexField:
    """Every cell of a field of tetrahedra divided into eight at the middles of its edges.

    The index at a new point is the mean of the edge's ends, which the field already had there; so
    surfaces of equal index do not move and get more triangles, all of them coplanar with
    the original ones. Recovered gradients change: the mean at a new point is taken over smaller
    cells, so that repeated refinement of a linear field leads back to the steps of its gradient.
    """
    corners = np.asarray(field.grid.cell_connectivity, dtype=np.int64).reshape(-1, 4)
    points = np.asarray(field.grid.points)
    ends = np.sort(corners[:, _EDGES].reshape(-1, 2), axis=1)
    key, edge = np.unique((ends[:, 0] << 32) | ends[:, 1], return_inverse=True)
    one, other = key >> 32, key & 0xFFFFFFFF
    middle = 0.5 * (points[one].astype(np.float64) + points[other])
    value = 0.5 * (field.refractivity[one] + field.refractivity[other])
    ten = np.concatenate((corners, len(points) + edge.reshape(-1, 6)), axis=1)
    return _field(
        field,
        np.concatenate((points.astype(np.float64), middle)),
        np.concatenate((field.refractivity, value)),
        ten[:, _EIGHTHS].reshape(-1, 4),
    )


def _field(
    field: IndexField, points: FloatArray, values: FloatArray, corners: IntArray
) -> IndexField:
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: corners}, points)
    return IndexField(grid, values, field.air, field.source)
