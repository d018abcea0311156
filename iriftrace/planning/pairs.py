"""Pairs of a sweep's poses for two devices, ranked by what they would measure, without tracing."""

from __future__ import annotations

from itertools import combinations, permutations
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.geometry.triangles import unit_vectors
from iriftrace.image.sightings import FaceSightings, sightings_of
from iriftrace.part.part import Part
from iriftrace.planning.criteria import STANDARD, Criteria
from iriftrace.planning.rank import normalised, ranked_region
from iriftrace.sweep.reload import load_swept_scene, swept_part
from iriftrace.sweep.store import attribute
from iriftrace.triangulation.first_order import first_order_error
from iriftrace.triangulation.scan import System, measure

if TYPE_CHECKING:
    import xarray as xr

ANGLES_DEG = (15.0, 45.0)
"""Angles of triangulation that sensors have: less makes noise large, more hides much."""

CONFIRMED = 3
"""Best pairs that are measured by the exact solver: those among which a user chooses."""


@frozen(eq=False)
class PairPlan:
    """Pairs of poses that see something in common, the best first.

    Attributes
    ----------
    pairs : (n, 2) array of int
        Numbers of the poses of the camera and of the second device.
    score : (n,) array
        Weighted sum of the normalised error, of what is not seen and of 1 / sin(angle), by which
        the noise in depth grows; the smallest is the best.
    error_mm : (n,) array, mm
        The criteria's statistic of the size of the error along the part's normal, weighted by area.
    bias_mm : (n,) array, mm
        Median of that error, with its sign.
    coverage : (n,) array
        Share of the area that both see at an angle in the range, 0..1.
    angle_deg : (n,) array, degree
        Median of the angle between the two lines of sight.
    exact_mm : (k,) array, mm
        As `error_mm`, of all measured points of the best k pairs by :func:`iriftrace.measure`.
    system : str
    """

    pairs: IntArray
    score: FloatArray
    error_mm: FloatArray
    bias_mm: FloatArray
    coverage: FloatArray
    angle_deg: FloatArray
    exact_mm: FloatArray
    system: System


@frozen(eq=False)
class _View:
    """What one pose sees."""

    camera: Camera
    seen: FaceSightings
    row: IntArray  # of each face in `seen`, -1 where it is not seen


def plan_pairs(
    dataset: xr.Dataset,
    criteria: Criteria = STANDARD,
    *,
    system: System = "fringe",
    angles_deg: tuple[float, float] = ANGLES_DEG,
    confirm: bool = True,
) -> PairPlan:
    """Rank the pairs of a sweep's poses as places of two devices.

    Errors are those of :func:`iriftrace.triangulation.first_order.first_order_error` at the centres
    of the faces that both poses see; no ray is traced but to confirm.

    Parameters
    ----------
    dataset : xarray.Dataset
        A sweep with one camera.
    criteria : Criteria
        Weights (those of both resolutions count for the noise in depth), statistic, region,
        percentile, ``min_coverage``, and ``min_hits`` on the faces in common.
    system : str
        ``"fringe"``, ``"stereo"`` or ``"laser"``.
    angles_deg : (2,) tuple, degree
        Smallest and largest angle between two lines of sight at which a face counts as seen.
    confirm : bool
        Measure the best three pairs by the exact solver; needs the scene's files.

    Raises
    ------
    InputError
        The angles are no range, the sweep has no faces, its part or scene has changed, or no pair
        can be ranked.
    SetupError
        Pairs are to be measured and no usable LLVM or CUDA is there.
    """
    low, high = angles_deg
    if not 0.0 < low < high < 180.0:
        raise InputError(
            f"The angles {low:g}:{high:g} are no range of triangulation; give the smaller one "
            "first, such as 15:45."
        )
    number = ranked_region(dataset, ["rays_good"], criteria.region)
    try:
        part = swept_part(dataset)
    except InputError as error:
        raise InputError(f"Pairs cannot be ranked without the part's file: {error}.") from error
    areas = np.array(part.face_areas)
    if number > 0:
        areas[np.asarray(dataset["face_region"].values) != number] = 0.0
    views = _views(dataset, len(areas))
    limits = np.cos(np.radians((high, low)))
    both = combinations if system == "stereo" else permutations
    rows = []
    for i, j in both(range(len(views)), 2):
        found = _pair(views[i], views[j], part, areas, limits, criteria, system)
        if found is not None:
            rows.append((i, j, *found))
    if not rows:
        raise InputError(
            f"No two poses of the sweep see {criteria.min_hits} rays' worth and "
            f"{criteria.min_coverage:.3g} of {criteria.region} in common at {low:g} to {high:g} "
            "degrees; sweep closer poses, or give another --angle."
        )
    table = np.array(rows)
    size, bias, coverage, angle = table[:, 2:].T
    weights = criteria.weights
    noise = 1.0 / np.sin(np.radians(angle))
    score = (
        weights["displacement"] * normalised(size, criteria.percentile)
        + weights["coverage"] * (1.0 - normalised(coverage, criteria.percentile))
        + (weights["axial"] + weights["lateral"]) * normalised(noise, criteria.percentile)
    )
    order = np.argsort(score, kind="stable")
    pairs = table[order, :2].astype(np.int64)
    confirmed = pairs[: CONFIRMED if confirm else 0]
    exact = [_exact(dataset, pair, criteria, system, number) for pair in confirmed]
    return PairPlan(
        pairs=pairs,
        score=score[order],
        error_mm=size[order],
        bias_mm=bias[order],
        coverage=coverage[order],
        angle_deg=angle[order],
        exact_mm=np.array(exact),
        system=system,
    )


def _views(dataset: xr.Dataset, faces: int) -> list[_View]:
    camera = Camera.from_dict(attribute(dataset, "camera"))
    if camera.projection == "orthographic":
        raise InputError(
            "A camera with parallel rays has no place from which to triangulate; sweep with a "
            "focal length."
        )
    views = []
    for pose, matrix in enumerate(dataset["matrix"].values):
        seen = sightings_of(dataset, pose)
        row = np.full(faces, -1, dtype=np.int64)
        row[seen.face] = np.arange(len(seen))
        views.append(_View(camera.at(matrix), seen, row))
    return views


def _pair(
    one: _View,
    other: _View,
    part: Part,
    areas: FloatArray,
    limits: FloatArray,
    criteria: Criteria,
    system: System,
) -> tuple[float, float, float, float] | None:
    """Error and bias, mm, coverage and angle, degree; None where the pair cannot be ranked."""
    face = one.seen.face[(other.row[one.seen.face] >= 0) & (areas[one.seen.face] > 0)]
    if len(face) == 0:
        return None
    points = part.face_centres[face]
    a, b = unit_vectors(points - one.camera.origin), unit_vectors(points - other.camera.origin)
    cosine = np.einsum("ij,ij->i", a, b)
    within = (cosine >= limits[0]) & (cosine <= limits[1])
    face, points, cosine = face[within], points[within], cosine[within]
    first, second = one.row[face], other.row[face]
    hits = min(one.seen.rays[first].sum(), other.seen.rays[second].sum())
    coverage = float(areas[face].sum() / areas.sum())
    if hits < criteria.min_hits or coverage < criteria.min_coverage:
        return None
    error = first_order_error(
        one.camera,
        other.camera,
        points,
        one.seen.offset[first],
        other.seen.offset[second],
        system,
    )
    along = np.einsum("ij,ij->i", error, part.face_normals[face])
    area = areas[face]
    angle = float(np.degrees(np.arccos(_quantile(cosine, 0.5, area))))
    return statistic_of(along, criteria, area), _quantile(along, 0.5, area), coverage, angle


def statistic_of(errors: FloatArray, criteria: Criteria, weights: FloatArray) -> float:
    """The criteria's statistic of the size of some errors, with weights."""
    if criteria.statistic == "mean":
        return float(np.average(np.abs(errors), weights=weights))
    return _quantile(np.abs(errors), 0.5 if criteria.statistic == "median" else 0.95, weights)


def _quantile(values: FloatArray, share: float, weights: FloatArray) -> float:
    return float(np.quantile(values, share, weights=weights, method="inverted_cdf"))


def _exact(
    dataset: xr.Dataset, pair: IntArray, criteria: Criteria, system: System, region: int
) -> float:
    """The statistic of what a pair measures, mm; points in the region alone."""
    try:
        swept = load_swept_scene(dataset, int(pair[0]))
    except InputError as error:
        raise InputError(
            f"The best pairs cannot be measured, because their scene is not there: {error}; leave "
            "that out with --no-confirm."
        ) from error
    matrices = dataset["matrix"].values
    camera, second = (swept.camera.at(matrices[pose]) for pose in pair)
    scan = measure(swept.scene, camera, second, system=system)
    chosen = np.ones(len(scan.face), dtype=bool)
    if region > 0:
        chosen = np.asarray(dataset["face_region"].values)[scan.face] == region
    errors = scan.error_normal[chosen]
    return statistic_of(errors, criteria, np.ones(len(errors)))
