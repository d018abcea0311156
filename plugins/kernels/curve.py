"""The ray equation d/ds (n dr/ds) = grad n, integrated from the camera to the part.

With time dt = ds / n it is r'' = n grad n (Sharma, Kumar and Ghatak, Applied Optics 21 (1982) 984),
which a step of Nystrom's method of order 4 advances (:func:`nystrom_step`).

A ray is in one of three modes. Outside the data it runs straight to the data's boundary. Inside, it
passes one piece of the medium after the other, with one step of order 4 in each. Where it is inside
but its piece is not known (the camera stands inside the data, or rounding led it astray at a
corner), the boundary is found straight ahead, and the pieces are followed back from there.

Every step is also a ray query against the opaque shapes, in single precision and only to learn
which triangle the ray ends on; where it ends is then computed in double precision.
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
from iriftrace.plugins.kernels.tables import BLOCKER, PART, SceneTables


class Step(NamedTuple):
    """End of a step."""

    point: Any  # Point3d, mm
    velocity: Any  # Vector3d: index times direction
    velocity_error: Any  # Float64: difference of the velocity to a rule of order 2


def nystrom_step(point: Any, velocity: Any, acceleration: Callable[[Any], Any], time: Any) -> Step:
    """Advance a ray by one step of Nystrom's method of order 4 (Hairer, Norsett and Wanner, II.14).

    Parameters
    ----------
    point, velocity : Point3d, Vector3d
        mm; index times unit direction.
    acceleration : callable
        n grad n (Vector3d, 1/mm) at points.
    time : Float64, mm
        Length of the step over the index; may be negative.
    """
    import drjit as dr

    first = acceleration(point) * time
    middle = acceleration(point + velocity * (time / 2) + first * (time / 8)) * time
    last = acceleration(point + velocity * time + middle * (time / 2)) * time
    return Step(
        point + (velocity + (first + 2 * middle) / 6) * time,
        velocity + (first + 4 * middle + last) / 6,
        dr.norm(first - 2 * middle + last) / 6,
    )


OUTSIDE, INSIDE, SEEKING = range(3)

OVERLAP_STEPS = 8
"""Steps by which each query of the part reaches back, so that no ray slips between two of them."""


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

    Parameters
    ----------
    opaque : mi.Scene
        The part and other opaque shapes.
    tables : SceneTables
    medium : TetrahedralAir
        Or anything else with its methods.
    origin, direction : Point3d, Vector3d
        Rays, mm, world; directions of length one.
    coherent : bool
        A hint to the ray query.
    max_steps : int
        Rays with more steps give up.
    step : float, mm
        From :func:`iriftrace.plugins.kernels.queries.query_step`.
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
        face: Any
        crossings: Any
        entry_index: Any
        position_error: Any  # Vector3d, mm: estimate of what the gradient's error does to the point
        velocity_error: Any  # Vector3d: and to the velocity
        step_position_error: Any  # Float64, mm: the same of the steps, without a direction
        step_velocity_error: Any
        opened: Any
        relocations: Any
        place: Any
        mode: Any
        ahead: Any  # outside: from where to query; seeking: how far the place is ahead
        last: Any  # length of the last piece
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

        tolerance = query_error(s.point, smallest_step)
        gap, entering = cell.entry_distance(
            s.point, heading, entrance.distance + s.ahead, tolerance
        )
        enters = outside & entrance.found & entering
        leaves = outside & entrance.found & ~entering
        # The boundary face that the ray has just come through.
        again = leaves & (gap < SAME_CROSSING_STEPS * smallest_step)
        astray = leaves & ~again

        passage = cell.passage(
            dr.select(seeking, ahead_point, s.point), dr.select(seeking, -heading, heading)
        )
        lost = inside & passage.lost
        walks = inside & ~passage.lost

        arrives = seeking & (passage.distance >= s.ahead)
        steps_back = seeking & ~arrives & ~passage.lost
        back = s.ahead - passage.distance
        # The way back came to the boundary: there the ray came in, unnoticed.
        came_in = steps_back & passage.ends

        length = dr.select(inside, passage.distance, dr.select(enters, gap, dr.inf))
        length = dr.select(came_in, back, length)
        looks = (walks & (length > 0)) | (outside & ~leaves) | came_in
        overlap = OVERLAP_STEPS * RELATIVE_STEP * dr.max(dr.abs(s.point))
        preliminary = ray_query(opaque, s.point - heading * overlap, heading, coherent, looks)
        found = looks & preliminary.is_valid()
        rough = mi.Float64(preliminary.t) - overlap
        found &= rough < length + overlap + tolerance
        shape = tables.shape_number(preliminary, found)
        kind = tables.kind(shape, found)
        on_part, on_blocker = found & (kind == PART), found & (kind == BLOCKER)
        face = tables.face(shape, preliminary.prim_index, on_part)
        triangle, normal = tables.plane(face, on_part)
        exact = distance_to_plane(s.point, heading, triangle, normal, rough, tolerance)
        distance = dr.select(on_part, exact, rough)
        on_part &= distance <= length
        on_blocker &= distance <= length
        ended = on_part | on_blocker

        passes = walks & ~ended
        time = dr.select(passes, length / speed, 0)

        def acceleration(point: Any) -> Any:
            return cell.gradient(point, heading) * (1 + cell.refractivity(point))

        stepped = nystrom_step(s.point, s.velocity, acceleration, time)
        middle = s.point + heading * (length / 2)
        gained = dr.select(passes, cell.gradient_error(middle, heading) * time, 0)
        of_step = dr.select(passes, stepped.velocity_error, 0)
        enters, came_in = enters & ~ended, came_in & ~ended
        straight = dr.select(enters, gap, dr.select(came_in, back, 0))
        point = mi.Point3d(dr.select(passes, stepped.point, s.point + heading * straight))
        moved = dr.select(passes, time, straight / speed)
        refractivity = cell.refractivity(point)
        starts = (s.entry_index == 0) & (enters | arrives | came_in)
        velocity = dr.select(passes, stepped.velocity, s.velocity)
        velocity = dr.select(starts | enters, heading * (1 + refractivity), velocity)

        # Where a ray starts does not count.
        sought = lost | (astray & (s.entry_index != 0))
        leaves_data = passes & passage.ends
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
        gave_up = s.active & ~ended & (count >= limit)
        escaped = outside & ~entrance.found & ~ended
        outcome = dr.select(on_part, mi.UInt32(HIT_PART), s.outcome)
        outcome = dr.select(on_blocker, mi.UInt32(HIT_BLOCKER), outcome)
        outcome = dr.select(gave_up, mi.UInt32(GAVE_UP), outcome)
        return (
            point,
            velocity,
            s.path_length + moved * (speed + dr.select(passes, dr.norm(velocity), speed)) / 2,
            outcome,
            dr.select(on_part, face, s.face),
            s.crossings + dr.select(passes, mi.UInt32(1), 0),
            dr.select(starts, 1 + refractivity, s.entry_index),
            s.position_error + (s.velocity_error + gained / 2) * moved,
            s.velocity_error + gained,
            s.step_position_error + dr.abs(moved) * (s.step_velocity_error + of_step / 2),
            s.step_velocity_error + of_step,
            s.opened | opened,
            s.relocations + dr.select(sought, mi.UInt32(1), 0),
            place,
            mode,
            ahead,
            dr.select(ended, distance, s.last),
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
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.Vector3d, width),
        dr.zeros(mi.Vector3d, width),
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.Float64, width),
        dr.full(mi.Bool, False, width),
        dr.zeros(mi.UInt32, width),
        dr.zeros(mi.UInt32, width),
        dr.full(mi.UInt32, OUTSIDE, width),
        step_at(mi.Point3d(origin)),
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.UInt32, width),
        dr.full(mi.Bool, True, width),
    )
    end = State(
        *dr.while_loop(
            start, lambda *s: s[-1], advance, labels=State._fields, compress=False, label="curve"
        )
    )
    return _ended(tables, medium, end)


def _ended(tables: SceneTables, medium: Any, end: Any) -> CurvedHits:
    """Take the last piece of each ray, up to what it hit."""
    import drjit as dr

    hit = (end.outcome == HIT_PART) | (end.outcome == HIT_BLOCKER)
    on_part = end.outcome == HIT_PART
    inside = hit & (end.mode == INSIDE)
    cell = medium.cell(end.place, inside)
    ahead = dr.normalize(end.velocity)

    def acceleration(point: Any) -> Any:
        bent = cell.gradient(point, ahead) * (1 + cell.refractivity(point))
        return dr.select(inside, bent, 0)

    speed = dr.norm(end.velocity)
    time = dr.select(hit, end.last / speed, 0)
    straight = nystrom_step(end.point, end.velocity, acceleration, time)
    triangle, normal = tables.plane(end.face, on_part)
    # The curve leaves the chord by far less than a micrometre, so that one correction is enough.
    slope = dr.dot(normal, straight.velocity)
    missing = dr.dot(normal, triangle.a - straight.point)
    correction = dr.select(on_part & (slope != 0), missing / slope, 0)
    time = time + dr.clip(correction, -1e-3, 1e-3)
    stepped = nystrom_step(end.point, end.velocity, acceleration, time)

    middle = end.point + end.velocity * (time / 2)
    gained = dr.select(inside, cell.gradient_error(middle, ahead) * time, 0)
    position_error = end.position_error + (end.velocity_error + gained / 2) * time
    heading = dr.normalize(stepped.velocity)
    cosine = dr.dot(normal, heading)
    # Along the part's surface, which the estimated ray meets elsewhere.
    along = dr.select(on_part, dr.dot(normal, position_error) / cosine, 0)
    position_error = position_error - heading * along
    of_steps = end.step_velocity_error + stepped.velocity_error / 2
    of_steps = end.step_position_error + dr.abs(time) * of_steps
    error = dr.norm(position_error) + of_steps / dr.maximum(dr.abs(cosine), 1e-6)
    final_speed = dr.norm(stepped.velocity)
    entered = end.entry_index != 0
    hits = CurvedHits(
        point=stepped.point,
        direction=heading,
        path_length=end.path_length + time * (speed + final_speed) / 2,
        outcome=end.outcome,
        face=end.face,
        crossings=end.crossings,
        entry_index=end.entry_index,
        index_sum=dr.select(entered, final_speed - end.entry_index, 0),
        error=dr.select(on_part & dr.isfinite(error), error, 0),
        opened=end.opened,
        relocations=end.relocations,
    )
    return settled(tables, hits)
