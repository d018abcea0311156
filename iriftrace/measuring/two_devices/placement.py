"""Units and motions with which a measured cloud would lie on the part, where it does not."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.mesh.transform import apply
from iriftrace.core.units import length_factor
from iriftrace.measuring.two_devices.larger import sample_of
from iriftrace.part.part import Part

SAMPLE = 500
"""Number of the cloud's points that are tried."""

LARGEST_MM, MOST = 1.0, 75
"""Largest distance from the part of most points (per cent) of a cloud that lies on it."""

LEAST_SIZE = 0.1
"""Least size of the cloud over that of the part; all points in one place may lie on any part."""

UNITS = ("mm", "m", "cm", "inch", "um")


def remedy(points: FloatArray, unit: str, motion: FloatArray | None, part: Part) -> str:
    """What puts a cloud on the part, in words; "" if it lies there or nothing.

    `points` (n, 3), mm, were read in `unit`; the (4, 4) `motion` moves them to the part.
    """
    least = LEAST_SIZE * np.linalg.norm(np.ptp(part.bounds, axis=0))
    found = {
        change: np.percentile(part.surface.distance(moved), MOST)
        for change, moved in _placed(sample_of(points, SAMPLE), unit, motion)
        if np.linalg.norm(np.ptp(moved, axis=0)) > least
    }
    if found.get("", np.inf) <= LARGEST_MM:
        return ""
    best = min(found, key=lambda change: found[change], default="")
    return best if best and found[best] <= LARGEST_MM else ""


def _placed(
    points: FloatArray, unit: str, motion: FloatArray | None
) -> Iterator[tuple[str, FloatArray]]:
    """Places of the points, as given first, and the change that leads to each."""
    motions = {"": motion}
    if motion is not None:
        metres = motion.copy()
        metres[:3, 3] *= 1e3
        motions |= {
            "the inverse of `cloud_to_part`": np.asarray(np.linalg.inv(motion), dtype=np.float64),
            "the translation of `cloud_to_part` in m (write it in mm)": metres,
            "no `cloud_to_part`": None,
        }
    for change, matrix in motions.items():
        for other in sorted(UNITS, key=lambda name: name != unit):
            scaled = points * (length_factor(other) / length_factor(unit))
            by_unit = "" if other == unit else f"`length_unit` {other}"
            moved = scaled if matrix is None else apply(matrix, scaled)
            yield " and ".join(filter(None, (by_unit, change))), moved
