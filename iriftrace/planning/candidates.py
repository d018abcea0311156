"""Poses of a sweep that can be ranked, and the variables of the ranking."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np
from attrs import astuple, evolve, frozen

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.planning.criteria import Criteria
from iriftrace.sweep.store import check_sweep

if TYPE_CHECKING:
    import xarray as xr

ROBUST = 2.0
"""Number of standard deviations over an ensemble's members that are added by default."""


@frozen
class RankedError:
    """The error by which a criterion ranks; {} is a statistic of it."""

    name: str
    short: str  # in a table's heading
    variable: str  # of a sweep
    scatter: str  # variable of an ensemble's sweep, its standard deviation over the members


_ERRORS = {
    "displacement": RankedError("displacement", "{}", "displacement_{}", "scatter_{}"),
    "normal": RankedError(
        "error along the normal", "|e| {}", "error_normal_{}", "error_normal_scatter_{}"
    ),
    "features": RankedError("error of diameters", "|d|", "size_error", "size_scatter"),
}


def ranked_error(criteria: Criteria) -> RankedError:
    """The error by which poses are ranked, and its statistic, by criteria in force."""
    error = _ERRORS[criteria.criterion or "displacement"]
    return RankedError(*(text.format(criteria.statistic) for text in astuple(error)))


def name_of(name: str, criteria: Criteria) -> str:
    """Name of one of `METRICS` in messages."""
    return ranked_error(criteria).name if name == "displacement" else name


def in_force(criteria: Criteria, dataset: xr.Dataset) -> Criteria:
    """The criteria with the criterion and the weights by which a sweep is ranked.

    Raises InputError for a criterion about two devices if the sweep has one camera.
    """
    rig = "error_normal_p95" in dataset
    if criteria.criterion in ("normal", "features") and not rig:
        raise InputError(
            f"The criterion {criteria.criterion} is about a sensor with two devices, and the sweep "
            "is of one camera; sweep a scene with two, or leave it out.",
            code="sweep.one_camera",
            argument="criterion",
        )
    members = "scatter_p95" in dataset
    if criteria.robust and not members:
        raise InputError(
            "The sweep is of a single field, so there is no scatter to rank by; sweep a scene of "
            "several states of the air, or leave it out.",
            code="sweep.one_field",
            argument="robust",
        )
    robust = (ROBUST if members else 0.0) if criteria.robust is None else criteria.robust
    criterion = criteria.criterion or ("normal" if rig else "displacement")
    weights = criteria.weights
    return evolve(
        criteria,
        displacement=weights["displacement"],
        coverage=weights["coverage"],
        axial=weights["axial"],
        lateral=weights["lateral"],
        criterion=criterion,
        robust=robust,
    )


def metric_variables(criteria: Criteria) -> dict[str, str]:
    """Names of the variables of a sweep for each of `METRICS`, by criteria in force."""
    return {
        "displacement": ranked_error(criteria).variable,
        "coverage": "coverage_area"
        if criteria.criterion == "displacement"
        else "coverage_measured",
        "axial": "axial_resolution",
        "lateral": "lateral_resolution",
    }


def rankable(
    dataset: xr.Dataset, criteria: Criteria, needed: Collection[str]
) -> tuple[dict[str, FloatArray], BoolArray, dict[int, str]]:
    """Metrics of all poses (mm; 0..1), mask of those that can be compared, and reasons for others.

    A pose without a value of one of `needed` cannot be compared. Reasons are by number of the pose.
    """
    region = criteria.region
    variables = metric_variables(criteria)
    column = ranked_region(dataset, region)
    metrics = {name: np.abs(values_of(dataset, v, column)) for name, v in variables.items()}
    if criteria.robust:
        metrics["displacement"] += scatter_added(dataset, criteria)
    count = dataset.sizes["pose"]
    reasons = _poor_poses(dataset, criteria, column, metrics["coverage"])
    rich = np.ones(count, dtype=np.bool_)
    rich[list(reasons)] = False
    if not rich.any():
        # Of all the one that is the nearest to a rank.
        pose = int(np.argmax(np.nan_to_num(metrics["coverage"])))
        raise InputError(
            f"None of the {count} poses can be ranked for {region} (pose {pose}: {reasons[pose]}); "
            "check the positions and directions of the cameras, rank another region, or lower what "
            "a pose must see.",
            code="plan.no_pose",
            argument="min_coverage",
        )
    eligible = rich.copy()
    for name in needed:
        known = np.isfinite(metrics[name])
        if not np.any(known & rich):
            raise InputError(
                f"The sweep has no value of {variables[name]} for {region}, so poses cannot be "
                "compared by it; choose another reading or sweep again with this one.",
                code="sweep.no_value",
            )
        for pose in np.flatnonzero(rich & ~known).tolist():
            called = name_of(name, criteria)
            if called == "error of diameters":
                called += " (too few points on each cylinder, cone and sphere)"
            reasons[pose] = (
                f"{reasons[pose]}, {called}" if pose in reasons else f"no value of {called}"
            )
        eligible &= known
    if not eligible.any():
        raise InputError(
            f"None of the {count} poses has all of {', '.join(needed)} for {region}, so none "
            "can be ranked; give the weight 0 to unknown metrics.",
            code="plan.no_pose",
        )
    return metrics, eligible, reasons


def _poor_poses(
    dataset: xr.Dataset, criteria: Criteria, column: int, coverage: FloatArray
) -> dict[int, str]:
    """Poses that failed or see too little, with the reason."""
    min_hits, min_coverage = criteria.min_hits, criteria.min_coverage
    good_rays = values_of(dataset, "rays_good", column).tolist()
    failures = dataset["failure"].to_numpy().tolist()
    together = criteria.criterion != "displacement"
    points = values_of(dataset, "points_measured", column).tolist() if together else None
    reasons = {}
    seen = coverage.tolist()
    for pose, (failure, rays) in enumerate(zip(failures, good_rays, strict=True)):
        if failure:
            reasons[pose] = f"failed: {failure}"
        elif not rays >= 0:
            reasons[pose] = "not traced"
        elif rays < min_hits:
            reasons[pose] = f"{rays:.0f} good rays, fewer than {min_hits}"
        elif points is not None and points[pose] < min_hits:
            reasons[pose] = (
                f"{points[pose]:.0f} points that both devices see in focus, fewer than {min_hits}"
            )
        elif seen[pose] < min_coverage:
            reasons[pose] = f"coverage {seen[pose]:.4g}, less than {min_coverage:g}"
    return reasons


def scatter_added(dataset: xr.Dataset, criteria: Criteria) -> FloatArray:
    """Addition to the displacement of all poses for the scatter over an ensemble's members, mm."""
    column = ranked_region(dataset, criteria.region)
    scatter = values_of(dataset, ranked_error(criteria).scatter, column)
    return np.asarray((criteria.robust or 0.0) * scatter)


def ranked_region(dataset: xr.Dataset, region: str) -> int:
    """Number of a region in a sweep; raises InputError for another dataset or region."""
    check_sweep(dataset)
    names = [str(name) for name in dataset["region"].to_numpy()]
    if region not in names:
        raise InputError(
            f"The sweep has no region '{region}'; it has {', '.join(names)}.",
            code="region.unknown_name",
            argument="region",
        )
    return names.index(region)


def values_of(dataset: xr.Dataset, variable: str, region: int) -> FloatArray:
    """A variable's values (poses,) in a region, by the region's number."""
    values = np.asarray(dataset[variable].isel(region=region).to_numpy(), dtype=np.float64)
    return np.where(np.isfinite(values), values, np.nan)
