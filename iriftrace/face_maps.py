"""How well a whole sweep sees each face of the part: maps added up pose by pose."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from iriftrace.face_sightings import COUNTS, FaceSightings
from iriftrace.part import Part


def face_maps(sightings: Iterable[FaceSightings], part: Part) -> dict[str, Any]:
    """Add up what the poses of a sweep see; only one pose is in memory at a time.

    Parameters
    ----------
    sightings : iterable of FaceSightings
        Of n poses, in their order.
    part : Part
        With m faces.

    Returns
    -------
    dict
        Variables for the sweep's dataset: ``sightings`` over ``pose`` and, over ``face``, area,
        region, times seen, mean displacement and smallest angle of incidence. The latter two are
        NaN for a face that was never seen.
    """
    count = len(part.faces)
    rows_of_pose = []
    times_seen = np.zeros(count, dtype=np.int32)
    rays = np.zeros(count, dtype=np.int64)
    moved = np.zeros(count)
    incidence = np.full(count, np.nan, dtype=np.float32)
    for found in sightings:
        face = found.face
        rows_of_pose.append(len(found))
        times_seen[face] += 1
        rays[face] += found.rays
        moved[face] += found.rays * found.displacement.astype(np.float64)
        incidence[face] = np.fmin(incidence[face], found.incidence)
    displacement = np.full(count, np.nan, dtype=np.float32)
    seen = rays > 0
    displacement[seen] = moved[seen] / rays[seen]
    region = (part.region_of_face + 1).astype(np.int16)
    of_face = {
        "face_area": (part.face_areas, "mm2", "area"),
        "face_region": (region, "1", "number of the face's region in the coordinate region"),
        "face_times_seen": (times_seen, "1", "poses that see the face"),
        "face_displacement": (displacement, "mm", "mean displacement of all rays of all poses"),
        "face_incidence": (incidence, "degree", "smallest angle of incidence in any pose"),
    }
    rows = np.array(rows_of_pose, dtype=np.int64)
    text = "faces that the pose sees: rows of the variables over sighting"
    return {
        COUNTS: (
            ("pose",),
            rows,
            {"units": "1", "long_name": text, "sample_dimension": "sighting"},
        ),
        **{
            name: (("face",), values, {"units": unit, "long_name": text})
            for name, (values, unit, text) in of_face.items()
        },
    }
