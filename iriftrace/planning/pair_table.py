"""Pairs of a sweep's poses to first order: error, bias, coverage, angle and score of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, permutations
from typing import TYPE_CHECKING

import numpy as np
from attrs import field, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.triangles import unit_vectors
from iriftrace.image.sightings import FaceSightings, sightings_of
from iriftrace.measuring.features.choice import FeatureChoice, on_region, surface_kind
from iriftrace.measuring.two_devices.devices import Sensor
from iriftrace.measuring.two_devices.first_order import first_order_error, first_order_size
from iriftrace.part.part import Part
from iriftrace.planning.criteria import Criteria, Pairing
from iriftrace.planning.objective import Objective
from iriftrace.sweep.measures import Limits
from iriftrace.sweep.reload import swept_camera
from iriftrace.sweep.store import WHOLE_PART

if TYPE_CHECKING:
    import xarray as xr


@frozen(eq=False)
class PoseView:
    """The faces that one pose sees."""

    scene: str
    camera: Camera
    seen: FaceSightings
    row: IntArray  # of each face in `seen`, -1 if it is not seen

    @property
    def fractions(self) -> FloatArray:
        """(m,) fraction of each face that is seen."""
        return np.where(self.row >= 0, np.append(self.seen.seen, 0.0)[self.row], 0.0)


@frozen(eq=False)
class PairRequest:
    """The part, and by what its pairs are ranked."""

    part: Part
    criteria: Criteria
    pairing: Pairing
    region: str = field(init=False)  # of the feature, else that of the criteria
    inside: BoolArray = field(init=False)  # (m,), mask of the part's faces in the region
    areas: FloatArray = field(init=False)  # (m,), mm2, of the part's faces; 0 outside the region

    @region.default
    def _region(self) -> str:
        if self.pairing.feature is None:
            return self.criteria.region
        return _feature_region(self.pairing.feature, self.criteria, self.part)

    @inside.default
    def _inside(self) -> BoolArray:
        region = None if self.region == WHOLE_PART else self.region
        return on_region(region, np.arange(len(self.part.faces)), self.part)

    @areas.default
    def _areas(self) -> FloatArray:
        return np.where(self.inside, self.part.face_areas, 0.0)

    def quantities(self, values: FloatArray) -> dict[str, FloatArray]:
        """What ranks n pairs, the smaller the better: error, mm, unseen fraction, noise.

        The values are `PairPlan.error_mm`, `bias_mm`, `coverage` and `angle_deg`, (4, n) array.
        """
        size, bias, coverage, angle_deg = values
        return {
            # A diameter that is right because large errors cancel is wrong in other air.
            "error": np.maximum(np.abs(bias), size) if self.pairing.feature else size,
            "unseen": 1.0 - coverage,
            "noise": 1.0 / np.sin(np.radians(angle_deg)),
        }

    def objective(self, limits: Mapping[str, Limits], *, clipped: bool = True) -> Objective:
        """Score of pairs by the limits of their quantities; one whose limits coincide counts 0."""
        weights = self.criteria.weights
        return Objective(
            weights={
                "error": weights["displacement"],
                "unseen": weights["coverage"],
                "noise": weights["axial"] + weights["lateral"],
            },
            limits=limits,
            constant=[name for name, (low, high) in limits.items() if low == high],
            clipped=clipped,
        )


def _feature_region(feature: str, criteria: Criteria, part: Part) -> str:
    """Region of the part for a feature."""
    choice = FeatureChoice.of(feature)
    kind, region = choice.kind, choice.region
    chosen = on_region(region, np.arange(len(part.faces)), part)
    if kind not in ("cylinder", "sphere"):
        raise InputError(
            f"Pairs are ranked by the diameter of a cylinder or sphere, not of {feature!r}; give "
            'for example "cylinder:lateral".',
            code="feature.no_diameter",
            argument="feature",
        )
    if criteria.region not in (WHOLE_PART, region):
        raise InputError(
            f"The feature {feature!r} is not on the region {criteria.region!r}; leave that out.",
            code="feature.other_region",
            argument="region",
        )
    is_a = surface_kind(part.vertices[np.unique(part.faces[chosen])])
    if is_a != kind:
        raise InputError(
            f"{region or 'The whole part'} is {f'a {is_a}' if is_a else 'not a simple surface'} "
            f"and not a {kind}; name a region that is one, such as cylinder:lateral.",
            code="feature.other_kind",
            argument="feature",
        )
    return region or WHOLE_PART


def pair_table(views: Sequence[PoseView], request: PairRequest) -> FloatArray:
    """Rows (n, 6) of the pairs with enough in common: both poses, and four values of each."""
    both = combinations if request.pairing.system == "stereo" else permutations
    rows = []
    for i, j in both(range(len(views)), 2):
        if views[i].scene == views[j].scene:
            found = _pair(views[i], views[j], request)
            if found is not None:
                rows.append((i, j, *found))
    return np.array(rows)


def views_of(dataset: xr.Dataset, faces: int) -> list[PoseView]:
    """The faces of the part that each pose of a sweep sees."""
    scenes = dataset["scene"].values.astype(str)
    views = []
    for pose, matrix in enumerate(dataset["matrix"].values):
        seen = sightings_of(dataset, pose)
        row = np.full(faces, -1, dtype=np.int64)
        row[seen.face] = np.arange(len(seen))
        placed = swept_camera(dataset, pose).at(matrix)
        views.append(PoseView(str(scenes[pose]), placed, seen, row))
    return views


def _pair(
    one: PoseView, other: PoseView, request: PairRequest
) -> tuple[float, float, float, float] | None:
    """`error_mm`, `bias_mm`, `coverage` and `angle_deg`; None if a pair cannot be ranked."""
    part, areas, criteria = request.part, request.areas, request.criteria
    largest, smallest = np.cos(np.radians(request.pairing.angle))
    face = one.seen.face[(other.row[one.seen.face] >= 0) & (areas[one.seen.face] > 0)]
    if len(face) == 0:
        return None
    points = part.face_centres[face]
    a, b = unit_vectors(points - one.camera.origin), unit_vectors(points - other.camera.origin)
    cosine = np.einsum("ij,ij->i", a, b)
    within = (cosine >= smallest) & (cosine <= largest)
    face, points, cosine = face[within], points[within], cosine[within]
    first, second = one.row[face], other.row[face]
    both = np.minimum(one.seen.seen[first], other.seen.seen[second])
    coverage = float(areas[face] @ both / areas.sum())
    # Errors are known on faces that both hit.
    hit = (one.seen.rays[first] > 0) & (other.seen.rays[second] > 0)
    face, points, cosine = face[hit], points[hit], cosine[hit]
    first, second = first[hit], second[hit]
    hits = min(one.seen.rays[first].sum(), other.seen.rays[second].sum())
    if hits < criteria.min_hits or coverage < criteria.min_coverage:
        return None
    sensor = Sensor.of(one.camera, other.camera, request.pairing.system)
    error = first_order_error(sensor, points, one.seen.offset[first], other.seen.offset[second])
    along = np.einsum("ij,ij->i", error, part.face_normals[face])
    # A face has as many measured points as the camera has pixels there.
    rays = one.seen.rays[first].astype(np.float64)
    angle = float(np.degrees(np.arccos(_quantile(cosine, 0.5, rays))))
    bias = (
        first_order_size(points, part.face_normals[face], error, rays)
        if request.pairing.feature
        else _quantile(along, 0.5, rays)
    )
    return statistic_of(along, criteria, rays), bias, coverage, angle


def statistic_of(errors: FloatArray, criteria: Criteria, weights: FloatArray) -> float:
    """The criteria's statistic of the size of some errors, with weights."""
    if criteria.statistic == "mean":
        return float(np.average(np.abs(errors), weights=weights))
    return _quantile(np.abs(errors), 0.5 if criteria.statistic == "median" else 0.95, weights)


def _quantile(values: FloatArray, fraction: float, weights: FloatArray) -> float:
    return float(np.quantile(values, fraction, weights=weights, method="inverted_cdf"))
