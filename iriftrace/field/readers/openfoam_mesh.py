"""Polyhedra of a finite-volume mesh as pyramids and tetrahedra around their centroids."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyvista as pv
from attrs import frozen
from scipy.spatial import cKDTree

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.field.flow import moves
from iriftrace.field.gradient import PYRAMID, TETRAHEDRON, cell_corners

_POLYHEDRON = 42


@frozen(eq=False)
class VolumeMesh:
    """A finite-volume mesh in linear cells.

    Attributes
    ----------
    points : (n + p, 3) array
        The mesh's n points and the centroids of its p polyhedra.
    cells : mapping
        VTK cell type to (k, corners) point numbers.
    centres : (c, 3) array
        Of the mesh's own cells, where their values belong.
    polyhedra : (p,) array
        Numbers of the cells that were split.
    """

    points: FloatArray
    cells: dict[int, IntArray]
    centres: FloatArray
    polyhedra: IntArray


def split_polyhedra(grid: Any) -> VolumeMesh:
    """Split the polyhedra of a grid; its other cells stay.

    Faces with four corners become pyramids, triangles tetrahedra, and faces with more corners are
    fanned from their corner with the smallest number, so that both neighbours split them alike.
    The gradients of a cell's parts then start from its own value at its own centroid, whereas
    triangulating by corners alone would drop that value and split all other cells too.

    Parameters
    ----------
    grid : pyvista.UnstructuredGrid

    Returns
    -------
    VolumeMesh
    """
    points = np.asarray(grid.points, dtype=np.float64)
    centres = np.array(grid.cell_centers().points, dtype=np.float64)
    cells = {kind: corners for kind, (_, corners) in cell_corners(grid).items()}
    polyhedra = np.flatnonzero(np.asarray(grid.celltypes) == _POLYHEDRON)
    if not len(polyhedra):
        return VolumeMesh(points, cells, centres, polyhedra)
    owner, starts, sizes, flat = _faces_of(grid, polyhedra)
    triangles, of_triangle = _fans(owner, starts, sizes, flat)
    centroids = _centroids(points, triangles, of_triangle, len(polyhedra))
    centres[polyhedra] = centroids
    apex = len(points) + np.arange(len(polyhedra))
    quads = np.flatnonzero(sizes == 4)
    base = flat[starts[quads, None] + np.arange(4)]
    pyramids = np.column_stack((base, apex[owner[quads]]))
    # Quadrilaterals were fanned only to find the centroids.
    others = sizes != 4
    triangles, of_triangle = _fans(owner[others], starts[others], sizes[others], flat)
    tetrahedra = np.column_stack((triangles, apex[of_triangle]))
    points = np.concatenate((points, centroids))
    for kind, new in ((TETRAHEDRON, tetrahedra), (PYRAMID, pyramids)):
        new = _upright(points, new)
        cells[kind] = np.concatenate((cells[kind], new)) if kind in cells else new
    return VolumeMesh(points, {kind: c for kind, c in cells.items() if len(c)}, centres, polyhedra)


def _faces_of(grid: pv.UnstructuredGrid, polyhedra: IntArray) -> tuple[IntArray, ...]:
    """Place of its polyhedron, first corner and number of corners of every face; all corners."""
    offsets = np.asarray(grid.polyhedron_face_location_offsets, dtype=np.int64)
    faces = np.asarray(grid.polyhedron_face_location_connectivity, dtype=np.int64)
    counts = np.diff(offsets)[polyhedra]
    starts = offsets[:-1][polyhedra]
    owner = np.repeat(np.arange(len(polyhedra)), counts)
    first = np.concatenate(([0], np.cumsum(counts)[:-1]))
    numbers = faces[starts[owner] + np.arange(len(owner)) - first[owner]]
    corners = np.asarray(grid.polyhedron_face_offsets, dtype=np.int64)
    flat = np.asarray(grid.polyhedron_face_connectivity, dtype=np.int64)
    return owner, corners[numbers], np.diff(corners)[numbers], flat


def _fans(
    owner: IntArray, starts: IntArray, sizes: IntArray, flat: IntArray
) -> tuple[IntArray, IntArray]:
    """Triangles (t, 3) that fill the faces, and the place of the polyhedron of each."""
    triangles, places = [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for size in np.unique(sizes):
        chosen = np.flatnonzero(sizes == size)
        corners = flat[starts[chosen, None] + np.arange(size)]
        turn = (corners.argmin(axis=1)[:, None] + np.arange(size)) % size
        corners = np.take_along_axis(corners, turn, axis=1)
        for k in range(1, size - 1):
            triangles.append(corners[:, [0, k, k + 1]])
            places.append(owner[chosen])
    return np.concatenate(triangles), np.concatenate(places)


def _centroids(points: FloatArray, triangles: IntArray, owner: IntArray, count: int) -> FloatArray:
    """Centres of volume of closed polyhedra from the triangles of their faces, (count, 3)."""
    corners = points[triangles]
    weight = np.bincount(owner, minlength=count)
    inside = np.stack(
        [np.bincount(owner, c, minlength=count) / weight for c in corners.mean(axis=1).T], axis=1
    )
    arms = corners - inside[owner][:, None]
    volume = np.abs(np.einsum("ij,ij->i", arms[:, 0], np.cross(arms[:, 1], arms[:, 2])))
    total = np.maximum(np.bincount(owner, volume, minlength=count), np.finfo(float).tiny)
    arm = arms.sum(axis=1) / 4.0
    return inside + np.stack(
        [np.bincount(owner, volume * a, minlength=count) / total for a in arm.T], axis=1
    )


def _upright(points: FloatArray, cells: IntArray) -> IntArray:
    """Cells whose last corner lies on the side to which their base winds counter-clockwise."""
    if not len(cells):
        return cells
    base = points[cells[:, :-1]]
    normal = np.cross(base[:, 1] - base[:, 0], base[:, 2] - base[:, 0])
    up = np.einsum("ij,ij->i", normal, points[cells[:, -1]] - base[:, 0])
    turned = np.column_stack((cells[:, -2::-1], cells[:, -1]))
    return np.where(up[:, None] < 0.0, turned, cells)


# MERGE readers.openfoam_points: Values of finite-volume cells and boundary faces at the points of

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
