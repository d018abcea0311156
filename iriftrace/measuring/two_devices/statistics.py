"""Outcomes of points, errors of members along normals, and values by region of a part."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.plain import JsonObject
from iriftrace.core.statistics import spread
from iriftrace.measuring.features.quantity import WorstMember
from iriftrace.part.part import Part


class PointStatus(IntEnum):
    """Outcome of a point, which scans and corrections define."""

    @property
    def key(self) -> str:
        """Name in JSON."""
        return self.name.lower()

    @classmethod
    def counts(cls, status: NDArray[np.int64]) -> dict[str, int]:
        """How many points have each status, by key."""
        return {one.key: int((status == one).sum()) for one in cls}


def each_along(errors: FloatArray, normal: FloatArray) -> FloatArray:
    """Components (k, n), mm, of (k, n, 3) errors of k members along (n, 3) normals."""
    along: FloatArray = np.einsum("kij,ij->ki", errors, normal)
    return along


def worst_member(
    values: FloatArray, true: float, weights: MemberWeights, provenance: JsonObject
) -> WorstMember:
    """The member in the mean whose value of the (k,) is farthest from the true one."""
    worst = int(np.argmax(np.abs(values - true) * (weights.weights > 0.0)))
    number = provenance["ensemble"]["members"][worst]["number"]
    return WorstMember(number, float(values[worst]))


@frozen
class RegionValues:
    """Measured points of a region and their values along the normal; no values without a point."""

    region: str
    points: int
    # Area of the faces with a point as a fraction of the region's; None for one line of a laser.
    measured: float | None
    along_normal_mm: dict[str, float] | None  # `spread` of the values
    size_p95_mm: float | None  # 95th percentile of their sizes


def region_values(
    part: Part, face: IntArray, along_normal: FloatArray, *, one_line: bool = False
) -> tuple[RegionValues, ...]:
    """Values (n,), mm, of points on the faces (n,) of a part by its regions, in their order."""
    hit = np.zeros(len(part.faces))
    hit[face] = part.face_areas[face]
    areas = np.bincount(part.region_of_face, hit, minlength=len(part.region_names))
    region = part.region_of_face[face]
    found = []
    for number, name in enumerate(part.region_names):
        values = along_normal[region == number]
        measured = None if one_line else float(areas[number] / part.region_areas[number])
        statistics = spread(values) if len(values) else None
        p95 = float(np.percentile(np.abs(values), 95)) if len(values) else None
        found.append(RegionValues(name, len(values), measured, statistics, p95))
    return tuple(found)
