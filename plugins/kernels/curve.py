"""The ray equation d/ds (n dr/ds) = grad n, integrated from the camera to the part.

With time dt = ds / n it is r'' = n grad n (Sharma, Kumar and Ghatak, Applied Optics 21 (1982) 984),
which a step of Nystrom's method of order 4 advances (:func:`nystrom_step`).

A ray is in one of three modes. Outside the data it runs straight to the data's boundary. Inside, it
passes one piece of the medium after the other, with one step of order 4 in each. Where it is inside
but its piece is not known (the camera stands inside the data, or rounding led it astray at a
corner), the boundary is found straight ahead, and the pieces are followed back from there.

Opaque shapes are found by ray queries in single precision, straight ahead. The answer holds until
the ray has come as far, or is some roundings beside that line. It only says which triangle the ray
ends on; where it ends is then computed in double precision.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from iriftrace.plugins.kernels.queries import (
    ESCAPED,
    GAVE_UP,
    HIT_BLOCKER,
    HIT_PART,
    RELATIVE_STEP,
    SAME_CROSSING_STEPS,
    query_error,
    ray_query,
    settled,
)
from iriftrace.plugins.kernels.snell import distance_to_plane
from iriftrace.plugins.kernels.tables import PART, SceneTables


class Step(NamedTuple):
    """End of a step."""

    point: Any  # Point3d, mm
    velocity: Any  # Vector3d: index times direction
    velocity_error: Any  # Vector3d: difference of the velocity to a rule of order 2
    middle: Any  # Point3d, mm


def nystrom_step(point: Any, velocity: Any, acceleration: Callable[[Any], Any], time: Any) -> Step:
    """Advance a ray by one step of Nystrom's method of order 4 (Hairer, Norsett and Wanner, II.14).

    From a point (Point3d, mm) and a velocity (Vector3d, index times unit direction), with the
    acceleration n grad n (Vector3d, 1/mm) at points. The time is the length of the step over the
    index, mm; it may be negative.
    """
    first = acceleration(point) * time
    halfway = point + velocity * (time / 2) + first * (time / 8)
    middle = acceleration(halfway) * time
    last = acceleration(point + velocity * time + middle * (time / 2)) * time
    return Step(
        point + (velocity + (first + 2 * middle) / 6) * time,
        velocity + (first + 4 * middle + last) / 6,
        (first - 2 * middle + last) / 6,
        halfway,
    )


OUTSIDE, INSIDE, SEEKING = range(3)

OVERLAP_STEPS = 8
"""Steps by which each query of the part reaches back, so that no ray slips between two of them, and
by which a ray may leave the line of the last one."""


MOST_RELOCATIONS = 20
"""A ray whose piece had to be sought more often gives up. Through meshes with folds and slits those
that arrive need 5 at most; others go round in circles."""


class CurvedHits(NamedTuple):
    """Ends of rays along curved paths, and what they met on the way."""

    point: Any  # Point3d, mm, world
    direction: Any  # Vector3d, at the end
    path_length: Any  # Float64, mm, geometric
    outcome: Any  # UInt32: ESCAPED, HIT_PART, HIT_BLOCKER or GAVE_UP
    face: Any  # UInt32: row of the part's face in the tables
    crossings: Any  # UInt32: pieces of the medium that were passed
    entry_index: Any  # Float64: index where the ray came into the data; 0 if it did not
    index_sum: Any  # Float64: index at the end less that
    error: Any  # Float64, mm: estimated error of the hit
    opened: Any  # Bool: it came or went through a boundary where the index is not the ambient one
    relocations: Any  # UInt32: times its piece had to be sought
    contrast: Any  # Float: most by which n differs from the ambient air's


def curved_hits(
    opaque: Any,
    tables: SceneTables,
    medium: Any,
    origin: Any,
    direction: Any,
    *,
    coherent: bool,
    max_steps: int,
    step: float,
) -> CurvedHits:
    """Ends of rays that follow the ray equation through a medium.

    A medium is TetrahedralAir, or anything else with its methods; the scene has opaque shapes
    alone. Rays have origins (Point3d, mm) and unit directions (Vector3d), world; those with more
    than `max_steps`, or that lose their way more than `MOST_RELOCATIONS` times, give up. `coherent`
    is a hint to the ray query; `step` is `query_step`.
    """
    import drjit as dr
    import mitsuba as mi

    smallest_step = dr.opaque(mi.Float64, step)
    limit = dr.opaque(mi.UInt32, max_steps)
    boundary = medium.boundary_beside(opaque)
    ambient = dr.opaque(mi.Float64, medium.ambient)
    open_step = dr.opaque(mi.Float64, medium.open_step)

    class State(NamedTuple):
        point: Any
        velocity: Any
        path_length: Any
        outcome: Any
        shape: Any  # number of the shape that was hit
        primitive: Any  # and of its triangle
        crossings: Any
        entry_index: Any
        position_error: Any  # Vector3f, mm: estimate of what the gradient's error does to the point
        velocity_error: Any  # Vector3f: and to the velocity
        step_position_error: Any  # Float, mm: the same of the steps, without a direction
        step_velocity_error: Any
        opened: Any
        relocations: Any
        contrast: Any
        place: Any
        mode: Any
        ahead: Any  # outside: from where to query; seeking: how far the place is ahead
        free: Any  # Float64, mm: straight way ahead that is known to be free of opaque shapes
        deflection: Any  # Float, rad: change of the direction since that was asked
        lateral_offset: Any  # Float, mm: lateral offset from that straight way
        retreat: Any  # Float64, mm: how far it has gone back, through cells turned inside out
        last: Any  # Float64, mm: length of the last piece, as single precision has it
        count: Any
        active: Any

    def advance(*values: Any) -> tuple[Any, ...]:
        s = State(*values)
        speed = dr.norm(s.velocity)
        heading = s.velocity / speed
        outside = s.active & (s.mode == OUTSIDE)
        inside = s.active & (s.mode == INSIDE)
        seeking = s.active & (s.mode == SEEKING)

        ahead_point = s.point + heading * s.ahead
        entrance = medium.entrance(
            ray_query(boundary, ahead_point, heading, coherent, outside), outside
        )
        place = dr.select(outside, entrance.place, s.place)
        cell = medium.cell(place, (outside & entrance.found) | inside | seeking)
        to_face = dr.select(outside, entrance.distance + s.ahead, 0)
        # A cell sees what is near, as rays need not be that are outside or have lost their way.
        at_cell = s.point + heading * dr.select(seeking, s.ahead, to_face)
        way = dr.select(seeking, -heading, heading)

        tolerance = query_error(s.point, smallest_step)
        remaining, entering = cell.entry_distance(at_cell, way)
        gap = to_face + remaining
        enters = outside & entrance.found & entering
        leaves = outside & entrance.found & ~entering
        # The boundary face that the ray has just come through.
        again = leaves & (gap < SAME_CROSSING_STEPS * smallest_step)
        astray = leaves & ~again

        passage = cell.passage(at_cell, way)
        lost = inside & passage.lost
        walks = inside & ~passage.lost

        arrives = seeking & (passage.distance >= s.ahead)
        steps_back = seeking & ~arrives & ~passage.lost
        back = s.ahead - passage.distance
        # The way back came to the boundary: there the ray came in, unnoticed.
        came_in = steps_back & passage.ends

        length = dr.select(inside, passage.distance, dr.select(enters, gap, dr.inf))
        length = dr.select(came_in, back, length)
        overlap = OVERLAP_STEPS * RELATIVE_STEP * dr.max(dr.abs(s.point))
        # The last answer holds while the ray stays within some roundings of that line (0.2 um in a
        # scene that reaches 165 mm). With more of them grazing rays miss an edge.
        lateral_offset = s.lateral_offset + s.deflection * mi.Float(length)
        known = (s.free > length + overlap + tolerance) & (
            lateral_offset < mi.Float(OVERLAP_STEPS * smallest_step)
        )
        looks = (walks & (length > 0) & ~known) | (outside & ~leaves) | came_in
        preliminary = ray_query(opaque, s.point - heading * overlap, heading, coherent, looks)
        seen = looks & preliminary.is_valid()
        rough = mi.Float64(preliminary.t) - overlap
        ended = seen & (rough <= length)

        passes = walks & ~ended
        time = dr.select(passes, length / speed, 0)
        stepped = nystrom_step(
            s.point, s.velocity, lambda point: cell.acceleration(point, heading), time
        )
        error = mi.Vector3f(cell.gradient_error(stepped.middle, heading))
        gained = dr.select(passes, error * mi.Float(time), 0)
        of_step = dr.select(passes, dr.norm(mi.Vector3f(stepped.velocity_error)), 0)
        enters, came_in = enters & ~ended, came_in & ~ended
        straight = dr.select(enters, gap, dr.select(came_in, back, 0))
        # Where the data's boundary is folded, a ray that goes back out of them would meet the same
        # fold for ever: it goes straight on from where it turned back.
        leaves_data = passes & passage.ends
        retreat = dr.maximum(s.retreat - dr.select(passes, length, straight), 0)
        skipped = dr.select(leaves_data, retreat, 0)
        point = mi.Point3d(dr.select(passes, stepped.point, s.point + heading * straight))
        point = mi.Point3d(point + heading * skipped)
        moved = dr.select(passes, time, straight / speed)
        time_passed = mi.Float(moved)
        refractivity = cell.refractivity(point)
        starts = (s.entry_index == 0) & (enters | arrives | came_in)
        velocity = dr.select(passes, stepped.velocity, s.velocity)
        free = dr.select(looks, dr.select(seen, rough, dr.inf), s.free)
        free -= dr.select(passes, length, straight) + skipped
        gain = velocity - s.velocity
        deflection = dr.select(looks, 0, s.deflection) + dr.norm(mi.Vector3f(gain))
        lateral_offset = dr.select(looks, 0, s.lateral_offset) + dr.select(
            passes, deflection * mi.Float(length), 0
        )
        velocity = dr.select(starts | enters, heading * (1 + refractivity), velocity)

        # Where a ray starts does not count.
        sought = lost | (astray & (s.entry_index != 0))
        mode = s.mode
        mode = dr.select(enters | arrives | came_in, mi.UInt32(INSIDE), mode)
        mode = dr.select(leaves_data | lost | (seeking & passage.lost), mi.UInt32(OUTSIDE), mode)
        mode = dr.select(astray, mi.UInt32(SEEKING), mode)
        here = medium.unentered(place)
        place = dr.select(passes | steps_back, passage.place, place)
        place = dr.select(arrives | came_in, here, place)
        place = dr.select(ended, s.place, place)
        ahead = dr.select(again, 4 * s.ahead, step_at(point))
        ahead = dr.select(astray, gap, ahead)
        ahead = dr.select(steps_back, back, ahead)

        at_wall = (enters & entrance.wall) | (leaves_data & passage.wall)
        opened = (enters | came_in | leaves_data) & ~at_wall
        opened &= dr.abs(refractivity - ambient) > open_step

        count = s.count + 1
        relocations = s.relocations + dr.select(sought, mi.UInt32(1), 0)
        gave_up = (count >= limit) | (relocations > MOST_RELOCATIONS)
        gave_up &= s.active & ~ended
        escaped = outside & ~entrance.found & ~ended
        # Whether it is the part, `_ended` looks up.
        outcome = dr.select(ended, mi.UInt32(HIT_PART), s.outcome)
        outcome = dr.select(gave_up, mi.UInt32(GAVE_UP), outcome)
        return (
            point,
            velocity,
            s.path_length
            + skipped
            + moved * (speed + dr.select(passes, dr.dot(gain, heading) / 2, 0)),
            outcome,
            dr.select(ended, tables.shape_number(preliminary, ended), s.shape),
            dr.select(ended, preliminary.prim_index, s.primitive),
            s.crossings + dr.select(passes, mi.UInt32(1), 0),
            dr.select(starts, 1 + refractivity, s.entry_index),
            s.position_error + (s.velocity_error + gained / 2) * time_passed,
            s.velocity_error + gained,
            s.step_position_error + dr.abs(time_passed) * (s.step_velocity_error + of_step / 2),
            s.step_velocity_error + of_step,
            s.opened | opened,
            relocations,
            dr.maximum(
                s.contrast, dr.select(passes | enters, dr.abs(mi.Float(refractivity - ambient)), 0)
            ),
            place,
            mode,
            ahead,
            free,
            deflection,
            lateral_offset,
            retreat - skipped,
            dr.select(ended, rough, s.last),
            count,
            s.active & ~ended & ~gave_up & ~escaped,
        )

    def step_at(point: Any) -> Any:
        return dr.maximum(RELATIVE_STEP * dr.max(dr.abs(point)), smallest_step / 50)

    width = dr.width(origin, direction)
    start = (
        mi.Point3d(origin),
        mi.Vector3d(direction),
        dr.zeros(mi.Float64, width),
        dr.full(mi.UInt32, ESCAPED, width),
        dr.zeros(mi.UInt32, width),
        dr.zeros(mi.UInt32, width),
        dr.zeros(mi.UInt32, width),
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.Vector3f, width),
        dr.zeros(mi.Vector3f, width),
        dr.zeros(mi.Float, width),
        dr.zeros(mi.Float, width),
        dr.full(mi.Bool, False, width),
        dr.zeros(mi.UInt32, width),
        dr.zeros(mi.Float, width),
        dr.zeros(mi.UInt32, width),
        dr.full(mi.UInt32, OUTSIDE, width),
        step_at(mi.Point3d(origin)),
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.Float, width),
        dr.zeros(mi.Float, width),
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.UInt32, width),
        dr.full(mi.Bool, True, width),
    )
    end = State(
        *dr.while_loop(
            start, lambda *s: s[-1], advance, labels=State._fields, compress=False, label="curve"
        )
    )
    return _ended(tables, medium, end, query_error(end.point, smallest_step))


def _ended(tables: SceneTables, medium: Any, end: Any, tolerance: Any) -> CurvedHits:
    """Take the last piece of each ray, up to what it hit.

    ``tolerance`` is that of :func:`iriftrace.plugins.kernels.snell.distance_to_plane`.
    """
    import drjit as dr
    import mitsuba as mi

    hit = end.outcome == HIT_PART
    on_part = hit & (tables.kind(end.shape, hit) == PART)
    face = dr.select(on_part, tables.face(end.shape, end.primitive, on_part), 0)
    triangle, normal = tables.plane(face, on_part)
    inside = hit & (end.mode == INSIDE)
    cell = medium.cell(end.place, inside)
    ahead = dr.normalize(end.velocity)

    def acceleration(point: Any) -> Any:
        return dr.select(inside, cell.acceleration(point, ahead), 0)

    speed = dr.norm(end.velocity)
    exact = distance_to_plane(end.point, ahead, triangle, normal, end.last, tolerance)
    time = dr.select(hit, dr.select(on_part, exact, end.last) / speed, 0)
    straight = nystrom_step(end.point, end.velocity, acceleration, time)
    # The curve leaves the chord by far less than a micrometre, so that one correction is enough.
    slope = dr.dot(normal, straight.velocity)
    missing = dr.dot(normal, triangle.a - straight.point)
    correction = dr.select(on_part & (slope != 0), missing / slope, 0)
    time = time + dr.clip(correction, -1e-3, 1e-3)
    stepped = nystrom_step(end.point, end.velocity, acceleration, time)

    gained = dr.select(inside, mi.Vector3d(cell.gradient_error(stepped.middle, ahead)) * time, 0)
    velocity_error = mi.Vector3d(end.velocity_error) + gained / 2
    position_error = mi.Vector3d(end.position_error) + velocity_error * time
    heading = dr.normalize(stepped.velocity)
    cosine = dr.dot(normal, heading)
    # Along the part's surface, which the estimated ray meets elsewhere.
    along = dr.select(on_part, dr.dot(normal, position_error) / cosine, 0)
    position_error = position_error - heading * along
    of_steps = end.step_velocity_error + dr.norm(stepped.velocity_error) / 2
    of_steps = end.step_position_error + dr.abs(time) * of_steps
    error = dr.norm(position_error) + of_steps / dr.maximum(dr.abs(cosine), 1e-6)
    final_speed = dr.norm(stepped.velocity)
    entered = end.entry_index != 0
    hits = CurvedHits(
        point=stepped.point,
        direction=heading,
        path_length=end.path_length + time * (speed + final_speed) / 2,
        outcome=dr.select(hit & ~on_part, mi.UInt32(HIT_BLOCKER), end.outcome),
        face=face,
        crossings=end.crossings,
        entry_index=end.entry_index,
        index_sum=dr.select(entered, final_speed - end.entry_index, 0),
        error=dr.select(on_part & dr.isfinite(error), error, 0),
        opened=end.opened,
        relocations=end.relocations,
        contrast=end.contrast,
    )
    return settled(tables, hits)
