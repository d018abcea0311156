"""Areas, normals and meshes of many triangles at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from iriftrace.core.arrays import (
    AnyIntArray,
    BoolArray,
    Float32Array,
    FloatArray,
    IntArray,
    as_float64,
)

if TYPE_CHECKING:
    import pyvista as pv


def area_vectors(vertices: Float32Array | FloatArray, faces: AnyIntArray) -> FloatArray:
    """Normals of triangles times their areas, (m, 3) array, mm^2, counter-clockwise side."""
    points = np.asarray(vertices, dtype=np.float64)
    first = points[faces[:, 0]]
    u, v = points[faces[:, 1]] - first, points[faces[:, 2]] - first
    return 0.5 * cross_rows(u, v)


def cross_rows(u: FloatArray, v: FloatArray) -> FloatArray:
    """(n, 3) array: vector products of the rows of two (n, 3) arrays."""
    # Written out, because numpy.cross takes several times as long on arrays of triples.
    return np.stack(
        (
            u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1],
            u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2],
            u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0],
        ),
        axis=1,
    )


def row_lengths(vectors: FloatArray) -> FloatArray:
    """(n,) array: lengths of (n, 3) vectors."""
    # As fast again as numpy.linalg.norm for many short vectors.
    return as_float64(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


def unit_vectors(vectors: FloatArray) -> FloatArray:
    """(n, 3) vectors scaled to length 1; zero stays zero."""
    length = row_lengths(vectors)
    length[length == 0.0] = 1.0
    return vectors / length[:, None]


def smooth_normals(vertices: Float32Array | FloatArray, faces: IntArray) -> FloatArray:
    """Area-weighted unit normals at the vertices, (n, 3) array; never zero at a used vertex."""
    areas = area_vectors(vertices, faces)
    sums = np.zeros((len(vertices), 3))
    for corner in faces.T:
        for axis in range(3):
            sums[:, axis] += np.bincount(corner, areas[:, axis], minlength=len(vertices))
    # Facets that cancel exactly leave no mean; any one of them is then as good.
    one_of = np.zeros((len(vertices), 3))
    one_of[faces.ravel()] = np.repeat(unit_vectors(areas), 3, axis=0)
    normals = unit_vectors(sums)
    return np.where(np.any(normals, axis=1)[:, None], normals, one_of)


def normals_along(vertices: Float32Array, faces: IntArray, vectors: FloatArray) -> Float32Array:
    """Unit vectors along the given (n, 3) ones; the facets' mean where these vanish."""
    size = row_lengths(vectors)
    # A gradient this far below the usual one is rounding and has no direction.
    weak = size <= 1e-6 * np.median(size)
    normals = unit_vectors(vectors)
    if weak.any():
        normals[weak] = smooth_normals(vertices, faces)[weak]
    return normals.astype(np.float32)


def used_vertices(count: int, faces: AnyIntArray) -> tuple[BoolArray, IntArray]:
    """Vertices of ``count`` that the triangles use, and the triangles numbered among these."""
    used = np.zeros(count, dtype=bool)
    used[faces.ravel()] = True
    renumbered: IntArray = (np.cumsum(used) - 1)[faces]
    return used, renumbered


def polydata(vertices: ArrayLike, faces: ArrayLike) -> pv.PolyData:
    """Triangles as VTK's mesh."""
    import pyvista as pv

    mesh: pv.PolyData = pv.PolyData.from_regular_faces(np.asarray(vertices), np.asarray(faces))
    return mesh
