"""Counting index steps along straight lines: in which layer does a point lie?"""

from __future__ import annotations

from typing import Any, NamedTuple

from .geometry import SHELL, SceneTables
from .ray_query import ray_query, same_crossing

MOST_STEPS = 30_000
"""Crossings of a straight line after which it is not followed any farther."""


def crossed_steps(
    scene: Any, tables: SceneTables, origin: Any, direction: Any, step: float
) -> tuple[Any, Any]:
    """Index steps along straight lines to infinity, opaque shapes being transparent.

    Returns
    -------
    start_index : Float64
        Index of the layer at the start: what remains outside less the steps on the way there;
        0 for a line without crossing, or with too many (``MOST_STEPS``) to be believed.
    enclosed : Bool
        The first shell on the way is crossed from inside.
    """
    import drjit as dr
    import mitsuba as mi

    smallest_step = dr.opaque(mi.Float64, step)

    class State(NamedTuple):
        travelled: Any
        gap: Any  # since the last crossing
        index_sum: Any
        last_index: Any
        enclosed: Any
        shape: Any
        outward: Any
        count: Any
        active: Any

    def advance(*values: Any) -> tuple[Any, ...]:
        s = State(*values)
        start = origin + direction * s.travelled
        preliminary = ray_query(scene, start, direction, False, s.active)
        found = s.active & preliminary.is_valid()
        shape = tables.shape_number(preliminary, found)
        on_shell = found & (tables.kind(shape, found) == SHELL)
        face = tables.face(shape, preliminary.prim_index, on_shell)
        _, normal = tables.plane(face, on_shell)
        outside, inside = tables.sides(shape, on_shell)
        outward = dr.dot(direction, normal) > 0
        move = dr.select(found, mi.Float64(preliminary.t) + smallest_step, 0)
        gap = s.gap + move
        crossed = on_shell & ~same_crossing(shape, outward, s.shape, s.outward, gap, smallest_step)
        near, far = dr.select(outward, inside, outside), dr.select(outward, outside, inside)
        first = crossed & (s.last_index == 0)
        return (
            s.travelled + move,
            dr.select(crossed, 0, gap),
            s.index_sum + dr.select(crossed, far - near, 0),
            dr.select(crossed, far, s.last_index),
            (first & outward) | (s.enclosed & ~first),
            dr.select(crossed, shape, s.shape),
            dr.select(crossed, outward, s.outward),
            s.count + 1,
            found & (s.count < MOST_STEPS),
        )

    width = dr.width(origin, direction)
    state = (
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.Float64, width),
        dr.zeros(mi.Float64, width),
        dr.full(mi.Bool, False, width),
        dr.full(mi.UInt32, 0xFFFFFFFF, width),
        dr.full(mi.Bool, False, width),
        dr.zeros(mi.UInt32, width),
        dr.full(mi.Bool, True, width),
    )
    end = State(
        *dr.while_loop(
            state, lambda *s: s[-1], advance, labels=State._fields, compress=False, label="count"
        )
    )
    known = end.count <= MOST_STEPS
    return dr.select(known, end.last_index - end.index_sum, 0), end.enclosed & known
