"""Outcomes of points, errors of members along normals, and values by region of a part."""

from __future__ import annotations

from enum import IntEnum
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.plain import JsonObject
from iriftrace.core.statistics import spread
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


def worst_member(values: list[float], true: float, key: str, provenance: JsonObject) -> JsonObject:
    """Number of the member whose value is farthest from the true one, and that value.

    As ``worst_member`` and ``worst_`` and the key of the values, such as ``size_mm``.
    """
    worst = int(np.argmax(np.abs(np.array(values) - true)))
    number = provenance["ensemble"]["members"][worst]["number"]
    return {"worst_member": number, f"worst_{key}": values[worst]}


class RegionRow(TypedDict):
    """Measured points of a region and their values along the normal; no values without a point."""

    region: str
    points: int
    measured: float  # area of the faces with a point as a fraction of the region's
    along_normal_mm: dict[str, float] | None  # `spread` of the values
    size_p95_mm: float | None  # 95th percentile of their sizes


def region_table(part: Part, face: IntArray, along_normal: FloatArray) -> list[RegionRow]:
    """Rows for all regions of a part, in its order, of values (n,), mm, on its faces (n,)."""
    hit = np.zeros(len(part.faces))
    hit[face] = part.face_areas[face]
    count = len(part.region_names)
    areas = np.bincount(part.region_of_face, hit, minlength=count)
    region = part.region_of_face[face]
    rows: list[RegionRow] = []
    for number, name in enumerate(part.region_names):
        values = along_normal[region == number]
        rows.append(
            {
                "region": name,
                "points": len(values),
                "measured": float(areas[number] / part.region_areas[number]),
                "along_normal_mm": spread(values) if len(values) else None,
                "size_p95_mm": float(np.percentile(np.abs(values), 95)) if len(values) else None,
            }
        )
    return rows
