"""Cells of a field split into tetrahedra with matching faces, and the neighbours of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import (
    AnyIntArray,
    BoolArray,
    FloatArray,
    IntArray,
    NumberArray,
    as_float64,
)
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.topology import cells_to_flip
from iriftrace.medium.gradient import (
    HEXAHEDRON,
    MIRRORED_CORNERS,
    MOST_BLOCKS,
    PYRAMID,
    TETRAHEDRON,
    TETRAHEDRON_EDGES,
    WEDGE,
    LinearCells,
    cell_corners,
    few_blocks,
)

BOUNDARY = 0x80000000
"""Flag in a neighbour's number where the data end; the rest is the boundary face's number."""

MOST_TETRAHEDRA = 2**28
"""With more, a face's number would not fit into 32 bits next to the tetrahedron's."""

SLIVER = 0.06
"""Six times a tetrahedron's volume over the cube of its longest edge, below which it is thin; 0.7
for a regular one."""

MIXED_SHARE = 1e-3
"""A larger fraction of negative volume means pieces of both orientations instead of single inverted
cells; flow solutions on snapped meshes have at most 4e-5."""

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
    """Tetrahedra that match face to face; arrays of uint32."""

    # (m, 4) point numbers, right-handed (positive volume) except for inverted cells.
    corners: NumberArray
    # (m, 4) behind the face opposite to each corner: four times the neighbour's number plus the
    # number of the face there, or `BOUNDARY` plus a number of `boundary`.
    neighbours: NumberArray
    boundary: NumberArray  # (b, 3) point numbers of the faces where the data end
    boundary_place: NumberArray  # (b,) four times the tetrahedron's number plus that of its face


def tetrahedra_of(grid: LinearCells) -> Tetrahedra:
    """Split linear cells into tetrahedra and find the neighbours.

    Every quadrilateral is cut at its lowest point number, which is the same from both sides. Every
    cell is then the cone from its own lowest point to the triangles that do not touch it
    (Dompierre et al. 1999, "How to subdivide pyramids, prisms and hexahedra into tetrahedra").
    Raises InputError if there are too many cells, or three of them have a common face.
    """
    points = as_float64(grid.points)
    of_kinds = []
    for kind, (_, cells) in cell_corners(grid).items():
        tetrahedra = np.concatenate(
            [_split(cells[block], kind) for block in few_blocks(len(cells))]
        )
        # Solvers do not agree on the order of a wedge's corners, and a mirrored field is all
        # left-handed. Negative volumes that remain are inverted cells.
        if _volumes(tetrahedra, points).sum() < 0:
            tetrahedra = tetrahedra[:, _MIRRORED]
        of_kinds.append(tetrahedra)
    split = np.concatenate(of_kinds)
    del of_kinds, tetrahedra
    if len(split) > MOST_TETRAHEDRA:
        raise InputError(
            f"The field splits into {len(split)} tetrahedra, but at most {MOST_TETRAHEDRA} can "
            "be numbered; crop it to the part's surroundings.",
            code="field.too_many_cells",
        )
    corners = _without_flat_twins(split, len(points))
    del split
    while True:
        first, second, crowded = _common_faces(corners, len(points))
        if not len(crowded):
            return _of_one_orientation(corners, points, first, second)
        corners = _without_caps(corners, crowded, points)


def _common_faces(corners: NumberArray, count: int) -> tuple[NumberArray, NumberArray, NumberArray]:
    """Pairs of coinciding faces, as two arrays, and triples (k, 3).

    A face's number is four times the tetrahedron's plus its own.
    """
    # The first corner is the lowest one of a tetrahedron, and the first face is opposite to it.
    lowest = np.repeat(corners[:, :1], 4, axis=1)
    lowest[:, 0] = np.minimum(np.minimum(corners[:, 1], corners[:, 2]), corners[:, 3])
    lowest = lowest.ravel()

    def ranked(faces: IntArray) -> NumberArray:
        return np.sort(corners[(faces >> 2)[:, None], OPPOSITE[faces & 3]], axis=1)

    found = []
    for order, same in _equal_rows_of(lowest, ranked, count):
        crowded = np.flatnonzero(same[1:] & same[:-1])
        found.append((order[:-1][same], order[1:][same], order[crowded[:, None] + np.arange(3)]))
    first, second, triples = (
        np.concatenate(parts, dtype=np.uint32, casting="unsafe")
        for parts in zip(*found, strict=True)
    )
    return first, second, triples


def _faces(corners: NumberArray) -> NumberArray:
    """Point numbers (4 m, 3) of the faces of tetrahedra (m, 4)."""
    return corners[:, OPPOSITE].reshape(-1, 3)


def _without_caps(corners: NumberArray, crowded: NumberArray, points: FloatArray) -> NumberArray:
    """The tetrahedra without slivers that lie on a face between two others.

    Filters that split each polyhedron separately cover warped faces with them. `crowded` are the
    numbers (k, 3) of coinciding faces; the thinnest of the three tetrahedra is removed. Raises
    InputError if that one is not a sliver.
    """
    cells = crowded // 4
    at = points[corners[cells]]
    edges = np.stack([at[..., a, :] - at[..., b, :] for a, b in TETRAHEDRON_EDGES])
    longest = np.linalg.norm(edges, axis=-1).max(axis=0)
    volume = np.abs(_volumes(corners[cells.ravel()], points)).reshape(cells.shape)
    thickness = volume / np.maximum(longest, np.finfo(float).tiny) ** 3
    if (thickness.min(axis=1) > SLIVER).any():
        raise InputError(
            "Three or more cells of the field have a common face, so the next cell of a ray is "
            "ambiguous; export the mesh without duplicate cells.",
            code="field.repeated_cells",
        )
    thinnest = np.take_along_axis(cells, thickness.argmin(axis=1)[:, None], axis=1)
    return np.delete(corners, np.unique(thinnest), axis=0)


def _of_one_orientation(
    corners: NumberArray, points: FloatArray, first: NumberArray, second: NumberArray
) -> Tetrahedra:
    """Reverse tetrahedra whose orientation differs from their neighbours'; returns these, too.

    `first` and `second` are the pairs of coinciding faces.

    The sign of a volume does not decide this: half a field may be a mirror image, tetrahedra may be
    numbered at random, and programs that split polyhedra make every piece right-handed, including
    inverted slivers. A ray that follows faces through such a piece is lost. The order of the points
    on the common faces of neighbours does decide it.
    """
    boundary = np.ones(corners.size, dtype=bool)
    boundary[first] = boundary[second] = False
    alone = np.flatnonzero(boundary)
    # Ascending or reversed, two of three pairs of consecutive points of a face ascend.
    ascends = np.concatenate(
        [
            (np.roll(faces, -1, axis=1) > faces).sum(axis=1) == 2
            for faces in (_faces(corners[block]) for block in few_blocks(len(corners)))
        ]
    )
    opposed = ascends[first] != ascends[second]
    volume = _volumes(corners, points)
    mixed = -volume[volume < 0].sum() > MIXED_SHARE * np.abs(volume).sum()
    if mixed or not opposed.all():
        pairs = np.stack((first, second), axis=1).astype(np.int64) // 4
        turned, one_sided = cells_to_flip(pairs, opposed, volume)
        turned &= ~one_sided
        corners = np.where(turned[:, None], corners[:, _MIRRORED], corners)
        first, second, alone = (
            np.where(turned[rows // 4], rows - rows % 4 + _MIRRORED[rows % 4], rows)
            for rows in (first, second, alone)
        )
    neighbours = np.empty(corners.size, dtype=np.uint32)
    neighbours[first], neighbours[second] = second, first
    neighbours[alone] = BOUNDARY + np.arange(len(alone))
    return Tetrahedra(
        corners=corners,
        neighbours=neighbours.reshape(-1, 4),
        boundary=corners[(alone >> 2)[:, None], OPPOSITE[alone & 3]],
        boundary_place=alone.astype(np.uint32),
    )


def _volumes(corners: AnyIntArray, points: FloatArray) -> FloatArray:
    """Six times the volumes of tetrahedra, (m,) array, mm^3."""
    axes = np.ascontiguousarray(points.T)
    volume: FloatArray = np.zeros(len(corners))
    for block in few_blocks(len(corners)):
        numbers = [np.ascontiguousarray(column) for column in corners[block].T]
        # Axis by axis, which is twice as fast as numpy.cross.
        first, second, third = (
            [axis[number] - axis[numbers[0]] for axis in axes] for number in numbers[1:]
        )
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            volume[block] += (first[i] * second[j] - first[j] * second[i]) * third[k]
    return volume


def _split(cells: IntArray, kind: int) -> NumberArray:
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
    return np.concatenate(found, dtype=np.uint32, casting="unsafe")


def _without_flat_twins(corners: NumberArray, count: int) -> NumberArray:
    """The tetrahedra without those of zero volume.

    Cells with coinciding corners give tetrahedra with a repeated corner. Polyhedra refined on one
    side have points in the middle of an edge. If such an edge belongs to two of their faces, the
    pieces next to it are the same flat tetrahedron twice, once inverted.
    """
    kept = np.ones(len(corners), dtype=bool)
    for block in few_blocks(len(corners)):
        some = np.sort(corners[block], axis=1)
        kept[block] = (some[:, 1:] != some[:, :-1]).all(axis=1)
    corners = corners[kept]
    twice = np.zeros(len(corners), dtype=bool)

    def ranked(numbers: IntArray) -> NumberArray:
        return np.sort(corners[numbers], axis=1)

    # The first corner is the lowest one.
    for order, repeated in _equal_rows_of(corners[:, 0], ranked, count):
        twice[order[1:][repeated]] = twice[order[:-1][repeated]] = True
    return corners[~twice]


def _equal_rows_of(
    lowest: NumberArray, ranked: Callable[[IntArray], NumberArray], count: int
) -> Iterator[tuple[IntArray, BoolArray]]:
    """Numbers of rows, in an order with equal rows adjacent, and the mask of equal neighbours.

    `lowest` is the lowest point number of each row, below `count`, and `ranked` returns the sorted
    rows of given numbers. Rows come in several parts, as a sort of all of them needs much memory.
    """
    size = max(1, -(-count // MOST_BLOCKS))
    for start in range(0, count, size):
        numbers = np.flatnonzero((lowest >= start) & (lowest < start + size))
        order, same = _equal_rows(ranked(numbers))
        yield numbers[order], same


def _equal_rows(rows: AnyIntArray) -> tuple[IntArray, BoolArray]:
    """Order (n,) that makes equal rows of point numbers adjacent; mask (n - 1,) of equal pairs."""
    count = int(rows.max(initial=0)) + 1
    if count ** rows.shape[1] >= 2**63:
        order = np.lexsort(rows.T)
        ranked = rows[order]
        return order, (ranked[1:] == ranked[:-1]).all(axis=1)
    # Sorting by one key is several times as fast as by several.
    key = np.zeros(len(rows), dtype=np.int64)
    for column in rows.T:
        key *= count
        key += column
    order = np.argsort(key)
    key = key[order]
    return order, key[1:] == key[:-1]
