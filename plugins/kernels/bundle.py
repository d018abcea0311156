"""A bundle of rays from start to verdict: straight and refracted hits joined and judged."""

from __future__ import annotations

import time
from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from iriftrace.image.aov_image import Status
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.edges import settle
from iriftrace.plugins.kernels.prepared import PreparedScene
from iriftrace.plugins.kernels.queries import (
    ESCAPED,
    GAVE_UP,
    HIT_BLOCKER,
    HIT_PART,
    query_error,
    ray_query,
)
from iriftrace.plugins.kernels.snell import distance_to_plane
from iriftrace.plugins.kernels.vertex_table import PART

ROUNDING = 1e-9
"""Change of a unit direction that is none."""


class StraightHits(NamedTuple):
    """First hits of unbent rays on opaque shapes."""

    distance: dt.Float64  # mm
    outcome: dt.UInt32  # ESCAPED, HIT_PART or HIT_BLOCKER
    face: dt.UInt32  # row of the part's face in the tables


class Trace(NamedTuple):
    """Hits and status of a bundle; one entry per traced ray (see :func:`trace_bundle`)."""

    ray: dt.UInt32  # number of the ray in the bundle
    origin: dt.Point3d
    direction: dt.Vector3d
    straight: dt.Point3d  # mm, world; 0 where there is no hit on the part
    straight_outcome: dt.UInt32
    straight_face: dt.UInt32  # face of the part
    incidence: dt.Float64  # rad
    refracted: dt.Hits
    status: dt.UInt32
    open_boundary: dt.Bool

    @property
    def displacement(self) -> dt.Vector3d:
        """Refracted minus straight hit (Vector3d, mm, world); 0 where one does not exist."""
        both = (self.straight_outcome == HIT_PART) & (self.refracted.outcome == HIT_PART)
        moved: dt.Vector3d = dr.select(both, self.refracted.point - self.straight, 0)
        return moved

    def shift_px(self, camera: dt.RayCamera) -> tuple[dt.Float64, dt.Float64]:
        """Shift of the refracted hit's image (Float64, px), right and down; 0 where there is none.

        A point of the straight ray at the depth of the refracted hit appears at the pixel's centre;
        projecting it too cancels what rounding the projection has.
        """
        point = self.refracted.point
        along = dr.dot(point - self.origin, self.direction)
        x_unbent, y_unbent, _ = camera.project64(self.origin + self.direction * along)
        x, y, in_front = camera.project64(point)
        visible = in_front & (self.refracted.outcome == HIT_PART)
        return dr.select(visible, x_unbent - x, 0), dr.select(visible, y_unbent - y, 0)


class Bundle(NamedTuple):
    """A trace and what was found of the rays that were not refracted."""

    trace: Trace | None  # None if no ray was to be traced on
    status: dt.UInt32  # every ray of the bundle: its status if it was not traced on
    time_s: dict[str, float]
    straight: StraightHits  # every ray of the bundle; faces are those of the part, from 0


def trace_bundle(
    prepared: PreparedScene,
    rays: dt.Rays,
    count: int,
    *,
    bend: dt.Bend,
    check: dt.Check,
    focus: tuple[float, float],
    coherent: bool,
    trace_all: bool,
    straight: StraightHits | None = None,
) -> Bundle:
    """Trace a bundle of `count` rays.

    `rays` gives origins (Point3d, mm) and unit directions (Vector3d) of ray numbers (UInt32),
    `bend` of these where the bent rays end (RefractedHits or CurvedHits), and `check` of these two
    masks (Bool): the index along the ray adds up; the ray came from ambient air through no boundary
    of the data that is open.

    `focus` is the nearest and farthest length of a straight ray, mm, that counts as sharp.
    Hits are attached to the parameters whose gradients are requested; statuses are constants.
    Neighbouring rays that run alike are `coherent`. Only rays whose straight twin hits the part are
    bent, unless `trace_all`. `straight` are hits of the same bundle in another scene with the same
    opaque shapes, such as the same part in other air; then straight rays are not traced again.
    """
    started = time.perf_counter()
    if straight is None:
        straight = paired_straight_rays(prepared, rays, count, coherent)
    straight_done = time.perf_counter()

    hit = straight.outcome == HIT_PART
    untraced = dr.select(
        straight.outcome == HIT_BLOCKER, mi.UInt32(int(Status.BLOCKED)), int(Status.MISSED)
    )
    chosen = dr.arange(mi.UInt32, count) if trace_all else dr.compress(hit)
    time_s = {"straight": straight_done - started, "refracted": 0.0}
    if dr.width(chosen) == 0:
        return Bundle(None, untraced, time_s, straight)
    origin, direction = rays(chosen)
    _begin_block()
    refracted = bend(origin, direction)
    dr.eval(*refracted)
    dr.sync_thread()
    time_s["refracted"] = time.perf_counter() - straight_done
    trace = _judged(prepared, chosen, origin, direction, straight, refracted, check, focus)
    return Bundle(trace, untraced, time_s, straight)


def _begin_block() -> None:
    """Keep expressions apart that follow from those before.

    Tables that the first pose makes in between keep them apart, too. Without this, the next pose
    would share constants with what comes before, and its kernels would be compiled again.
    """
    dr.detail.new_scope(dr.backend_v(mi.Float64))


def rays_of(origin: dt.Point3d, direction: dt.Vector3d) -> dt.Rays:
    """Rays by their numbers, from origins and directions, one each or the same for all."""
    count = dr.width(origin, direction)
    starts, headings = (
        [axis + dr.zeros(mi.Float64, count) for axis in vector] for vector in (origin, direction)
    )
    return lambda ray: (
        mi.Point3d(*(dr.gather(mi.Float64, axis, ray) for axis in starts)),
        mi.Vector3d(*(dr.gather(mi.Float64, axis, ray) for axis in headings)),
    )


def paired_straight_rays(
    prepared: PreparedScene, rays: dt.Rays, count: int, coherent: bool
) -> StraightHits:
    """Straight hits of a bundle of rays, with faces of the part from 0; see `trace_bundle`."""
    hits = straight_hits(prepared, *rays(dr.arange(mi.UInt32, count)), coherent)
    # In some scenes shells come before the part in the tables, and not as many in each.
    if prepared.tables.part_first_face:
        hits = hits._replace(face=hits.face - dr.opaque(mi.UInt32, prepared.tables.part_first_face))
    dr.eval(*hits)
    dr.sync_thread()
    return hits


def straight_hits(
    prepared: PreparedScene, origin: dt.Point3d, direction: dt.Vector3d, coherent: bool
) -> StraightHits:
    """First hits of straight rays on the opaque shapes of a scene.

    Rays have origins (Point3d, mm) and unit directions (Vector3d), world. `coherent` says that
    neighbouring rays run alike, as a camera's do, a hint to the ray query.
    """
    tables = prepared.tables
    preliminary = ray_query(prepared.opaque, origin, direction, coherent, mi.Bool(True))
    found = preliminary.is_valid()
    shape = tables.shape_number(preliminary, found)
    on_part = found & (tables.kind(shape, found) == PART)
    face = tables.face(shape, preliminary.prim_index, on_part)
    triangle, normal = tables.plane(face, on_part)
    rough = mi.Float64(preliminary.t)
    tolerance = query_error(origin, dr.opaque(mi.Float64, prepared.step))
    exact = distance_to_plane(origin, direction, triangle, normal, rough, tolerance)
    face, exact = settle(tables, origin, direction, face, exact, on_part)
    outcome = dr.select(on_part, mi.UInt32(HIT_PART), dr.select(found, HIT_BLOCKER, ESCAPED))
    return StraightHits(
        distance=dr.select(on_part, exact, rough), outcome=outcome, face=dr.select(on_part, face, 0)
    )


def _judged(
    prepared: PreparedScene,
    chosen: dt.UInt32,
    origin: dt.Point3d,
    direction: dt.Vector3d,
    straight: StraightHits,
    refracted: dt.Hits,
    check: dt.Check,
    focus: tuple[float, float],
) -> Trace:
    """Join both rays' hits and judge them."""
    tables = prepared.tables
    length = dr.gather(mi.Float64, straight.distance, chosen)
    outcome = dr.gather(mi.UInt32, straight.outcome, chosen)
    face = dr.gather(mi.UInt32, straight.face, chosen)
    on_part = outcome == HIT_PART
    _, normal = tables.plane(face + dr.opaque(mi.UInt32, tables.part_first_face), on_part)
    # The arc cosine alone loses digits near normal incidence.
    sine = dr.norm(dr.cross(direction, normal))
    incidence = dr.atan2(sine, dr.abs(dr.dot(direction, normal)))

    bent_hit = refracted.outcome == HIT_PART
    frozen = refracted._replace(**dr.detach(refracted._asdict()))
    _begin_block()
    consistent, from_outside = check(frozen)
    too_bent = _bent_too_much(dr.detach(direction), frozen)
    distance = dr.detach(length)

    near, far = (dr.opaque(mi.Float64, limit) for limit in focus)
    status = mi.UInt32(int(Status.GOOD))
    for code, applies in (
        (Status.INDEX_MISMATCH, ~consistent),
        (Status.ONLY_REFRACTED, ~on_part & bent_hit),
        (Status.REFRACTED_MISSED, on_part & ~bent_hit),
        (Status.INDEX_MISMATCH, too_bent),
        (Status.GAVE_UP, refracted.outcome == GAVE_UP),
        (Status.BLOCKED, (outcome == HIT_BLOCKER) | (refracted.outcome == HIT_BLOCKER)),
        (Status.OUT_OF_FOCUS, on_part & ((distance < near) | (distance > far))),
        (Status.MISSED, ~too_bent & ((outcome + refracted.outcome) == 0)),
    ):
        status = dr.select(applies, mi.UInt32(int(code)), status)
    return Trace(
        ray=chosen,
        origin=origin,
        direction=direction,
        straight=dr.select(on_part, origin + direction * length, 0),
        straight_outcome=outcome,
        straight_face=face,
        incidence=dr.select(on_part, incidence, 0),
        refracted=refracted,
        status=status,
        open_boundary=~from_outside & (status == int(Status.GOOD)),
    )


def is_lost(direction: dt.Vector3d, refracted: dt.Hits) -> dt.Bool:
    """Mask of rays (Bool) that gave up or are bent too much, from their first directions."""
    return (refracted.outcome == GAVE_UP) | _bent_too_much(direction, refracted)


def _bent_too_much(direction: dt.Vector3d, refracted: dt.Hits) -> dt.Bool:
    """Mask of rays (Bool) that are deflected more than the index range along them can give.

    Through layers, n times the sine of the angle to their gradient is conserved: a ray that enters
    a contrast dn, turns and leaves is deflected by 2 arccos(1 - dn / n) at most, some 40 mrad at a
    part of 1100 degC. Real air gives a tenth of that; a wrong gradient knows no such bound.
    """
    contrast = mi.Float64(refracted.contrast)
    # Sine of half the angle.
    most = dr.sqrt(contrast * dr.maximum(2 - contrast, 0))
    return dr.norm(refracted.direction - direction) > 2 * most + ROUNDING
