"""Distances of parallel planes and angles of square ones: steps, widths and squareness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from iriftrace.core.arrays import FloatArray

NEAR_DEG = 2.0
"""Two planes are parallel or square to this by their fits: forged faces are off by tenths."""


def relations(features: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Distances and angles between the planes among features, rows of `feature_table`.

    Of parallel planes ``{"kind": "distance", "regions": [a, b], "size_mm": {cloud: mm}}``: how far
    the points' centres are apart along the mean of both normals. Of square ones ``{"kind": "angle",
    "regions": [a, b], "angle_deg": {cloud: deg}}``, below or above 90 degrees as their normals
    point (each with its largest component positive). The first cloud tells which planes these are.
    """
    planes = [row for row in features if row["kind"] == "plane"]
    found: list[dict[str, Any]] = []
    for one, other in combinations(planes, 2):
        pairs = {
            name: (np.array(one["direction"][name]), np.array(other["direction"][name]))
            for name in one["direction"]
        }
        angles = {name: _angle_deg(*normals) for name, normals in pairs.items()}
        angle = next(iter(angles.values()))
        regions = [one["region"], other["region"]]
        if min(angle, 180.0 - angle) < NEAR_DEG:
            arms = {
                name: np.subtract(other["position_mm"][name], one["position_mm"][name])
                for name in pairs
            }
            sizes = {name: _along(arms[name], *pairs[name]) for name in pairs}
            found.append({"kind": "distance", "regions": regions, "size_mm": sizes})
        elif abs(angle - 90.0) < NEAR_DEG:
            found.append({"kind": "angle", "regions": regions, "angle_deg": angles})
    return found


def _angle_deg(first: FloatArray, second: FloatArray) -> float:
    """Angle between unit vectors, deg, exact for small ones."""
    across = np.linalg.norm(np.cross(first, second))
    return float(np.degrees(np.arctan2(across, first @ second)))


def _along(arm: FloatArray, first: FloatArray, second: FloatArray) -> float:
    """Length of an arm along the mean of two normals, of either sense."""
    mean = first + np.copysign(1.0, first @ second) * second
    return float(abs(arm @ mean) / np.linalg.norm(mean))
