"""An unstructured grid in OpenFOAM's form: faces between an owner and a neighbour."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.medium.gradient import cell_corners

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Corners of the faces of tetrahedra, hexahedra, wedges and pyramids, seen from outside.
_FACES = {
    10: ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    12: (
        *((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4)),
        *((2, 3, 7, 6), (0, 4, 7, 3), (1, 2, 6, 5)),
    ),
    13: ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    14: ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
}


@frozen
class Patch:
    """A part of the boundary."""

    name: str
    kind: str  # its type in ``polyMesh/boundary``, such as "wall"
    # From face centres (m, 3) to the mask (m,) of its own; the first that wants a face gets it.
    where: Callable[[FloatArray], NDArray[np.bool_]]
    value: float | None  # fixed value of the field; None for ``zeroGradient``


@frozen(eq=False)
class FaceMesh:
    """Faces with -1 instead of a fourth corner, in OpenFOAM's order: internal ones first."""

    points: FloatArray  # (n, 3)
    faces: IntArray  # (f, 4)
    owner: IntArray  # (f,)
    neighbour: IntArray  # (i,), of the internal faces
    sizes: tuple[int, ...]  # boundary faces of each patch


def face_mesh(grid: Any, patches: Sequence[Patch], groups: IntArray | None = None) -> FaceMesh:
    """Faces of a grid of linear cells; cells of one group become one polyhedron."""
    points = np.asarray(grid.points, dtype=np.float64)
    groups = np.arange(grid.n_cells) if groups is None else groups
    corners, cells = _all_faces(grid)
    corners = _outward(points, corners, np.asarray(grid.cell_centers().points)[cells])
    key = np.sort(corners, axis=1)
    number = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(number, kind="stable")
    count = np.bincount(number)
    if count.max() > 2:
        raise ValueError("three cells have a common face")
    start = np.concatenate(([0], np.cumsum(count)[:-1]))
    here, there = order[start], order[np.minimum(start + 1, len(order) - 1)]
    one = groups[cells[here]]
    two = np.where(count == 2, groups[cells[there]], -1)
    # A face is stored as the cell with the smaller number sees it.
    faces = corners[np.where((two >= 0) & (two < one), there, here)]
    owner, other = np.where(two >= 0, np.minimum(one, two), one), np.maximum(one, two)
    inner = np.flatnonzero((two >= 0) & (one != two))
    inner = inner[np.lexsort((other[inner], owner[inner]))]
    outer = np.flatnonzero(two < 0)
    patch = _patch_of(points, faces[outer], patches)
    by_patch = np.argsort(patch, kind="stable")
    outer = outer[by_patch]
    chosen = np.concatenate((inner, outer))
    return FaceMesh(
        points,
        faces[chosen],
        owner[chosen],
        other[inner],
        tuple(int(n) for n in np.bincount(patch, minlength=len(patches))),
    )


def _all_faces(grid: Any) -> tuple[IntArray, IntArray]:
    corners, cells = [], []
    for kind, (numbers, points) in cell_corners(grid).items():
        for face in _FACES[kind]:
            padded = np.full((len(numbers), 4), -1, dtype=np.int64)
            padded[:, : len(face)] = points[:, face]
            corners.append(padded)
            cells.append(numbers)
    return np.concatenate(corners), np.concatenate(cells)


def reversed_faces(faces: IntArray) -> IntArray:
    """Faces as the cell on their other side sees them."""
    turned = faces[:, [0, 3, 2, 1]]
    triangles = faces[:, 3] < 0
    turned[triangles] = faces[triangles][:, [0, 2, 1, 3]]
    return turned


def _outward(points: FloatArray, faces: IntArray, inside: FloatArray) -> IntArray:
    """Faces that wind counter-clockwise seen from outside; programs disagree about wedges."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    side = np.einsum("ij,ij->i", np.cross(b - a, c - a), face_centres(points, faces) - inside)
    return np.where(side[:, None] < 0.0, reversed_faces(faces), faces)


def face_centres(points: FloatArray, faces: IntArray) -> FloatArray:
    """Means of the corners, (f, 3)."""
    there = faces >= 0
    total = (points[faces] * there[:, :, None]).sum(axis=1)
    centres: FloatArray = total / there.sum(axis=1)[:, None]
    return centres


def _patch_of(points: FloatArray, faces: IntArray, patches: Sequence[Patch]) -> IntArray:
    centres = face_centres(points, faces)
    result = np.full(len(faces), -1, dtype=np.int64)
    for number, patch in enumerate(patches):
        result[(result < 0) & patch.where(centres)] = number
    if (result < 0).any():
        raise ValueError("some boundary faces belong to no patch")
    return result
