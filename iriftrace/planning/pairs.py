"""Pairs of a sweep's poses for two devices, ranked by predicted errors without tracing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.features.choice import FeatureChoice, on_region, surface_kind
from iriftrace.part.part import Part
from iriftrace.planning.candidates import ranked_region
from iriftrace.planning.criteria import STANDARD, Criteria
from iriftrace.planning.pair_table import PairRequest, PoseView, pair_table, statistic_of, views_of
from iriftrace.planning.rank import limits_of
from iriftrace.sweep.reload import load_swept_scene, swept_part
from iriftrace.sweep.store import WHOLE_PART
from iriftrace.triangulation.devices import System
from iriftrace.triangulation.measure import measure
from iriftrace.triangulation.scan import Scan

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.scene.loaded import LoadedScene

ANGLES_DEG = (15.0, 45.0)
"""Usual angles of triangulation of sensors: smaller ones increase noise, larger ones occlusion."""

CONFIRMED = 3
"""Number of best pairs that are measured by the exact solver, from which a user chooses."""

LEAVE_OUT = "leave that out with --no-confirm."


@frozen(eq=False)
class PairPlan:
    """Pairs of poses that see something in common, the best first.

    Attributes
    ----------
    pairs : (n, 2) array of int
        Numbers of the poses of the camera and of the second device.
    score : (n,) array
        Weighted sum of the normalised error, of the unseen fraction and of 1 / sin(angle), to
        which the noise in depth is proportional; the smallest is the best. For measured pairs with
        the measured error.
    error_mm : (n,) array, mm
        The criteria's statistic of the size of the error along the part's normal, over the camera's
        pixels.
    bias_mm : (n,) array, mm
        Median of that error, with its sign; for a feature the error of its diameter instead.
    coverage : (n,) array
        Fraction of the area that both see at an angle in the range, 0..1.
    angle_deg : (n,) array, degree
        Median of the angle between the two lines of sight.
    exact_mm : (k,) array, mm
        Error of the best k pairs by :func:`iriftrace.measure`: as `error_mm` of all measured
        points, for a feature the error of its diameter.
    exact_engine : str
        Engine that bent the rays for it; empty if nothing was measured.
    system : str
    feature : str
        Feature whose diameter counts; empty if there is none.
    criteria : Criteria
    angles_deg : (2,) tuple, degree
        Range of angles that count as seen.
    limits : dict of (2,) tuples
        Limits of the three quantities of the score: minimum, and percentile over the pairs.
    """

    pairs: IntArray
    score: FloatArray
    error_mm: FloatArray
    bias_mm: FloatArray
    coverage: FloatArray
    angle_deg: FloatArray
    exact_mm: FloatArray
    exact_engine: str
    system: System
    feature: str
    criteria: Criteria
    angles_deg: tuple[float, float]
    limits: dict[str, tuple[float, float]]


def plan_pairs(
    dataset: xr.Dataset,
    criteria: Criteria = STANDARD,
    *,
    system: System = "fringe",
    angles_deg: tuple[float, float] = ANGLES_DEG,
    feature: str | None = None,
    confirm: bool = True,
) -> PairPlan:
    """Rank the pairs of a sweep's poses as places of two devices.

    Errors are those of :func:`iriftrace.triangulation.first_order.first_order_error` at the centres
    of the faces that both poses see; rays are traced only to confirm the best pairs.

    Parameters
    ----------
    dataset : xarray.Dataset
        A sweep. With several scenes, only poses of the same one are paired.
    criteria : Criteria
        Weights (those of both resolutions count for the noise in depth), statistic, region,
        percentile, ``min_coverage``, and ``min_hits`` on the faces in common.
    system : str
        ``"fringe"``, ``"stereo"`` or ``"laser"``.
    angles_deg : (2,) tuple, degree
        Smallest and largest angle between two lines of sight at which a face counts as seen.
    feature : str, optional
        A region that is a cylinder or sphere, ``"cylinder:lateral"``. Its diameter's error is
        stated, and pairs are ranked by that or by the points' error, whichever is larger. On a
        short arc, micrometres that vary along it change the diameter by many times as much;
        elsewhere large errors cancel in one state of the air and not in the next.
    confirm : bool
        Measure the best three pairs by the exact solver and order them by the measured error; needs
        the scene's files.

    Raises
    ------
    InputError
        The angles are not a range, the part does not have the feature, the sweep has no faces, its
        part or scene has changed, or no pair can be ranked.
    SetupError
        Pairs are to be measured and there is no usable LLVM or CUDA.
    """
    low, high = angles_deg
    if not 0.0 < low < high < 180.0:
        raise InputError(
            f"The angles {low:g}:{high:g} are not a range of triangulation; give the smaller one "
            "first, such as 15:45."
        )
    ranked_region(dataset, criteria.region)
    try:
        part = swept_part(dataset)
    except InputError as error:
        why = str(error).rstrip(".")
        raise InputError(f"Pairs cannot be ranked without the part's file: {why}.") from error
    region = feature_region(feature, criteria, part) if feature else criteria.region
    areas = np.array(part.face_areas)
    areas[~in_region(region, np.arange(len(areas)), part)] = 0.0
    request = PairRequest(part, areas, region, criteria, system, feature, angles_deg)
    views = views_of(dataset, len(areas))
    table = pair_table(views, request)
    if not len(table):
        least = f", and {criteria.min_coverage:.1%} of its area" if criteria.min_coverage else ""
        raise InputError(
            f"No two poses of the sweep have {criteria.min_hits} rays each on faces of {region} "
            f"that both see at {low:g} to {high:g} degrees{least}; sweep closer poses, or give "
            "another --angle."
        )
    size, bias, coverage, angle = table[:, 2:].T
    counted = quantities(table[:, 2:].T, bool(feature))
    limits = {name: limits_of(values, criteria.percentile) for name, values in counted.items()}
    score = score_of_pairs(counted, limits, criteria, clipped=True)
    order = np.argsort(score, kind="stable")
    exact: list[float] = []
    engine = ""
    if confirm:
        best = order[:CONFIRMED].copy()
        pairs = table[best, :2].astype(np.int64)
        exact, engine = _measured(dataset, views, pairs, request)
        # The measured pairs are ordered by their measured errors.
        values = table[best, 2:].T
        values[1 if feature else 0] = exact
        known = score_of_pairs(quantities(values, bool(feature)), limits, criteria, clipped=True)
        again = np.argsort(known, kind="stable")
        order[: len(exact)], exact = best[again], [exact[k] for k in again]
        score[best] = known
    return PairPlan(
        pairs=table[order, :2].astype(np.int64),
        score=score[order],
        error_mm=size[order],
        bias_mm=bias[order],
        coverage=coverage[order],
        angle_deg=angle[order],
        exact_mm=np.array(exact),
        exact_engine=engine,
        system=system,
        feature=feature or "",
        criteria=criteria,
        angles_deg=angles_deg,
        limits=limits,
    )


def _measured(
    dataset: xr.Dataset,
    views: Sequence[PoseView],
    pairs: IntArray,
    request: PairRequest,
) -> tuple[list[float], str]:
    """Errors of pairs (k, 2) by the exact solver, mm, and the engine that bent the rays."""
    exact, engine = [], ""
    scenes: dict[str, LoadedScene] = {}
    for i, j in pairs:
        scene = scenes.get(views[i].scene) or scene_of_pairs(dataset, i)
        scenes[views[i].scene] = scene
        try:
            scan = measure(scene, views[i].camera, views[j].camera, system=request.system)
            engine = scan.provenance["engine"]
            part, criteria = request.part, request.criteria
            exact.append(
                size_error(scan, part, request.feature)
                if request.feature
                else statistic_along(scan, in_region(request.region, scan.face, part), criteria)
            )
        except InputError as reason:
            raise InputError(
                f"Poses {i} and {j} cannot be measured: {reason} Or {LEAVE_OUT}"
            ) from reason
    return exact, engine


def quantities(values: FloatArray, feature: bool) -> dict[str, FloatArray]:
    """The quantities that rank n pairs, the smaller the better: error, mm, unseen fraction, noise.

    From `PairPlan.error_mm`, `bias_mm`, `coverage` and `angle_deg`, (4, n) array; the bias may be
    that of a feature's diameter.
    """
    size, bias, coverage, angle_deg = values
    return {
        # A diameter that is right because large errors cancel is wrong in other air.
        "error": np.maximum(np.abs(bias), size) if feature else size,
        "unseen": 1.0 - coverage,
        "noise": 1.0 / np.sin(np.radians(angle_deg)),
    }


def score_of_pairs(
    values: Mapping[str, FloatArray],
    limits: Mapping[str, tuple[float, float]],
    criteria: Criteria,
    *,
    clipped: bool,
) -> FloatArray:
    """Scores (n,) of pairs by their `quantities` and the limits of these, as `PairPlan.score`.

    With clipping, no value counts less than its minimum or more than its percentile.
    """
    weights = criteria.weights
    factors = {
        "error": weights["displacement"],
        "unseen": weights["coverage"],
        "noise": weights["axial"] + weights["lateral"],
    }
    total = np.zeros(len(values["error"]))
    for name, factor in factors.items():
        low, high = limits[name]
        fraction = (values[name] - low) / (high - low) if high > low else 0.0 * values[name]
        total += factor * (np.clip(fraction, 0.0, 1.0) if clipped else fraction)
    return total


def feature_region(feature: str, criteria: Criteria, part: Part) -> str:
    """Region of the part for a feature."""
    choice = FeatureChoice.of(feature)
    kind, region = choice.kind, choice.region
    chosen = on_region(region, np.arange(len(part.faces)), part)
    if kind not in ("cylinder", "sphere"):
        raise InputError(
            f"Pairs are ranked by the diameter of a cylinder or sphere, not of {feature!r}; give "
            'for example "cylinder:lateral".'
        )
    if criteria.region not in (WHOLE_PART, region):
        raise InputError(
            f"The feature {feature!r} is not on the region {criteria.region!r}; leave that out."
        )
    is_a = surface_kind(part.vertices[np.unique(part.faces[chosen])])
    if is_a != kind:
        raise InputError(
            f"{region or 'The whole part'} is {f'a {is_a}' if is_a else 'not a simple surface'} "
            f"and not a {kind}; name a region that is one, such as cylinder:lateral."
        )
    return region or WHOLE_PART


def in_region(region: str, face: IntArray, part: Part) -> BoolArray:
    """Mask (n,) of faces in a region; all of them if that is the whole part."""
    return on_region(None if region == WHOLE_PART else region, face, part)


def scene_of_pairs(dataset: xr.Dataset, pose: int) -> LoadedScene:
    """The scene of a pose."""
    try:
        return load_swept_scene(dataset, pose).scene
    except InputError as error:
        raise InputError(
            f"The best pairs cannot be measured, because their scene is missing: {error}; "
            f"{LEAVE_OUT}"
        ) from error


def size_error(scan: Scan, part: Part, feature: str) -> float:
    """Error of a feature's diameter, mm."""
    (fitted,) = scan.features(part, [feature])
    error = fitted.size.difference("measured", "cold")
    if error is None:
        raise AssertionError("a cylinder or sphere has a diameter")
    return error


def statistic_along(scan: Scan, chosen: BoolArray, criteria: Criteria) -> float:
    """The criteria's statistic of the size of chosen points' errors along the normal, mm."""
    errors = scan.error_normal[chosen]
    if len(errors) == 0:
        raise InputError(f"they measure no point of {criteria.region}.")
    return statistic_of(errors, criteria, np.ones(len(errors)))
