"""Finite-volume meshes as linear cells with values at their points.

Polyhedra are split around their centroids (`iriftrace.field.polyhedra`), and cells and boundary
faces give their values to the points around them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pyvista as pv
from attrs import frozen
from scipy.spatial import cKDTree

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.field.gradient import cell_corners
from iriftrace.field.polyhedra import SplitPolyhedra, added, split_polyhedra

_CELLS, _PATCHES, _WALLS = range(3)
"""Kinds of places from which a point can have its value, the one that counts most last."""


@frozen(eq=False)
class Piece:
    """A mesh as it was read, whole or from one processor, and in linear cells."""

    grid: Any  # pyvista.UnstructuredGrid with cell data
    patches: Mapping[str, Any]  # pyvista.PolyData with cell data of the patches that state values
    walls: frozenset[str]  # names of those that are walls
    # (n + f + p, 3), the mesh's points, the centres of its f faces with more than four corners
    # and the centroids of its p polyhedra.
    points: FloatArray
    cells: dict[int, IntArray]  # VTK cell type to (k, corners) point numbers
    centres: FloatArray  # (c, 3) of the mesh's own cells, where their values belong
    split: SplitPolyhedra


def split_piece(grid: Any, patches: Mapping[str, Any], walls: frozenset[str]) -> Piece:
    """Split the polyhedra of a grid; its other cells stay.

    The gradients of a cell's parts then start from its own value at its own centroid, whereas
    triangulating by corners alone would drop that value and split all other cells too.
    """
    split = split_polyhedra(grid)
    centres = np.array(grid.cell_centers().points, dtype=np.float64)
    centres[split.cells] = split.centres
    cells = {kind: corners for kind, (_, corners) in cell_corners(grid).items()}
    for kind, new in split.pieces.items():
        cells[kind] = np.concatenate((cells[kind], new)) if kind in cells else new
    points = np.asarray(grid.points, dtype=np.float64)
    points = np.concatenate((points, split.face_centres, split.centres))
    return Piece(grid, patches, walls, points, cells, centres, split)


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
                sums[name][source] += added(at, (w * value[owner].T).T, count)
        centroids = number[len(piece.points) - len(piece.split.cells) :]
        weight[_CELLS, centroids] = 1.0
        for name in names:
            sums[name][_CELLS, centroids] = piece.grid.cell_data[name][piece.split.cells]
    best = (_WALLS - (weight[::-1] > 0.0).argmax(axis=0), np.arange(count))
    # Points that no cell uses have no weight and no value.
    total = np.where(weight[best] > 0.0, weight[best], np.nan)
    return {name: (rows[best].T / total).T for name, rows in sums.items()}


def _corners(piece: Piece) -> Iterator[tuple[int, IntArray, IntArray, FloatArray, Any]]:
    """Kind of source, points, cell or face, weight and cell data, for the cells and each patch."""
    starts = np.asarray(piece.grid.cell_offsets, dtype=np.int64)
    corner = np.asarray(piece.grid.cell_connectivity, dtype=np.int64)
    cell = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    faces, cells = piece.split.face_sides
    corner = np.concatenate((corner, piece.grid.n_points + faces))
    cell = np.concatenate((cell, cells))
    weight = _inverse_length(piece.points[corner] - piece.centres[cell])
    yield _CELLS, corner, cell, weight, piece.grid.cell_data
    tree = cKDTree(piece.points) if piece.patches else None
    for name, patch in piece.patches.items():
        if not patch.n_cells or tree is None:
            continue
        polygons = patch.GetPolys()
        starts = np.asarray(polygons.GetOffsetsArray(), dtype=np.int64)
        corner = np.asarray(polygons.GetConnectivityArray(), dtype=np.int64)
        face = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        points = np.asarray(patch.points, dtype=np.float64)
        centres = added(face, points[corner], len(starts) - 1) / np.diff(starts)[:, None]
        weight = _inverse_length(points[corner] - centres[face])
        source = _WALLS if name in piece.walls else _PATCHES
        yield source, tree.query(points)[1][corner], face, weight, patch.cell_data
        fanned = np.flatnonzero(np.diff(starts) > 4)
        at = tree.query(centres[fanned])[1]
        yield source, at, fanned, np.ones(len(fanned)), patch.cell_data


def _inverse_length(arms: FloatArray) -> FloatArray:
    inverse: FloatArray = 1.0 / np.maximum(np.linalg.norm(arms, axis=1), np.finfo(float).tiny)
    return inverse
