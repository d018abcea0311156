"""A Mitsuba scene flattened into tables that a kernel gathers from.

Triangles of part and shells, the index on each side of a shell, and at its vertices the normal and
the derivatives of the index. Vertices are float32, as Mitsuba's own, and upcast where they are
used.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.part.tessellation import MOST_FACES
from iriftrace.plugins.kernels.edges import NONE, edge_neighbours
from iriftrace.plugins.kernels.snell import Triangle, facet_normal
from iriftrace.shells.hessian import HESSIAN_AXES, PLY_COLUMNS


def has_derivatives(shape: Any) -> bool:
    """True if a shell has the derivatives of the index at its vertices, False if it has none.

    InputError for some of them, or under other names: they would be ignored in silence.
    """
    import mitsuba as mi

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
            "(a PLY's columns gradient_1, gradient_2, gradient_3 become vertex_gradient)."
        )
    return bool(given)


def _listed(attributes: dict[str, int]) -> str:
    return ", ".join(f"{name} ({size})" for name, size in sorted(attributes.items()))


def shell_derivatives(
    shape: Any, normals: NDArray[np.floating], step: float
) -> tuple[FloatArray, FloatArray]:
    """Normals, (n, 3), and derivatives of the index, (n, 7), at the vertices of a shell with them.

    Normals are along the gradient, as the mesh's own vertex normals (n, 3) are but for single
    precision, or these where there is no gradient or the mesh was turned. Derivatives are the
    magnitude of the gradient, 1/mm, and the Hessian xx, yy, zz, yz, xz, xy, 1/mm^2. The step is the
    index outside less that inside; the file counts in these steps, so a shell without one bends
    nothing.
    """
    import mitsuba as mi

    values = mi.traverse(shape)
    gradient, *others = (
        np.nan_to_num(np.array(values[f"vertex_{name}"], dtype=np.float64).reshape(-1, size))
        for name, size in PLY_COLUMNS.items()
    )
    hessian = np.hstack(others)
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    found = np.divide(gradient, length, out=np.array(normals, dtype=np.float64), where=length > 0)
    if np.abs(gradient - length * normals).sum() > 1e-5 * length.sum():
        hessian = _rotated(hessian, _rotation(gradient, normals))
        found = np.asarray(normals, dtype=np.float64)
    return found, step * np.hstack((length, hessian))


def _rotation(before: FloatArray, after: FloatArray) -> FloatArray:
    """Rotation (3, 3) that takes vectors into unit vectors, in least squares (Kabsch 1976).

    A mesh's ``to_world`` turns its normals, but not what else its file knows.
    """
    left, _, right = np.linalg.svd(after.T @ before)
    sign = np.sign(np.linalg.det(left) * np.linalg.det(right))
    rotation: FloatArray = left @ np.diag((1.0, 1.0, sign)) @ right
    return rotation


def _rotated(hessian: FloatArray, rotation: FloatArray) -> FloatArray:
    """Hessians, (n, 6) in the file's order, after a rotation."""
    full = np.empty((len(hessian), 3, 3))
    for column, (i, j) in enumerate(HESSIAN_AXES.values()):
        full[:, i, j] = full[:, j, i] = hessian[:, column]
    full = rotation @ full @ rotation.T
    return np.stack([full[:, i, j] for i, j in HESSIAN_AXES.values()], axis=1)


BYTES = 128
"""The widest vector that Dr.Jit loads: 16 numbers of 8 bytes."""


def aligned(values: NDArray[Any]) -> NDArray[Any]:
    """Copy an array of one dimension to memory that starts at a multiple of 128 bytes.

    Dr.Jit reads NumPy's own memory where it can, and writes into the kernel whether an address is
    aligned. NumPy's addresses are so by chance, and each other combination compiles a kernel anew.
    """
    copy = aligned_zeros(len(values), values.dtype)
    copy[:] = values
    return copy


def aligned_zeros(count: int, dtype: Any) -> NDArray[Any]:
    """Array (count,) of zeros in such memory, to be filled in."""
    size = count * np.dtype(dtype).itemsize
    memory = np.zeros(size + BYTES, dtype=np.uint8)
    start = -memory.ctypes.data % BYTES
    return memory[start : start + size].view(dtype)


_PLAIN, _WITH_DERIVATIVES = 2, 4
"""Rows per vertex without and with the derivatives of the index."""


class VertexTable:
    """Triangles of many meshes, and what is known at their corners; zero where a mesh lacks it.

    A vertex's rows are x, y, z, 0; the normal and the gradient's magnitude; xx, yy, zz, yz; and xz,
    xy, 0, 0 of the Hessian. Without ``derivatives`` there are the first two.
    """

    def __init__(self, meshes: list[_Described], derivatives: bool) -> None:
        import mitsuba as mi

        per_vertex = _WITH_DERIVATIVES if derivatives else _PLAIN
        vertices = sum(mesh.shape.vertex_count() for mesh in meshes)
        self.face_count = sum(mesh.face_count for mesh in meshes)
        # Filled in mesh by mesh: copies of all of them would take as much again.
        rows = aligned_zeros(4 * per_vertex * vertices, np.float32)
        corners = aligned_zeros(4 * self.face_count, np.uint32)
        rest, faces_left = rows.reshape(-1, 4 * per_vertex), corners.reshape(-1, 4)
        first_vertex = 0
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
            # The first of a corner's rows.
            faces_left[: mesh.face_count, :3] = per_vertex * (faces + first_vertex)
            faces_left = faces_left[mesh.face_count :]
            first_vertex += count
        self._rows = mi.Float(rows)
        self._corners = mi.UInt32(corners)

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


SHELL, PART, BLOCKER = 0, 1, 2

PART_ID = "part"


def shell_indices(bsdf: Any) -> tuple[float, float] | None:
    """Index outside and inside, if the bsdf is a shell's; None for an opaque one."""
    import mitsuba as mi

    if bsdf is None:
        return None
    if hasattr(bsdf, "ext_ior"):
        return bsdf.ext_ior, bsdf.int_ior
    if bsdf.class_name() == "SmoothDielectric":
        return 1.0, float(mi.traverse(bsdf)["eta"])
    return None


def surface_index(bsdf: Any) -> float:
    """Index of the air on a shell itself."""
    pair = shell_indices(bsdf)
    assert pair is not None
    return float(getattr(bsdf, "iso_ior", 0.5 * (pair[0] + pair[1])))


def is_closed(vertices: NDArray[np.float32], faces: NDArray[np.uint32]) -> bool:
    """True if a surface has no boundary, by integrals that need no edges.

    On a closed surface the vector area vanishes and x, y and z give the same enclosed volume
    (Gauss); an opening breaks one of the two unless it is tiny.
    """
    # Axis by axis, which takes half the time of rows of three.
    axes = np.ascontiguousarray(vertices.T, dtype=np.float64)
    corners = [axes[:, number] for number in np.ascontiguousarray(faces.T)]
    low = np.min([corner.min(axis=1) for corner in corners], axis=0)
    high = np.max([corner.max(axis=1) for corner in corners], axis=0)
    u, v = corners[1] - corners[0], corners[2] - corners[0]
    area = np.stack([u[i] * v[j] - u[j] * v[i] for i, j in ((1, 2), (2, 0), (0, 1))]) / 2
    centre = (corners[0] + corners[1] + corners[2]) / 3 - ((low + high) / 2)[:, None]
    total = np.sqrt((area * area).sum(axis=0)).sum()
    size = np.linalg.norm(high - low)
    volumes = (centre * area).sum(axis=1)
    return bool(
        np.linalg.norm(area.sum(axis=1)) < 1e-5 * total and np.ptp(volumes) < 1e-5 * total * size
    )


def _runs_against_its_normals(shape: Any) -> bool:
    """True if most of a mesh's triangles face away from its vertex normals, by area."""
    import drjit as dr
    import mitsuba as mi

    corners = dr.unravel(mi.Vector3u, shape.faces_buffer())
    a, b, c = (dr.gather(mi.Point3f, shape.vertex_positions_buffer(), v) for v in corners)
    normal = sum(dr.gather(mi.Vector3f, shape.vertex_normals_buffer(), v) for v in corners)
    facing = dr.dot(dr.cross(b - a, c - a), normal)
    return bool(dr.sum(dr.select(dr.isfinite(facing), facing, 0))[0] < 0)


class _Described(NamedTuple):
    """One shape, as the tables have it."""

    shape: Any
    kind: int
    sides: tuple[float, float]  # index outside and inside
    level: float  # index of the air on it
    smooth: bool  # it has normals at its vertices
    derived: bool  # and the derivatives of the index, as a shell's file has them
    face_count: int  # 0 for what only blocks the view


def _part_of(shapes: list[Any]) -> tuple[Any, int]:
    """The measured part, and its place in a scene's list."""
    parts = [i for i, shape in enumerate(shapes) if shape.id() == PART_ID]
    if len(parts) != 1:
        raise InputError(
            f"The scene has {len(parts)} shapes with id '{PART_ID}', but the measured part is "
            "known by it: give exactly one shape this id, and load with optimize=False, because "
            "Mitsuba otherwise merges shapes of equal bsdfs into one without id."
        )
    part = shapes[parts[0]]
    if shell_indices(part.bsdf()) is not None or not part.is_mesh():
        raise InputError(
            "The shape with id 'part' must be an opaque triangle mesh (ply, obj, mi.Mesh), since "
            "faces and regions are numbered by it; a sphere or cylinder of Mitsuba is none."
        )
    if part.face_count() == 0:
        raise InputError(
            "The part's file has no triangles, so there is nothing to see; give the part's surface "
            "as triangles, or write the scene again."
        )
    if part.face_count() > MOST_FACES:
        raise InputError(
            f"The part has {part.face_count()} faces, but channel part.face holds at most "
            f"{MOST_FACES} exactly; simplify the mesh."
        )
    return part, parts[0]


def _described(shape: Any, is_part: bool) -> _Described:
    """A shape's row of the tables; InputError for a shell that cannot be traced."""
    sides = shell_indices(shape.bsdf())
    if sides is None and not is_part:
        return _Described(shape, BLOCKER, (1.0, 1.0), 1.0, False, False, 0)
    if sides is not None and not shape.is_mesh():
        raise InputError(
            f"Shell '{shape.id()}' is no triangle mesh, so its index steps cannot be traced in "
            "double precision; give it as a mesh (PLY)."
        )
    if sides is not None and shape.has_flipped_normals():
        raise InputError(
            f"Shell '{shape.id()}' has flip_normals, which would swap inside and outside only in "
            "part; swap ext_ior and int_ior instead."
        )
    smooth = shape.has_vertex_normals() and not shape.has_face_normals()
    if sides is not None and smooth and _runs_against_its_normals(shape):
        raise InputError(
            f"The triangles of shell '{shape.id()}' face against its vertex normals, as after a "
            "mirroring to_world, so outside and inside would be swapped; mirror the mesh itself "
            "instead."
        )
    count = shape.face_count()
    if sides is None:
        return _Described(shape, PART, (1.0, 1.0), 1.0, smooth, False, count)
    derived = smooth and has_derivatives(shape)
    return _Described(shape, SHELL, sides, surface_index(shape.bsdf()), smooth, derived, count)


class SceneTables:
    """Triangles, kinds and indices of every mesh of a scene, for gathering in a kernel.

    InputError if there is no shape with id ``part``, a shell is not a mesh or is turned inside out,
    or the part is too large.
    """

    def __init__(self, scene: Any) -> None:
        import mitsuba as mi

        shapes = scene.shapes()
        self.part, place = _part_of(shapes)
        rows = [_described(shape, number == place) for number, shape in enumerate(shapes)]
        shells = [row for row in rows if row.kind == SHELL]
        first_face = np.cumsum([0, *(row.face_count for row in rows)])
        self.part_first_face = int(first_face[place])
        self.shell_shapes = [row.shape for row in shells]
        self.stock_shells = sum(not hasattr(row.shape.bsdf(), "ext_ior") for row in shells)
        self.index_pairs = [row.sides for row in shells]
        self.has_normals = any(row.smooth for row in shells)
        self.facet_shells = [row.shape.id() for row in shells if not row.smooth]
        steps = [abs(outside - inside) for outside, inside in self.index_pairs]
        # By half of the least step layers are told apart; what enters the data in air that is half
        # a usual step from the ambient's comes through an open end.
        self.half_step = min((step for step in steps if step > 0), default=1e-9) / 2
        self.open_step = max(steps, default=1e-9) / 2
        known = bool(shells) and all(row.derived for row in shells)
        # The ratio that Mitsuba's dielectric knows is no index by which layers could be joined.
        self.knows_derivatives = known and not self.stock_shells
        meshes = [row for row in rows if row.kind != BLOCKER]
        self._table = VertexTable(meshes, self.knows_derivatives)
        self._first_face = mi.UInt32(first_face[:-1])
        self._kind = mi.UInt32([row.kind for row in rows])
        self._outside = mi.Float64([row.sides[0] for row in rows])
        self._inside = mi.Float64([row.sides[1] for row in rows])
        self._level = mi.Float64([row.level for row in rows])
        self._number = self._numbers(shapes)
        beyond = edge_neighbours(*self.part_arrays())
        self._neighbours = mi.UInt32(aligned(beyond.ravel()))

    @staticmethod
    def _numbers(shapes: list[Any]) -> Any:
        """Table from Mitsuba's registry number of a shape to its place in the list."""
        import drjit as dr
        import mitsuba as mi

        registry = [int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]) for shape in shapes]
        table = np.zeros(max(registry) + 1, dtype=np.uint32)
        table[registry] = np.arange(len(shapes))
        return mi.UInt32(table)

    def shape_number(self, preliminary: Any, active: Any) -> Any:
        """Place of the hit shape in the scene's list (UInt32)."""
        import drjit as dr
        import mitsuba as mi

        registry = dr.reinterpret_array(mi.UInt32, preliminary.shape)
        return dr.gather(mi.UInt32, self._number, registry, active)

    def kind(self, shape: Any, active: Any) -> Any:
        """SHELL, PART or BLOCKER (UInt32)."""
        import drjit as dr
        import mitsuba as mi

        return dr.gather(mi.UInt32, self._kind, shape, active)

    def sides(self, shape: Any, active: Any) -> tuple[Any, Any]:
        """Index outside and inside a shell (Float64)."""
        import drjit as dr
        import mitsuba as mi

        return (
            dr.gather(mi.Float64, self._outside, shape, active),
            dr.gather(mi.Float64, self._inside, shape, active),
        )

    def with_sides(self, pairs: list[tuple[float, float]]) -> SceneTables:
        """The same tables with other indices outside and inside each shape of the scene's list."""
        import mitsuba as mi

        other = copy(self)
        outside, inside = zip(*pairs, strict=True)
        other._outside, other._inside = mi.Float64(outside), mi.Float64(inside)
        return other

    def face(self, shape: Any, primitive: Any, active: Any) -> Any:
        """Row of a triangle in the face table (UInt32)."""
        import drjit as dr
        import mitsuba as mi

        return dr.gather(mi.UInt32, self._first_face, shape, active) + primitive

    def triangle(self, face: Any, active: Any) -> Triangle:
        """Corners of triangles in double precision."""
        return self._table.triangle(face, active)

    def vertex_normals(self, face: Any, active: Any) -> Triangle:
        """Vertex normals of triangles in double precision; zero where a mesh has none."""
        return self._table.normals(face, active)

    def gradients(self, face: Any, direction: Any, active: Any) -> tuple[Triangle, Triangle]:
        """Gradient of the index at the corners of shells' triangles, 1/mm (Vector3f).

        And its change along a direction (Vector3f), 1/mm^2.
        """
        return self._table.gradients(face, direction, active)

    def level(self, shape: Any, active: Any) -> Any:
        """Index of the air on a shell itself (Float64)."""
        import drjit as dr
        import mitsuba as mi

        return dr.gather(mi.Float64, self._level, shape, active)

    def neighbour(self, face: Any, edge: Any, active: Any) -> Any:
        """Row of the part's face beyond an edge of another (UInt32); ``NONE`` without one."""
        import drjit as dr
        import mitsuba as mi

        place = 3 * (face - self.part_first_face) + edge
        number = dr.gather(mi.UInt32, self._neighbours, place, active)
        return dr.select(active & (number != NONE), number + self.part_first_face, NONE)

    def part_arrays(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Vertices (n, 3), mm, world, and faces (m, 3) of the part."""
        vertices = np.array(self.part.vertex_positions_buffer(), dtype=np.float64).reshape(-1, 3)
        faces = np.array(self.part.faces_buffer(), dtype=np.int64).reshape(-1, 3)
        return vertices, faces

    @cached_property
    def ambient(self) -> float:
        """Index of the air outside: the outside of the shell with the largest box."""
        if not self.shell_shapes:
            return 1.0
        boxes = [np.array(s.bbox().max) - np.array(s.bbox().min) for s in self.shell_shapes]
        largest = int(np.argmax([np.linalg.norm(box) for box in boxes]))
        pair = shell_indices(self.shell_shapes[largest].bsdf())
        assert pair is not None
        return pair[0]

    @cached_property
    def open_steps(self) -> float:
        """Sum of the index steps of the shells that have a boundary."""
        total = 0.0
        for shape in self.shell_shapes:
            vertices = np.array(shape.vertex_positions_buffer()).reshape(-1, 3)
            if not is_closed(vertices, np.array(shape.faces_buffer()).reshape(-1, 3)):
                pair = shell_indices(shape.bsdf())
                assert pair is not None
                total += abs(pair[1] - pair[0])
        return total

    def triangles_in_view(
        self, project: Any, lowest: tuple[int, int], highest: tuple[int, int]
    ) -> int:
        """Number of shell triangles whose centre appears in a window of the picture."""
        import drjit as dr
        import mitsuba as mi

        face = dr.arange(mi.UInt32, self._table.face_count)
        active = mi.Bool(True)
        corners = self.triangle(face, active)
        x, y, in_front = project((corners.a + corners.b + corners.c) / 3)
        seen = in_front
        for position, low, high in zip((x, y), lowest, highest, strict=True):
            seen &= (position >= low) & (position < high)
        part = (face >= self.part_first_face) & (
            face < self.part_first_face + self.part.face_count()
        )
        return int(dr.count(seen & ~part)[0])

    def plane(self, face: Any, active: Any) -> tuple[Triangle, Any]:
        """Corners and unit normal of triangles."""
        triangle = self.triangle(face, active)
        return triangle, facet_normal(triangle)
