"""Acceptance test of an optical 3-D system by VDI/VDE 2634 part 2, simulated in hot air.

Reference artefacts are the part's regions: spheres and planes. Their calibrated sizes are those of
surfaces through the part's corners. The errors of the cold points come from the tessellation alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TypedDict

import numpy as np

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.features.fit import fit_feature
from iriftrace.part.part import Part


class AcceptanceRow(TypedDict):
    """One error of the test, by cloud: ``cold``, ``measured``."""

    error: str
    region: str
    error_mm: dict[str, float]


def acceptance(features: Sequence[JsonObject], part: Part) -> list[AcceptanceRow]:
    """Errors of fitted spheres and planes that VDI/VDE 2634 part 2 tests.

    - probing error of form: range of the distances from the fitted sphere;
    - probing error of size: diameter of the fitted sphere less the calibrated one;
    - sphere-spacing error: distance of two spheres' centres less the calibrated one;
    - flatness error: range of the distances from the fitted plane.

    Features are rows of `feature_table`; regions that are neither sphere nor plane are left out.
    """
    spheres = [row for row in features if row["kind"] == "sphere" and row["region"]]
    rows = []
    calibrated = {row["region"]: _calibrated(part, row["region"]) for row in spheres}
    for row in spheres:
        _, diameter = calibrated[row["region"]]
        size = {name: value - diameter for name, value in row["size_mm"].items()}
        rows.append(("probing error of form", row["region"], row["form_mm"]))
        rows.append(("probing error of size", row["region"], size))
    for one, other in combinations(spheres, 2):
        names = (one["region"], other["region"])
        (centre, _), (second_centre, _) = (calibrated[name] for name in names)
        true = np.linalg.norm(second_centre - centre)
        spacing = {
            name: float(np.linalg.norm(np.subtract(other["position_mm"][name], place)) - true)
            for name, place in one["position_mm"].items()
        }
        rows.append(("sphere-spacing error", " to ".join(names), spacing))
    planes = (row for row in features if row["kind"] == "plane")
    rows += [("flatness error", row["region"], row["form_mm"]) for row in planes]
    if not rows:
        raise InputError(
            "No region of the part that was measured is a sphere or a plane, so there is nothing "
            "to test; take a part of `iriftrace part sphere`, `ball-bar` or `plate`."
        )
    return [{"error": error, "region": region, "error_mm": mm} for error, region, mm in rows]


def _calibrated(part: Part, region: str) -> tuple[FloatArray, float]:
    """Centre and diameter, mm, of the sphere through a region's corners."""
    faces = part.faces[part.region_of_face == part.region_names.index(region)]
    found = fit_feature(part.vertices[np.unique(faces)], "sphere")
    if found.size_mm is None:
        raise AssertionError("a sphere has a diameter")
    return found.position, found.size_mm
