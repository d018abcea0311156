"""Table of the measured points and their errors by region of a part."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.statistics import spread
from iriftrace.part.part import Part


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
