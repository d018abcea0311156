"""A bundle of rays from start to verdict: straight and refracted hits joined and judged."""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

from iriftrace.status import Status

from .aligned import aligned
from .prepared import PreparedScene
from .tracing import (
    GAVE_UP,
    HIT_BLOCKER,
    HIT_PART,
    RefractedHits,
    refracted_hits,
    straight_hits,
)

WITNESSES = 9
"""Lines by which the layer at a hit is counted where a ray did not end in the usual one."""


class Trace(NamedTuple):
    """What became of a bundle of rays; one entry per traced ray (see :func:`trace_bundle`)."""

    ray: Any  # UInt32: number of the ray in the bundle
    origin: Any  # Point3d
    direction: Any  # Vector3d
    straight: Any  # Point3d
    straight_length: Any  # Float64
    straight_outcome: Any  # UInt32
    straight_face: Any  # UInt32: face of the part
    incidence: Any  # Float64, rad
    refracted: RefractedHits
    status: Any  # UInt32
    open_boundary: Any  # Bool


class Bundle(NamedTuple):
    """A trace and what was found of the rays that were not refracted."""

    trace: Trace | None  # None if no ray was to be traced on
    status: Any  # UInt32, every ray of the bundle: its status if it was not traced on
    time_s: dict[str, float]


def trace_bundle(
    prepared: PreparedScene,
    rays: Any,
    count: int,
    *,
    focus: tuple[float, float],
    coherent: bool,
    trace_all: bool,
    gradient_normals: bool,
    max_crossings: int,
) -> Bundle:
    """Trace a bundle of rays.

    Parameters
    ----------
    prepared : PreparedScene
    rays : callable
        From ray numbers (UInt32) to origins (Point3d, mm) and unit directions (Vector3d).
    count : int
        Number of rays.
    focus : (2,) float, mm
        Nearest and farthest length of a straight ray that counts as sharp.
    coherent : bool
        Neighbouring rays run alike.
    trace_all : bool
        Refract every ray, not only those whose straight twin hits the part.
    gradient_normals, max_crossings
        See :func:`iriftrace.plugins.tracing.refracted_hits`.
    """
    import drjit as dr
    import mitsuba as mi

    tables = prepared.tables
    started = time.perf_counter()
    straight = straight_hits(
        prepared.opaque,
        tables,
        *rays(dr.arange(mi.UInt32, count)),
        coherent=coherent,
        step=prepared.step,
    )
    dr.eval(*straight)
    dr.sync_thread()
    straight_done = time.perf_counter()

    hit = straight.outcome == HIT_PART
    untraced = dr.select(
        straight.outcome == HIT_BLOCKER, mi.UInt32(int(Status.BLOCKED)), int(Status.MISSED)
    )
    chosen = dr.arange(mi.UInt32, count) if trace_all else dr.compress(hit)
    if dr.width(chosen) == 0:
        return Bundle(None, untraced, {"straight": straight_done - started, "refracted": 0.0})
    origin, direction = rays(chosen)
    refracted = refracted_hits(
        prepared.scene,
        prepared.opaque,
        tables,
        origin,
        direction,
        coherent=coherent,
        gradient_normals=gradient_normals,
        max_crossings=max_crossings,
        step=prepared.step,
    )
    dr.eval(*refracted)
    dr.sync_thread()
    refracted_done = time.perf_counter()

    trace = _judged(prepared, chosen, origin, direction, straight, refracted, focus)
    return Bundle(
        trace,
        untraced,
        {
            "straight": straight_done - started,
            "refracted": refracted_done - straight_done,
        },
    )


def _judged(
    prepared: PreparedScene,
    chosen: Any,
    origin: Any,
    direction: Any,
    straight: Any,
    refracted: RefractedHits,
    focus: tuple[float, float],
) -> Trace:
    """Join both rays' hits and judge them."""
    import drjit as dr
    import mitsuba as mi

    tables = prepared.tables
    length = dr.gather(mi.Float64, straight.distance, chosen)
    outcome = dr.gather(mi.UInt32, straight.outcome, chosen)
    face = dr.gather(mi.UInt32, straight.face, chosen)
    on_part = outcome == HIT_PART
    _, normal = tables.plane(face, on_part)
    # The arc cosine alone loses digits near normal incidence.
    sine = dr.norm(dr.cross(direction, normal))
    incidence = dr.atan2(sine, dr.abs(dr.dot(direction, normal)))

    bent_hit = refracted.outcome == HIT_PART
    consistent, from_outside = _index_check(prepared, refracted)

    near, far = (dr.opaque(mi.Float64, limit) for limit in focus)
    status = mi.UInt32(int(Status.GOOD))
    for code, applies in (
        (Status.INDEX_MISMATCH, ~consistent),
        (Status.ONLY_REFRACTED, ~on_part & bent_hit),
        (Status.REFRACTED_MISSED, on_part & ~bent_hit),
        (Status.GAVE_UP, refracted.outcome == GAVE_UP),
        (
            Status.BLOCKED,
            (outcome == HIT_BLOCKER) | (refracted.outcome == HIT_BLOCKER),
        ),
        (Status.OUT_OF_FOCUS, on_part & ((length < near) | (length > far))),
        (Status.MISSED, (outcome + refracted.outcome) == 0),
    ):
        status = dr.select(applies, mi.UInt32(int(code)), status)
    return Trace(
        ray=chosen,
        origin=origin,
        direction=direction,
        straight=dr.select(on_part, origin + direction * length, 0),
        straight_length=length,
        straight_outcome=outcome,
        straight_face=face - tables.part_first_face,
        incidence=dr.select(on_part, incidence, 0),
        refracted=refracted,
        status=status,
        open_boundary=~from_outside & (status == int(Status.GOOD)),
    )


def _index_check(prepared: PreparedScene, refracted: RefractedHits) -> tuple[Any, Any]:
    """Whether a ray's index steps lead to the layer at its hit, and start from ambient.

    The steps of a ray and the index before the first of them give the layer in which it
    ended. It must be one of those that touch the part there.
    """
    import drjit as dr
    import mitsuba as mi

    tables = prepared.tables
    if tables.stock_shells:
        # Mitsuba's dielectric knows ratios only, so its steps have no common scale.
        return mi.Bool(True), mi.Bool(True)
    hit = refracted.outcome == HIT_PART
    face = refracted.face - tables.part_first_face
    ambient, slack, open_steps = (
        dr.opaque(mi.Float64, value)
        for value in (tables.ambient, tables.half_step, tables.open_steps)
    )
    entry = dr.select(refracted.entry_index != 0, refracted.entry_index, ambient)
    layer = entry + refracted.index_sum
    usual = dr.gather(mi.Float64, prepared.usual_wall_index, face, hit)
    missing = dr.abs(entry - ambient)
    fits = dr.abs(layer - usual) < slack
    # A ray without a crossing does not tell in which air it runs, unless that at the wall is cold.
    silent = hit & (refracted.entry_index == 0) & (dr.abs(usual - ambient) > slack)
    dr.eval(layer, missing, fits, silent)
    doubtful = dr.compress(hit & (~fits | silent))
    if dr.width(doubtful) > 0:
        number = np.array(doubtful)
        near = prepared.layers_near(*_hits(prepared, refracted, number), lines=WITNESSES)
        right = (np.abs(np.array(layer)[number] - near) < tables.half_step).any(axis=0)
        # It has come all its way in the air before the wall then, through an open end.
        astray = np.array(silent)[number] & ~right
        steps, exact = np.array(missing), np.array(fits)
        steps[number[astray]] = np.abs(near[0, astray] - tables.ambient)
        exact[number] = right | astray
        missing, fits = mi.Float64(aligned(steps)), mi.Bool(aligned(exact))
    return fits & (missing < open_steps + slack), missing < slack


def _hits(prepared: PreparedScene, refracted: RefractedHits, number: Any) -> tuple[Any, Any]:
    """Points (n, 3) and outward normals (n, 3) of some of the refracted hits."""
    vertices, faces = prepared.tables.part_arrays()
    face = np.array(refracted.face)[number] - prepared.tables.part_first_face
    a, b, c = np.moveaxis(vertices[faces[face]], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # Axis by axis: Dr.Jit compiles a kernel for every length when it interleaves them.
    return np.stack([np.array(axis)[number] for axis in refracted.point], axis=1), normals
