"""Table of the measured points and their errors by region of a part."""

from __future__ import annotations

import numpy as np

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.plain import JsonObject
from iriftrace.core.statistics import spread
from iriftrace.part.part import Part


def region_table(part: Part, face: IntArray, along_normal: FloatArray) -> list[JsonObject]:
    """Rows for all regions of a part, in its order, of values (n,), mm, on its faces (n,).

    ``region``, number of ``points``, ``measured``: area of the faces with a point as a fraction of
    the region's, ``along_normal_mm``: `spread` of the values, and ``size_p95_mm``: 95th
    percentile of their sizes; both None without a point.
    """
    hit = np.zeros(len(part.faces))
    hit[face] = part.face_areas[face]
    count = len(part.region_names)
    areas = np.bincount(part.region_of_face, hit, minlength=count)
    region = part.region_of_face[face]
    rows = []
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
