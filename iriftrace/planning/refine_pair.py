"""From the best pair of a sweep's poses to the best pair near it, by the exact solver."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import asdict, frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.files import whole_file
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
from iriftrace.planning.refine import around_pose, check_evaluations, search
from iriftrace.sweep.reload import swept_camera
from iriftrace.sweep.store import attribute
from iriftrace.trace.render import is_inside
from iriftrace.triangulation.scan import measure

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.camera.camera import Camera
    from iriftrace.scene.load import LoadedScene


SCHEMA = "iriftrace.refined_pair/1"

_NOTHING = 1e3
"""Score of a pair that cannot be measured: more than any other."""


@frozen(eq=False)
class PairValue:
    """What a pair measures.

    Attributes
    ----------
    matrices : (2, 4, 4) array
        Of the camera and the second device, camera to world, mm.
    distances_mm : (2,) array, mm
        From each to what it looks at.
    score : float
        By the normalisation of the sweep's pairs, less than 0 where it is better than all of them.
    error_mm, bias_mm, coverage, angle_deg : float
        As in `PairPlan`, of all measured points.
    """

    matrices: FloatArray
    distances_mm: FloatArray
    score: float
    error_mm: float = math.nan
    bias_mm: float = math.nan
    coverage: float = math.nan
    angle_deg: float = math.nan

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        values = asdict(self)
        devices = {
            name: {"matrix": matrix.tolist(), "distance_mm": float(distance)}
            for name, matrix, distance in zip(
                ("camera", "second"),
                values.pop("matrices"),
                values.pop("distances_mm"),
                strict=True,
            )
        }
        return {**devices, **values}


@frozen(eq=False)
class PairRefinement:
    """The best pair that was found near the best one of a sweep; never worse than that.

    Attributes
    ----------
    start, best : PairValue
    evaluations : int
        Pairs that were measured.
    converged : bool
        The search ended before the evaluations did.
    """

    start: PairValue
    best: PairValue
    evaluations: int
    converged: bool


def write_refined_pair(
    path: Path, refined: PairRefinement, plan: PairPlan, dataset: xr.Dataset
) -> None:
    """Write a refined pair and what it is worth (.json); an existing file is replaced when done.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    content = {
        "schema": SCHEMA,
        "version": version("iriftrace"),
        "length_unit": "mm",
        "convention": "camera to world; x right, y down, z forward",
        "system": plan.system,
        "feature": plan.feature or None,
        **refined.best.as_dict(),
        "start": {"poses": plan.pairs[0].tolist(), **refined.start.as_dict()},
        "evaluations": refined.evaluations,
        "converged": refined.converged,
        "ranking": {
            **plan.criteria.as_dict(),
            "angles_deg": list(plan.angles_deg),
            "limits": {name: list(limits) for name, limits in plan.limits.items()},
        },
        "scene": attribute(dataset, "scene"),
    }
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def refine_pair(
    dataset: xr.Dataset,
    plan: PairPlan,
    *,
    evaluations: int = 80,
    progress: Callable[[int, float], None] | None = None,
) -> PairRefinement:
    """Search for a better pair around the best one of a sweep.

    Direction, distance and roll of both devices are free, each as in
    `iriftrace.planning.refine.refine_pose`; every pair is measured (`iriftrace.measure`) through
    the field itself where it lies beside the scene.

    Parameters
    ----------
    dataset : xarray.Dataset
        The sweep.
    plan : PairPlan
        Its pairs.
    evaluations : int
        Most pairs to measure, at least 10.
    progress : callable, optional
        Called after each with their number and the best score so far.

    Raises
    ------
    InputError
        Too few evaluations, the scene is gone or has changed, or the best pair cannot be measured.
    """
    check_evaluations(evaluations)
    first, second = plan.pairs[0].tolist()
    around = [around_pose(dataset, pose) for pose in (first, second)]
    cameras = [swept_camera(dataset, pose) for pose in (first, second)]
    scene = scene_of_pairs(dataset, first)
    trials: list[PairValue] = []

    def evaluate(place: FloatArray) -> float:
        halves = place[:4], place[4:]
        matrices = np.array([one.matrix(half) for one, half in zip(around, halves, strict=True)])
        distances = np.array([one.distance(half) for one, half in zip(around, halves, strict=True)])
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
        with warnings.catch_warnings():
            # What limits a scene was said when it was swept.
            warnings.simplefilter("ignore", IriftraceWarning)
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
    values = np.array(((error, bias, coverage, middle),)).T
    counted = quantities(values[0], values[1], values[2], values[3], bool(plan.feature))
    score = float(score_of_pairs(counted, plan.limits, criteria, clipped=False)[0])
    return PairValue(matrices, distances, score, error, bias, coverage, middle)
