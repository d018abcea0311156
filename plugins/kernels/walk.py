"""Rays traced through a medium, piece by piece, between opaque shapes.

A ray is in one of three modes. Outside the data it runs straight to the data's boundary. Inside, it
passes one piece of the medium after the other, with one step of order 4 in each. Where it is inside
but its piece is not known (the camera is inside the data, or rounding moved it into the wrong piece
at a corner), the boundary is found straight ahead, and the pieces are followed back from there.

Opaque shapes are found by ray queries in single precision, straight ahead. The answer is
valid until the ray has come as far, or is some roundings off that line.
"""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.nystrom import nystrom_step
from iriftrace.plugins.kernels.prepared import PreparedScene
from iriftrace.plugins.kernels.queries import (
    ESCAPED,
    GAVE_UP,
    HIT_PART,
    RELATIVE_STEP,
    SAME_CROSSING_STEPS,
    advanced,
    query_error,
    ray_query,
    zeros,
)
from iriftrace.plugins.kernels.tetrahedra import CellPassage, Entrance

OUTSIDE, INSIDE, SEEKING = range(3)

OVERLAP_STEPS = 8
"""Steps by which each query of the part reaches back, so that no ray slips between two of them, and
by which a ray may leave the line of the last one."""

MOST_RELOCATIONS = 20
"""A ray whose piece had to be sought more often gives up. Through meshes with folds and slits those
that arrive need 5 at most; others go round in circles."""


class WalkState(NamedTuple):
    """Where rays are, and what is known of the path so far and ahead."""

    point: dt.Point3d
    velocity: dt.Vector3d
    path_length: dt.Float64
    outcome: dt.UInt32
    shape: dt.UInt32  # number of the shape that was hit
    primitive: dt.UInt32  # and of its triangle
    crossings: dt.UInt32
    entry_index: dt.Float64
    position_error: dt.Vector3f  # mm: estimate of what the gradient's error does to the point
    velocity_error: dt.Vector3f  # and to the velocity
    step_position_error: dt.Float  # mm: the same of the steps, without a direction
    step_velocity_error: dt.Float
    opened: dt.Bool
    relocations: dt.UInt32
    contrast: dt.Float
    place: dt.UInt32
    mode: dt.UInt32
    ahead: dt.Float64  # outside: from where to query; seeking: how far the place is ahead
    free: dt.Float64  # mm: straight path ahead that is known to be free of opaque shapes
    deflection: dt.Float  # rad: change of the direction since that query
    lateral_offset: dt.Float  # mm: lateral offset from that straight path
    retreat: dt.Float64  # mm: how far it has gone back, through cells turned inside out
    last: dt.Float64  # mm: length of the last piece, as single precision has it
    count: dt.UInt32
    active: dt.Bool


class _Piece(NamedTuple):
    """The next piece of a ray's path unless an opaque shape ends it; masks of rays are Bool."""

    speed: dt.Float64  # the index
    heading: dt.Vector3d
    outside: dt.Bool
    inside: dt.Bool
    seeking: dt.Bool
    entrance: Entrance  # of the data's boundary, ahead
    cell: dt.Cell  # the piece of the medium
    place: dt.UInt32
    passage: CellPassage  # of a ray through the cell
    length: dt.Float64  # mm: of the piece; infinite where it has no end
    gap: dt.Float64  # mm: up to where the ray comes in
    back: dt.Float64  # mm: remaining path back to a seeking ray
    enters: dt.Bool
    leaves: dt.Bool
    again: dt.Bool  # it met the boundary face that it has just come through
    astray: dt.Bool  # it came to a boundary from inside without knowing its piece
    lost: dt.Bool
    walks: dt.Bool
    arrives: dt.Bool
    steps_back: dt.Bool
    came_in: dt.Bool  # the path back met the boundary: there the ray came in, unnoticed


class _Sight(NamedTuple):
    """Opaque shapes ahead."""

    ended: dt.Bool  # one stands in this piece
    hit: dt.PreliminaryIntersection3f
    rough: dt.Float64  # mm: distance to it, in single precision
    free: dt.Float64  # of `WalkState`, from the piece's beginning
    deflection: dt.Float  # likewise
    lateral_offset: dt.Float


class _Move(NamedTuple):
    """A piece of the path that was passed."""

    passes: dt.Bool  # through a cell, by the ray equation
    enters: dt.Bool
    came_in: dt.Bool
    starts: dt.Bool  # it is in the data for the first time
    leaves_data: dt.Bool
    point: dt.Point3d
    velocity: dt.Vector3d
    gain: dt.Vector3d  # of velocity
    refractivity: dt.Float64  # at the point
    time: dt.Float64  # mm: length over index
    skipped: dt.Float64  # mm: straight on where it leaves the data after it had gone back
    retreat: dt.Float64
    length: dt.Float64  # mm
    gradient_error: dt.Vector3f  # what the gradient's error does to the velocity
    step_error: dt.Float  # and the step's


class Walk:
    """Rays in a medium between opaque shapes."""

    def __init__(
        self,
        prepared: PreparedScene,
        medium: dt.Medium,
        coherent: bool,
        most: int,
        reverse_passes: int | None,
    ) -> None:
        self.reverse_passes = reverse_passes
        self.opaque, self.tables = prepared.opaque, prepared.tables
        self.medium, self.coherent = medium, coherent
        self.smallest_step = dr.opaque(mi.Float64, prepared.step)
        self.limit = dr.opaque(mi.UInt32, most)
        self.boundary = medium.boundary_beside(self.opaque)
        self.ambient = dr.opaque(mi.Float64, medium.ambient)
        self.open_step = dr.opaque(mi.Float64, medium.open_step)

    def to_the_end(self, origin: dt.Point3d, direction: dt.Vector3d) -> WalkState:
        """Advance rays, (Point3d, mm) and (Vector3d), until all have ended."""
        return advanced(self._start(origin, direction), self._advance, "curve", self.reverse_passes)

    def _start(self, origin: dt.Point3d, direction: dt.Vector3d) -> WalkState:
        width = dr.width(origin, direction)
        zero = zeros(
            width,
            Float64="path_length entry_index free retreat last",
            Vector3f="position_error velocity_error",
            Float="step_position_error step_velocity_error contrast deflection lateral_offset",
            UInt32="shape primitive crossings relocations place count",
            Bool="opened",
        )
        return WalkState(
            point=mi.Point3d(origin),
            velocity=mi.Vector3d(direction),
            outcome=dr.full(mi.UInt32, ESCAPED, width),
            mode=dr.full(mi.UInt32, OUTSIDE, width),
            ahead=self._step_at(mi.Point3d(origin)),
            active=dr.full(mi.Bool, True, width),
            **zero,
        )

    def _step_at(self, point: dt.Point3d) -> dt.Float64:
        return dr.maximum(RELATIVE_STEP * dr.max(dr.abs(point)), self.smallest_step / 50)

    def _advance(self, s: WalkState) -> WalkState:
        piece = self._piece(s)
        sight = self._sight(s, piece)
        move = self._move(s, piece, sight)
        s = self._with_errors(self._with_mode(s, piece, sight, move), piece, move)
        return self._with_outcome(s, piece, sight, move)

    def _piece(self, s: WalkState) -> _Piece:
        """Find the next piece: up to the data, through a cell, or back to one."""
        speed = dr.norm(s.velocity)
        heading = s.velocity / speed
        modes = (OUTSIDE, INSIDE, SEEKING)
        outside, inside, seeking = (s.active & (s.mode == mode) for mode in modes)

        ahead_point = s.point + heading * s.ahead
        hit = ray_query(self.boundary, ahead_point, heading, self.coherent, outside)
        entrance = self.medium.entrance(hit, outside)
        place = dr.select(outside, entrance.place, s.place)
        cell = self.medium.cell(place, (outside & entrance.found) | inside | seeking)
        to_face = dr.select(outside, entrance.distance + s.ahead, 0)
        # A cell sees what is near, but rays that are outside or lost need not be near.
        at_cell = s.point + heading * dr.select(seeking, s.ahead, to_face)
        remaining, entering = cell.entry_distance(at_cell, dr.select(seeking, -heading, heading))
        gap = to_face + remaining
        enters = outside & entrance.found & entering
        leaves = outside & entrance.found & ~entering
        again = leaves & (gap < SAME_CROSSING_STEPS * self.smallest_step)

        passage = cell.passage(at_cell, dr.select(seeking, -heading, heading))
        arrives = seeking & (passage.distance >= s.ahead)
        steps_back = seeking & ~arrives & ~passage.lost
        back = s.ahead - passage.distance
        came_in = steps_back & passage.ends
        length = dr.select(inside, passage.distance, dr.select(enters, gap, dr.inf))
        return _Piece(
            speed=speed,
            heading=heading,
            outside=outside,
            inside=inside,
            seeking=seeking,
            entrance=entrance,
            cell=cell,
            place=place,
            passage=passage,
            length=dr.select(came_in, back, length),
            gap=gap,
            back=back,
            enters=enters,
            leaves=leaves,
            again=again,
            astray=leaves & ~again,
            lost=inside & passage.lost,
            walks=inside & ~passage.lost,
            arrives=arrives,
            steps_back=steps_back,
            came_in=came_in,
        )

    def _sight(self, s: WalkState, piece: _Piece) -> _Sight:
        """Ask for opaque shapes, where the last answer does not hold any more.

        It holds while the ray stays within some roundings of that line (0.2 um in a scene that
        reaches 165 mm). With more of them grazing rays miss an edge.
        """
        overlap = OVERLAP_STEPS * RELATIVE_STEP * dr.max(dr.abs(s.point))
        lateral_offset = s.lateral_offset + s.deflection * mi.Float(piece.length)
        reach = piece.length + overlap + query_error(s.point, self.smallest_step)
        known = (s.free > reach) & (lateral_offset < mi.Float(OVERLAP_STEPS * self.smallest_step))
        looks = piece.came_in | (piece.outside & ~piece.leaves)
        looks |= piece.walks & (piece.length > 0) & ~known
        start = s.point - piece.heading * overlap
        hit = ray_query(self.opaque, start, piece.heading, self.coherent, looks)
        seen = looks & hit.is_valid()
        rough = mi.Float64(hit.t) - overlap
        return _Sight(
            ended=seen & (rough <= piece.length),
            hit=hit,
            rough=rough,
            free=dr.select(looks, dr.select(seen, rough, dr.inf), s.free),
            deflection=dr.select(looks, 0, s.deflection),
            lateral_offset=dr.select(looks, 0, s.lateral_offset),
        )

    def _move(self, s: WalkState, piece: _Piece, sight: _Sight) -> _Move:
        """Pass the piece: through a cell by a step of order 4, straight to or back to the data."""
        cell, heading = piece.cell, piece.heading
        passes = piece.walks & ~sight.ended
        enters, came_in = piece.enters & ~sight.ended, piece.came_in & ~sight.ended
        time = dr.select(passes, piece.length / piece.speed, 0)
        stepped = nystrom_step(
            s.point, s.velocity, lambda point: cell.acceleration(point, heading), time
        )
        error: dt.Vector3f = mi.Vector3f(cell.gradient_error(stepped.middle, heading))
        straight = dr.select(enters, piece.gap, dr.select(came_in, piece.back, 0))
        # Where the data's boundary is folded, a ray that goes back out of them would meet the same
        # fold for ever: it goes straight on from where it turned back.
        leaves_data = passes & piece.passage.ends
        length = dr.select(passes, piece.length, straight)
        retreat = dr.maximum(s.retreat - length, 0)
        skipped = dr.select(leaves_data, retreat, 0)
        point = mi.Point3d(dr.select(passes, stepped.point, s.point + heading * straight))
        point = mi.Point3d(point + heading * skipped)
        refractivity = cell.refractivity(point)
        starts = (s.entry_index == 0) & (enters | piece.arrives | came_in)
        velocity = dr.select(passes, stepped.velocity, s.velocity)
        return _Move(
            passes=passes,
            enters=enters,
            came_in=came_in,
            starts=starts,
            leaves_data=leaves_data,
            point=point,
            velocity=dr.select(starts | enters, heading * (1 + refractivity), velocity),
            gain=velocity - s.velocity,
            refractivity=refractivity,
            time=dr.select(passes, time, straight / piece.speed),
            skipped=skipped,
            retreat=retreat - skipped,
            length=length,
            gradient_error=dr.select(passes, error * mi.Float(time), 0),
            step_error=dr.select(passes, dr.norm(mi.Vector3f(stepped.velocity_error)), 0),
        )

    def _with_mode(self, s: WalkState, piece: _Piece, sight: _Sight, move: _Move) -> WalkState:
        """Where the ray is now, and what is known of the path ahead."""
        inside = move.enters | piece.arrives | move.came_in
        mode = dr.select(inside, mi.UInt32(INSIDE), s.mode)
        outside = move.leaves_data | piece.lost | (piece.seeking & piece.passage.lost)
        mode = dr.select(outside, mi.UInt32(OUTSIDE), mode)
        mode = dr.select(piece.astray, mi.UInt32(SEEKING), mode)
        place = dr.select(move.passes | piece.steps_back, piece.passage.place, piece.place)
        here = self.medium.unentered(piece.place)
        place = dr.select(piece.arrives | move.came_in, here, place)
        ahead = dr.select(piece.again, 4 * s.ahead, self._step_at(move.point))
        ahead = dr.select(piece.astray, piece.gap, ahead)
        deflection = sight.deflection + dr.norm(mi.Vector3f(move.gain))
        gone_aside = dr.select(move.passes, deflection * mi.Float(piece.length), 0)
        return s._replace(
            mode=mode,
            place=dr.select(sight.ended, s.place, place),
            ahead=dr.select(piece.steps_back, piece.back, ahead),
            free=sight.free - (move.length + move.skipped),
            deflection=deflection,
            lateral_offset=sight.lateral_offset + gone_aside,
            retreat=move.retreat,
        )

    def _with_errors(self, s: WalkState, piece: _Piece, move: _Move) -> WalkState:
        """Add up the path length and the estimates of its errors."""
        time, gained = mi.Float(move.time), move.gradient_error
        along = dr.select(move.passes, dr.dot(move.gain, piece.heading) / 2, 0)
        of_steps = s.step_velocity_error + move.step_error / 2
        return s._replace(
            point=move.point,
            velocity=move.velocity,
            path_length=s.path_length + move.skipped + move.time * (piece.speed + along),
            position_error=s.position_error + (s.velocity_error + gained / 2) * time,
            velocity_error=s.velocity_error + gained,
            step_position_error=s.step_position_error + dr.abs(time) * of_steps,
            step_velocity_error=s.step_velocity_error + move.step_error,
        )

    def _with_outcome(self, s: WalkState, piece: _Piece, sight: _Sight, move: _Move) -> WalkState:
        """Count, and end the rays that hit, escape or give up."""
        ended, contrast = sight.ended, move.refractivity - self.ambient
        at_wall = (move.enters & piece.entrance.wall) | (move.leaves_data & piece.passage.wall)
        opened = (move.enters | move.came_in | move.leaves_data) & ~at_wall
        # Where a ray starts does not count.
        sought = piece.lost | (piece.astray & (s.entry_index != 0))
        relocations = s.relocations + dr.select(sought, mi.UInt32(1), 0)
        gave_up = (s.count + 1 >= self.limit) | (relocations > MOST_RELOCATIONS)
        gave_up &= s.active & ~ended
        escaped = piece.outside & ~piece.entrance.found & ~ended
        # Whether it is the part, `_ended` looks up.
        outcome = dr.select(ended, mi.UInt32(HIT_PART), s.outcome)
        met = dr.select(move.passes | move.enters, dr.abs(mi.Float(contrast)), 0)
        return s._replace(
            outcome=dr.select(gave_up, mi.UInt32(GAVE_UP), outcome),
            shape=dr.select(ended, self.tables.shape_number(sight.hit, ended), s.shape),
            primitive=dr.select(ended, sight.hit.prim_index, s.primitive),
            crossings=s.crossings + dr.select(move.passes, mi.UInt32(1), 0),
            entry_index=dr.select(move.starts, 1 + move.refractivity, s.entry_index),
            opened=s.opened | (opened & (dr.abs(contrast) > self.open_step)),
            relocations=relocations,
            contrast=dr.maximum(s.contrast, met),
            last=dr.select(ended, sight.rough, s.last),
            count=s.count + 1,
            active=s.active & ~ended & ~gave_up & ~escaped,
        )
