"""From the best pose or pair of a sweep to the best near it: position, distance and roll are free.

The score is that of the plan, with the normalisation of the sweep, so that scores can be compared.
It has small steps (a pixel comes onto the part or leaves it) and no derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from attrs import asdict, frozen
from scipy.optimize import minimize

from iriftrace.camera.pose import look_at_of
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn, without_warnings
from iriftrace.core.files import write_json
from iriftrace.core.plain import JsonObject
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.planning.around import around_pose
from iriftrace.planning.candidates import metric_variables, ranked_error
from iriftrace.planning.pair_table import PairRequest
from iriftrace.planning.pairs import PairPlan, measured_values, scene_of_pairs
from iriftrace.planning.rank import Plan, score_of
from iriftrace.sweep.measures import ENSEMBLE, MEASURES, RIG, Limits
from iriftrace.sweep.reload import swept_camera
from iriftrace.sweep.store import WHOLE_PART, attribute
from iriftrace.tracing.rays import is_inside

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.camera.camera import Camera
    from iriftrace.sweep.reload import SweptScene
    from iriftrace.tracing.scene import Scene


SCHEMA = "iriftrace.refined/1"
PAIR_SCHEMA = "iriftrace.refined_pair/1"

EVALUATIONS, FEWEST_EVALUATIONS = 80, 10

# Steps of the search, as fractions of the ranges of `Around`.
_FIRST_STEP, _LAST_STEP = 0.4, 1e-3

# Smaller differences are rounding, or no more than a ray at an edge.
_LEAST_GAIN = 1e-4

# Rendering the pose again gives the sweep's own score, except for a few rays on other processors.
_SAME_SCORE = 0.01

# Score of a pair that cannot be measured: larger than any other.
_NOTHING = 1e3


@frozen(eq=False)
class Refinement:
    """The best pose found near a pose of a sweep.

    Attributes
    ----------
    start : int
        Number of the pose where the search started.
    matrix : (4, 4) array, mm, world
        Camera to world; x right, y down, z forward.
    distance_mm : float, mm
        From the camera to its target, which does not change.
    score, start_score : float
        Scores by the plan; the refined one is never the larger.
    metrics, start_metrics : dict of float
        The four metrics of both poses; mm, and 0..1 for the coverage.
    turn_deg : float, degree
        Angle between the two directions to the camera, seen from its target.
    roll_deg : float, degree
        Roll of the camera, clockwise as it looks.
    evaluations : int
        Number of rendered poses, including the start.
    converged : bool
        True if the search ended by itself and not because the evaluations were used up.
    """

    start: int
    matrix: FloatArray
    distance_mm: float
    score: float
    start_score: float
    metrics: dict[str, float]
    start_metrics: dict[str, float]
    turn_deg: float
    roll_deg: float
    evaluations: int
    converged: bool

    @property
    def gain(self) -> float:
        """Decrease of the score; 0 if nothing better was found."""
        return self.start_score - self.score


@frozen(eq=False)
class PairValue:
    """Measurement of a pair: `error_mm` to `angle_deg` as in `PairPlan`, of all measured points.

    The score uses the normalisation of the sweep's pairs, and is less than 0 if it is better than
    all of them.
    """

    matrices: FloatArray  # (2, 4, 4), of the camera and the second device, camera to world, mm
    distances_mm: FloatArray  # (2,), from each to its target
    score: float
    error_mm: float = math.nan
    bias_mm: float = math.nan
    coverage: float = math.nan
    angle_deg: float = math.nan

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        values = asdict(self)
        matrices, distances = values.pop("matrices"), values.pop("distances_mm")
        devices = {
            name: {"matrix": matrices[row].tolist(), "distance_mm": float(distances[row])}
            for row, name in enumerate(("camera", "second"))
        }
        return {**devices, **values}


@frozen(eq=False)
class PairRefinement:
    """The best pair found near the best one of a sweep; never worse than that."""

    start: PairValue
    best: PairValue
    evaluations: int  # number of measured pairs
    converged: bool  # the search ended before the evaluations did


@frozen(eq=False)
class _Trial:
    score: float
    metrics: dict[str, float]
    place: FloatArray


_T = TypeVar("_T", _Trial, PairValue)


def check_evaluations(evaluations: int) -> None:
    """Refuse a search with too few evaluations for its directions."""
    if evaluations < FEWEST_EVALUATIONS:
        raise InputError(
            f"{evaluations} evaluations are too few; give at least {FEWEST_EVALUATIONS}.",
            code="evaluations.too_few",
            argument="evaluations",
        )


def refine_pose(
    dataset: xr.Dataset,
    plan: Plan,
    swept: SweptScene,
    *,
    evaluations: int = EVALUATIONS,
    progress: Callable[[int, float], None] | None = None,
) -> Refinement:
    """Search for a better pose around the best one of a sweep, with at most so many renderings.

    The camera keeps looking at the same point. Free are the direction from which it looks (as far
    as the nearest other pose of the sweep), its distance (by a quarter) and its roll (by 45
    degrees). The search is SciPy's COBYQA (Ragonneau, 2022), which fits quadratic models in a trust
    region, needs no derivatives and is reproducible. From eight poses of the cylinder it gained as
    much as Nelder and Mead's simplex (on average 0.23) with 61 instead of 80 renderings, and
    Powell's directions gained 0.18.

    `progress` is called after each pose with their number and the best score so far. Raises
    InputError for fewer than 10 evaluations, or if the best pose no longer has a score; warns if
    the scene gives it another score than the sweep had.
    """
    check_evaluations(evaluations)
    around = around_pose(dataset, plan.best)
    # Larger than any other score.
    without_score = 1.0 + sum(plan.criteria.weights.values())

    def trial(place: FloatArray) -> _Trial:
        metrics = _metrics(swept, around.matrix(place), plan) or {}
        score = score_of(plan, metrics) if metrics else math.nan
        return _Trial(without_score if math.isnan(score) else score, metrics, np.array(place))

    def check(start: _Trial) -> None:
        swept_score = plan.score[plan.best]
        if start.score >= without_score:
            raise InputError(
                f"Pose {plan.best} can no longer be scored, so its scene has changed; sweep again.",
                code="scene.changed",
            )
        if abs(start.score - swept_score) > _SAME_SCORE:
            warn(
                f"The scene gives pose {plan.best} the score {start.score:.3f}, its sweep gave "
                f"{swept_score:.3f}, so the air is not that of the sweep; run it again."
            )

    start, best, count, converged = _search(trial, check, 4, evaluations, progress)
    if start.score - best.score < _LEAST_GAIN:
        best = start
    return Refinement(
        start=plan.best,
        matrix=around.matrix(best.place),
        distance_mm=around.distance(best.place),
        score=best.score,
        start_score=start.score,
        metrics=best.metrics,
        start_metrics=start.metrics,
        turn_deg=float(np.degrees(np.linalg.norm(around.turn(best.place)))),
        roll_deg=around.roll_deg(best.place),
        evaluations=count,
        converged=converged,
    )


def refine_pair(
    dataset: xr.Dataset,
    plan: PairPlan,
    *,
    evaluations: int = EVALUATIONS,
    progress: Callable[[int, float], None] | None = None,
) -> PairRefinement:
    """Search for a better pair around the best one of a sweep, with at most so many measurements.

    Direction, distance and roll of both devices are free, each as in `refine_pose`; every pair is
    measured (`iriftrace.measure`) through the field data if they lie next to the scene. `progress`
    is called after each with their number and the best score so far.

    Raises InputError for fewer than 10 evaluations, if the scene is missing or has changed, or if
    the best pair cannot be measured.
    """
    check_evaluations(evaluations)
    first, second = plan.pairs[0].tolist()
    around = [around_pose(dataset, pose) for pose in (first, second)]
    cameras = [swept_camera(dataset, pose) for pose in (first, second)]
    scene = scene_of_pairs(dataset, first)
    request = PairRequest(scene.part, plan.criteria, plan.pairing)

    def trial(place: FloatArray) -> PairValue:
        moves = list(zip(cameras, around, place.reshape(2, 4), strict=True))
        devices = [camera.at(poses.matrix(move)) for camera, poses, move in moves]
        distances = np.array([poses.distance(move) for _, poses, move in moves])
        return _value(scene, devices, distances, request, plan.limits)

    def check(start: PairValue) -> None:
        if start.score >= _NOTHING:
            raise InputError(
                f"Poses {first} and {second} measure too little together; give other angles.",
                code="pairs.too_little",
                argument="angle",
            )

    return PairRefinement(*_search(trial, check, 8, evaluations, progress))


def _search(
    trial: Callable[[FloatArray], _T],
    check: Callable[[_T], None],
    count: int,
    evaluations: int,
    progress: Callable[[int, float], None] | None,
) -> tuple[_T, _T, int, bool]:
    """Search for the place, `count` numbers in -1..1, of the smallest score, by SciPy's COBYQA.

    The start, all zeros, is checked before the search. Returns the trial there, the best trial, the
    number of trials, and True if the search ended before the evaluations did.
    """
    trials: list[_T] = []

    def evaluate(place: FloatArray) -> float:
        trials.append(trial(place))
        if progress is not None:
            progress(len(trials), min(each.score for each in trials))
        return trials[-1].score

    evaluate(np.zeros(count))
    check(trials[0])
    found = minimize(
        evaluate,
        np.zeros(count),
        method="COBYQA",
        bounds=[(-1.0, 1.0)] * count,
        options={
            "maxfev": evaluations - 1,
            "initial_tr_radius": _FIRST_STEP,
            "final_tr_radius": _LAST_STEP,
        },
    )
    best = min(trials, key=lambda each: each.score)
    return trials[0], best, len(trials), bool(found.success)


def _metrics(swept: SweptScene, matrix: FloatArray, plan: Plan) -> dict[str, float] | None:
    """The four metrics of a pose; None if the camera cannot stand there or sees too little."""
    criteria = plan.criteria
    try:
        view = swept.metrics(matrix)
    except InputError:
        return None
    if criteria.region != WHOLE_PART:
        view = view["regions"][criteria.region]
    if view["rays"]["good"] < criteria.min_hits:
        return None
    variables = metric_variables(criteria)
    known = {**MEASURES, **ENSEMBLE, **RIG}
    together = criteria.criterion != "displacement"
    if together and known["points_measured"].value(view) < criteria.min_hits:
        return None
    found = {name: abs(known[variable].value(view)) for name, variable in variables.items()}
    if criteria.robust:
        found["displacement"] += criteria.robust * known[ranked_error(criteria).scatter].value(view)
    if not math.isfinite(sum(found.values())) or found["coverage"] < criteria.min_coverage:
        return None
    return found


def _value(
    scene: Scene,
    devices: list[Camera],
    distances: FloatArray,
    request: PairRequest,
    limits: dict[str, Limits],
) -> PairValue:
    """What devices measure together; the score is `_NOTHING` if that is too little."""
    matrices = np.array([device.matrix for device in devices])
    nothing = PairValue(matrices, distances, _NOTHING)
    if is_inside(scene, matrices[:, :3, 3]).any():
        return nothing
    try:
        with without_warnings():
            # Limits of a scene were warned of when it was swept.
            scan = measure(scene, *devices, system=request.pairing.system)
    except InputError:
        return nothing
    values = measured_values(scan, request)
    if values is None:
        return nothing
    score = request.objective(limits, clipped=False).score(request.quantities(values))
    return PairValue(matrices, distances, float(score), *values.tolist())


def write_refined(path: Path, refined: Refinement, plan: Plan, dataset: xr.Dataset) -> None:
    """Write the refined pose, its starting pose and its score."""
    origin, target, up = look_at_of(refined.matrix, refined.distance_mm)
    wavelength = dataset.attrs.get("wavelength_nm")
    content = {
        "wavelength_nm": float(wavelength) if isinstance(wavelength, int | float) else None,
        "matrix": refined.matrix.tolist(),
        "look_at": {"origin": origin.tolist(), "target": target.tolist(), "up": up.tolist()},
        "distance_mm": refined.distance_mm,
        "score": refined.score,
        "metrics": refined.metrics,
        "start": {
            "pose": refined.start,
            "matrix": np.asarray(dataset["matrix"].values[refined.start]).tolist(),
            "score": refined.start_score,
            "metrics": refined.start_metrics,
        },
        "gain": refined.gain,
        "evaluations": refined.evaluations,
        "converged": refined.converged,
    }
    _write(path, SCHEMA, content, {**plan.criteria.as_dict(), "limits": plan.limits}, dataset)


def write_refined_pair(
    path: Path, refined: PairRefinement, plan: PairPlan, dataset: xr.Dataset
) -> None:
    """Write a refined pair and its score (.json)."""
    content = {
        "system": plan.pairing.system,
        "feature": plan.pairing.feature,
        **refined.best.as_dict(),
        "start": {"poses": plan.pairs[0].tolist(), **refined.start.as_dict()},
        "evaluations": refined.evaluations,
        "converged": refined.converged,
    }
    ranking = {"angles_deg": plan.pairing.angle, "limits": plan.limits}
    _write(path, PAIR_SCHEMA, content, {**plan.criteria.as_dict(), **ranking}, dataset)


def _write(
    path: Path, schema: str, found: JsonObject, ranking: JsonObject, dataset: xr.Dataset
) -> None:
    """Write the result of a search (.json), with the ranking of the sweep where it started."""
    content = {
        "schema": schema,
        "version": version("iriftrace"),
        "length_unit": "mm",
        "convention": "camera to world; x right, y down, z forward",
        **found,
        "ranking": ranking,
        "scene": attribute(dataset, "scene"),
    }
    write_json(path, content)
