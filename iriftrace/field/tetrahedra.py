"""Cells of a field as tetrahedra that fit together face to face, and the neighbours of each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import AnyIntArray, BoolArray, FloatArray, IntArray, NumberArray
from iriftrace.core.errors import InputError
from iriftrace.field.gradient import (
    HEXAHEDRON,
    MIRRORED_CORNERS,
    PYRAMID,
    TETRAHEDRON,
    TETRAHEDRON_EDGES,
    WEDGE,
    cell_corners,
)
from iriftrace.geometry.topology import cells_to_flip

if TYPE_CHECKING:
    import pyvista as pv

BOUNDARY = 0x80000000
"""Set in a neighbour's number where the data end; the rest is the boundary face's number."""

MOST_TETRAHEDRA = 2**28
"""More would not leave room for a face's number beside the tetrahedron's in 32 bits."""

SLIVER = 0.06
"""Six times a tetrahedron's volume over the cube of its longest edge below which it is thin; a
regular one has 0.7."""

MIXED_SHARE = 1e-3
"""A larger share of negative volume comes from pieces of both orientations, and not from cells that
are turned inside out; flow solutions on snapped meshes have 4e-5 at most."""

# Faces of each cell type by VTK's corner numbers; quadrilaterals in cyclic order.
_FACES: dict[int, tuple[tuple[int, ...], ...]] = {
    TETRAHEDRON: ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)),
    HEXAHEDRON: (
        *((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4)),
        *((3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)),
    ),
    WEDGE: ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (0, 2, 5, 3)),
    PYRAMID: ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
}

OPPOSITE = np.array(_FACES[TETRAHEDRON])
"""Corners of the face opposite to each corner of a tetrahedron."""

_MIRRORED = np.array(MIRRORED_CORNERS[TETRAHEDRON])


@frozen(eq=False)
class Tetrahedra:
    """Tetrahedra that share whole faces; arrays of uint32."""

    # (m, 4) point numbers, right-handed (positive volume) but for cells that are turned inside out.
    corners: NumberArray
    # (m, 4) behind the face opposite to each corner: four times the neighbour's number plus the
    # number of the face there, or `BOUNDARY` plus a number of `boundary`.
    neighbours: NumberArray
    boundary: NumberArray  # (b, 3) point numbers of the faces where the data end
    boundary_place: NumberArray  # (b,) four times the tetrahedron's number plus that of its face


def tetrahedra_of(grid: pv.UnstructuredGrid) -> Tetrahedra:
    """Split linear cells into tetrahedra and find the neighbours.

    Every quadrilateral is cut at its lowest point number, which is the same seen from both sides;
    every cell is then the cone from its own lowest point to the triangles that do not touch it
    (Dompierre et al. 1999, "How to subdivide pyramids, prisms and hexahedra into tetrahedra").

    The grid has ``points``, ``celltypes``, ``cell_offsets`` and ``cell_connectivity`` as a
    pyvista.UnstructuredGrid has them. An InputError if there are too many cells, or three of them
    share a face.
    """
    points = np.asarray(grid.points, dtype=np.float64)
    split = (_split(cells, kind) for kind, (_, cells) in cell_corners(grid).items())
    corners = np.concatenate([_turned_by_majority(tetrahedra, points) for tetrahedra in split])
    if len(corners) > MOST_TETRAHEDRA:
        raise InputError(
            f"The field splits into {len(corners)} tetrahedra, but at most {MOST_TETRAHEDRA} can "
            "be numbered; crop it to the part's surroundings."
        )
    corners = _without_flat_twins(corners)
    equal = _equal_faces(corners)
    while len(crowded := _crowded(equal)):
        corners = _without_caps(corners, crowded, points)
        equal = _equal_faces(corners)
    return _of_one_orientation(corners, points, _face_pairs(equal))


def _turned_by_majority(corners: IntArray, points: FloatArray) -> IntArray:
    """All tetrahedra of one cell type, turned if most of their volume is negative.

    Solvers do not agree on the order of a wedge's corners, and a mirrored field is left-handed
    throughout. What is negative besides is really turned inside out.
    """
    return corners[:, _MIRRORED] if _volumes(corners, points).sum() < 0 else corners


def _without_caps(corners: NumberArray, crowded: IntArray, points: FloatArray) -> NumberArray:
    """The tetrahedra without slivers that lie on a face which two others share already.

    Filters that split each polyhedron by itself cover warped faces with them. `crowded` are the
    numbers (k, 3) of faces that are the same one; the thinnest of the three tetrahedra goes. An
    InputError if that is no sliver.
    """
    cells = crowded // 4
    at = points[corners[cells]]
    edges = np.stack([at[..., a, :] - at[..., b, :] for a, b in TETRAHEDRON_EDGES])
    longest = np.linalg.norm(edges, axis=-1).max(axis=0)
    volume = np.abs(_volumes(corners[cells.ravel()], points)).reshape(cells.shape)
    thickness = volume / np.maximum(longest, np.finfo(float).tiny) ** 3
    if (thickness.min(axis=1) > SLIVER).any():
        raise InputError(
            "Three or more cells of the field share one face, so it is not clear where light goes "
            "on; export the mesh without duplicate cells."
        )
    thinnest = np.take_along_axis(cells, thickness.argmin(axis=1)[:, None], axis=1)
    return np.delete(corners, np.unique(thinnest), axis=0)


def _of_one_orientation(
    corners: NumberArray, points: FloatArray, pairs: tuple[IntArray, IntArray, IntArray]
) -> Tetrahedra:
    """Tetrahedra turned where their orientation is not that of their neighbours, and those.

    The sign of a volume does not tell: half a field may be a mirror image, tetrahedra may be
    numbered at random, and whoever splits polyhedra makes every piece right-handed, also the
    slivers that are turned inside out. A ray that follows faces through such a piece is lost. The
    order of the points of the faces that neighbours share does tell.
    """
    faces = corners[:, OPPOSITE].reshape(-1, 3)
    first, second, alone = pairs
    # Of a face's points in ascending order, or turned from it, two of three pairs ascend.
    ascends = (np.roll(faces, -1, axis=1) > faces).sum(axis=1) == 2
    opposed = ascends[first] != ascends[second]
    volume = _volumes(corners, points)
    mixed = -volume[volume < 0].sum() > MIXED_SHARE * np.abs(volume).sum()
    if mixed or not opposed.all():
        turned, one_sided = cells_to_flip(np.stack((first, second), axis=1) // 4, opposed, volume)
        turned &= ~one_sided
        corners = np.where(turned[:, None], corners[:, _MIRRORED], corners)
        first, second, alone = (_renumbered(rows, turned) for rows in pairs)
    return _with_neighbours(corners, first, second, alone)


def _renumbered(faces: IntArray, turned: BoolArray) -> IntArray:
    """Numbers of faces, four times the tetrahedron's plus their own, once some are turned."""
    return np.where(turned[faces // 4], faces - faces % 4 + _MIRRORED[faces % 4], faces)


def _volumes(corners: AnyIntArray, points: FloatArray) -> FloatArray:
    """Six times the volumes of tetrahedra, (m,) array, mm^3."""
    numbers = [np.ascontiguousarray(column) for column in corners.T]
    # Axis by axis, which takes half the time of numpy.cross.
    first, second, third = (
        [axis[number] - axis[numbers[0]] for axis in np.ascontiguousarray(points.T)]
        for number in numbers[1:]
    )
    volume: FloatArray = np.zeros(len(corners))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        volume += (first[i] * second[j] - first[j] * second[i]) * third[k]
    return volume


def _split(cells: IntArray, kind: int) -> IntArray:
    """Tetrahedra (m, 4) of the cells of one type, (c, corners) point numbers."""
    lowest = cells.min(axis=1)
    found = []
    for face in _FACES[kind]:
        around = cells[:, face]
        if len(face) == 4:
            first = around.argmin(axis=1)[:, None]
            around = np.take_along_axis(around, (first + np.arange(4)) % 4, axis=1)
        apart = (around != lowest[:, None]).all(axis=1)
        for second in range(1, len(face) - 1):
            triangle = around[:, (0, second, second + 1)]
            found.append(np.column_stack((lowest, triangle))[apart])
    return np.concatenate(found)


def _without_flat_twins(corners: IntArray) -> NumberArray:
    """The tetrahedra without those that enclose nothing.

    Cells whose corners coincide leave some with a repeated corner. Polyhedra that a solver refined
    on one side have points in the middle of an edge, and where such an edge belongs to two of their
    faces, the pieces next to it are the same flat tetrahedron twice, once turned inside out.
    """
    ranked = np.sort(corners, axis=1)
    kept = (ranked[:, 1:] != ranked[:, :-1]).all(axis=1)
    corners, ranked = corners[kept], ranked[kept]
    order, repeated = _equal_rows(ranked)
    twice = np.zeros(len(corners), dtype=bool)
    twice[order[1:][repeated]] = twice[order[:-1][repeated]] = True
    return corners[~twice].astype(np.uint32)


def _with_neighbours(
    corners: NumberArray, first: IntArray, second: IntArray, alone: IntArray
) -> Tetrahedra:
    neighbours = np.empty(corners.size, dtype=np.uint32)
    neighbours[first], neighbours[second] = second, first
    neighbours[alone] = BOUNDARY + np.arange(len(alone))
    return Tetrahedra(
        corners=corners,
        neighbours=neighbours.reshape(-1, 4),
        boundary=corners[:, OPPOSITE].reshape(-1, 3)[alone],
        boundary_place=alone.astype(np.uint32),
    )


def _equal_faces(corners: AnyIntArray) -> tuple[IntArray, BoolArray]:
    """Faces with the same points, of tetrahedra (m, 4); as `_equal_rows`."""
    return _equal_rows(np.sort(corners[:, OPPOSITE].reshape(-1, 3), axis=1))


def _crowded(equal: tuple[IntArray, BoolArray]) -> IntArray:
    """Numbers (k, 3) of faces with the same points, of which there may be two at most."""
    order, same = equal
    triples: IntArray = order[np.flatnonzero(same[1:] & same[:-1])[:, None] + np.arange(3)]
    return triples


def _face_pairs(equal: tuple[IntArray, BoolArray]) -> tuple[IntArray, IntArray, IntArray]:
    """Numbers of faces that have the same points, first and second, and of those without a twin."""
    order, same = equal
    first, second = order[:-1][same], order[1:][same]
    alone = np.ones(len(order), dtype=bool)
    alone[first] = alone[second] = False
    return first, second, np.flatnonzero(alone)


def _equal_rows(rows: AnyIntArray) -> tuple[IntArray, BoolArray]:
    """Order (n,) that puts equal rows of point numbers side by side; mask (n - 1,) of those."""
    count = int(rows.max(initial=0)) + 1
    if count ** rows.shape[1] >= 2**63:
        order = np.lexsort(rows.T)
        ranked = rows[order]
        return order, (ranked[1:] == ranked[:-1]).all(axis=1)
    # One key sorts several times as fast as several.
    key = np.zeros(len(rows), dtype=np.int64)
    for column in rows.T:
        key *= count
        key += column
    order = np.argsort(key)
    key = key[order]
    return order, key[1:] == key[:-1]
