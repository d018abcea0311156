"""Values of finite-volume cells and boundary faces at the points of the mesh."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from iriftrace.readers.openfoam_cells import VolumeMesh
from iriftrace.velocity_arrays import moves

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SOURCES = 3
"""Kinds of places from which a point can have its value, the weightiest last: cells, faces of
patches, faces of walls."""


@frozen(eq=False)
class PointSums:
    """Weighted sums at points, which pieces of one mesh can add up before they are divided.

    Attributes
    ----------
    weight : (SOURCES, n) array
        1/distance, summed, for each kind of source.
    sums : mapping
        For every array (SOURCES, n), or (SOURCES, n, 3) for vectors: weight times value, summed.
    """

    weight: FloatArray
    sums: dict[str, FloatArray]

    def merged(self, numbers: IntArray, count: int) -> PointSums:
        """The sums at `count` points, where point i became point ``numbers[i]``."""

        def add(rows: FloatArray) -> FloatArray:
            return np.stack([_added(numbers, row, count) for row in rows])

        return PointSums(add(self.weight), {name: add(rows) for name, rows in self.sums.items()})

    def means(self) -> dict[str, FloatArray]:
        """Values at the points: from walls where there are any, else patches, else cells."""
        source = SOURCES - 1 - (self.weight[::-1] > 0.0).argmax(axis=0)
        at = (source, np.arange(self.weight.shape[1]))
        weight = self.weight[at]
        # Points that no cell uses have no weight and no value.
        weight = np.where(weight > 0.0, weight, np.nan)
        return {name: (rows[at].T / weight).T for name, rows in self.sums.items()}


def point_sums(
    grid: Any,
    mesh: VolumeMesh,
    patches: Mapping[str, Any],
    walls: frozenset[str],
    *,
    flow: bool,
) -> PointSums:
    """Sums at the points of a piece, with the inverse distance as weight as OpenFOAM does it.

    VTK's own translation averages the cells alone, which puts air from half a cell away onto the
    wall. Here points on patches have values of the patches' faces only, and points on walls those
    of the walls' faces only, so a wall of one temperature keeps it to the last digit.

    Parameters
    ----------
    grid : pyvista.UnstructuredGrid
        The piece as it was read, with cell data.
    mesh : VolumeMesh
        The same, split.
    patches : mapping
        pyvista.PolyData of the patches that state values, with cell data.
    walls : frozenset
        Names of those that are walls.
    flow : bool
        Also of the vectors that tell how the air moves, and not of scalars only.
    """
    points = np.asarray(grid.points, dtype=np.float64)
    names = [
        name
        for name in grid.cell_data
        if grid.cell_data[name].dtype.kind == "f"
        and (grid.cell_data[name].ndim == 1 or (flow and moves(name)))
    ]
    count = len(mesh.points)
    weight = np.zeros((SOURCES, count))
    sums = {name: np.zeros((SOURCES, count, *grid.cell_data[name].shape[1:])) for name in names}
    starts = np.asarray(grid.cell_offsets, dtype=np.int64)
    corner = np.asarray(grid.cell_connectivity, dtype=np.int64)
    cell = np.repeat(np.arange(grid.n_cells), np.diff(starts))
    w = _inverse(points[corner] - mesh.centres[cell])
    weight[0] += np.bincount(corner, w, minlength=count)
    for name in names:
        value = np.asarray(grid.cell_data[name], dtype=np.float64)
        sums[name][0] += _added(corner, (w * value[cell].T).T, count)
        sums[name][0, len(points) :] = value[mesh.polyhedra]
    weight[0, len(points) :] = 1.0
    tree = cKDTree(np.asarray(grid.points)) if patches else None
    for patch_name, patch in patches.items():
        if not patch.n_cells or tree is None:
            continue
        row = 2 if patch_name in walls else 1
        number = tree.query(np.asarray(patch.points))[1]
        corner, face, centres = _patch_corners(patch)
        w = _inverse(np.asarray(patch.points, dtype=np.float64)[corner] - centres[face])
        weight[row] += np.bincount(number[corner], w, minlength=count)
        for name in names:
            value = np.asarray(patch.cell_data[name], dtype=np.float64)
            sums[name][row] += _added(number[corner], (w * value[face].T).T, count)
    return PointSums(weight, sums)


def _added(numbers: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Sums (count,) or (count, 3) of the scalars or vectors that have the same number."""
    columns = [np.bincount(numbers, column, minlength=count) for column in np.atleast_2d(values.T)]
    total: FloatArray = np.stack(columns, axis=-1)
    return total if values.ndim > 1 else total[:, 0]


def _patch_corners(patch: Any) -> tuple[IntArray, IntArray, FloatArray]:
    """Corner and face of every corner of the faces, and the faces' centres."""
    polygons = patch.GetPolys()
    starts = np.asarray(polygons.GetOffsetsArray(), dtype=np.int64)
    corner = np.asarray(polygons.GetConnectivityArray(), dtype=np.int64)
    face = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    points = np.asarray(patch.points, dtype=np.float64)
    size = np.bincount(face)
    centres = np.stack([np.bincount(face, c) / size for c in points[corner].T], axis=1)
    return corner, face, centres


def _inverse(arms: FloatArray) -> FloatArray:
    inverse: FloatArray = 1.0 / np.maximum(np.linalg.norm(arms, axis=1), np.finfo(float).tiny)
    return inverse
