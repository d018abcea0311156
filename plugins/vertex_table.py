"""What is known at the vertices of a scene's meshes, in rows of four that a kernel gathers at once.

Single precision, as the meshes themselves are; upcasting a gathered corner gives the same bits as a
table in double precision would, at half of the memory.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .aligned import aligned
from .refraction import Triangle

_PLAIN, _STEEP = 2, 4
"""Rows per vertex where the index's slope at the shells is not known, and where it is."""


class MeshArrays(NamedTuple):
    """One mesh, in NumPy arrays."""

    places: NDArray[np.floating]  # (n, 3), mm, world
    faces: NDArray[np.uint32]  # (m, 3)
    normals: NDArray[np.floating] | None  # (n, 3), unit
    slopes: NDArray[np.floating] | None  # (n, 7), from shell_slopes


class VertexTable:
    """Triangles of many meshes, and what is known at their corners.

    A vertex's rows are x, y, z, 0; the normal and the gradient's part along it; xx, yy, zz, yz; and
    xz, xy, 0, 0 of the second derivatives. Without ``steep`` there are the first two.

    Parameters
    ----------
    meshes : list of MeshArrays
        What one lacks is taken to be zero.
    steep : bool
        Keep the slopes.
    """

    def __init__(self, meshes: list[MeshArrays], steep: bool) -> None:
        import mitsuba as mi

        per_vertex = _STEEP if steep else _PLAIN
        rows = np.zeros((sum(len(mesh.places) for mesh in meshes), 4 * per_vertex), np.float32)
        self.face_count = sum(len(mesh.faces) for mesh in meshes)
        corners = np.zeros((self.face_count, 4), dtype=np.uint32)
        first_vertex = first_face = 0
        for mesh in meshes:
            own = rows[first_vertex : first_vertex + len(mesh.places)]
            own[:, 0:3] = mesh.places
            if mesh.normals is not None:
                # Mitsuba turns a (0, 0, 0) normal into NaN; zero makes the tracer take the facet's.
                own[:, 4:7] = np.nan_to_num(mesh.normals)
            if steep and mesh.slopes is not None:
                own[:, 7:14] = mesh.slopes
            # The first of a corner's rows.
            first_row = per_vertex * (mesh.faces + first_vertex)
            corners[first_face : first_face + len(mesh.faces), :3] = first_row
            first_vertex, first_face = first_vertex + len(own), first_face + len(mesh.faces)
        self._rows = mi.Float(aligned(rows.ravel()))
        self._corners = mi.UInt32(aligned(corners.ravel()))

    def triangle(self, face: Any, active: Any) -> Triangle:
        """Corners of triangles (Point3d, mm)."""
        import mitsuba as mi

        return Triangle(*(mi.Point3d(row.xyz) for row in self._gather(0, face, active)))

    def normals(self, face: Any, active: Any) -> Triangle:
        """Vertex normals of triangles (Vector3d); zero where a mesh has none."""
        import mitsuba as mi

        return Triangle(*(mi.Vector3d(row.xyz) for row in self._gather(1, face, active)))

    def gradients(self, face: Any, direction: Any, active: Any) -> tuple[Triangle, Triangle]:
        """Gradient of the index at corners, 1/mm, and its change along a direction, 1/mm^2.

        All vectors are Vector3f.
        """
        x, y, z = direction
        gradients, changes = [], []
        known = zip(*(self._gather(row, face, active) for row in (1, 2, 3)), strict=True)
        for normal, (xx, yy, zz, yz), (xz, xy, _, _) in known:
            gradients.append(normal.xyz * normal.w)
            changes.append(
                type(direction)(
                    xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z
                )
            )
        return Triangle(*gradients), Triangle(*changes)

    def _gather(self, row: int, face: Any, active: Any) -> list[Any]:
        """One row of each corner of triangles (three Vector4f)."""
        import drjit as dr
        import mitsuba as mi

        *corners, _ = dr.gather(mi.Vector4u, self._corners, face, active)
        return [dr.gather(mi.Vector4f, self._rows, corner + row, active) for corner in corners]
