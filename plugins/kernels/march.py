"""Marching rays through a scene's shells, from crossing to crossing.

The point on a triangle's plane and the direction behind it are computed in double precision, and
the next query starts from that exact point, a small step further along the ray. Mitsuba's own
``spawn`` rule would move the origin off the ray by more than the whole deflection.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from iriftrace.plugins.kernels.between import onto_plane
from iriftrace.plugins.kernels.layers import Passage
from iriftrace.plugins.kernels.queries import (
    ESCAPED,
    GAVE_UP,
    HIT_BLOCKER,
    HIT_PART,
    RELATIVE_STEP,
    SAME_CROSSING_STEPS,
    query_error,
    ray_query,
    same_crossing,
    settled,
)
from iriftrace.plugins.kernels.snell import distance_to_plane
from iriftrace.plugins.kernels.tables import BLOCKER, PART, SceneTables
from iriftrace.plugins.kernels.vertex_table import SHELL

GRAZING_COSINE = 1e-3
"""A ray that leaves a triangle at a smaller cosine is queried from a little beyond its plane."""

CLEARANCE_STEPS = 2
"""Steps beyond it; without, single precision would guess the side of the next triangle it is on.

Rays turned into a triangle's plane are such: of those that look down along a plume, 0.3 % crossed
the next triangle of the shell once more, or not at all.
"""

LEAST_STEP = 0.02
"""Smallest step, as a share of the step at the scene's largest coordinate."""


class RefractedHits(NamedTuple):
    """Ends of refracted rays, and what they met on the way."""

    point: Any  # Point3d, mm, world
    direction: Any  # Vector3d, at the end
    path_length: Any  # Float64, mm, geometric
    outcome: Any  # UInt32
    face: Any  # UInt32: row of the part's face in the tables
    crossings: Any  # UInt32
    entry_index: Any  # Float64: index of the layer before the first crossing; 0 without crossing
    index_sum: Any  # Float64: sum of the index steps
    # Float: most by which n differs from the ambient air's in the layers that were crossed and
    # those next to them; infinite where shells know ratios only.
    contrast: Any


def refracted_hits(
    scene: Any,
    opaque: Any,
    tables: SceneTables,
    origin: Any,
    direction: Any,
    *,
    coherent: bool,
    bending: Any,
    max_crossings: int,
    step: float,
    drop_inside_hits: bool = False,
) -> RefractedHits:
    """Ends of rays that are bent by shells or by the layers between them.

    The scene has part, shells and other shapes; `opaque` is the same without shells. Rays have
    origins (Point3d, mm) and unit directions (Vector3d), world; those with more than
    `max_crossings` give up, and with `drop_inside_hits` those that meet a shell from its inside.
    `bending` is AtShells or InLayers; `coherent` and `step` as for :func:`straight_hits`.
    """
    import drjit as dr
    import mitsuba as mi

    smallest_step = dr.opaque(mi.Float64, step)
    limit = dr.opaque(mi.UInt32, max_crossings)
    ambient = dr.opaque(mi.Float64, tables.ambient)
    nothing = mi.UInt32(0xFFFFFFFF)

    def step_at(point: Any) -> Any:
        # Single precision is finer near the origin, and so may be the step.
        return dr.maximum(RELATIVE_STEP * dr.max(dr.abs(point)), LEAST_STEP * smallest_step)

    class State(NamedTuple):
        point: Any
        direction: Any
        path_length: Any
        outcome: Any
        face: Any
        crossings: Any
        entry_index: Any
        index_sum: Any
        contrast: Any
        segment: Any
        shape: Any
        outward: Any
        start: Any  # of the next query
        memory: Any
        active: Any

    def advance(*values: Any) -> tuple[Any, ...]:
        s = State(*values)
        preliminary = ray_query(scene, s.start, s.direction, coherent, s.active)
        found = s.active & preliminary.is_valid()
        shape = tables.shape_number(preliminary, found)
        kind = tables.kind(shape, found)
        on_shell, on_part = found & (kind == SHELL), found & (kind == PART)
        blocked = found & (kind == BLOCKER)
        flat = on_shell | on_part
        face = tables.face(shape, preliminary.prim_index, flat)
        triangle, normal = tables.plane(face, flat)
        outward = dr.dot(s.direction, normal) > 0
        step = dr.dot(s.start - s.point, s.direction)
        rough = mi.Float64(preliminary.t) + step
        same = same_crossing(shape, outward, s.shape, s.outward, rough, smallest_step)
        # Then look again from further along.
        again = on_shell & ((face == s.face) | same)
        crossed = on_shell & ~again

        tolerance = query_error(s.point, smallest_step)
        distance = dr.select(
            flat,
            distance_to_plane(s.point, s.direction, triangle, normal, rough, tolerance),
            rough,
        )
        moves = found & ~again
        point = dr.select(moves, s.point + s.direction * distance, s.point)

        outside, inside = tables.sides(shape, crossed)
        near = dr.select(outward, inside, outside)
        far = dr.select(outward, outside, inside)
        bent, reflected, memory = bending.cross(
            s.memory,
            Passage(
                direction=s.direction,
                length=distance,
                first=s.crossings == 0,
                point=point,
                outward=outward,
                face=face,
                triangle=triangle,
                facet=normal,
                shape=shape,
                near=near,
                far=far,
                crossed=crossed,
            ),
        )

        leaving = dr.dot(bent, normal)
        beyond = dr.select(outward ^ reflected, normal, -normal)
        clear = crossed & (dr.abs(leaving) < GRAZING_COSINE)
        ahead = dr.select(crossed, bent, s.direction)
        small = step_at(point)
        start = point + ahead * small + beyond * dr.select(clear, CLEARANCE_STEPS * small, 0)
        start = dr.select(again, s.start + s.direction * (3 * step), start)

        farthest = dr.maximum(dr.abs(near - ambient), dr.abs(far - ambient))
        crossings = s.crossings + dr.select(crossed, mi.UInt32(1), 0)
        gave_up = crossed & (crossings >= limit)
        if drop_inside_hits:
            gave_up |= crossed & outward
        outcome = dr.select(on_part, mi.UInt32(HIT_PART), s.outcome)
        outcome = dr.select(blocked, mi.UInt32(HIT_BLOCKER), outcome)
        outcome = dr.select(gave_up, mi.UInt32(GAVE_UP), outcome)
        return (
            point,
            ahead,
            s.path_length + dr.select(moves, distance, 0),
            outcome,
            dr.select(flat, face, s.face),
            crossings,
            dr.select(crossed & (s.crossings == 0), near, s.entry_index),
            s.index_sum + dr.select(crossed & ~reflected, far - near, 0),
            dr.maximum(s.contrast, mi.Float(dr.select(crossed, farthest, 0))),
            dr.select(moves, distance, s.segment),
            dr.select(crossed, shape, s.shape),
            dr.select(crossed, outward, s.outward),
            start,
            memory,
            on_shell & ~gave_up,
        )

    width = dr.width(origin, direction)
    state = (
        mi.Point3d(origin),
        mi.Vector3d(direction),
        dr.zeros(mi.Float64, width),
        dr.full(mi.UInt32, ESCAPED, width),
        mi.UInt32(nothing),
        dr.zeros(mi.UInt32, width),
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.Float, width),
        dr.zeros(mi.Float64, width),
        mi.UInt32(nothing),
        dr.full(mi.Bool, False, width),
        mi.Point3d(origin),
        bending.start(width),
        dr.full(mi.Bool, True, width),
    )
    end = State(
        *dr.while_loop(
            state, lambda *s: s[-1], advance, labels=State._fields, compress=False, label="march"
        )
    )
    next_layer = dr.opaque(mi.Float, dr.inf if tables.stock_shells else 2 * tables.open_step)
    marched = RefractedHits(*end[:8], contrast=end.contrast + next_layer)
    hits = _back_on_front(opaque, tables, marched, end.segment, coherent, step)
    length = end.segment + (hits.path_length - marched.path_length)
    return settled(tables, _put_right(bending, tables, hits, end.memory, length))


def _put_right(
    bending: Any, tables: SceneTables, hits: RefractedHits, memory: Any, length: Any
) -> RefractedHits:
    """Ends of rays where they really are, and their directions there.

    Those that left the scene are given by a point and the direction in which they left.
    """
    import drjit as dr
    import mitsuba as mi

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
    opaque: Any,
    tables: SceneTables,
    hits: RefractedHits,
    segment: Any,
    coherent: bool,
    step: float,
) -> RefractedHits:
    """Bring rays that slipped through the part's front back to it.

    Where a shell lies closer to the wall than the step, the query after the crossing starts behind
    the wall and finds the part's back from inside. Going back along the ray finds the front, just
    behind the last crossing; a back that is seen through an opening of the part has none there.
    """
    import drjit as dr
    import mitsuba as mi

    on_part = hits.outcome == HIT_PART
    _, normal = tables.plane(hits.face, on_part)
    slipped = on_part & (dr.dot(hits.direction, normal) > 0)
    smallest_step = dr.opaque(mi.Float64, step)
    back = -hits.direction
    preliminary = ray_query(opaque, hits.point + back * smallest_step, back, coherent, slipped)
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
