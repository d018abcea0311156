"""Hits near an edge, moved to the face that is really met.

Within a float32 spacing of an edge, the ray query may name the neighbour of the face that the ray
meets. The hit then lies on the neighbour's plane a little beyond the edge, and is wrong by as much
as the two planes differ there; and two equal rays may get different faces.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from iriftrace.core.arrays import FloatArray, IntArray, NumberArray
from iriftrace.core.mesh.topology import find_neighbours, weld
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.snell import Triangle

ROUNDS = 3
"""Edges that a hit may be moved across, one after the other, as near a corner of many faces."""

NONE = 0xFFFFFFFF


def edge_neighbours(vertices: FloatArray, faces: IntArray) -> NumberArray:
    """Face beyond each edge of each face, (m, 3) array; ``NONE`` where there is no single one.

    Edge i runs from corner i to the next. Vertices at the same place count as one.
    """
    found = find_neighbours(weld(vertices)[faces])
    table = np.full(faces.shape, NONE, dtype=np.uint32)
    for one, other in ((0, 1), (1, 0)):
        table[found.pairs[:, one], found.edges[:, one]] = found.pairs[:, other]
    return table


def settle(
    tables: Any,  # SceneTables, which needs this module
    origin: dt.Point3d,
    direction: dt.Vector3d,
    face: dt.UInt32,
    distance: dt.Float64,
    active: dt.Bool,
) -> tuple[dt.UInt32, dt.Float64]:
    """Face and distance of a hit on the part, moved across the edges that it lies beyond.

    Of rays (Point3d, mm; Vector3d), the row of the part's face in the tables (UInt32) that the
    query gave, and the distance to its plane (Float64, mm).
    """
    triangle, normal = tables.plane(face, active)
    in_front = dr.dot(direction, normal) < 0
    room, edge = _room(origin + direction * distance, triangle, normal)
    for _ in range(ROUNDS):
        outside = active & (room < 0)
        other = tables.neighbour(face, edge, outside)
        exists = outside & (other != NONE)
        triangle, normal = tables.plane(other, exists)
        cosine = dr.dot(direction, normal)
        # A neighbour seen from its other side is behind the edge: the ray just misses it.
        exists &= (cosine != 0) & ((cosine < 0) == in_front)
        there = dr.dot(triangle.a - origin, normal) / dr.select(exists, cosine, 1)
        there_room, there_edge = _room(origin + direction * there, triangle, normal)
        better = exists & (there_room > room)
        face = dr.select(better, other, face)
        distance = dr.select(better, there, distance)
        room = dr.select(better, there_room, mi.Float64(0))
        edge = dr.select(better, there_edge, edge)
    return face, distance


def _room(
    point: dt.Point3d, triangle: Triangle, normal: dt.Vector3d
) -> tuple[dt.Float64, dt.UInt32]:
    """Distance to the nearest edge's line, negative outside the triangle, and that edge."""
    corners = (triangle.a, triangle.b, triangle.c, triangle.a)
    least, edge = mi.Float64(dr.inf), mi.UInt32(0)
    for number, (start, end) in enumerate(pairwise(corners)):
        inward = dr.normalize(dr.cross(normal, end - start))
        gap = dr.dot(point - start, inward)
        edge = dr.select(gap < least, number, edge)
        least = dr.minimum(gap, least)
    return least, edge
