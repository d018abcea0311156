"""Polyhedra of a finite-volume mesh as pyramids and tetrahedra around their centroids."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.field_cells import PYRAMID, TETRAHEDRON, cell_corners

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

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
