"""Vertices, normals and gradients of all triangles, in tables that kernels gather from."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import DTypeLike, NDArray

from iriftrace.core.arrays import AnyArray, FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.medium.shells.hessian import HESSIAN_AXES, PLY_COLUMNS
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.snell import Triangle

EDGES = 1000
"""Edges of each shell on which its derivatives are checked."""

FLAT = 1e-5
"""Relative change of the gradient along an edge below which both may be rounding."""

OTHER_UNIT = 5.0
"""Factor between what gradient and second derivatives say that only another unit makes: noise and
coarse meshes leave less than 2, mm and cm differ by 10."""


def has_derivatives(shape: mi.Mesh) -> bool:
    """True if a shell has the derivatives of the index at its vertices, False if it has none.

    InputError for some of them, or under other names: they would be ignored in silence.
    """
    values, count = mi.traverse(shape), shape.vertex_count()
    given = {
        name: len(values[name]) // count
        for name, _ in values
        if name.startswith("vertex_") and ("gradient" in name.lower() or "hessian" in name.lower())
    }
    expected = {f"vertex_{name}": size for name, size in PLY_COLUMNS.items()}
    if given and given != expected:
        raise InputError(
            f"Shell '{shape.id()}' has the vertex attributes {_listed(given)}, but the derivatives "
            f"of the index are {_listed(expected)}; give all of them by these names, or none "
            "(a PLY's columns gradient_1, gradient_2, gradient_3 become vertex_gradient).",
            code="shells.vertex_attributes",
        )
    return bool(given)


def _listed(attributes: dict[str, int]) -> str:
    return ", ".join(f"{name} ({size})" for name, size in sorted(attributes.items()))


def shell_derivatives(
    shape: mi.Mesh, normals: NDArray[np.floating], step: float
) -> tuple[FloatArray, FloatArray]:
    """Normals, (n, 3), and derivatives of the index, (n, 7), at the vertices of a shell with them.

    Normals are along the gradient, as the mesh's own vertex normals (n, 3) are but for single
    precision, or these where there is no gradient or the mesh was turned. Derivatives are the
    magnitude of the gradient, 1/mm, and the Hessian xx, yy, zz, yz, xz, xy, 1/mm^2. The step is the
    index outside less that inside; the file counts in these steps, so a shell without one bends
    nothing.
    """
    values = mi.traverse(shape)
    columns: list[FloatArray] = [
        np.nan_to_num(np.array(values[f"vertex_{name}"], dtype=np.float64).reshape(-1, size))
        for name, size in PLY_COLUMNS.items()
    ]
    gradient, *others = columns
    hessian = np.hstack(others)
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    found = np.divide(gradient, length, out=np.array(normals, dtype=np.float64), where=length > 0)
    if np.abs(gradient - length * normals).sum() > 1e-5 * length.sum():
        hessian = _rotated(hessian, _rotation(gradient, normals))
        found = np.asarray(normals, dtype=np.float64)
    return found, step * np.hstack((length, hessian))


def check_lengths(shells: Sequence[tuple[FloatArray, IntArray, FloatArray]]) -> None:
    """Refuse derivatives of the index whose mm are not those of the shells, with an InputError.

    Each shell has vertices (n, 3), mm, triangles (m, 3) and derivatives as `shell_derivatives`
    gives them, of unit normals. Along an edge the gradient changes by the Hessian times the edge;
    on flow meshes the median over all shells is off by half at most.
    """
    ratios = []
    for vertices, faces, rows in shells:
        start, end = faces[:: 1 + len(faces) // EDGES, :2].T
        gradient = rows[:, :3] * rows[:, 3:4]
        hessian = _full(rows[:, 4:])
        means = (hessian[start] + hessian[end]) / 2.0
        said = np.linalg.norm(
            np.einsum("nij,nj->ni", means, vertices[end] - vertices[start]), axis=1
        )
        came = np.linalg.norm(gradient[end] - gradient[start], axis=1)
        curved = (came > 0.0) & (said > FLAT * rows[start, 3])
        ratios.append(came[curved] / said[curved])
    every = np.concatenate(ratios) if ratios else np.zeros(0)
    ratio = float(np.median(every)) if len(every) else 1.0
    if not 1.0 / OTHER_UNIT < ratio < OTHER_UNIT:
        raise InputError(
            f"Along the edges of the shells the gradient of the index changes {ratio:.3g} times as "
            "much as its second derivatives say, as after a to_world or a unit that makes all "
            f"lengths {1.0 / ratio:.3g} times as large: divide vertex_gradient (1/mm) by this "
            "factor and vertex_hessian_xx ... (1/mm^2) by its square.",
            code="shells.gradient_scale",
        )


def _rotation(before: FloatArray, after: NDArray[np.floating]) -> FloatArray:
    """Rotation (3, 3) that takes vectors into unit vectors, in least squares (Kabsch 1976).

    A mesh's ``to_world`` turns its normals, but not what else its file knows.
    """
    left, _, right = np.linalg.svd(after.T @ before)
    sign = np.sign(np.linalg.det(left) * np.linalg.det(right))
    return as_float64(left @ np.diag((1.0, 1.0, sign)) @ right)


def _rotated(hessian: FloatArray, rotation: FloatArray) -> FloatArray:
    """Hessians, (n, 6) in the file's order, after a rotation."""
    full = rotation @ _full(hessian) @ rotation.T
    return np.stack([full[:, i, j] for i, j in HESSIAN_AXES.values()], axis=1)


def _full(hessian: FloatArray) -> FloatArray:
    """Hessians (n, 3, 3) of their six components (n, 6), in the file's order."""
    full = np.empty((len(hessian), 3, 3))
    for column, (i, j) in enumerate(HESSIAN_AXES.values()):
        full[:, i, j] = full[:, j, i] = hessian[:, column]
    return full


BYTES = 128
"""The widest vector that Dr.Jit loads: 16 numbers of 8 bytes."""


def aligned(values: AnyArray) -> AnyArray:
    """Copy an array of one dimension to memory that starts at a multiple of 128 bytes.

    Dr.Jit uses NumPy's own memory if it can, and compiles into the kernel whether an address is
    aligned. NumPy's addresses are aligned by chance, and each other combination compiles a kernel
    again.
    """
    copy = aligned_zeros(len(values), values.dtype)
    copy[:] = values
    return copy


def aligned_rows(rows: AnyArray) -> list[AnyArray]:
    """The columns of (n, 3) rows in such memory, for a vector of Dr.Jit."""
    return [aligned(column) for column in rows.reshape(-1, 3).T]


def aligned_zeros(count: int, dtype: DTypeLike) -> AnyArray:
    """Array (count,) of zeros in such memory, to be filled in."""
    size = count * np.dtype(dtype).itemsize
    memory = np.zeros(size + BYTES, dtype=np.uint8)
    start = -memory.ctypes.data % BYTES
    return memory[start : start + size].view(dtype)


_PLAIN, _WITH_DERIVATIVES = 2, 4
"""Rows per vertex without and with the derivatives of the index."""


class VertexTable:
    """Triangles of many meshes with the data at their corners; zero where a mesh has none.

    A vertex's rows are x, y, z, 0; the normal and the gradient's magnitude; xx, yy, zz, yz; and xz,
    xy, 0, 0 of the Hessian. Without ``derivatives`` there are the first two.
    """

    def __init__(self, shapes: list[DescribedShape], derivatives: bool) -> None:
        meshes = [shape for shape in shapes if shape.kind != BLOCKER]
        per_vertex = _WITH_DERIVATIVES if derivatives else _PLAIN
        vertices = sum(mesh.shape.vertex_count() for mesh in meshes)
        self.face_count = sum(mesh.face_count for mesh in meshes)
        # Filled in mesh by mesh: copies of all of them would take as much again.
        rows = aligned_zeros(4 * per_vertex * vertices, np.float32)
        corners = aligned_zeros(4 * self.face_count, np.uint32)
        rest, faces_left = rows.reshape(-1, 4 * per_vertex), corners.reshape(-1, 4)
        first_vertex, derived = 0, []
        for mesh in meshes:
            shape, count = mesh.shape, mesh.shape.vertex_count()
            own, rest = rest[:count], rest[count:]
            own[:, 0:3] = np.array(shape.vertex_positions_buffer()).reshape(-1, 3)
            if mesh.smooth:
                # Mitsuba turns a (0, 0, 0) normal into NaN; zero makes the tracer take the facet's.
                normals = np.nan_to_num(np.array(shape.vertex_normals_buffer()).reshape(-1, 3))
                own[:, 4:7] = normals
                if derivatives and mesh.kind == SHELL:
                    outside, inside = mesh.sides
                    own[:, 4:7], own[:, 7:14] = shell_derivatives(shape, normals, outside - inside)
            faces = np.array(shape.faces_buffer()).reshape(-1, 3)
            if derivatives and mesh.kind == SHELL:
                derived.append((own[:, :3], faces, own[:, 4:14]))
            # The first of a corner's rows.
            faces_left[: mesh.face_count, :3] = per_vertex * (faces + first_vertex)
            faces_left = faces_left[mesh.face_count :]
            first_vertex += count
        check_lengths(derived)
        counts = [0 if s.kind == BLOCKER else s.shape.vertex_count() for s in shapes]
        self._vertices_before = np.cumsum([0, *counts]).tolist()
        self._rows = mi.Float(rows)
        self._corners = mi.UInt32(corners)

    def with_steps(self, factors: dict[int, dt.Float64]) -> VertexTable:
        """The same table with other steps of the index, in which files give its derivatives.

        Factors (Float64) on the steps of some shapes, by their places in the scene's list.
        """
        other, width = copy(self), 4 * _WITH_DERIVATIVES
        other._rows = mi.Float(self._rows)
        for number, factor in factors.items():
            first, end = self._vertices_before[number : number + 2]
            place = dr.arange(mi.UInt32, width * (end - first)) + dr.opaque(
                mi.UInt32, width * first
            )
            derived = (place % width >= 7) & (place % width < 14)
            value = dr.gather(mi.Float, self._rows, place) * mi.Float(factor)
            dr.scatter(other._rows, value, place, derived)
        return other

    def triangle(self, face: dt.UInt32, active: dt.Bool) -> Triangle:
        """Corners of triangles (Point3d, mm)."""
        return Triangle(*(mi.Point3d(row.xyz) for row in self._gather(0, face, active)))

    def normals(self, face: dt.UInt32, active: dt.Bool) -> Triangle:
        """Vertex normals of triangles (Vector3d); zero where a mesh has none."""
        return Triangle(*(mi.Vector3d(row.xyz) for row in self._gather(1, face, active)))

    def gradients(
        self, face: dt.UInt32, direction: dt.Vector3f, active: dt.Bool
    ) -> tuple[Triangle, Triangle]:
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

    def _gather(self, row: int, face: dt.UInt32, active: dt.Bool) -> list[dt.Vector4f]:
        """One row of each corner of triangles (three Vector4f)."""
        *corners, _ = dr.gather(mi.Vector4u, self._corners, face, active)
        return [dr.gather(mi.Vector4f, self._rows, corner + row, active) for corner in corners]


SHELL, PART, BLOCKER = 0, 1, 2


class DescribedShape(NamedTuple):
    """One shape, as the tables have it."""

    shape: dt.Shape
    kind: int
    sides: tuple[float, float]  # index outside and inside
    level: float  # index of the air on it
    smooth: bool  # it has normals at its vertices
    derived: bool  # and the derivatives of the index, as a shell's file has them
    face_count: int  # 0 for what only blocks the view
