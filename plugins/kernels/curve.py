"""The ray equation d/ds (n dr/ds) = grad n, integrated from the camera to the part.

With time dt = ds / n it is r'' = n grad n (Sharma, Kumar and Ghatak, Applied Optics 21 (1982) 984),
which a step of Nystrom's method of order 4 advances
(:func:`iriftrace.plugins.kernels.nystrom.nystrom_step`).

The path is that of :mod:`iriftrace.plugins.kernels.walk`, which says on which triangle a ray ends;
where it ends is then computed here in double precision.
"""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from iriftrace.plugins.kernels.nystrom import nystrom_step
from iriftrace.plugins.kernels.prepared import PreparedScene
from iriftrace.plugins.kernels.queries import HIT_BLOCKER, HIT_PART, query_error, settled
from iriftrace.plugins.kernels.snell import distance_to_plane
from iriftrace.plugins.kernels.tables import SceneTables
from iriftrace.plugins.kernels.types import Bool, Float, Float64, Medium, Point3d, UInt32, Vector3d
from iriftrace.plugins.kernels.vertex_table import PART
from iriftrace.plugins.kernels.walk import INSIDE, Walk, WalkState


class CurvedHits(NamedTuple):
    """Ends of rays along curved paths, and what they met along the path."""

    point: Point3d  # mm, world
    direction: Vector3d  # at the end
    path_length: Float64  # mm: geometric
    outcome: UInt32  # ESCAPED, HIT_PART, HIT_BLOCKER or GAVE_UP
    face: UInt32  # row of the part's face in the tables
    crossings: UInt32  # pieces of the medium that were passed
    entry_index: Float64  # index where the ray came into the data; 0 if it did not
    index_sum: Float64  # index at the end less that
    error: Float64  # mm: estimated error of the hit
    opened: Bool  # it came or went through a boundary where the index is not the ambient one
    relocations: UInt32  # times its piece had to be sought
    contrast: Float  # most by which n differs from the ambient air's


def curved_hits(
    prepared: PreparedScene,
    medium: Medium,
    origin: Point3d,
    direction: Vector3d,
    *,
    coherent: bool,
    max_steps: int,
    reverse_passes: int | None = None,
) -> CurvedHits:
    """Ends of rays that follow the ray equation through a medium to a scene's opaque shapes.

    A medium is TetrahedralAir, or anything else with its methods. Rays have origins (Point3d, mm)
    and unit directions (Vector3d), world; those with more than `max_steps`, or that get lost more
    than `MOST_RELOCATIONS` times, give up. `coherent` is a hint to the ray query; `reverse_passes`
    is that of :func:`iriftrace.plugins.kernels.queries.advanced`.
    """
    walk = Walk(prepared, medium, coherent, max_steps, reverse_passes)
    end = walk.to_the_end(origin, direction)
    return _ended(prepared.tables, medium, end, query_error(end.point, walk.smallest_step))


def _ended(tables: SceneTables, medium: Medium, end: WalkState, tolerance: Float64) -> CurvedHits:
    """Take the last piece of each ray, up to what it hit.

    ``tolerance`` is that of :func:`iriftrace.plugins.kernels.snell.distance_to_plane`.
    """
    hit = end.outcome == HIT_PART
    on_part = hit & (tables.kind(end.shape, hit) == PART)
    face = dr.select(on_part, tables.face(end.shape, end.primitive, on_part), 0)
    triangle, normal = tables.plane(face, on_part)
    inside = hit & (end.mode == INSIDE)
    cell = medium.cell(end.place, inside)
    ahead = dr.normalize(end.velocity)

    def acceleration(point: Point3d) -> Vector3d:
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
    on_their_faces: CurvedHits = settled(tables, hits)
    return on_their_faces
