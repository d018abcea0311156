"""Acceptance test of an optical 3-D system by VDI/VDE 2634 part 2, simulated in hot air.

Reference artefacts are the part's regions: spheres and planes. Their calibrated sizes are those of
surfaces through the part's corners. The errors of the cold points come from the tessellation alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from attrs import frozen

from iriftrace.core.errors import InputError
from iriftrace.measuring.features.feature import Feature
from iriftrace.measuring.features.fit import fit_feature
from iriftrace.measuring.features.fitted import FittedFeature
from iriftrace.part.part import Part

CLOUDS = ("cold", "measured")
"""Clouds of a simulated measurement that are tested, both of the part as hot as it is."""


@frozen
class AcceptanceError:
    """One error of the test."""

    error: str  # its name
    region: str | None  # or two of them, "a to b"; None for all points
    error_mm: dict[str, float]  # by cloud: ``cold``, ``measured``


def acceptance(features: Sequence[FittedFeature], part: Part) -> tuple[AcceptanceError, ...]:
    """Errors of fitted spheres and planes that VDI/VDE 2634 part 2 tests.

    - probing error of form: range of the distances from the fitted sphere;
    - probing error of size: diameter of the fitted sphere less the calibrated one;
    - sphere-spacing error: distance of two spheres' centres less the calibrated one;
    - flatness error: range of the distances from the fitted plane.

    Features that are neither sphere nor plane, and spheres of all points, are left out.
    """
    spheres = [
        (each, _calibrated(part, each.region))
        for each in features
        if each.kind == "sphere" and each.region is not None
    ]
    errors = []
    for sphere, true in spheres:
        size = {name: _diameter(sphere.fits[name]) - _diameter(true) for name in CLOUDS}
        errors.append(AcceptanceError("probing error of form", sphere.region, _form(sphere)))
        errors.append(AcceptanceError("probing error of size", sphere.region, size))
    for (one, true), (other, other_true) in combinations(spheres, 2):
        calibrated = _spacing(true, other_true)
        spacing = {name: _spacing(one.fits[name], other.fits[name]) - calibrated for name in CLOUDS}
        names = f"{one.region} to {other.region}"
        errors.append(AcceptanceError("sphere-spacing error", names, spacing))
    planes = (each for each in features if each.kind == "plane")
    errors += [AcceptanceError("flatness error", each.region, _form(each)) for each in planes]
    if not errors:
        raise InputError(
            "No region of the part that was measured is a sphere or a plane, so there is nothing "
            "to test; take a part of `iriftrace part sphere`, `ball-bar` or `plate`.",
            code="part.no_artefact",
        )
    return tuple(errors)


def _calibrated(part: Part, region: str) -> Feature:
    """The sphere through a region's corners."""
    faces = part.faces[part.region_of_face == part.region_names.index(region)]
    return fit_feature(part.vertices[np.unique(faces)], "sphere")


def _form(feature: FittedFeature) -> dict[str, float]:
    return {name: feature.form_mm[name] for name in CLOUDS}


def _diameter(sphere: Feature) -> float:
    if sphere.size_mm is None:
        raise AssertionError("a sphere has a diameter")
    return sphere.size_mm


def _spacing(one: Feature, other: Feature) -> float:
    return float(np.linalg.norm(other.position - one.position))
