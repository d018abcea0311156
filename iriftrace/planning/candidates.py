"""The poses of a sweep that can be compared, and the four metrics by which they are."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from attrs import asdict, frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError

if TYPE_CHECKING:
    import xarray as xr


Statistic = Literal["mean", "median", "p95"]
"""Statistic of the displacements in one view."""

Resolution = Literal["step", "nn3d", "nnxy"]
"""Definition of the resolution: pixel step, nearest neighbour in space, or in the image plane."""

METRICS = ("displacement", "coverage", "axial", "lateral")
"""Names of the metrics; the coverage is better the larger it is, the others the smaller."""

_DIMENSIONS = {"pose", "region"}


@frozen(eq=False)
class Candidates:
    """Which of n poses can be compared.

    Attributes
    ----------
    metrics : dict of (n,) arrays
        Values of each of `METRICS` in all poses; mm, and 0..1 for the coverage.
    eligible : (n,) array of bool
        The poses that can be compared.
    reasons : dict
        Number of each other pose and why it cannot be compared.
    """

    metrics: dict[str, FloatArray]
    eligible: BoolArray
    reasons: dict[int, str]


def find_candidates(
    dataset: xr.Dataset,
    statistic: str,
    resolution: str,
    region: str,
    min_hits: int,
    min_coverage: float,
    needed: Collection[str],
) -> Candidates:
    """The metrics of all poses, and why some of them cannot be compared.

    Parameters
    ----------
    dataset, statistic, resolution, region, min_hits, min_coverage
        As for `iriftrace.planning.rank.rank_poses`.
    needed
        Those of `METRICS` without which a pose cannot be compared.

    Raises
    ------
    InputError
        An option is wrong, the dataset is not a sweep, or no pose can be compared.
    """
    check_choice("statistic", statistic, get_args(Statistic))
    check_choice("resolution", resolution, get_args(Resolution))
    if min_hits < 1:
        raise InputError(
            f"The smallest number of good rays is {min_hits}, so views of nothing would be ranked; "
            "give at least 1."
        )
    if not 0 <= min_coverage <= 1:
        raise InputError(
            f"The smallest coverage is {min_coverage:g}, but it is a share of the area; give a "
            "number from 0 to 1, such as 0.3."
        )
    reading = "" if resolution == "step" else f"_{resolution}"
    variables = {
        "displacement": f"displacement_{statistic}",
        "coverage": "coverage",
        "axial": f"axial_resolution{reading}",
        "lateral": f"lateral_resolution{reading}",
    }
    column = ranked_region(dataset, [*variables.values(), "rays_good"], region)
    metrics = {name: _column(dataset, v, column) for name, v in variables.items()}
    good_rays = _column(dataset, "rays_good", column)
    failures = _failures(dataset)
    reasons = {}
    seen = metrics["coverage"].tolist()
    for pose, (failure, rays) in enumerate(zip(failures, good_rays.tolist(), strict=True)):
        if failure:
            reasons[pose] = f"failed: {failure}"
        elif not rays >= 0:
            reasons[pose] = "not traced"
        elif rays < min_hits:
            reasons[pose] = f"{rays:.0f} good rays, fewer than {min_hits}"
        elif seen[pose] < min_coverage:
            reasons[pose] = f"coverage {seen[pose]:.4g}, less than {min_coverage:g}"
    rich = np.ones(len(good_rays), dtype=np.bool_)
    rich[list(reasons)] = False
    if not rich.any():
        pose, reason = next(iter(reasons.items()))
        raise InputError(
            f"None of the {len(rich)} poses can be ranked for {region} (pose {pose}: {reason}); "
            "check where the cameras stand and look, or rank another region."
        )
    eligible = rich.copy()
    for name in needed:
        known = np.isfinite(metrics[name])
        if not np.any(known & rich):
            raise InputError(
                f"The sweep has no value of {variables[name]} for {region}, so poses cannot be "
                "compared by it; choose another reading or sweep again with this one."
            )
        for pose in np.flatnonzero(rich & ~known).tolist():
            reasons[pose] = f"{reasons[pose]}, {name}" if pose in reasons else f"no value of {name}"
        eligible &= known
    if not eligible.any():
        raise InputError(
            f"None of the {len(rich)} poses has all of {', '.join(needed)} for {region}, so none "
            "can be ranked; give the weight 0 to what is not known."
        )
    return Candidates(metrics, eligible, reasons)


def ranked_region(dataset: xr.Dataset, variables: list[str], region: str) -> int:
    """Number of a region in a sweep that has some variables of poses and regions.

    Raises
    ------
    InputError
        If the dataset is no sweep, has no pose or no such region.
    """
    missing = [v for v in variables if v not in dataset or set(dataset[v].dims) != _DIMENSIONS]
    if missing or "region" not in dataset.coords:
        raise InputError(
            f"This is not a sweep of iriftrace: {missing[0] if missing else 'region'} is missing; "
            "give the file that `iriftrace sweep` wrote."
        )
    if dataset.sizes["pose"] == 0:
        raise InputError("The sweep has no poses, so there is nothing to rank; run it again.")
    names = [str(name) for name in dataset["region"].to_numpy()]
    if region not in names:
        raise InputError(f"The sweep has no region '{region}'; it has {', '.join(names)}.")
    return names.index(region)


def _column(dataset: xr.Dataset, variable: str, region: int) -> FloatArray:
    values = np.asarray(dataset[variable].isel(region=region).to_numpy(), dtype=np.float64)
    return np.where(np.isfinite(values), values, np.nan)


def _failures(dataset: xr.Dataset) -> list[str]:
    if "failure" not in dataset:
        return [""] * dataset.sizes["pose"]
    texts = dataset["failure"].to_numpy().tolist()
    # Text that was never written comes back from some writers as NaN or None.
    return [text if isinstance(text, str) else "" for text in texts]


def check_choice(option: str, value: str, choices: Collection[str]) -> None:
    """Raise `InputError` for a value that is not one of the choices."""
    if value not in choices:
        raise InputError(f"Unknown {option} '{value}'; use one of {', '.join(choices)}.")


# MERGE plan_weights: How much each metric counts when poses are ranked.


@frozen
class Weights:
    """How much each metric counts in the score; as given, not scaled to a sum of 1.

    Raises
    ------
    InputError
        If a weight is negative or not finite, or all are zero.
    """

    displacement: float = 0.5
    coverage: float = 0.2
    axial: float = 0.15
    lateral: float = 0.15

    def __attrs_post_init__(self) -> None:
        given = asdict(self)
        wrong = {name: w for name, w in given.items() if not (math.isfinite(w) and w >= 0)}
        if wrong:
            name, weight = next(iter(wrong.items()))
            raise InputError(
                f"The weight of {name} is {weight}, which would make its bad values good; "
                "give zero or a positive number."
            )
        if sum(given.values()) <= 0:
            raise InputError(
                "All weights are zero, so every pose would be equally good; "
                "make at least one positive."
            )

    def as_dict(self) -> dict[str, float]:
        """Name of each metric and its weight."""
        return {name: float(weight) for name, weight in asdict(self).items()}


# MERGE pareto: Poses that are the best for some taste: nothing surpasses them in every respect.


def pareto_front(
    dataset: xr.Dataset,
    *,
    statistic: Statistic = "mean",
    resolution: Resolution = "step",
    region: str = "part",
    min_hits: int = 100,
    min_coverage: float = 0.0,
) -> IntArray:
    """Poses that no other pose surpasses in every respect, whatever the weights.

    A pose is left out if another one is at least as good in displacement, coverage, axial and
    lateral resolution and better in one of them. Parameters and errors are those of
    `iriftrace.planning.rank.rank_poses`.

    Returns
    -------
    (k,) array of int
        Numbers of the poses, ascending.
    """
    found = find_candidates(dataset, statistic, resolution, region, min_hits, min_coverage, METRICS)
    poses = np.flatnonzero(found.eligible)
    costs = np.stack(
        [
            -found.metrics[name][poses] if name == "coverage" else found.metrics[name][poses]
            for name in METRICS
        ],
        axis=1,
    )
    # In this order, a pose can only be dominated by an earlier one.
    order = np.lexsort(costs.T[::-1])
    poses, costs = poses[order], costs[order]
    front: list[int] = []
    for i, cost in enumerate(costs):
        others = costs[front]
        dominated = np.all(others <= cost, axis=1) & np.any(others < cost, axis=1)
        if not dominated.any():
            front.append(i)
    return np.sort(poses[front]).astype(np.int64)
