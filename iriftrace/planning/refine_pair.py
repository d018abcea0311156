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
from iriftrace.planning.pairs import (
    PairPlan,
    feature_region,
    in_region,
    quantities,
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
    from iriftrace.scene.loaded import LoadedScene


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
    trials: list[PairValue] = []

    def evaluate(place: FloatArray) -> float:
        one, other = around
        matrices = np.array((one.matrix(place[:4]), other.matrix(place[4:])))
        distances = np.array((one.distance(place[:4]), other.distance(place[4:])))
        devices = [camera.at(matrix) for camera, matrix in zip(cameras, matrices, strict=True)]
        trials.append(_value(scene, devices, matrices, distances, plan))
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
    scene: LoadedScene,
    devices: list[Camera],
    matrices: FloatArray,
    distances: FloatArray,
    plan: PairPlan,
) -> PairValue:
    part, criteria = scene.part, plan.criteria
    region = feature_region(plan.feature, criteria, part) if plan.feature else criteria.region
    nothing = PairValue(matrices, distances, _NOTHING)
    if is_inside(scene, matrices[:, :3, 3]).any():
        return nothing
    try:
        with without_warnings():
            # Limits of a scene were warned of when it was swept.
            scan = measure(scene, *devices, system=plan.system)
    except InputError:
        return nothing
    angle = np.degrees(scan.angle)
    low, high = plan.angles_deg
    chosen = in_region(region, scan.face, part) & (angle >= low) & (angle <= high)
    areas = np.where(in_region(region, np.arange(len(part.faces)), part), part.face_areas, 0.0)
    seen = np.unique(scan.face[chosen])
    coverage = float(areas[seen].sum() / areas.sum())
    if chosen.sum() < criteria.min_hits or coverage < criteria.min_coverage:
        return nothing
    error = statistic_along(scan, chosen, criteria)
    if plan.feature:
        bias = size_error(scan, part, plan.feature)
    else:
        bias = float(np.median(scan.error_normal[chosen]))
    middle = float(np.median(angle[chosen]))
    values = np.array((error, bias, coverage, middle))[:, None]
    counted = quantities(values, bool(plan.feature))
    score = float(score_of_pairs(counted, plan.limits, criteria, clipped=False)[0])
    return PairValue(matrices, distances, score, error, bias, coverage, middle)
