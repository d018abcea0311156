"""Pairs of a sweep's poses for two devices, ranked by predicted errors without tracing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan
from iriftrace.planning.candidates import ranked_region
from iriftrace.planning.cover import warn_of_large_faces
from iriftrace.planning.criteria import STANDARD_CRITERIA, USUAL_PAIRING, Criteria, Pairing
from iriftrace.planning.objective import limits_of
from iriftrace.planning.pair_table import PairRequest, PoseView, pair_table, statistic_of, views_of
from iriftrace.sweep.measures import Limits
from iriftrace.sweep.reload import load_swept_scene, swept_part

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.tracing.scene import Scene

CONFIRMED = 3
"""Number of best pairs that are measured by the exact solver, from which a user chooses."""

LEAVE_OUT = "leave the measurement out."


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
        Engine that bent the rays for it, ``"cells and shells"`` if not the same for all k; empty if
        nothing was measured.
    criteria : Criteria
    pairing : Pairing
        What was asked for.
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
    criteria: Criteria
    pairing: Pairing
    limits: dict[str, Limits]


def plan_pairs(
    dataset: xr.Dataset,
    criteria: Criteria = STANDARD_CRITERIA,
    pairing: Pairing = USUAL_PAIRING,
) -> PairPlan:
    """Rank the pairs of a sweep's poses as places of two devices.

    Errors are those of `iriftrace.measuring.two_devices.first_order.first_order_error` at the
    centres of the faces that both poses see; rays are traced only to confirm the best pairs.

    Parameters
    ----------
    dataset : xarray.Dataset
        A sweep. With several scenes, only poses of the same one are paired.
    criteria : Criteria
        Weights (those of both resolutions count for the noise in depth), statistic, region,
        percentile, ``min_coverage``, and ``min_hits`` on the faces in common.
    pairing : Pairing
        Kind of the second device, angles, feature. On a short arc, micrometres that vary along it
        change a diameter by many times as much; elsewhere large errors cancel in one state of the
        air and not in the next. The best pairs are measured by the exact solver and ordered by the
        measured error, unless `Pairing.confirm` is false; that needs the scene's files.

    Raises
    ------
    InputError
        The angles are not a range, the criteria add a scatter, which a sweep does not have for
        pairs, discard pairs or rank by an error that is not that of pairs, the part does not have
        the feature, the sweep has no faces, its part or scene has changed, or no pair can be
        ranked.
    SetupError
        Pairs are to be measured and there is no usable LLVM or CUDA.
    """
    if criteria.robust:
        raise InputError(
            "A sweep has no scatter of pairs over an ensemble's members, so none can be added; "
            "leave it out, and measure the best pairs, which states it.",
            code="pairs.no_scatter",
            argument="robust",
        )
    alone = "features" if pairing.feature else "normal"
    if criteria.criterion not in (None, alone):
        raise InputError(
            "Pairs are ranked by the error along the normal, with a feature by the larger one of "
            f"that and the error of its diameter, not by the criterion {criteria.criterion}; leave "
            f"it out, or give {alone}.",
            code="pairs.criterion",
            argument="criterion",
        )
    if criteria.outside != "clip":
        raise InputError(
            "Pairs beyond the percentile are clipped to it, as all of them are ranked; clip "
            "instead of discarding.",
            code="pairs.no_discard",
            argument="outside",
        )
    ranked_region(dataset, criteria.region)
    try:
        part = swept_part(dataset)
    except InputError as error:
        why = str(error).rstrip(".")
        raise InputError(
            f"Pairs cannot be ranked without the part's file: {why}.",
            code=error.code,
            argument=error.argument,
        ) from error
    low, high = pairing.angle
    request = PairRequest(part, criteria, pairing)
    views = views_of(dataset, len(part.faces))
    table = pair_table(views, request)
    if not len(table):
        least = f", and {criteria.min_coverage:.1%} of its area" if criteria.min_coverage else ""
        raise InputError(
            f"No two poses of the sweep have {criteria.min_hits} rays each on faces of "
            f"{request.region} that both see at {low:g} to {high:g} degrees{least}; sweep closer "
            "poses, or give other angles.",
            code="pairs.none",
            argument="angle",
        )
    values = table[:, 2:].T
    quantities = request.quantities(values)
    limits = {name: limits_of(each, criteria.percentile) for name, each in quantities.items()}
    objective = request.objective(limits)
    score = objective.score(quantities)
    order = objective.order(quantities)
    exact: list[float] = []
    engine = ""
    best_pair = views[int(table[order[0], 0])], views[int(table[order[0], 1])]
    warn_of_large_faces(np.stack([view.fractions for view in best_pair]), request.areas)
    if pairing.confirm:
        best = order[:CONFIRMED].copy()
        pairs = table[best, :2].astype(np.int64)
        exact, engine = _measured(dataset, views, pairs, request)
        # The measured pairs are ordered by their measured errors.
        measured = values[:, best]
        measured[1 if pairing.feature else 0] = exact
        known = request.quantities(measured)
        again = objective.order(known)
        order[: len(exact)], exact = best[again], [exact[k] for k in again]
        score[best] = objective.score(known)
    size, bias, coverage, angle = values[:, order]
    return PairPlan(
        pairs=table[order, :2].astype(np.int64),
        score=score[order],
        error_mm=size,
        bias_mm=bias,
        coverage=coverage,
        angle_deg=angle,
        exact_mm=np.array(exact),
        exact_engine=engine,
        criteria=criteria,
        pairing=pairing,
        limits=limits,
    )


def _measured(
    dataset: xr.Dataset, views: Sequence[PoseView], pairs: IntArray, request: PairRequest
) -> tuple[list[float], str]:
    """Errors of pairs (k, 2) by the exact solver, mm, and the engines that bent the rays."""
    exact, engines = [], set()
    scenes: dict[str, Scene] = {}
    for i, j in pairs:
        scene = scenes.get(views[i].scene) or scene_of_pairs(dataset, i)
        scenes[views[i].scene] = scene
        try:
            scan = measure(scene, views[i].camera, views[j].camera, system=request.pairing.system)
            engines.add(scan.provenance["engine"])
            exact.append(
                _size_error(scan, request)
                if request.pairing.feature
                else statistic_along(scan, request.inside[scan.face], request.criteria)
            )
        except InputError as reason:
            raise InputError(
                f"Poses {i} and {j} cannot be measured: {reason} Or {LEAVE_OUT}",
                code=reason.code,
                argument="no_confirm",
            ) from reason
    return exact, " and ".join(sorted(engines))


def scene_of_pairs(dataset: xr.Dataset, pose: int) -> Scene:
    """The scene of a pose."""
    try:
        return load_swept_scene(dataset, pose).scene
    except InputError as error:
        raise InputError(
            f"The best pairs cannot be measured, because their scene is missing: {error}; "
            f"{LEAVE_OUT}",
            code=error.code,
            argument="no_confirm",
        ) from error


def measured_values(scan: Scan, request: PairRequest) -> FloatArray | None:
    """What a measured pair has of `error_mm`, `bias_mm`, `coverage` and `angle_deg`, (4,) array.

    Of all points at an angle in the range; None if they are too few.
    """
    angle = np.degrees(scan.angle)
    low, high = request.pairing.angle
    chosen = request.inside[scan.face] & (angle >= low) & (angle <= high)
    seen = scan.seen_fractions(request.part, chosen)
    coverage = float(request.areas @ seen / request.areas.sum())
    criteria = request.criteria
    if chosen.sum() < criteria.min_hits or coverage < criteria.min_coverage:
        return None
    along = np.median(scan.error_normal[chosen])
    bias = _size_error(scan, request) if request.pairing.feature else along
    error = statistic_along(scan, chosen, criteria)
    return np.array((error, bias, coverage, np.median(angle[chosen])))


def _size_error(scan: Scan, request: PairRequest) -> float:
    """Error of the feature's diameter, mm."""
    (fitted,) = scan.features(request.part, [request.pairing.feature or ""])
    error = fitted.size.difference("measured", "cold")
    if error is None:
        raise AssertionError("a cylinder or sphere has a diameter")
    return error


def statistic_along(scan: Scan, chosen: BoolArray, criteria: Criteria) -> float:
    """The criteria's statistic of the size of chosen points' errors along the normal, mm."""
    errors = scan.error_normal[chosen]
    if len(errors) == 0:
        raise InputError(f"they measure no point of {criteria.region}.", code="region.no_point")
    return statistic_of(errors, criteria, np.ones(len(errors)))
