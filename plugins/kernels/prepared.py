"""A scene prepared for tracing: tables, the scene without shells, the air's layer at the part.

Built once, it is used for every pose. The layer at a point is determined from the index steps along
straight lines from there to the outside (`PreparedScene.crossed_steps`), so no field is needed.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.sampling import r2_sequence
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.queries import advanced, query_step, ray_query, same_crossing, zeros
from iriftrace.plugins.kernels.tables import PART_ID, SceneTables, shell_indices, surface_index
from iriftrace.plugins.kernels.vertex_table import PART, SHELL, aligned, aligned_rows

MOST_STEPS = 30_000
"""Crossings of a straight line after which it is not followed any farther."""


SAMPLES_PER_DIAGONAL = 50
"""Wall samples along the part's diagonal, by which the layer at the wall is found."""

WALL_STEPS = 80
"""Steps of a ray query before and behind a point between which its layer is uncertain."""

TILT = np.radians(50.0)
"""Angle between a wall's normal and the other lines by which its layer is counted."""

ALONG = 0.125, 0.375, 0.625, 0.875
"""Places along a ray's path through the shells' box at which its layer is determined."""

FEWEST = 5
"""Layers' steps below which leaving half of them out says nothing of the rest."""


def scene_beside(scene: mi.Scene, shapes: list[mi.Shape]) -> dt.Scene:
    """A scene of other shapes that rays may be traced into in the kernels that query `scene`.

    OptiX allows one shader binding table in a kernel, and drops queries of other scenes silently;
    a scene that has another one as a child uses the same table.
    """
    # A shape takes its key as id, so the keys are the ids it has.
    content = {shape.id() or f"shape_{i}": shape for i, shape in enumerate(shapes)}
    return mi.load_dict(
        {
            "type": "scene",
            "embree_use_robust_intersections": True,
            **content,
            "shader_binding_table_of": scene,
        },
        optimize=False,
    )


class PreparedScene:
    """A scene ready for tracing, loaded with ``optimize=False``; InputError as of `SceneTables`."""

    def __init__(self, scene: mi.Scene) -> None:
        self.scene = scene
        self.tables = SceneTables(scene)
        self.step = query_step(scene)
        opaque = [s for s in scene.shapes() if shell_indices(s.bsdf()) is None]
        self.has_blockers = len(opaque) > 1
        if self.tables.shell_shapes:
            # Straight rays never look at shells; most of the query's cost is theirs.
            self.opaque = scene_beside(scene, opaque)
        else:
            self.opaque = scene

    def attached(self) -> PreparedScene:
        """The same scene as a function of its shells' indices whose gradients are requested."""
        tables = self.tables.attached()
        if tables is self.tables:
            return self
        other = copy(self)
        other.tables = tables
        return other

    def surroundings(self, point: FloatArray) -> str | None:
        """``"part"`` or ``"hot air"`` around a point (3,), mm, world; None for outside.

        Inside a closed surface every line starts by crossing it outward; most do if it has holes.
        """
        directions = _directions(256)
        origin = mi.Point3d(*aligned_rows(np.broadcast_to(point, directions.shape)))
        direction = mi.Vector3d(*aligned_rows(directions))
        _, _, enclosed = self.crossed_steps(origin, direction)
        ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction))
        hit = self.opaque.ray_intersect_preliminary(ray)
        found = hit.is_valid()
        shape = self.tables.shape_number(hit, found)
        on_part = found & (self.tables.kind(shape, found) == PART)
        _, normal = self.tables.plane(self.tables.face(shape, hit.prim_index, on_part), on_part)
        behind = on_part & (dr.dot(normal, direction) > 0)
        seen = np.array(dr.select(behind, mi.UInt32(1), 0) + dr.select(enclosed, mi.UInt32(2), 0))
        if np.mean(seen & 1) > 0.5:
            return "part"
        return "hot air" if np.mean(seen >> 1) > 0.5 else None

    @cached_property
    def part_alone(self) -> dt.Scene:
        """The scene without shells and without what only blocks the view."""
        part = [shape for shape in self.scene.shapes() if shape.id() == PART_ID]
        return scene_beside(self.scene, part)

    @cached_property
    def usual_wall_index(self) -> dt.Float64:
        """Index of the layer that usually touches each face of the part (Float64)."""
        return mi.Float64(aligned(self._wall_layers()))

    def _wall_layers(self) -> FloatArray:
        """The same as an array (m,).

        Straight lines from a few points on each face count the steps to the outside; so no field is
        needed, and shells that cut the part or end on it are taken as they are. Rays that end in
        another layer are looked at one by one.
        """
        vertices, faces = self.tables.part_arrays()
        if not self.tables.shell_shapes or self.tables.stock_shells:
            return np.full(len(faces), self.tables.ambient)
        points, directions, face = _wall_samples(vertices, faces)
        index = self.layers_near(points, directions).ravel()
        return _median_of_each(index, np.concatenate((face, face)), len(faces))

    def layers_near(self, points: FloatArray, normals: FloatArray, *, lines: int = 1) -> FloatArray:
        """Index of the layer just before and just behind points, (2, n), counted from outside.

        Points are (n, 3), mm, world, with unit normals towards the outside. By `lines` straight
        lines from each point the steps are counted. With several, the majority decides, so that a
        hole in a shell does not.
        """
        directions = _around(normals, lines)
        # Each line starts behind and passes its point; the tilted ones start as deep.
        ahead = WALL_STEPS * self.step / np.where(np.arange(lines) > 0, np.cos(TILT), 1.0)
        starts = points - ahead[:, None, None] * directions
        passed = mi.Float64(aligned(np.repeat(2 * ahead, len(points))))
        behind, before, _ = self.crossed_steps(
            mi.Point3d(*aligned_rows(starts)), mi.Vector3d(*aligned_rows(directions)), passed
        )
        # Together, the lines are followed once.
        dr.eval(before, behind)
        counted = (np.array(index).reshape(lines, -1) for index in (before, behind))
        return np.array([self._majority(index) for index in counted])

    def between_shells(
        self, origin: dt.Point3d, direction: dt.Vector3d, length: dt.Float64, unmet: dt.Bool
    ) -> dt.Bool:
        """Mask (Bool) of the rays among `unmet` that run through air which is not ambient.

        They have origins (Point3d, mm), unit directions (Vector3d) and straight lengths (Float64,
        mm; 0 or infinite where they hit nothing). They meet no shell, so lines across them do, from
        places along their path through the box of the shells.
        """
        chosen = np.flatnonzero(np.array(unmet))
        result = np.zeros(dr.width(unmet), dtype=bool)
        if len(chosen) == 0 or not self.tables.shell_shapes:
            return mi.Bool(aligned(result))
        start, way = (
            np.broadcast_to(np.array(vector).T, (len(result), 3))[chosen]
            for vector in (origin, direction)
        )
        end = np.array(length)[chosen]
        boxes = [shape.bbox() for shape in self.tables.shell_shapes]
        low = np.min([np.array(box.min) for box in boxes], axis=0)
        high = np.max([np.array(box.max) for box in boxes], axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            faces = np.sort(((low - start) / way, (high - start) / way), axis=0)
        enters = np.maximum(np.nanmax(faces[0], axis=1), 0.0)
        leaves = np.minimum(np.nanmin(faces[1], axis=1), np.where(end > 0.0, end, np.inf))
        inside = leaves > enters
        along = enters + (np.maximum(leaves - enters, 0.0)) * np.array(ALONG)[:, None]
        along = np.where(inside & np.isfinite(along), along, 0.0)
        places = start + along[..., None] * way
        across = _around(way, 5)[1:]
        starts, lines = np.broadcast_arrays(places[:, None], across[None])
        index, _, _ = self.crossed_steps(
            mi.Point3d(*aligned_rows(starts)), mi.Vector3d(*aligned_rows(lines))
        )
        layer = np.array(index).reshape(-1, len(chosen))
        away = np.abs(layer - self.tables.ambient) > self.tables.half_step
        result[chosen] = inside & ((layer != 0) & away).any(axis=0)
        return mi.Bool(aligned(result))

    def crossed_steps(
        self, origin: dt.Point3d, direction: dt.Vector3d, passed: dt.Float64 | float = 0.0
    ) -> tuple[dt.Float64, dt.Float64, dt.Bool]:
        """Index steps along straight lines to infinity, opaque shapes being transparent.

        Gives the indices (Float64) of the layers at the start, and where the line has passed a
        length (mm): what remains outside less the steps up to there; 0 for a line without
        crossing, or with too many (``MOST_STEPS``) to be believed. Also returns whether (Bool) the
        first shell along the line is crossed from inside.
        """
        tables, smallest_step = self.tables, dr.opaque(mi.Float64, self.step)

        class State(NamedTuple):
            travelled: dt.Float64
            gap: dt.Float64  # since the last crossing
            index_sum: dt.Float64
            passed_sum: dt.Float64  # of the crossings on the passed length
            last_index: dt.Float64
            enclosed: dt.Bool
            shape: dt.UInt32
            outward: dt.Bool
            count: dt.UInt32
            active: dt.Bool

        def advance(s: State) -> State:
            start = origin + direction * s.travelled
            preliminary = ray_query(self.scene, start, direction, False, s.active)
            found = s.active & preliminary.is_valid()
            shape = tables.shape_number(preliminary, found)
            on_shell = found & (tables.kind(shape, found) == SHELL)
            face = tables.face(shape, preliminary.prim_index, on_shell)
            _, normal = tables.plane(face, on_shell)
            outside, inside = tables.sides(shape, on_shell)
            outward = dr.dot(direction, normal) > 0
            move = dr.select(found, mi.Float64(preliminary.t) + smallest_step, 0)
            gap = s.gap + move
            crossed = on_shell & ~same_crossing(
                shape, outward, s.shape, s.outward, gap, smallest_step
            )
            near, far = dr.select(outward, inside, outside), dr.select(outward, outside, inside)
            first = crossed & (s.last_index == 0)
            travelled, change = s.travelled + move, dr.select(crossed, far - near, 0)
            return State(
                travelled,
                dr.select(crossed, 0, gap),
                s.index_sum + change,
                s.passed_sum + dr.select(travelled < passed, change, 0),
                dr.select(crossed, far, s.last_index),
                (first & outward) | (s.enclosed & ~first),
                dr.select(crossed, shape, s.shape),
                dr.select(crossed, outward, s.outward),
                s.count + 1,
                found & (s.count < MOST_STEPS),
            )

        width = dr.width(origin, direction)
        start = State(
            shape=dr.full(mi.UInt32, 0xFFFFFFFF, width),
            active=dr.full(mi.Bool, True, width),
            **zeros(
                width,
                Float64="travelled gap index_sum passed_sum last_index",
                Bool="enclosed outward",
                UInt32="count",
            ),
        )
        end = advanced(start, advance, "count")
        known = (end.count <= MOST_STEPS) & (end.last_index != 0)
        first = end.last_index - end.index_sum
        there = first + end.passed_sum
        return dr.select(known, first, 0), dr.select(known, there, 0), end.enclosed & known

    def _majority(self, index: FloatArray) -> FloatArray:
        """Most frequent index of each column; ambient where no line met a shell."""
        known = index != 0
        same = np.abs(index[:, None] - index[None]) < self.tables.half_step
        votes = (same & known[None]).sum(axis=1) * known
        chosen = np.take_along_axis(index, votes.argmax(axis=0)[None], axis=0)[0]
        return np.where(known.any(axis=0), chosen, self.tables.ambient)


def with_every_second_shell(prepared: PreparedScene) -> PreparedScene | None:
    """The same scene with the first, the third, ... and the last step of the index.

    Meshes, tables and gradients are shared. The steps of the shells that stay add up to the same
    sum. None where the shells' steps do not lead from one to the next, or are fewer than
    ``FEWEST``.
    """
    shapes = prepared.scene.shapes()
    pairs = [shell_indices(shape.bsdf()) for shape in shapes]
    steps = sorted({pair for pair in pairs if pair}, reverse=True)
    if len(steps) < FEWEST or any(one[1] != other[0] for one, other in pairwise(steps)):
        return None
    kept = [*steps[:-1:2], steps[-1]]
    levels = {p: surface_index(s.bsdf()) for s, p in zip(shapes, pairs, strict=True) if p}
    between = [0.5 * (levels[one] + levels[other]) for one, other in pairwise(kept)]
    ends = [kept[0][0], *between, kept[-1][1]]
    sides = dict(zip(kept, pairwise(ends), strict=True))

    fewer = copy(prepared)
    fewer.tables = prepared.tables.with_sides(
        [sides[pair] if pair in sides else (1.0, 1.0) for pair in pairs]
    )
    fewer.scene = scene_beside(
        prepared.scene,
        [s for s, pair in zip(shapes, pairs, strict=True) if pair is None or pair in sides],
    )
    return fewer


def _around(normals: FloatArray, count: int) -> FloatArray:
    """Unit vectors (count, n, 3): the normals first, then others evenly about them."""
    helper = np.where(np.abs(normals[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    right = np.cross(normals, helper)
    length = np.linalg.norm(right, axis=1, keepdims=True)
    right = np.divide(right, length, out=np.zeros_like(right), where=length > 0)
    forward = np.cross(normals, right)
    turns = 2 * np.pi * np.arange(count - 1) / max(1, count - 1)
    tilted = [
        np.cos(TILT) * normals + np.sin(TILT) * (np.cos(turn) * right + np.sin(turn) * forward)
        for turn in turns
    ]
    return np.stack([normals, *tilted])


def _directions(count: int) -> FloatArray:
    """Unit vectors spread evenly over the sphere (count, 3): a Fibonacci lattice."""
    number = np.arange(count)
    z = 1 - (2 * number + 1) / count
    azimuth = number * np.pi * (3 - np.sqrt(5))
    radius = np.sqrt(1 - z * z)
    return np.stack((radius * np.cos(azimuth), radius * np.sin(azimuth), z), axis=1)


def _wall_samples(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Points spread over all faces (n, 3), the outward normals there, and their face numbers."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    spacing = np.linalg.norm(np.ptp(vertices, axis=0)) / SAMPLES_PER_DIAGONAL
    # As many as the area asks for, and at least three, so that one odd one does not decide.
    counts = np.where(length[:, 0] > 0, 3 + length[:, 0] / spacing**2, 0).astype(np.int64)
    face = np.repeat(np.arange(len(faces)), counts)
    # Folded into the triangle.
    u, v = r2_sequence(len(face)).T
    folded = u + v > 1
    u, v = np.where(folded, 1 - u, u)[:, None], np.where(folded, 1 - v, v)[:, None]
    a, b, c = (corners[face, k] for k in range(3))
    return a + u * (b - a) + v * (c - a), normals[face], face


def _median_of_each(values: FloatArray, group: IntArray, count: int) -> FloatArray:
    """Median of the values of each group, (count,) array; NaN for a group without any."""
    order = np.lexsort((values, group))
    sizes = np.bincount(group, minlength=count)
    some = sizes > 0
    middle = (np.cumsum(sizes) - sizes + sizes // 2)[some]
    result = np.full(count, np.nan)
    result[some] = values[order][middle]
    return result
