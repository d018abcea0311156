"""A Mitsuba scene flattened into tables that a kernel gathers from.

Triangles of part and shells, the index on each side of a shell, and at its vertices the normal and
the derivatives of the index. Vertices are float32, as Mitsuba's own, and upcast where they are
used.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np

from iriftrace.core.arrays import (
    Float32Array,
    FloatArray,
    IntArray,
    NumberArray,
    as_float64,
)
from iriftrace.core.errors import InputError, warn
from iriftrace.core.mesh.topology import connected, edge_keys, weld
from iriftrace.core.mesh.triangles import area_vectors
from iriftrace.medium.polyhedra import added
from iriftrace.part.part import MOST_FACES
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.edges import NONE, edge_neighbours
from iriftrace.plugins.kernels.snell import Triangle, facet_normal
from iriftrace.plugins.kernels.vertex_table import (
    BLOCKER,
    PART,
    SHELL,
    DescribedShape,
    VertexTable,
    aligned,
    has_derivatives,
)

PART_ID = "part"

CRACK = 1e-5
"""Fraction of a surface's area below which an opening is none."""

GLASS = 0.01
"""Relative step of the index beyond which a shell bounds no air, whose index is 1.0003 at most."""


def shell_indices(bsdf: dt.BSDF | None) -> tuple[float, float] | None:
    """Index outside and inside, if the bsdf is a shell's; None for an opaque one."""
    if bsdf is None:
        return None
    if hasattr(bsdf, "ext_ior"):
        return bsdf.ext_ior, bsdf.int_ior
    if bsdf.class_name() == "SmoothDielectric":
        return 1.0, float(mi.traverse(bsdf)["eta"])
    return None


def is_glass(sides: tuple[float, float]) -> bool:
    """True if the indices of a shell's sides, outside and inside, are not both those of air."""
    return abs(sides[1] / sides[0] - 1) > GLASS


def surface_index(bsdf: dt.BSDF) -> float:
    """Index of the air on a shell itself."""
    pair = shell_indices(bsdf)
    assert pair is not None
    return float(getattr(bsdf, "iso_ior", 0.5 * (pair[0] + pair[1])))


def is_closed(vertices: Float32Array, faces: NumberArray) -> bool:
    """True if a surface has no opening, other than cracks and single triangles of a fine mesh.

    The edges around an opening, which are not passed as often forwards as backwards, enclose its
    vector area (Stokes); that of a crack vanishes.
    """
    if _edges_cancel(vertices, faces):
        return True
    number = weld(vertices)
    key, rises = edge_keys(number[faces])
    edges, place = np.unique(key, return_inverse=True)
    balance = np.bincount(place, np.where(rises, 1.0, -1.0))
    around = balance != 0.0
    ends = np.stack((edges[around] >> 32, edges[around] & 0xFFFFFFFF), axis=1)
    opening = connected(ends, len(vertices))[ends[:, 0]]
    start, end = vertices[ends].astype(np.float64).swapaxes(0, 1) - vertices.mean(axis=0)
    swept = as_float64(0.5 * balance[around, None] * np.cross(start, end))
    areas = np.linalg.norm(added(opening, swept, len(vertices)), axis=1)
    return bool(areas.max() < CRACK * np.linalg.norm(area_vectors(vertices, faces), axis=1).sum())


def _edges_cancel(vertices: Float32Array, faces: NumberArray) -> bool:
    """True if each edge is passed as often forwards as backwards.

    Then a sum over the sides of all triangles vanishes whose terms change their sign with the
    direction. These are products of random numbers that belong to places, modulo 2**64.
    """
    # Adding zero makes -0 and 0 the same bits.
    bits = (np.ascontiguousarray(vertices, dtype=np.float32) + np.float32(0)).view(np.uint32)
    factors = np.random.default_rng(1).integers(2**63, size=(3, 2), dtype=np.uint64) * 2 + 1
    mixed = bits.astype(np.uint64) @ factors
    mixed = (mixed ^ (mixed >> np.uint64(31))) * factors[0, 0]
    one, other = (mixed ^ (mixed >> np.uint64(29))).T
    ends = np.roll(faces, -1, axis=1)
    return not (one[faces] * other[ends] - one[ends] * other[faces]).sum(dtype=np.uint64)


def _runs_against_its_normals(shape: mi.Mesh) -> bool:
    """True if most of a mesh's triangles face away from its vertex normals, by area."""
    corners = dr.unravel(mi.Vector3u, shape.faces_buffer())
    a, b, c = (dr.gather(mi.Point3f, shape.vertex_positions_buffer(), v) for v in corners)
    normals = shape.vertex_normals_buffer()
    normal: dt.Vector3f = sum(dr.gather(mi.Vector3f, normals, v) for v in corners)
    facing: dt.Float = dr.dot(dr.cross(b - a, c - a), normal)
    return bool(dr.sum(dr.select(dr.isfinite(facing), facing, 0))[0] < 0)


def _part_of(shapes: list[dt.Shape]) -> tuple[mi.Mesh, int]:
    """The measured part, and its place in a scene's list."""
    parts = [i for i, shape in enumerate(shapes) if shape.id() == PART_ID]
    if len(parts) != 1:
        raise InputError(
            f"The scene has {len(parts)} shapes with id '{PART_ID}', but the measured part is "
            "known by it: give exactly one shape this id, and load with optimize=False, because "
            "Mitsuba otherwise merges shapes of equal bsdfs into one without id.",
            code="scene.part_count",
        )
    part = shapes[parts[0]]
    if shell_indices(part.bsdf()) is not None or not part.is_mesh():
        raise InputError(
            "The shape with id 'part' must be an opaque triangle mesh (ply, obj, mi.Mesh), since "
            "faces and regions are numbered by it; a sphere or cylinder of Mitsuba is none.",
            code="part.no_mesh",
        )
    if part.face_count() == 0:
        raise InputError(
            "The part's file has no triangles, so there is nothing to see; give the part's surface "
            "as triangles, or write the scene again.",
            code="part.no_triangles",
        )
    if part.face_count() > MOST_FACES:
        raise InputError(
            f"The part has {part.face_count()} faces, but channel part.face holds at most "
            f"{MOST_FACES} exactly; simplify the mesh.",
            code="part.too_many_triangles",
        )
    return part, parts[0]


def _refuse_transparent(shape: dt.Shape, bsdf: dt.BSDF, sides: tuple[float, float] | None) -> None:
    """Refuse what light passes and rays here would not: all but `dielectric` shells of air."""
    through = mi.has_flag(bsdf.flags(), mi.BSDFFlags.Transmission)
    if through and (sides is None or is_glass(sides)):
        raise InputError(
            f"Light passes through shape '{shape.id()}' (Mitsuba's {bsdf.class_name()}), but rays "
            "here pass only through shells of iso_shell; leave the shape out, or give a window as "
            "a closed mesh with iso_shell (ext_ior of the air, int_ior of the glass) and trace it "
            "with first_hit.",
            code="scene.transparent",
        )


def _described(shape: dt.Shape, is_part: bool) -> DescribedShape:
    """A shape's row of the tables; InputError for one that cannot be traced."""
    bsdf = shape.bsdf()
    sides = shell_indices(bsdf)
    if bsdf is not None and not is_part and not hasattr(bsdf, "ext_ior"):
        _refuse_transparent(shape, bsdf, sides)
    if sides is None and not is_part:
        return DescribedShape(shape, BLOCKER, (1.0, 1.0), 1.0, False, False, 0)
    if sides is not None and not shape.is_mesh():
        raise InputError(
            f"Shell '{shape.id()}' is not a triangle mesh, so its index steps cannot be traced in "
            "double precision; give it as a mesh (PLY).",
            code="shells.no_mesh",
        )
    if sides is not None and shape.has_flipped_normals():
        raise InputError(
            f"Shell '{shape.id()}' has flip_normals, which would swap inside and outside only in "
            "part; swap ext_ior and int_ior instead.",
            code="shells.flipped",
        )
    count = shape.face_count()
    if sides is not None and count == 0:
        raise InputError(
            f"Shell '{shape.id()}' has no triangles; leave it out, with the shells inside of it.",
            code="shells.no_triangles",
        )
    smooth = shape.has_vertex_normals() and not shape.has_face_normals()
    if sides is not None and smooth and _runs_against_its_normals(shape):
        raise InputError(
            f"The triangles of shell '{shape.id()}' face against its vertex normals, as after a "
            "mirroring to_world, so outside and inside would be swapped; mirror the mesh itself "
            "instead.",
            code="shells.mirrored",
        )
    if sides is None:
        return DescribedShape(shape, PART, (1.0, 1.0), 1.0, smooth, False, count)
    derived = smooth and has_derivatives(shape)
    return DescribedShape(shape, SHELL, sides, surface_index(shape.bsdf()), smooth, derived, count)


class SceneTables:
    """Triangles, kinds and indices of every mesh of a scene, for gathering in a kernel.

    InputError if there is no shape with id ``part``, a shell is not a mesh or is turned inside out,
    or the part is too large.
    """

    def __init__(self, scene: mi.Scene) -> None:
        shapes = scene.shapes()
        self.part, place = _part_of(shapes)
        rows = [_described(shape, number == place) for number, shape in enumerate(shapes)]
        shells = [row for row in rows if row.kind == SHELL]
        first_face = np.cumsum([0, *(row.face_count for row in rows)])
        self.part_first_face = int(first_face[place])
        self.shell_shapes = [row.shape for row in shells]
        self._shells = [n for n, row in enumerate(rows) if row.kind == SHELL]  # in the scene's list
        self.stock_shells = sum(not hasattr(row.shape.bsdf(), "ext_ior") for row in shells)
        self.index_pairs = [row.sides for row in shells]
        self.has_normals = any(row.smooth for row in shells)
        self.glass_shells = [row.shape.id() for row in shells if is_glass(row.sides)]
        self.facet_shells = [row.shape.id() for row in shells if not row.smooth]
        steps = [abs(outside - inside) for outside, inside in self.index_pairs]
        # Layers are distinguished by half of the smallest step; a ray that enters the data in air
        # that is half a usual step from the ambient's comes through an open end.
        self.half_step = min((step for step in steps if step > 0), default=1e-9) / 2
        self.open_step = max(steps, default=1e-9) / 2
        known = bool(shells) and all(row.derived for row in shells)
        self.mixes_glass = bool(self.glass_shells) and any(row.derived for row in shells)
        # Mitsuba's dielectric has a ratio of indices, which cannot join layers.
        self.knows_derivatives = known and not self.stock_shells
        self.vertices = VertexTable(rows, self.knows_derivatives)
        self._first_face = mi.UInt32(first_face[:-1])
        self._kind = mi.UInt32([row.kind for row in rows])
        self._outside = mi.Float64([row.sides[0] for row in rows])
        self._inside = mi.Float64([row.sides[1] for row in rows])
        self._level = mi.Float64([row.level for row in rows])
        self._number = self._numbers(shapes)
        beyond = edge_neighbours(*self.part_arrays())
        self._neighbours = mi.UInt32(aligned(beyond.ravel()))

    @staticmethod
    def _numbers(shapes: list[mi.Shape]) -> dt.UInt32:
        """Table from Mitsuba's registry number of a shape to its place in the list."""
        numbers: list[dt.UInt32] = [
            dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape)) for shape in shapes
        ]
        registry = [int(number[0]) for number in numbers]
        table = np.zeros(max(registry) + 1, dtype=np.uint32)
        table[registry] = np.arange(len(shapes))
        return mi.UInt32(table)

    def shape_number(self, preliminary: dt.PreliminaryIntersection3f, active: dt.Bool) -> dt.UInt32:
        """Place of the hit shape in the scene's list (UInt32)."""
        registry: dt.UInt32 = dr.reinterpret_array(mi.UInt32, preliminary.shape)
        return dr.gather(mi.UInt32, self._number, registry, active)

    def kind(self, shape: dt.UInt32, active: dt.Bool) -> dt.UInt32:
        """SHELL, PART or BLOCKER (UInt32)."""
        return dr.gather(mi.UInt32, self._kind, shape, active)

    def sides(self, shape: dt.UInt32, active: dt.Bool) -> tuple[dt.Float64, dt.Float64]:
        """Index outside and inside a shell (Float64)."""
        return (
            dr.gather(mi.Float64, self._outside, shape, active),
            dr.gather(mi.Float64, self._inside, shape, active),
        )

    def with_sides(self, pairs: list[tuple[float, float]]) -> SceneTables:
        """The same tables with other indices outside and inside each shape of the scene's list."""
        other = copy(self)
        outside, inside = zip(*pairs, strict=True)
        other._outside, other._inside = mi.Float64(outside), mi.Float64(inside)
        return other

    def attached(self) -> SceneTables:
        """The same tables as functions of the shells' indices whose gradients are requested."""
        found = {
            number: indices
            for number, shape in zip(self._shells, self.shell_shapes, strict=True)
            if hasattr(bsdf := shape.bsdf(), "attached_indices")
            and (indices := bsdf.attached_indices()) is not None
        }
        if not found:
            return self
        other, steps = copy(self), {}
        other._outside, other._inside, other._level = (
            mi.Float64(column) for column in (self._outside, self._inside, self._level)
        )
        columns = other._outside, other._inside, other._level
        for number, indices in found.items():
            for column, index in zip(columns, indices, strict=True):
                dr.scatter(column, index, mi.UInt32(number))
            step = indices[0] - indices[1]
            steps[number] = dr.select(dr.detach(step) != 0, step / dr.detach(step), 1)
        if self.knows_derivatives:
            other.vertices = self.vertices.with_steps(steps)
        return other

    def face(self, shape: dt.UInt32, primitive: dt.UInt32, active: dt.Bool) -> dt.UInt32:
        """Row of a triangle in the face table (UInt32)."""
        return dr.gather(mi.UInt32, self._first_face, shape, active) + primitive

    def level(self, shape: dt.UInt32, active: dt.Bool) -> dt.Float64:
        """Index of the air on a shell itself (Float64)."""
        return dr.gather(mi.Float64, self._level, shape, active)

    def neighbour(self, face: dt.UInt32, edge: dt.UInt32, active: dt.Bool) -> dt.UInt32:
        """Row of the part's face beyond an edge of another (UInt32); ``NONE`` without one."""
        place = 3 * (face - self.part_first_face) + edge
        number = dr.gather(mi.UInt32, self._neighbours, place, active)
        return dr.select(active & (number != NONE), number + self.part_first_face, NONE)

    def part_arrays(self) -> tuple[FloatArray, IntArray]:
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
        return self.index_pairs[largest][0]

    @cached_property
    def missing_steps(self) -> list[tuple[float, float]]:
        """Index nearer the ambient air's and beyond, of each step that no shell of the scene makes.

        Shells lead from layer to layer, so the intervals between their two indices leave no gap.
        """
        steps = np.sort([pair for pair in self.index_pairs if pair[0] != pair[1]], axis=-1)
        if self.stock_shells or len(steps) == 0:
            return []
        low, high = steps[np.argsort(steps[:, 0])].T
        reached = np.maximum.accumulate(high)[:-1]
        gaps = np.stack((reached, low[1:]), axis=1)[low[1:] > reached + self.half_step]
        return [
            (near, far) if abs(near - self.ambient) < abs(far - self.ambient) else (far, near)
            for near, far in gaps.tolist()
        ]

    def warn_of_missing_shells(self, name: str) -> None:
        """Warn of index steps that no shell makes; rays behind them get status 5."""
        for near, far in self.missing_steps:
            warn(
                f"{name} has no shell between the layers of index {near:.9g} and {far:.9g}, but "
                "others lead to both: one is missing, or its ext_ior and int_ior are wrong. The "
                "index steps along rays beyond it do not add up (status 5); add the shell."
            )

    @cached_property
    def open_steps(self) -> float:
        """Sum of the index steps of the shells that have a boundary."""
        total = 0.0
        for shape, (outside, inside) in zip(self.shell_shapes, self.index_pairs, strict=True):
            vertices = np.array(shape.vertex_positions_buffer()).reshape(-1, 3)
            if not is_closed(vertices, np.array(shape.faces_buffer()).reshape(-1, 3)):
                total += abs(inside - outside)
        return total

    def triangles_in_view(
        self, project: dt.Project, corner: tuple[int, int], size: tuple[int, int]
    ) -> int:
        """Number of shell triangles whose centre appears in a window of the picture."""
        face = dr.arange(mi.UInt32, self.vertices.face_count)
        corners = self.vertices.triangle(face, mi.Bool(True))
        x, y, seen = project((corners.a + corners.b + corners.c) / 3)
        for position, low, length in zip((x, y), corner, size, strict=True):
            seen &= (position >= low) & (position < low + length)
        part = (face >= self.part_first_face) & (
            face < self.part_first_face + self.part.face_count()
        )
        count: dt.UInt32 = dr.count(seen & ~part)
        return int(count[0])

    def plane(self, face: dt.UInt32, active: dt.Bool) -> tuple[Triangle, dt.Vector3d]:
        """Corners and unit normal of triangles."""
        triangle = self.vertices.triangle(face, active)
        return triangle, facet_normal(triangle)
