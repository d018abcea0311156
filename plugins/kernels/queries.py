"""Queries of a scene for the next triangle.

Mitsuba's ray query (single precision) only says *which triangle* comes next. The point on that
triangle's plane is computed in double precision.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import drjit as dr
import mitsuba as mi

from iriftrace.core.errors import InputError
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.edges import settle
from iriftrace.plugins.kernels.tables import SceneTables

ESCAPED, HIT_PART, HIT_BLOCKER, GAVE_UP = range(4)

S = TypeVar("S", bound=tuple[dt.Struct, ...])
"""State of rays, a NamedTuple whose last fields are the passes of each ray and the mask of active
ones."""

SAME_CROSSING_STEPS = 20
"""Within this many steps, a second crossing of one shell in one direction is the same crossing."""

LEAST_COMPONENT = 1e-9
"""Least component of a queried direction; it turns a ray by far less than single precision does."""

QUERY_ERROR_STEPS = 40
"""Steps by which a single precision query can be wrong across the ray, generously."""

RELATIVE_STEP = 1.5e-7
"""Step beyond a crossing, as a fraction of the largest coordinate there.

Hardly more than a float32 spacing, because sliver cells fold a shell over by as little as 1e-4 mm,
and a fold that is stepped over leaves index steps that do not add up (6 of 266,000 rays with a step
eight times as long, none with this one).
"""


def zeros(width: int, **names: str) -> dict[str, dt.Array]:
    """Zeros for fields of a state by the names of their types: ``Float64="length time"``."""
    return {
        name: dr.zeros(getattr(mi, kind), width)
        for kind, listed in names.items()
        for name in listed.split()
    }


def advanced(
    start: S, advance: Callable[[S], S], label: str, reverse_passes: int | None = None
) -> S:
    """Advance rays until none is active.

    With `reverse_passes`, ``dr.backward`` can go back through that many passes of the loop. It
    would silently leave out further ones, so an InputError is raised if a ray took more and the
    rays depend on a parameter whose gradient is requested.
    """
    kind, types = type(start), [type(value) for value in start]
    # Dr.Jit 1.5 cannot store masks for `dr.backward`: its LLVM code mixes i8 and i1.
    stored = [mi.UInt32 if each is mi.Bool and reverse_passes else each for each in types]

    def cast(to: list[Any], state: dt.Struct) -> tuple[dt.Struct, ...]:
        return tuple(each(value) for each, value in zip(to, state, strict=True))

    end = dr.while_loop(
        cast(stored, start),
        lambda *s: mi.Bool(s[-1]),
        lambda *s: cast(stored, advance(kind(*cast(types, s)))),
        labels=start._fields,  # type: ignore[attr-defined]
        compress=False,
        label=label,
        max_iterations=reverse_passes,
    )
    state = kind(*cast(types, end))
    if reverse_passes and dr.grad_enabled(end):
        _check_passes(state[-2], reverse_passes)
    return state


def _check_passes(count: dt.UInt32, reverse_passes: int) -> None:
    """Refuse rays with more passes than a derivative in reverse mode can go back through."""
    most: dt.UInt32 = dr.max(count)
    if int(most[0]) > reverse_passes:
        raise InputError(
            f"A ray takes {int(most[0]):,} passes of the tracing loop, but reverse_passes of the "
            f"integrator is {reverse_passes:,}, and dr.backward would leave out the others; set "
            f"reverse_passes to at least {int(most[0]):,}.",
            code="derivative.passes",
        )


def counted(mask: dt.Bool) -> int:
    """Number of rays in a mask."""
    count: dt.UInt32 = dr.count(mask)
    return int(count[0])


def query_step(scene: mi.Scene) -> float:
    """Step along the ray that keeps a query from finding the triangle it starts on, mm."""
    box = scene.bbox()
    largest: float = max(abs(x) for corner in (box.min, box.max) for x in corner)
    return RELATIVE_STEP * largest


def query_error(origin: dt.Point3d, smallest_step: dt.Float64) -> dt.Float64:
    """Largest error of a query from a point across the ray, mm; more from far away."""
    spacing = RELATIVE_STEP * dr.max(dr.abs(origin))
    return QUERY_ERROR_STEPS * dr.maximum(spacing, smallest_step)


def same_crossing(
    shape: dt.UInt32,
    outward: dt.Bool,
    last_shape: dt.UInt32,
    last_outward: dt.Bool,
    gap: dt.Float64,
    smallest_step: dt.Float64,
) -> dt.Bool:
    """True where a crossing is the last one met again.

    A shell cannot be crossed twice in a row in one direction. When it seems so, the query has found
    its own start, or the neighbour of a triangle whose plane was met just beyond the edge.
    """
    repeated = (shape == last_shape) & (outward == last_outward)
    return repeated & (gap < SAME_CROSSING_STEPS * smallest_step)


def ray_query(
    scene: dt.Scene, origin: dt.Point3d, direction: dt.Vector3d, coherent: bool, active: dt.Bool
) -> dt.PreliminaryIntersection3f:
    """First triangle along rays, in single precision (PreliminaryIntersection3f)."""
    # Embree's traversal of coherent packets loses rays, a whole packet at a time, when one of them
    # runs exactly along a plane of two axes (as the central column's do in a picture of odd width).
    queried = mi.Vector3f(
        *(dr.select(dr.abs(x) < LEAST_COMPONENT, LEAST_COMPONENT, x) for x in direction)
    )
    ray = mi.Ray3f(mi.Point3f(origin), queried)
    return scene.ray_intersect_preliminary(ray, coherent=coherent, active=active)


def settled(tables: SceneTables, hits: dt.Hits) -> dt.Hits:
    """Hits (RefractedHits or CurvedHits) near an edge on the face that is really met."""
    on_part = hits.outcome == HIT_PART
    face, ahead = settle(tables, hits.point, hits.direction, hits.face, mi.Float64(0), on_part)
    ahead = dr.select(on_part, ahead, 0)
    return hits._replace(
        point=hits.point + hits.direction * ahead, path_length=hits.path_length + ahead, face=face
    )
