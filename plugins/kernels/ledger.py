"""The ledger of a ray's index steps, which add up to the layer in which it hit the part.

On shells that are closed, or end on the part or at the data's edge, the sum of the steps is
conserved: index at the hit less index of the air in which the ray started. A ray that slipped
between two triangles breaks the sum.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.march import RefractedHits
from iriftrace.plugins.kernels.prepared import PreparedScene
from iriftrace.plugins.kernels.queries import HIT_PART
from iriftrace.plugins.kernels.vertex_table import aligned

LINES = 9
"""Lines by which the layer at a hit is counted where one along the normal speaks against it."""


def index_check(prepared: PreparedScene, refracted: RefractedHits) -> tuple[dt.Bool, dt.Bool]:
    """Masks of rays whose index steps lead to the layer at the hit, and start from ambient.

    The steps of a ray and the index before the first of them give the layer in which it
    ended. It must be one of those that touch the part there. Where a shell is missing, the steps
    of a ray that passed it do not add up, nor do those of the lines by which layers are counted.
    """
    tables = prepared.tables
    if tables.stock_shells:
        # Mitsuba's dielectric knows ratios only, so its steps have no common scale.
        return mi.Bool(True), mi.Bool(True)
    # Made in the first pose; later on it would split this kernel, which is another one then.
    wall_index = prepared.usual_wall_index
    hit = refracted.outcome == HIT_PART
    face = refracted.face - tables.part_first_face
    ambient, slack, open_step, open_steps = (
        dr.opaque(mi.Float64, value)
        for value in (tables.ambient, tables.half_step, tables.open_step, tables.open_steps)
    )
    entry = dr.select(refracted.entry_index != 0, refracted.entry_index, ambient)
    layer = entry + refracted.index_sum
    usual = dr.gather(mi.Float64, wall_index, face, hit)
    missing = dr.abs(entry - ambient)
    fits = dr.abs(layer - usual) < slack
    # A ray without a crossing does not tell in which air it runs, unless that at the wall is cold.
    silent = hit & (refracted.entry_index == 0) & (dr.abs(usual - ambient) > slack)
    dr.eval(layer, missing, fits, silent)
    suspects = dr.compress(hit & (~fits | silent))
    if dr.width(suspects) > 0:
        points, normals, found, quiet = _records(prepared, refracted, layer, silent, suspects)
        right = ~quiet
        right[right] = _touches(prepared, points[right], normals[right], found[right], 1)[0]
        rest = np.flatnonzero(~right)
        right[rest], near = _touches(prepared, points[rest], normals[rest], found[rest], LINES)
        # Its whole path was in the air at the wall then, so it came in through an open end.
        unmet = quiet[rest] & ~right[rest]
        right[rest[unmet]] = True
        dr.scatter(fits, mi.Bool(aligned(right)), suspects)
        if unmet.any():
            steps = mi.Float64(aligned(np.abs(near[unmet] - tables.ambient)))
            number = mi.UInt32(aligned(rest[unmet].astype(np.uint32)))
            dr.scatter(missing, steps, dr.gather(mi.UInt32, suspects, number))
    for before, behind in tables.missing_steps:
        # The contrast includes layers next to those that a ray crossed.
        least = abs(behind - tables.ambient) + 2 * tables.open_step - tables.half_step
        middle = abs(0.5 * (before + behind) - tables.ambient)
        passed = refracted.contrast > dr.opaque(mi.Float, least)
        fits &= ~(passed & (missing < dr.opaque(mi.Float64, middle)))
    return fits & (missing < open_steps + slack), missing < open_step


def _touches(
    prepared: PreparedScene, points: FloatArray, normals: FloatArray, layer: FloatArray, lines: int
) -> tuple[Any, FloatArray]:  # NumPy's stubs take a mask for one truth value
    """Mask of layers that touch the part at points, and the layers before it, by so many lines."""
    if len(points) == 0:
        return np.zeros(0, dtype=bool), np.zeros(0)
    near = prepared.layers_near(points, normals, lines=lines)
    return (np.abs(layer - near) < prepared.tables.half_step).any(axis=0), near[0]


def _records(
    prepared: PreparedScene,
    refracted: RefractedHits,
    layer: dt.Float64,
    silent: dt.Bool,
    rays: dt.UInt32,
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Points (n, 3), normals (n, 3), layers and `silent` of some rays.

    The normals point to where the ray came from: an open part may be seen from its back.
    """
    _, normal = prepared.tables.plane(dr.gather(mi.UInt32, refracted.face, rays), mi.Bool(True))
    ahead = mi.Vector3d(*(dr.gather(mi.Float64, axis, rays) for axis in refracted.direction))
    normal = dr.select(dr.dot(ahead, normal) > 0, -normal, normal)
    of_rays = (dr.gather(mi.Float64, values, rays) for values in (*refracted.point, layer))
    quiet = dr.select(dr.gather(mi.Bool, silent, rays), mi.Float64(1), 0)
    columns = (*normal, quiet, *of_rays)
    dr.eval(columns)
    rows = np.array([np.array(column) for column in columns])
    return rows[4:7].T, rows[:3].T, rows[7], rows[3] != 0
