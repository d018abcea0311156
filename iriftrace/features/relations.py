"""Distances of parallel planes and angles of square ones: steps, widths and squareness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.plain import JsonObject

NEAR_DEG = 2.0
"""Tolerance within which two planes are parallel or square: forged faces are off by tenths."""

Row = Mapping[str, Any]


def relations(features: Sequence[Row]) -> list[JsonObject]:
    """Distances and angles between the planes among features, rows of `feature_table`.

    For parallel planes ``{"kind": "distance", "regions": [a, b], "size_mm": {cloud: mm},
    "u_size_mm": {cloud: mm}}``: how far the points' centres are apart along the mean of both
    normals. For square ones ``{"kind": "angle", "regions": [a, b], "angle_deg": {cloud: deg},
    "u_angle_deg": {cloud: deg}}``, below or above 90 degrees as their normals point (each with its
    largest component positive). The first cloud decides which planes these are. u is the standard
    uncertainty by the scatter of the points, as in `Feature`. For an ensemble also ``by_member``
    with the distances or angles by each member.
    """
    planes = [row for row in features if row["kind"] == "plane"]
    pairs = (_relation(*pair) for pair in combinations(planes, 2))
    return [row for row in pairs if row is not None]


def value_key(row: Row) -> str:
    """Key of a relation's or feature's values: ``angle_deg`` or ``size_mm``."""
    return "angle_deg" if value_unit(row) == "deg" else "size_mm"


def value_unit(row: Row) -> str:
    """Unit at the end of the keys of a relation's or feature's values."""
    return "deg" if row["kind"] == "angle" else "mm"


def _relation(one: Row, other: Row) -> JsonObject | None:
    """Row of two planes; None where they are neither parallel nor square."""
    clouds = list(one["direction"])
    angle = _angle(one, other, clouds[0])
    if min(angle, 180.0 - angle) < NEAR_DEG:
        kind, key, value, doubt = "distance", "size_mm", _distance, _u_distance
    elif abs(angle - 90.0) < NEAR_DEG:
        kind, key, value, doubt = "angle", "angle_deg", _angle, _u_angle
    else:
        return None
    row: JsonObject = {
        "kind": kind,
        "regions": [one["region"], other["region"]],
        key: {name: value(one, other, name) for name in clouds},
        f"u_{key}": {name: doubt(one, other, name) for name in clouds},
    }
    if "by_member" in one:
        members = one["by_member"], other["by_member"]
        count = len(one["by_member"]["direction"])
        row["by_member"] = {key: [value(*members, number) for number in range(count)]}
    return row


def _normals(one: Row, other: Row, name: str | int) -> tuple[FloatArray, FloatArray]:
    return np.array(one["direction"][name]), np.array(other["direction"][name])


def _angle(one: Row, other: Row, name: str | int) -> float:
    """Angle between the normals, deg, exact for small ones."""
    first, second = _normals(one, other, name)
    across = np.linalg.norm(np.cross(first, second))
    return float(np.degrees(np.arctan2(across, first @ second)))


def _arm(one: Row, other: Row, name: str | int) -> FloatArray:
    return np.asarray(np.subtract(other["position_mm"][name], one["position_mm"][name]))


def _distance(one: Row, other: Row, name: str | int) -> float:
    """Length of the arm between the centres along the mean of two normals, of either sense."""
    first, second = _normals(one, other, name)
    mean = first + np.copysign(1.0, first @ second) * second
    return float(abs(_arm(one, other, name) @ mean) / np.linalg.norm(mean))


def _u_distance(one: Row, other: Row, name: str) -> float:
    """By the heights of both centres, and by the tilt of the mean normal over the arm."""
    arm = _arm(one, other, name)
    tilts = np.array([row["normal_covariance"][name] for row in (one, other)])
    heights = [row["u_position_mm"][name] for row in (one, other)]
    return float(np.sqrt(np.square(heights).sum() + arm @ tilts.sum(axis=0) @ arm / 4.0))


def _u_angle(one: Row, other: Row, name: str) -> float:
    """By the tilt of each normal towards the other, deg."""
    first, second = _normals(one, other, name)
    tilts = (row["normal_covariance"][name] for row in (one, other))
    variance = second @ next(tilts) @ second + first @ next(tilts) @ first
    return float(np.degrees(np.sqrt(variance) / np.linalg.norm(np.cross(first, second))))
