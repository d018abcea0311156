"""From the best pair of a sweep's poses to the best pair near it, by the exact solver."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from attrs import asdict, frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, without_warnings
from iriftrace.core.plain import JsonObject
from iriftrace.planning.pair_table import PairRequest
from iriftrace.planning.pairs import (
    PairPlan,
    scene_of_pairs,
    score_of_pairs,
    size_error,
    statistic_along,
)
from iriftrace.planning.refine import around_pose, check_evaluations, search, write_search
from iriftrace.sweep.reload import swept_camera
from iriftrace.trace.rays import is_inside
from iriftrace.triangulation.measure import measure

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.camera.camera import Camera
    from iriftrace.scene.scene import Scene


SCHEMA = "iriftrace.refined_pair/1"

_NOTHING = 1e3
"""Score of a pair that cannot be measured: larger than any other."""


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


def write_refined_pair(
    path: Path, refined: PairRefinement, plan: PairPlan, dataset: xr.Dataset
) -> None:
    """Write a refined pair and its score (.json)."""
    content = {
        "system": plan.system,
        "feature": plan.feature or None,
        **refined.best.as_dict(),
        "start": {"poses": plan.pairs[0].tolist(), **refined.start.as_dict()},
        "evaluations": refined.evaluations,
        "converged": refined.converged,
    }
    ranking = {"angles_deg": plan.angles_deg, "limits": plan.limits}
    write_search(path, SCHEMA, content, {**plan.criteria.as_dict(), **ranking}, dataset)


def refine_pair(
    dataset: xr.Dataset,
    plan: PairPlan,
    *,
    evaluations: int = 80,
    progress: Callable[[int, float], None] | None = None,
) -> PairRefinement:
    """Search for a better pair around the best one of a sweep, with at most so many measurements.

    Direction, distance and roll of both devices are free, each as in
    `iriftrace.planning.refine.refine_pose`; every pair is measured (`iriftrace.measure`) through
    the field data if they lie next to the scene. `progress` is called after each with their number
    and the best score so far.

    Raises InputError for fewer than 10 evaluations, if the scene is missing or has changed, or if
    the best pair cannot be measured.
    """
    check_evaluations(evaluations)
    first, second = plan.pairs[0].tolist()
    around = [around_pose(dataset, pose) for pose in (first, second)]
    cameras = [swept_camera(dataset, pose) for pose in (first, second)]
    scene = scene_of_pairs(dataset, first)
    request = PairRequest(scene.part, plan.criteria, plan.system, plan.feature, plan.angles_deg)
    trials: list[PairValue] = []

    def evaluate(place: FloatArray) -> float:
        moves = list(zip(cameras, around, place.reshape(2, 4), strict=True))
        devices = [camera.at(pose.matrix(move)) for camera, pose, move in moves]
        distances = np.array([pose.distance(move) for _, pose, move in moves])
        trials.append(_value(scene, devices, distances, request, plan.limits))
        if progress is not None:
            progress(len(trials), min(trial.score for trial in trials))
        return trials[-1].score

    if evaluate(np.zeros(8)) >= _NOTHING:
        raise InputError(
            f"Poses {first} and {second} measure too little together to search around them; give "
            "another --angle or --min-coverage."
        )
    converged = search(evaluate, 8, evaluations - 1)
    best = min(trials, key=lambda trial: trial.score)
    return PairRefinement(trials[0], best, len(trials), converged)


def _value(
    scene: Scene,
    devices: list[Camera],
    distances: FloatArray,
    request: PairRequest,
    limits: dict[str, tuple[float, float]],
) -> PairValue:
    matrices = np.array([device.matrix for device in devices])
    nothing = PairValue(matrices, distances, _NOTHING)
    if is_inside(scene, matrices[:, :3, 3]).any():
        return nothing
    try:
        with without_warnings():
            # Limits of a scene were warned of when it was swept.
            scan = measure(scene, *devices, system=request.system)
    except InputError:
        return nothing
    angle = np.degrees(scan.angle)
    low, high = request.angles_deg
    chosen = request.inside[scan.face] & (angle >= low) & (angle <= high)
    seen = np.unique(scan.face[chosen])
    coverage = float(request.areas[seen].sum() / request.areas.sum())
    criteria = request.criteria
    if chosen.sum() < criteria.min_hits or coverage < criteria.min_coverage:
        return nothing
    along = float(np.median(scan.error_normal[chosen]))
    values = (
        statistic_along(scan, chosen, criteria),
        size_error(scan, request) if request.feature else along,
        coverage,
        float(np.median(angle[chosen])),
    )
    score = score_of_pairs(np.array(values)[:, None], limits, request, clipped=False)
    return PairValue(matrices, distances, float(score[0]), *values)
