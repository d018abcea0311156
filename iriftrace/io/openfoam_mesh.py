"""Finite-volume meshes as linear cells with values at their points.

Polyhedra are split around their centroids (`iriftrace.medium.polyhedra`), and the values of cells
and boundary faces are averaged onto the points around them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pyvista as pv
from attrs import frozen
from scipy.spatial import cKDTree

from iriftrace.core.arrays import FloatArray, IntArray, as_float64
from iriftrace.medium.cell_means import linear_weights
from iriftrace.medium.gradient import cell_centroids, cell_corners, corners_in
from iriftrace.medium.polyhedra import SplitPolyhedra, added, split_polyhedra

_CELLS, _PATCHES, _WALLS = range(3)
"""Kinds of locations that give a point its value, in ascending priority."""


@frozen(eq=False)
class MeshPiece:
    """A mesh as read, whole or from one processor, and as linear cells."""

    grid: pv.UnstructuredGrid  # with cell data
    patches: Mapping[str, pv.PolyData]  # those that have values, as cell data
    walls: frozenset[str]  # names of the patches that are walls
    # (n + f + p, 3), the mesh's points, the centres of its f faces with more than four corners
    # and the centroids of its p polyhedra.
    points: FloatArray
    cells: dict[int, IntArray]  # VTK cell type to (k, corners) point numbers
    centres: FloatArray  # (c, 3) of the mesh's own cells, where their values are located
    split: SplitPolyhedra


def split_piece(
    grid: pv.UnstructuredGrid, patches: Mapping[str, pv.PolyData], walls: frozenset[str]
) -> MeshPiece:
    """Split the polyhedra of a grid; its other cells do not change.

    The gradients in a cell's pieces then start from its own value at its own centroid.
    Triangulating by corners alone would drop that value and split all other cells too.
    """
    split = split_polyhedra(grid)
    centres = cell_centroids(grid)
    centres[split.cells] = split.centres
    cells = {kind: corners for kind, (_, corners) in cell_corners(grid).items()}
    for kind, new in split.pieces.items():
        cells[kind] = np.concatenate((cells[kind], new)) if kind in cells else new
    points = np.asarray(grid.points, dtype=np.float64)
    points = np.concatenate((points, split.face_centres, split.centres))
    return MeshPiece(grid, patches, walls, points, cells, centres, split)


def joined(pieces: Sequence[MeshPiece], names: Sequence[str]) -> pv.UnstructuredGrid:
    """One grid of all pieces, joined at points that coincide exactly, with values at its points.

    A point gets a weighted mean of the values around it that is exact for values linear in space,
    even where cells double in size. VTK's own translation averages only the cells, which assigns
    air from half a cell away to the wall. Here points on patches get values of the patches' faces
    only, and points on walls those of the walls' faces only, so a wall of one temperature keeps it
    to the last digit. Centres of faces get the means of the faces' corners. `names` are cell
    arrays, scalars or vectors, that all pieces have.
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
    pieces: Sequence[MeshPiece], numbers: Sequence[IntArray], count: int, names: Sequence[str]
) -> dict[str, FloatArray]:
    """Values at `count` points; `numbers` are those of the points of each piece."""
    around = [
        places
        for piece, number in zip(pieces, numbers, strict=True)
        for places in _around(piece, number)
    ]
    total = np.zeros((3, count))
    first = pieces[0].grid.cell_data
    sums = {name: np.zeros((3, count, *np.shape(first[name])[1:])) for name in names}
    for kind in range(3):
        chosen = [places for places in around if places.kind == kind]
        weights = linear_weights([(places.point, places.arm) for places in chosen], count)
        for places, weight in zip(chosen, weights, strict=True):
            total[kind] += np.bincount(places.point, weight, minlength=count)
            for name in names:
                value = np.asarray(places.data[name], dtype=np.float64)[places.owner]
                sums[name][kind] += added(places.point, (weight * value.T).T, count)
    for piece, number in zip(pieces, numbers, strict=True):
        centroids = number[len(piece.points) - len(piece.split.cells) :]
        total[_CELLS, centroids] = 1.0
        for name in names:
            sums[name][_CELLS, centroids] = piece.grid.cell_data[name][piece.split.cells]
    best = (_WALLS - (total[::-1] > 0.0).argmax(axis=0), np.arange(count))
    # Points that no cell uses have no weight and no value.
    whole = np.where(total[best] > 0.0, total[best], np.nan)
    means = {name: (rows[best].T / whole).T for name, rows in sums.items()}
    for piece, number in zip(pieces, numbers, strict=True):
        for faces, corners in piece.split.face_corners:
            for values in means.values():
                values[number[piece.grid.n_points + faces]] = values[number[corners]].mean(axis=1)
    return means


@frozen(eq=False)
class _Around:
    """Cells of a grid, or faces of a patch, around points: k pairs of a point and a location."""

    kind: int  # of the locations: `_CELLS`, `_PATCHES` or `_WALLS`
    point: IntArray  # (k,)
    owner: IntArray  # (k,) cell or face
    arm: FloatArray  # (k, 3) from the point to its centre
    data: pv.DataSetAttributes  # cell data


def _around(piece: MeshPiece, number: IntArray) -> Iterator[_Around]:
    """Cells and faces of each patch around points, with the points' numbers in the joined grid."""
    cell, corner = corners_in(piece.grid.GetCells())
    arm = piece.centres[cell] - piece.points[corner]
    yield _Around(_CELLS, number[corner], cell, arm, piece.grid.cell_data)
    tree = cKDTree(piece.points) if piece.patches else None
    for name, patch in piece.patches.items():
        if not patch.n_cells or tree is None:
            continue
        face, corner = corners_in(patch.GetPolys())
        points = as_float64(patch.points)
        centres = added(face, points[corner], patch.n_cells) / np.bincount(face)[:, None]
        kind = _WALLS if name in piece.walls else _PATCHES
        arm = centres[face] - points[corner]
        yield _Around(kind, number[tree.query(points)[1]][corner], face, arm, patch.cell_data)
