"""Finite-volume meshes as linear cells with values at their points.

Polyhedra become pyramids and tetrahedra around their centroids, and cells and boundary faces give
their values to the points around them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pyvista as pv
from attrs import frozen
from scipy.spatial import cKDTree

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.field.gradient import PYRAMID, TETRAHEDRON, cell_corners
from iriftrace.geometry.query import runs

_POLYHEDRON = 42

_CELLS, _PATCHES, _WALLS = range(3)
"""Kinds of places from which a point can have its value, the one that counts most last."""


@frozen(eq=False)
class Piece:
    """A mesh as it was read, whole or from one processor, and in linear cells."""

    grid: Any  # pyvista.UnstructuredGrid with cell data
    patches: Mapping[str, Any]  # pyvista.PolyData with cell data of the patches that state values
    walls: frozenset[str]  # names of those that are walls
    points: FloatArray  # (n + p, 3), the mesh's points and the centroids of its p polyhedra
    cells: dict[int, IntArray]  # VTK cell type to (k, corners) point numbers
    centres: FloatArray  # (c, 3) of the mesh's own cells, where their values belong
    polyhedra: IntArray  # (p,) numbers of the cells that were split


def split_piece(grid: Any, patches: Mapping[str, Any], walls: frozenset[str]) -> Piece:
    """Split the polyhedra of a grid; its other cells stay.

    Faces with four corners become pyramids, triangles tetrahedra, and faces with more corners are
    fanned from their corner with the smallest number, so that both neighbours split them alike.
    The gradients of a cell's parts then start from its own value at its own centroid, whereas
    triangulating by corners alone would drop that value and split all other cells too.
    """
    points = np.asarray(grid.points, dtype=np.float64)
    centres = np.array(grid.cell_centers().points, dtype=np.float64)
    cells = {kind: corners for kind, (_, corners) in cell_corners(grid).items()}
    polyhedra = np.flatnonzero(np.asarray(grid.celltypes) == _POLYHEDRON)
    if not len(polyhedra):
        return Piece(grid, patches, walls, points, cells, centres, polyhedra)
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
    cells = {kind: corners for kind, corners in cells.items() if len(corners)}
    return Piece(grid, patches, walls, points, cells, centres, polyhedra)


def _faces_of(grid: pv.UnstructuredGrid, polyhedra: IntArray) -> tuple[IntArray, ...]:
    """Place of its polyhedron, first corner and number of corners of every face; all corners."""
    offsets = np.asarray(grid.polyhedron_face_location_offsets, dtype=np.int64)
    faces = np.asarray(grid.polyhedron_face_location_connectivity, dtype=np.int64)
    owner, place = runs(np.diff(offsets)[polyhedra])
    numbers = faces[offsets[:-1][polyhedra][owner] + place]
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
    weight = np.bincount(owner, minlength=count)[:, None]
    inside = _added(owner, corners.mean(axis=1), count) / weight
    arms = corners - inside[owner][:, None]
    volume = np.abs(np.einsum("ij,ij->i", arms[:, 0], np.cross(arms[:, 1], arms[:, 2])))
    total = np.maximum(_added(owner, volume, count), np.finfo(float).tiny)[:, None]
    moment = volume[:, None] * (arms.sum(axis=1) / 4.0)
    return inside + _added(owner, moment, count) / total


def _upright(points: FloatArray, cells: IntArray) -> IntArray:
    """Cells whose last corner lies on the side to which their base winds counter-clockwise."""
    if not len(cells):
        return cells
    base = points[cells[:, :-1]]
    normal = np.cross(base[:, 1] - base[:, 0], base[:, 2] - base[:, 0])
    up = np.einsum("ij,ij->i", normal, points[cells[:, -1]] - base[:, 0])
    turned = np.column_stack((cells[:, -2::-1], cells[:, -1]))
    return np.where(up[:, None] < 0.0, turned, cells)


def joined(pieces: Sequence[Piece], names: Sequence[str]) -> pv.UnstructuredGrid:
    """One grid of all pieces, joined at points that coincide exactly, with values at its points.

    A point has the mean of the places around it, weighted with the inverse distance as OpenFOAM
    does it. VTK's own translation averages the cells alone, which puts air from half a cell away
    onto the wall. Here points on patches have values of the patches' faces only, and points on
    walls those of the walls' faces only, so a wall of one temperature keeps it to the last digit.
    `names` are cell arrays, scalars or vectors, that all pieces have.
    """
    points = np.concatenate([piece.points for piece in pieces])
    number = np.arange(len(points))
    if len(pieces) > 1:
        points, number = np.unique(points, axis=0, return_inverse=True)
    ends = np.cumsum([len(piece.points) for piece in pieces])
    numbers = np.split(number.ravel(), ends[:-1])
    cells: dict[int, list[IntArray]] = {}
    for piece, number in zip(pieces, numbers, strict=True):
        for kind, corners in piece.cells.items():
            cells.setdefault(kind, []).append(number[corners])
    grid = pv.UnstructuredGrid(
        {kind: np.concatenate(parts) for kind, parts in cells.items()}, points
    )
    for name, values in _point_means(pieces, numbers, len(points), names).items():
        grid.point_data[name] = values
    return grid


def _point_means(
    pieces: Sequence[Piece], numbers: Sequence[IntArray], count: int, names: Sequence[str]
) -> dict[str, FloatArray]:
    """Values at `count` points, where `numbers` are those of the points of each piece."""
    weight = np.zeros((3, count))
    first = pieces[0].grid.cell_data
    sums = {name: np.zeros((3, count, *np.shape(first[name])[1:])) for name in names}
    for piece, number in zip(pieces, numbers, strict=True):
        for source, corner, owner, w, data in _corners(piece):
            at = number[corner]
            weight[source] += np.bincount(at, w, minlength=count)
            for name in names:
                value = np.asarray(data[name], dtype=np.float64)
                sums[name][source] += _added(at, (w * value[owner].T).T, count)
        centroids = number[piece.grid.n_points :]
        weight[_CELLS, centroids] = 1.0
        for name in names:
            sums[name][_CELLS, centroids] = piece.grid.cell_data[name][piece.polyhedra]
    best = (_WALLS - (weight[::-1] > 0.0).argmax(axis=0), np.arange(count))
    # Points that no cell uses have no weight and no value.
    total = np.where(weight[best] > 0.0, weight[best], np.nan)
    return {name: (rows[best].T / total).T for name, rows in sums.items()}


def _corners(piece: Piece) -> Iterator[tuple[int, IntArray, IntArray, FloatArray, Any]]:
    """Kind of source, points, cell or face, weight and cell data, for the cells and each patch."""
    points = np.asarray(piece.grid.points, dtype=np.float64)
    starts = np.asarray(piece.grid.cell_offsets, dtype=np.int64)
    corner = np.asarray(piece.grid.cell_connectivity, dtype=np.int64)
    cell = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    weight = _inverse_length(points[corner] - piece.centres[cell])
    yield _CELLS, corner, cell, weight, piece.grid.cell_data
    tree = cKDTree(points) if piece.patches else None
    for name, patch in piece.patches.items():
        if not patch.n_cells or tree is None:
            continue
        polygons = patch.GetPolys()
        starts = np.asarray(polygons.GetOffsetsArray(), dtype=np.int64)
        corner = np.asarray(polygons.GetConnectivityArray(), dtype=np.int64)
        face = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        points = np.asarray(patch.points, dtype=np.float64)
        centres = _added(face, points[corner], len(starts) - 1) / np.diff(starts)[:, None]
        weight = _inverse_length(points[corner] - centres[face])
        source = _WALLS if name in piece.walls else _PATCHES
        yield source, tree.query(points)[1][corner], face, weight, patch.cell_data


def _added(numbers: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Sums (count,) or (count, 3) of the scalars or vectors that have the same number."""
    columns = [np.bincount(numbers, column, minlength=count) for column in np.atleast_2d(values.T)]
    total: FloatArray = np.stack(columns, axis=-1)
    return total if values.ndim > 1 else total[:, 0]


def _inverse_length(arms: FloatArray) -> FloatArray:
    inverse: FloatArray = 1.0 / np.maximum(np.linalg.norm(arms, axis=1), np.finfo(float).tiny)
    return inverse
