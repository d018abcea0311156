"""Polyhedra split into pyramids and tetrahedra around their centres.

A face with three corners becomes the base of a tetrahedron, one with four the base of a pyramid,
with the cell's centre as apex. A face with more corners is split into a fan around its own centre.
Refined meshes have corners in the middle of an edge: with any other split these give flat triangles
and slivers with the cell's centre, in which the gradient is meaningless and rays get lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import AnyArray, BoolArray, FloatArray, IntArray
from iriftrace.core.mesh.query import runs
from iriftrace.medium.gradient import PYRAMID, TETRAHEDRON

if TYPE_CHECKING:
    import pyvista as pv

PENTAGONAL_PRISM, HEXAGONAL_PRISM, POLYHEDRON = 15, 16, 42
"""VTK's numbers of the cell types that are split."""

SPLIT = (PENTAGONAL_PRISM, HEXAGONAL_PRISM, POLYHEDRON)

_TRIANGLES_OF_QUAD = ((0, 1, 2), (0, 2, 3))

CLOSED = 1e-6
"""Sum of the area vectors of a polyhedron's faces over the sum of their areas. Above this value the
faces do not all have the same orientation; below it is rounding of single precision."""


@frozen(eq=False)
class SplitPolyhedra:
    """Pieces of a grid's polyhedra; f face and p cell centres follow the grid's own n points."""

    cells: IntArray  # (p,) numbers of the polyhedra in the grid
    face_centres: FloatArray  # (f, 3), the means of the faces' corners
    face_corners: list[tuple[IntArray, IntArray]]  # (k,) faces and their (k, s) corners, per size
    centres: FloatArray  # (p, 3), their centroids or the means of their corners
    centroids: FloatArray  # (p, 3)
    pieces: dict[int, IntArray]  # VTK cell type to (k, corners) point numbers
    owners: dict[int, IntArray]  # VTK cell type to (k,) numbers from 0 to p - 1

    def extended(self, grid: pv.UnstructuredGrid, values: AnyArray) -> AnyArray:
        """Point values, (n,) or (n, k), with the means of the corners at the points added.

        Values that are linear in space stay linear if the centres are the means of the corners.
        """
        at_faces = np.zeros((len(self.face_centres), *values.shape[1:]))
        for faces, corners in self.face_corners:
            at_faces[faces] = values[corners].mean(axis=1)
        at_cells = corner_means(grid, values, self.cells)
        return np.concatenate((values, at_faces, at_cells), dtype=values.dtype, casting="unsafe")


def split_polyhedra(grid: pv.UnstructuredGrid, *, at_corner_means: bool = False) -> SplitPolyhedra:
    """Split the polyhedra of a pyvista.UnstructuredGrid, and its prisms with five or six sides.

    Both sides of a face get the same triangles: quadrilaterals are cut at their lowest point
    number, as in other cells (`iriftrace.medium.tetrahedra`). With `at_corner_means` the cells'
    centres are the means of their corners instead of their centroids.
    """
    points = np.asarray(grid.points, dtype=np.float64)
    polyhedra = np.flatnonzero(np.isin(np.asarray(grid.celltypes), SPLIT))
    faces = _faces_of(grid, polyhedra)
    face_centres, face_corners, fans, fan_owners = _fanned(points, faces)
    triangles, triangle_owners = _with_corners(faces, 3)
    quads, quad_owners = _with_corners(faces, 4)
    triangles = np.concatenate((triangles, fans))
    triangle_owners = np.concatenate((triangle_owners, fan_owners))
    halves = [quads[:, corners] for corners in _TRIANGLES_OF_QUAD]
    surface = np.concatenate((triangles, *halves))
    surface_owners = np.concatenate((triangle_owners, quad_owners, quad_owners))
    known = np.concatenate((points, face_centres))
    centroids = _centroids(known, surface, surface_owners, len(polyhedra))
    centres = corner_means(grid, points, polyhedra) if at_corner_means else centroids
    mixed, inward = _orientations(known, centres, surface, surface_owners)
    owners = {TETRAHEDRON: triangle_owners, PYRAMID: quad_owners}
    pieces = {}
    for kind, base in ((TETRAHEDRON, triangles), (PYRAMID, quads)):
        if len(base):
            owner, (first, second, third) = owners[kind], (known[base[:, k]] for k in range(3))
            normal = np.cross(second - first, third - first)
            seen = np.einsum("ij,ij->i", normal, first - centres[owner]) < 0.0
            kept = np.where(mixed[owner], seen, inward[owner])
            # Right-handed as in VTK: the base winds counter-clockwise as seen from the apex.
            base = np.where(kept[:, None], base, base[:, ::-1])
            pieces[kind] = np.column_stack((base, len(known) + owner))
    return SplitPolyhedra(polyhedra, face_centres, face_corners, centres, centroids, pieces, owners)


@frozen(eq=False)
class _Faces:
    """Faces of polyhedra; a face between two cells occurs once for each."""

    owner: IntArray  # (m,) number of the polyhedron, from 0
    start: IntArray  # (m,) where the corners start in `flat`
    size: IntArray  # (m,) number of corners
    flat: IntArray


def _faces_of(grid: pv.UnstructuredGrid, polyhedra: IntArray) -> _Faces:
    """Faces of cells of the types in `SPLIT`."""
    types = np.asarray(grid.celltypes)[polyhedra]
    starts = np.asarray(grid.cell_offsets, dtype=np.int64)[polyhedra]
    corners = np.asarray(grid.cell_connectivity, dtype=np.int64)
    owner: list[IntArray] = []
    flat: list[IntArray] = []
    size: list[IntArray] = []
    for kind, sides in ((PENTAGONAL_PRISM, 5), (HEXAGONAL_PRISM, 6)):
        prisms = np.flatnonzero(types == kind)
        for face in _prism_faces(sides):
            owner.append(prisms)
            flat.append(corners[starts[prisms, None] + face].ravel())
            size.append(np.full(len(prisms), len(face)))
    general = np.flatnonzero(types == POLYHEDRON)
    if len(general):
        offsets = np.asarray(grid.polyhedron_face_location_offsets, dtype=np.int64)
        numbers = np.asarray(grid.polyhedron_face_location_connectivity, dtype=np.int64)
        of_face = np.asarray(grid.polyhedron_face_offsets, dtype=np.int64)
        cell, place = runs(np.diff(offsets)[polyhedra[general]])
        number = numbers[offsets[:-1][polyhedra[general]][cell] + place]
        side, place = runs(np.diff(of_face)[number])
        owner.append(general[cell])
        all_corners = np.asarray(grid.polyhedron_face_connectivity, dtype=np.int64)
        flat.append(all_corners[of_face[number][side] + place])
        size.append(np.diff(of_face)[number])
    sizes = np.concatenate(size)
    return _Faces(np.concatenate(owner), np.cumsum(sizes) - sizes, sizes, np.concatenate(flat))


def _prism_faces(sides: int) -> list[list[int]]:
    """Corners of the faces of a prism as VTK numbers them, counter-clockwise from outside."""
    bottom = list(range(sides))
    walls = [[k, (k + 1) % sides, (k + 1) % sides + sides, k + sides] for k in bottom]
    return [bottom[::-1], [k + sides for k in bottom], *walls]


def corner_means(grid: pv.UnstructuredGrid, values: AnyArray, cells: IntArray) -> FloatArray:
    """Means of point values, (n,) or (n, k), over the corners of some of a grid's cells."""
    starts = np.asarray(grid.cell_offsets, dtype=np.int64)
    corners = np.asarray(grid.cell_connectivity, dtype=np.int64)
    count = np.diff(starts)[cells]
    cell, place = runs(count)
    sums = added(cell, values[corners[starts[cells][cell] + place]], len(cells))
    return (sums.T / count).T


def _with_corners(faces: _Faces, size: int) -> tuple[IntArray, IntArray]:
    """Point numbers (k, size) of the faces of one size, in order, and their polyhedra (k,)."""
    chosen = np.flatnonzero(faces.size == size)
    return faces.flat[faces.start[chosen, None] + np.arange(size)], faces.owner[chosen]


def _fanned(
    points: FloatArray, faces: _Faces
) -> tuple[FloatArray, list[tuple[IntArray, IntArray]], IntArray, IntArray]:
    """Centres of the faces with more than four corners, their corners, triangles and owners."""
    centres, corners_of = [np.zeros((0, 3))], []
    triangles, owners = [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    count = 0
    for size in np.unique(faces.size[faces.size > 4]).tolist():
        corners, owner = _with_corners(faces, size)
        # Both sides of a face have the same corners, in another order.
        same, number = np.unique(np.sort(corners, axis=1), axis=0, return_inverse=True)
        number = count + number.ravel()
        # Summed in ascending order, so that the pieces of a decomposed mesh agree to the last bit.
        centres.append(np.sort(points[same], axis=1).mean(axis=1))
        corners_of.append((count + np.arange(len(same)), same))
        count += len(same)
        for k in range(size):
            edge = corners[:, [k, (k + 1) % size]]
            triangles.append(np.column_stack((edge, len(points) + number)))
            owners.append(owner)
    return np.concatenate(centres), corners_of, np.concatenate(triangles), np.concatenate(owners)


def _centroids(points: FloatArray, triangles: IntArray, owner: IntArray, count: int) -> FloatArray:
    """Centroids of closed polyhedra from the triangles of their faces, (count, 3)."""
    corners = points[triangles]
    weight = np.bincount(owner, minlength=count)[:, None]
    inside = added(owner, corners.mean(axis=1), count) / weight
    arms = corners - inside[owner][:, None]
    volume = np.abs(np.einsum("ij,ij->i", arms[:, 0], np.cross(arms[:, 1], arms[:, 2])))
    total = np.maximum(added(owner, volume, count), np.finfo(float).tiny)[:, None]
    moment = volume[:, None] * (arms.sum(axis=1) / 4.0)
    return inside + added(owner, moment, count) / total


def _orientations(
    points: FloatArray, centres: FloatArray, triangles: IntArray, owner: IntArray
) -> tuple[BoolArray, BoolArray]:
    """Polyhedra (p,) with faces of both orientations, and with faces clockwise from outside.

    The volume of the whole polyhedron decides: a face that the centre sees from its wrong side
    belongs to an inverted piece, which has to stay inverted.
    """
    count = len(centres)
    corners = points[triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    volumes = np.einsum("ij,ij->i", areas, corners[:, 0] - centres[owner])
    size = np.bincount(owner, np.linalg.norm(areas, axis=1), minlength=count)
    mixed = np.linalg.norm(added(owner, areas, count), axis=1) > CLOSED * size
    return mixed, np.bincount(owner, volumes, minlength=count) < 0.0


def added(numbers: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Sums (count,) or (count, 3) of the scalars or vectors with the same number."""
    columns = [np.bincount(numbers, column, minlength=count) for column in np.atleast_2d(values.T)]
    total: FloatArray = np.stack(columns, axis=-1)
    return total if values.ndim > 1 else total[:, 0]
