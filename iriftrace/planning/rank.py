"""Ranking of the poses of a sweep by one score of four metrics, and their Pareto front.

The score is that of `iriftrace.planning.objective`; its quantities are `METRICS`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError, warn, without_warnings
from iriftrace.planning.candidates import in_force, name_of, rankable, scatter_added
from iriftrace.planning.criteria import METRICS, STANDARD_CRITERIA, Criteria
from iriftrace.planning.objective import Objective, limits_of
from iriftrace.sweep.measures import Limits

if TYPE_CHECKING:
    import xarray as xr


# Differences, as fractions of a metric's size: due to rounding, and too small to rank by.
_ROUNDING, _LITTLE = 1e-9, 0.01

# Metrics of which a larger value is better.
_GAINS = ("coverage",)


@frozen(eq=False)
class Plan:
    """Ranking of the n poses of a sweep.

    Values of the sweep are by name of `METRICS`: in mm, and 0..1 for the coverage. They are
    normalised to 0 at the minimum and 1 at the percentile and above, or to 0 if all ranked poses
    are the same. Warnings were also issued as `IriftraceWarning`.
    """

    order: IntArray  # (m,) numbers of the ranked poses, the best first, by `Objective.order`
    score: FloatArray  # (n,) weighted sum of the costs, smallest best; NaN for unranked poses
    metrics: dict[str, FloatArray]  # (n,) each
    normalised: dict[str, FloatArray]  # (n,) each; NaN for unranked poses
    costs: dict[str, FloatArray]  # as normalised, but 1 - that for a coverage that differs
    limits: dict[str, Limits]  # minimum and percentile, without the added scatter
    upper: dict[str, float]  # percentile with it, above which poses may be discarded
    unranked: dict[int, str]  # number of each unranked pose and the reason
    constant: tuple[str, ...]  # metrics that are the same in all ranked poses; they count 0
    criteria: Criteria
    warnings: tuple[str, ...]

    @property
    def best(self) -> int:
        """Number of the best pose."""
        return int(self.order[0])

    @property
    def objective(self) -> Objective:
        """Score of any pose by the sweep's normalisation."""
        return Objective(self.criteria.weights, self.limits, self.constant, _GAINS)


def rank_poses(dataset: xr.Dataset, criteria: Criteria = STANDARD_CRITERIA) -> Plan:
    """Rank the poses of a sweep.

    The score of a pose is the weighted sum of its normalised displacement, axial and lateral
    resolution, and of 1 - its normalised coverage. Every metric is normalised between its minimum
    and its percentile over all poses that can be compared (NumPy's linear percentile). With
    ``outside="discard"`` a pose above the percentile in any metric of positive weight, also in
    coverage, is unranked; the normalisation stays that of all poses. For an ensemble the scatter
    is added to the displacement that is scored and discarded, and the means alone are normalised.

    Raises InputError if the dataset is not a sweep, or no pose can be ranked. Warns of a metric
    that is the same, or nearly the same, in all ranked poses.
    """
    criteria = in_force(criteria, dataset)
    needed = criteria.needed
    metrics, eligible, unranked = rankable(dataset, criteria, needed)
    limits = {
        name: limits_of(values[eligible], criteria.percentile) for name, values in metrics.items()
    }
    upper = {name: high for name, (_, high) in limits.items()}
    if criteria.robust:
        # The scatter of poses down the plume would stretch the scale until no other one counts.
        mean = metrics["displacement"] - scatter_added(dataset, criteria)
        limits["displacement"] = limits_of(mean[eligible], criteria.percentile)
    if criteria.outside == "discard":
        unranked |= _above_percentile(metrics, eligible, upper, criteria)
    ranked = eligible.copy()
    ranked[list(unranked)] = False
    if not ranked.any():
        raise InputError(
            "Every pose is above the percentile in some metric, so none is left to rank; "
            "clip instead of discarding.",
            code="plan.no_pose",
            argument="outside",
        )

    spreads = {name: _spread(values[ranked]) for name, values in metrics.items()}
    constant = tuple(name for name in METRICS if spreads[name] <= _ROUNDING)
    objective = Objective(criteria.weights, limits, constant, _GAINS)
    of_ranked = {name: np.where(ranked, values, np.nan) for name, values in metrics.items()}
    normalised = {name: objective.normalised(name, values) for name, values in of_ranked.items()}
    costs = {name: objective.cost(name, values) for name, values in normalised.items()}
    score = objective.weighted(costs)
    order = objective.order(of_ranked)[: np.count_nonzero(ranked)]

    messages = _of_spreads(spreads, needed, criteria, len(order))
    for message in messages:
        warn(message)
    return Plan(
        order=order,
        score=score,
        metrics=metrics,
        normalised=normalised,
        costs=costs,
        limits=limits,
        upper=upper,
        unranked=dict(sorted(unranked.items())),
        constant=constant,
        criteria=criteria,
        warnings=tuple(messages),
    )


def _above_percentile(
    metrics: Mapping[str, FloatArray],
    eligible: BoolArray,
    upper: Mapping[str, float],
    criteria: Criteria,
) -> dict[int, str]:
    """Poses above the percentile in a metric that is needed, with the reason."""
    reasons: dict[int, str] = {}
    for name in criteria.needed:
        for pose in np.flatnonzero(eligible & _above(metrics[name], upper[name])).tolist():
            reasons.setdefault(
                pose,
                f"{name} {metrics[name][pose]:.4g} is above the {criteria.percentile:g}th "
                f"percentile, {upper[name]:.4g}",
            )
    return reasons


def _of_spreads(
    spreads: Mapping[str, float], needed: Sequence[str], criteria: Criteria, count: int
) -> list[str]:
    """Sentences about metrics that do not differ, or hardly, between the ranked poses."""
    if count == 1:
        return ["Only one pose is ranked, so its score of 0 compares it with no other pose."]
    messages = []
    if same := [name for name in needed if spreads[name] <= _ROUNDING]:
        messages.append(
            f"The ranked poses ({count}) do not differ in "
            f"{', '.join(name_of(name, criteria) for name in same)}, which therefore "
            "counts 0 in the score."
        )
    little = "so their order says little."
    if len(needed) > 1:
        little = (
            "which the normalisation stretches so that it decides as much as the others; give it "
            "the weight 0 if so little does not matter."
        )
    messages += [
        f"The ranked poses differ in {name_of(name, criteria)} only by {100 * spreads[name]:.2g} "
        f"%, {little}"
        for name in needed
        if _ROUNDING < spreads[name] < _LITTLE
    ]
    return messages


def ranked_quietly(dataset: xr.Dataset, criteria: Criteria) -> Plan:
    """As `rank_poses`, without the warnings, which are issued for the ranking that is shown."""
    with without_warnings():
        return rank_poses(dataset, criteria)


def score_of(plan: Plan, metrics: Mapping[str, float]) -> float:
    """Score of a pose that is not in the sweep, by the sweep's own normalisation.

    `metrics` are its values of those of `METRICS` that have a positive weight; mm, and 0..1 for the
    coverage. NaN if one is unknown, or above the percentile if the plan discards such poses.
    """
    counted = [name for name in plan.criteria.needed if name not in plan.constant]
    values = {name: np.asarray(metrics[name], dtype=np.float64) for name in counted}
    if plan.criteria.outside == "discard" and any(
        _above(value, plan.upper[name]) for name, value in values.items()
    ):
        return math.nan
    return float(plan.objective.score(values))


def pareto_front(dataset: xr.Dataset, criteria: Criteria = STANDARD_CRITERIA) -> IntArray:
    """Numbers (k,), ascending, of poses that no other one surpasses, independent of the weights.

    A pose is left out if another one is at least as good in displacement, coverage, axial and
    lateral resolution and better in one of them. Raises InputError if the dataset is not a sweep,
    or no pose can be compared.
    """
    metrics, eligible, _ = rankable(dataset, in_force(criteria, dataset), METRICS)
    poses = np.flatnonzero(eligible)
    by_name = {**metrics, "coverage": -metrics["coverage"]}
    costs = np.stack([by_name[name][poses] for name in METRICS], axis=1)
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


def _above(values: FloatArray, upper: float) -> BoolArray:
    """True where values are above the percentile, and not only by rounding."""
    return np.asarray(values > upper + _ROUNDING * abs(upper))


def _spread(values: FloatArray) -> float:
    """Range of the known values as a fraction of the largest; 0 if there are none."""
    known = values[np.isfinite(values)]
    largest = np.abs(known).max(initial=0.0)
    return float(np.ptp(known) / largest) if largest > 0 else 0.0
