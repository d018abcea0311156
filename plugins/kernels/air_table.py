"""A field's table for kernels as a differentiable function of the temperature at its points.

The chain T -> n - 1 -> recovered gradient -> table, which `iriftrace.medium` computes in NumPy when
a scene is made (`Air.refractivity`, `point_gradient`, `consistent_gradient`), in Dr.Jit. Cells,
their corners and their edges are constants.
"""

from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi
import numpy as np

from iriftrace.core.arrays import AnyIntArray, NumberArray
from iriftrace.medium.gradient import (
    MOST_CHANGE,
    RELAXATION,
    ROUNDS,
    SPLIT_WAYS,
    SPLITS,
    cell_corners,
    edges_of,
)
from iriftrace.medium.path_data import FieldCells
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.vertex_table import aligned

COLUMNS = 8
"""Numbers of a point in the table: x, y, z, n - n_ambient, the gradient of n, 0."""


_Tetrahedra = tuple[int, tuple[int, ...], list[dt.UInt32], tuple[dt.Vector3d, ...], dt.Float64]


class AirTable:
    """Rows of a field's points for kernels, from the temperatures at the points.

    The cells and the corners (m, 4) of their tetrahedra give the gradient.
    """

    def __init__(self, cells: FieldCells, corners: NumberArray) -> None:
        self._count = len(cells.points)
        self._refractivity_k = cells.air.ambient_refractivity * cells.air.temperature_k
        self._ambient = cells.ambient
        self._points = [mi.Float(aligned(column)) for column in cells.points.T]
        self._corners = [
            (kind, [_numbers(column) for column in of_cells.T])
            for kind, (_, of_cells) in cell_corners(cells).items()
        ]
        volume = dr.zeros(mi.Float64, self._count)
        for kind, tet, numbers, _, six_volumes in self._tetrahedra():
            for corner in tet:
                dr.scatter_add(volume, six_volumes * _weight(kind, six_volumes), numbers[corner])
        self._inverse_volume = dr.select(volume > 0, 1 / dr.select(volume > 0, volume, 1), 0)
        start, end = edges_of(corners, self._count)
        edge = cells.points[end].astype(np.float64) - cells.points[start]
        squared = np.einsum("ij,ij->i", edge, edge)
        weight = np.divide(1.0, squared, out=np.zeros_like(squared), where=squared > 0.0)
        self._ends = _numbers(start), _numbers(end)
        self._edge = mi.Vector3d(*(aligned(column) for column in edge.T))
        self._weight = mi.Float64(aligned(weight))
        dr.eval(self._inverse_volume)

    def excess(self, temperature: dt.Float64, contrast: dt.Float64) -> dt.Float64:
        """n - n_ambient at the points (Float64), of their temperatures (Float64, K).

        `contrast` is a factor on it (Float64), as of an air with another refractivity.
        """
        return (self._refractivity_k / temperature - self._ambient) * contrast

    def gradient(self, excess: dt.Float64) -> dt.Vector3d:
        """Gradient of n at the points (Vector3d, 1/mm), as `consistent_gradient` recovers it."""
        sums = [dr.zeros(mi.Float64, self._count) for _ in range(3)]
        for kind, tet, numbers, areas, six_volumes in self._tetrahedra():
            first, *others = (dr.gather(mi.Float64, excess, numbers[corner]) for corner in tet)
            term: dt.Vector3d = sum(
                (area * (other - first) for area, other in zip(areas, others, strict=True)),
                mi.Vector3d(0),
            )
            term *= _weight(kind, six_volumes)
            for corner in tet:
                for total, part in zip(sums, term, strict=True):
                    dr.scatter_add(total, part, numbers[corner])
        gradient = mi.Vector3d(*(total * self._inverse_volume for total in sums))
        start, end = self._ends
        change = dr.gather(mi.Float64, excess, end) - dr.gather(mi.Float64, excess, start)
        for _ in range(ROUNDS):
            gradient = gradient * self._stretch(gradient, change)
        return gradient

    def _stretch(self, gradient: dt.Vector3d, change: dt.Float64) -> dt.Float64:
        """Factor on each gradient, as in a round of `consistent_gradient`."""
        along = [
            dr.dot(mi.Vector3d(*(dr.gather(mi.Float64, g, end) for g in gradient)), self._edge)
            for end in self._ends
        ]
        residual = self._weight * (2 * change - along[0] - along[1])
        right, left = (dr.zeros(mi.Float64, self._count) for _ in range(2))
        for end, part in zip(self._ends, along, strict=True):
            dr.scatter_add(right, residual * part, end)
            dr.scatter_add(left, self._weight * part * part, end)
        # Without the inner one, the derivative of 0 / 0 would be NaN where no edge ends.
        quotient = dr.select(left > 0, right / dr.select(left > 0, left, 1), 0)
        return 1 + dr.clip(RELAXATION * quotient, -MOST_CHANGE, MOST_CHANGE)

    def rows(self, temperature: dt.Float64, contrast: dt.Float64) -> dt.Float:
        """The table, ``COLUMNS`` numbers a point (Float)."""
        excess = self.excess(temperature, contrast)
        rows = dr.zeros(mi.Float, COLUMNS * self._count)
        place = COLUMNS * dr.arange(mi.UInt32, self._count)
        for k, column in enumerate([*self._points, excess, *self.gradient(excess)]):
            dr.scatter(rows, mi.Float(column), place + k)
        return rows

    def _tetrahedra(self) -> Iterator[_Tetrahedra]:
        """Of each tetrahedron of each cell type: its cells' corners, areas and six volumes."""
        for kind, numbers in self._corners:
            for tet in SPLITS[kind]:
                o, a, b, c = (
                    mi.Vector3d(*(dr.gather(mi.Float, x, numbers[corner]) for x in self._points))
                    for corner in tet
                )
                e1, e2, e3 = a - o, b - o, c - o
                areas = dr.cross(e2, e3), dr.cross(e3, e1), dr.cross(e1, e2)
                yield kind, tet, numbers, areas, dr.dot(e1, areas[0])


def _weight(kind: int, six_volumes: dt.Float64) -> dt.Float64:
    """Weight of a tetrahedron's sums, positive for those that are turned inside out."""
    return dr.select(six_volumes < 0, -1 / SPLIT_WAYS[kind], 1 / SPLIT_WAYS[kind])


def _numbers(values: AnyIntArray) -> dt.UInt32:
    return mi.UInt32(aligned(values.astype(np.uint32)))
