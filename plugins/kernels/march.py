"""Marching rays through a scene's shells, from crossing to crossing.

The point on a triangle's plane and the direction behind it are computed in double precision, and
the next query starts from that exact point, a small step further along the ray. Mitsuba's own
``spawn`` rule would move the origin off the ray by more than the whole deflection.
"""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from iriftrace.plugins.kernels.between import onto_plane
from iriftrace.plugins.kernels.layers import AtShells, InLayers, Passage
from iriftrace.plugins.kernels.prepared import PreparedScene
from iriftrace.plugins.kernels.queries import (
    ESCAPED,
    GAVE_UP,
    HIT_BLOCKER,
    HIT_PART,
    RELATIVE_STEP,
    SAME_CROSSING_STEPS,
    advanced,
    query_error,
    ray_query,
    same_crossing,
    settled,
    zeros,
)
from iriftrace.plugins.kernels.snell import Triangle, distance_to_plane
from iriftrace.plugins.kernels.tables import SceneTables
from iriftrace.plugins.kernels.types import Array, Bool, Float, Float64, Point3d, UInt32, Vector3d
from iriftrace.plugins.kernels.vertex_table import BLOCKER, PART, SHELL

GRAZING_COSINE = 1e-3
"""A ray that leaves a triangle at a smaller cosine is queried from a little beyond its plane."""

CLEARANCE_STEPS = 2
"""Steps beyond it; without, single precision would guess the side of the next triangle it is on.

Rays turned into a triangle's plane are such: of those that look down along a plume, 0.3 % crossed
the next triangle of the shell once more, or not at all.
"""

LEAST_STEP = 0.02
"""Smallest step, as a fraction of the step at the scene's largest coordinate."""


class RefractedHits(NamedTuple):
    """Ends of refracted rays, and what they met along the path."""

    point: Point3d  # mm, world
    direction: Vector3d  # at the end
    path_length: Float64  # mm: geometric
    outcome: UInt32
    face: UInt32  # row of the part's face in the tables
    crossings: UInt32
    entry_index: Float64  # index of the layer before the first crossing; 0 without crossing
    index_sum: Float64  # sum of the index steps
    # Float: most by which n differs from the ambient air's in the layers that were crossed and
    # those next to them; infinite where shells know ratios only.
    contrast: Float


def refracted_hits(
    prepared: PreparedScene,
    origin: Point3d,
    direction: Vector3d,
    *,
    coherent: bool,
    bending: AtShells | InLayers,
    max_crossings: int,
    reverse_passes: int | None = None,
    drop_inside_hits: bool = False,
) -> RefractedHits:
    """Ends of rays that are bent by shells or by the layers between them.

    Rays have origins (Point3d, mm) and unit directions (Vector3d), world; those with more than
    `max_crossings` give up, and with `drop_inside_hits` those that meet a shell from its inside.
    `bending` is AtShells or InLayers; `coherent` as for `straight_hits`, `reverse_passes` as for
    `advanced`.
    """
    tables = prepared.tables
    march = _March(prepared, bending, coherent, max_crossings, reverse_passes, drop_inside_hits)
    end = march.to_the_end(origin, direction)
    marched = march.hits(end)
    hits = _back_on_front(prepared, marched, end.segment, coherent)
    length = end.segment + (hits.path_length - marched.path_length)
    fixed = _fix_transitions(bending, tables, hits, end.memory, length)
    on_their_faces: RefractedHits = settled(tables, fixed)
    return on_their_faces


class _State(NamedTuple):
    """Rays behind their last crossing."""

    point: Point3d
    direction: Vector3d
    path_length: Float64
    outcome: UInt32
    face: UInt32
    crossings: UInt32
    entry_index: Float64
    index_sum: Float64
    contrast: Float
    segment: Float64  # mm: length of the last segment
    shape: UInt32  # number of the shell that was crossed last
    outward: Bool  # and whether it was from its inside
    start: Point3d  # of the next query
    memory: tuple[Array, ...]  # of the rule that bends
    count: UInt32
    active: Bool


class _Met(NamedTuple):
    """What a ray meets next."""

    shape: UInt32
    face: UInt32
    triangle: Triangle
    normal: Vector3d
    on_shell: Bool
    on_part: Bool
    blocked: Bool
    again: Bool  # the shell that was crossed last; then look again from further along
    outward: Bool  # from its inside
    distance: Float64  # mm
    step: Float64  # mm: from the crossing to where the query began


class _March:
    """Rays marched from shell to shell."""

    def __init__(
        self,
        prepared: PreparedScene,
        bending: AtShells | InLayers,
        coherent: bool,
        max_crossings: int,
        reverse_passes: int | None,
        drop_inside_hits: bool,
    ) -> None:
        self.reverse_passes = reverse_passes
        self.scene, self.tables, self.bending = prepared.scene, prepared.tables, bending
        self.coherent, self.drop_inside_hits = coherent, drop_inside_hits
        self.smallest_step = dr.opaque(mi.Float64, prepared.step)
        self.limit = dr.opaque(mi.UInt32, max_crossings)
        self.ambient = dr.opaque(mi.Float64, self.tables.ambient)

    def to_the_end(self, origin: Point3d, direction: Vector3d) -> _State:
        """Advance rays, (Point3d, mm) and (Vector3d), until all have ended."""
        return advanced(self._start(origin, direction), self._advance, "march", self.reverse_passes)

    def hits(self, end: _State) -> RefractedHits:
        """Ends as the march left them, before `_back_on_front` and `_fix_transitions`."""
        step = dr.inf if self.tables.stock_shells else 2 * self.tables.open_step
        return RefractedHits(*end[:8], contrast=end.contrast + dr.opaque(mi.Float, step))

    def _start(self, origin: Point3d, direction: Vector3d) -> _State:
        width = dr.width(origin, direction)
        zero = zeros(
            width,
            Float64="path_length entry_index index_sum segment",
            Float="contrast",
            UInt32="crossings count",
            Bool="outward",
        )
        nothing = mi.UInt32(0xFFFFFFFF)
        return _State(
            point=mi.Point3d(origin),
            direction=mi.Vector3d(direction),
            outcome=dr.full(mi.UInt32, ESCAPED, width),
            face=mi.UInt32(nothing),
            shape=mi.UInt32(nothing),
            start=mi.Point3d(origin),
            memory=self.bending.start(width),
            active=dr.full(mi.Bool, True, width),
            **zero,
        )

    def _met(self, s: _State) -> _Met:
        """Ask for the next triangle, and compute where its plane is met."""
        tables = self.tables
        preliminary = ray_query(self.scene, s.start, s.direction, self.coherent, s.active)
        found = s.active & preliminary.is_valid()
        shape = tables.shape_number(preliminary, found)
        kind = tables.kind(shape, found)
        on_shell, on_part = found & (kind == SHELL), found & (kind == PART)
        flat = on_shell | on_part
        face = tables.face(shape, preliminary.prim_index, flat)
        triangle, normal = tables.plane(face, flat)
        outward = dr.dot(s.direction, normal) > 0
        step = dr.dot(s.start - s.point, s.direction)
        rough = mi.Float64(preliminary.t) + step
        same = same_crossing(shape, outward, s.shape, s.outward, rough, self.smallest_step)
        tolerance = query_error(s.point, self.smallest_step)
        exact = distance_to_plane(s.point, s.direction, triangle, normal, rough, tolerance)
        return _Met(
            shape=shape,
            face=face,
            triangle=triangle,
            normal=normal,
            on_shell=on_shell,
            on_part=on_part,
            blocked=found & (kind == BLOCKER),
            again=on_shell & ((face == s.face) | same),
            outward=outward,
            distance=dr.select(flat, exact, rough),
            step=step,
        )

    def _advance(self, s: _State) -> _State:
        """Go to what is met, and through it where it is a shell."""
        met = self._met(s)
        crossed = met.on_shell & ~met.again
        moves = crossed | met.on_part | met.blocked
        point = dr.select(moves, s.point + s.direction * met.distance, s.point)
        outside, inside = self.tables.sides(met.shape, crossed)
        near = dr.select(met.outward, inside, outside)
        far = dr.select(met.outward, outside, inside)
        bent, reflected, memory = self.bending.cross(
            s.memory,
            Passage(
                direction=s.direction,
                length=met.distance,
                first=s.crossings == 0,
                point=point,
                outward=met.outward,
                face=met.face,
                triangle=met.triangle,
                facet=met.normal,
                shape=met.shape,
                near=near,
                far=far,
                crossed=crossed,
            ),
        )
        crossings = s.crossings + dr.select(crossed, mi.UInt32(1), 0)
        gave_up = crossed & (crossings >= self.limit)
        if self.drop_inside_hits:
            gave_up |= crossed & met.outward
        outcome = dr.select(met.on_part, mi.UInt32(HIT_PART), s.outcome)
        outcome = dr.select(met.blocked, mi.UInt32(HIT_BLOCKER), outcome)
        farthest = dr.maximum(dr.abs(near - self.ambient), dr.abs(far - self.ambient))
        return _State(
            point=point,
            direction=dr.select(crossed, bent, s.direction),
            path_length=s.path_length + dr.select(moves, met.distance, 0),
            outcome=dr.select(gave_up, mi.UInt32(GAVE_UP), outcome),
            face=dr.select(met.on_shell | met.on_part, met.face, s.face),
            crossings=crossings,
            entry_index=dr.select(crossed & (s.crossings == 0), near, s.entry_index),
            index_sum=s.index_sum + dr.select(crossed & ~reflected, far - near, 0),
            contrast=dr.maximum(s.contrast, mi.Float(dr.select(crossed, farthest, 0))),
            segment=dr.select(moves, met.distance, s.segment),
            shape=dr.select(crossed, met.shape, s.shape),
            outward=dr.select(crossed, met.outward, s.outward),
            start=self._next_start(s, met, crossed, point, bent, reflected),
            memory=memory,
            count=s.count + 1,
            active=met.on_shell & ~gave_up,
        )

    def _next_start(
        self, s: _State, met: _Met, crossed: Bool, point: Point3d, bent: Vector3d, reflected: Bool
    ) -> Point3d:
        """A small step beyond the crossing; from a plane that is grazed, also off it."""
        # Single precision is finer near the origin, and so may be the step.
        small = dr.maximum(RELATIVE_STEP * dr.max(dr.abs(point)), LEAST_STEP * self.smallest_step)
        beyond = dr.select(met.outward ^ reflected, met.normal, -met.normal)
        clear = crossed & (dr.abs(dr.dot(bent, met.normal)) < GRAZING_COSINE)
        ahead = dr.select(crossed, bent, s.direction)
        start = point + ahead * small + beyond * dr.select(clear, CLEARANCE_STEPS * small, 0)
        return dr.select(met.again, s.start + s.direction * (3 * met.step), start)


def _fix_transitions(
    bending: AtShells | InLayers,
    tables: SceneTables,
    hits: RefractedHits,
    memory: tuple[Array, ...],
    length: Float64,
) -> RefractedHits:
    """Ends of rays where they really are, and their directions there.

    Those that left the scene are given by a point and the direction in which they left.
    """
    on_part, escaped = hits.outcome == HIT_PART, hits.outcome == ESCAPED
    _, normal = tables.plane(hits.face, on_part)
    length = dr.select(escaped, mi.Float64(dr.inf), length)
    aside, direction = bending.end(memory, hits.direction, length, normal, hits.crossings > 0)
    back = dr.select(on_part, onto_plane(aside, hits.direction, normal), 0)
    ends = on_part | escaped
    return hits._replace(
        point=dr.select(ends, hits.point + aside + back * hits.direction, hits.point),
        direction=dr.select(ends, direction, hits.direction),
        path_length=hits.path_length + back,
    )


def _back_on_front(
    prepared: PreparedScene, hits: RefractedHits, segment: Float64, coherent: bool
) -> RefractedHits:
    """Bring rays that slipped through the part's front back to it.

    Where a shell lies closer to the wall than the step, the query after the crossing starts behind
    the wall and finds the part's back from inside. Going back along the ray finds the front, just
    behind the last crossing; a back that is seen through an opening of the part has none there.
    """
    tables, smallest_step = prepared.tables, dr.opaque(mi.Float64, prepared.step)
    on_part = hits.outcome == HIT_PART
    _, normal = tables.plane(hits.face, on_part)
    slipped = on_part & (dr.dot(hits.direction, normal) > 0)
    back = -hits.direction
    preliminary = ray_query(
        prepared.opaque, hits.point + back * smallest_step, back, coherent, slipped
    )
    found = slipped & preliminary.is_valid()
    shape = tables.shape_number(preliminary, found)
    found &= tables.kind(shape, found) == PART
    face = tables.face(shape, preliminary.prim_index, found)
    triangle, normal = tables.plane(face, found)
    found &= dr.dot(hits.direction, normal) < 0
    rough = mi.Float64(preliminary.t) + smallest_step
    tolerance = query_error(hits.point, smallest_step)
    distance = distance_to_plane(hits.point, back, triangle, normal, rough, tolerance)
    # Where the front lies, counted from the last crossing (the length of the last segment).
    depth = segment - distance
    reach = SAME_CROSSING_STEPS * smallest_step
    found &= (hits.crossings > 0) & (dr.abs(depth) < reach)
    distance = dr.select(found, distance, 0)
    return hits._replace(
        point=hits.point + back * distance,
        path_length=hits.path_length - distance,
        face=dr.select(found, face, hits.face),
    )
