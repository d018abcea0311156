"""Which pose of a sweep is the best: one score of four metrics, and what it depends on.

Every metric is brought to 0..1 between its minimum and a high percentile over the ranked poses, so
that metrics of different units can be weighted against each other. The score is a sum of costs; the
smallest is the best.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.planning.candidates import (
    METRICS,
    Resolution,
    Statistic,
    Weights,
    check_choice,
    find_candidates,
)

if TYPE_CHECKING:
    import xarray as xr


# MERGE plan_stability: How sure the best pose of a plan is: other weights, and poses that score n

# Scores that differ by less than this share of the sum of the weights differ by rounding.
_EQUAL_SCORES = 1e-12

CLOSE_SCORES = 0.03
"""Scores that differ by less than this share of the sum of the weights do not settle anything."""

# Coverages of another kind: one view sees twice as much, and not just of next to nothing.
_OTHER_RATIO = 2.0
_OTHER_DIFFERENCE = 0.05


@frozen(eq=False)
class Stability:
    """What becomes of a plan's best pose when the weights vary.

    Attributes
    ----------
    share : float
        By how much a weight varies, 0.5 for +-50 %.
    ranks : dict of (2,) tuples of int
        Rank of the best pose (1: still the best) when this one weight is smaller and larger.
    winners : dict of (2,) tuples of int
        Number of the best pose then.
    rivals : (k,) array of int
        All poses that are better than the best one for some weights within the share, when all
        weights vary at once; its rank is never worse than k + 1.
    """

    share: float
    ranks: dict[str, tuple[int, int]]
    winners: dict[str, tuple[int, int]]
    rivals: IntArray

    @property
    def worst_rank(self) -> int:
        """Worst rank of the best pose when one weight varies."""
        return max(rank for pair in self.ranks.values() for rank in pair)


@frozen(eq=False)
class Alternative:
    """A pose that scores nearly as well as the best one and shows something else.

    Attributes
    ----------
    pose : int
        Its number.
    behind : float
        By how much its score is worse.
    coverage, best_coverage : float
        0..1, its own and that of the best pose.
    """

    pose: int
    behind: float
    coverage: float
    best_coverage: float


def stability(plan: Plan, share: float = 0.5) -> Stability:
    """Tell how a plan's best pose fares when the weights vary.

    The score is linear in the weights, so a pose beats another somewhere in the box of weights if
    it does where each weight is at the end that favours it.

    Parameters
    ----------
    plan
        The plan.
    share
        By how much each weight varies, above 0 and below 1.

    Raises
    ------
    InputError
        If the share is out of range.
    """
    if not 0 < share < 1:
        raise InputError(
            f"The weights are to vary by {share}, which leaves none of them or changes nothing; "
            "give a share between 0 and 1."
        )
    weights = {name: weight for name, weight in plan.weights.as_dict().items() if weight > 0}
    equal = _EQUAL_SCORES * sum(weights.values())
    costs = {name: plan.costs[name][plan.order] for name in weights}
    ranks, winners = {}, {}
    for name, weight in weights.items():
        scores = [
            _stability_score(costs, {**weights, name: weight * factor})
            for factor in (1 - share, 1 + share)
        ]
        smaller, larger = (1 + int(np.count_nonzero(s < s[0] - equal)) for s in scores)
        ranks[name] = smaller, larger
        smaller, larger = (int(plan.order[np.argmin(s)]) for s in scores)
        winners[name] = smaller, larger
    lead = np.zeros(len(plan.order))
    for name, weight in weights.items():
        behind = weight * (costs[name][0] - costs[name])
        lead += behind + share * np.abs(behind)
    return Stability(share, ranks, winners, plan.order[lead > equal])


def close_alternative(plan: Plan) -> Alternative | None:
    """The best of the poses that score nearly as well as the winner and cover far more or less.

    Nearly means within `CLOSE_SCORES`; far means at least twice or at most half the coverage, and
    5 % of the area.

    Returns
    -------
    Alternative or None
        None if the winner is clear, or the coverage is unknown.
    """
    behind = plan.score[plan.order] - plan.score[plan.best]
    coverage = plan.metrics["coverage"][plan.order]
    margin = CLOSE_SCORES * sum(plan.weights.as_dict().values())
    low, high = np.minimum(coverage, coverage[0]), np.maximum(coverage, coverage[0])
    other = (high >= _OTHER_RATIO * low) & (high - low >= _OTHER_DIFFERENCE)
    found = np.flatnonzero(other & (behind <= margin * (1 + _EQUAL_SCORES)))
    if len(found) == 0:
        return None
    first = int(found[0])
    return Alternative(
        pose=int(plan.order[first]),
        behind=float(behind[first]),
        coverage=float(coverage[first]),
        best_coverage=float(coverage[0]),
    )


def _stability_score(costs: dict[str, FloatArray], weights: dict[str, float]) -> FloatArray:
    total: FloatArray = np.sum([weight * costs[name] for name, weight in weights.items()], axis=0)
    return total


Outside = Literal["clip", "discard"]
"""What becomes of a pose with a metric above the percentile: counts as 1, or is not ranked."""

# Metrics that differ by less than this share of their size differ by rounding.
_ROUNDING = 1e-9

# Metrics that differ by less than this share of their size hardly tell poses apart.
_LITTLE = 0.01


@frozen(eq=False)
class Plan:
    """Ranking of the n poses of a sweep.

    Attributes
    ----------
    order : (m,) array of int
        Numbers of the ranked poses, the best first; of equal poses, the earlier one first.
    score : (n,) array
        Weighted sum of the costs, smallest best; NaN for unranked poses.
    metrics : dict of (n,) arrays
        The values of the sweep, for each of `METRICS`; mm, and 0..1 for the coverage.
    normalised : dict of (n,) arrays
        The same, 0 at the minimum and 1 at the percentile and above; 0 where all ranked poses are
        the same, NaN for unranked poses.
    costs : dict of (n,) arrays
        What the weights multiply: `normalised`, but 1 - normalised for the coverage, unless it is
        the same in all ranked poses.
    limits : dict of (2,) tuples
        Minimum and percentile of each metric.
    unranked : dict
        Number of each unranked pose and why it is not ranked.
    constant : tuple of str
        Metrics that are the same in all ranked poses; they count 0.
    weights : Weights
    percentile : float
    statistic, resolution, region, outside : str
        What was compared, as given to `rank_poses`.
    min_hits : int
    min_coverage : float
    warnings : tuple of str
        What was also issued as `IriftraceWarning`.
    """

    order: IntArray
    score: FloatArray
    metrics: dict[str, FloatArray]
    normalised: dict[str, FloatArray]
    costs: dict[str, FloatArray]
    limits: dict[str, tuple[float, float]]
    unranked: dict[int, str]
    constant: tuple[str, ...]
    weights: Weights
    percentile: float
    statistic: Statistic
    resolution: Resolution
    region: str
    outside: Outside
    min_hits: int
    min_coverage: float
    warnings: tuple[str, ...]

    @property
    def best(self) -> int:
        """Number of the best pose."""
        return int(self.order[0])


def rank_poses(
    dataset: xr.Dataset,
    *,
    weights: Weights | None = None,
    statistic: Statistic = "mean",
    resolution: Resolution = "step",
    region: str = "part",
    percentile: float = 95.0,
    outside: Outside = "clip",
    min_hits: int = 100,
    min_coverage: float = 0.0,
) -> Plan:
    """Rank the poses of a sweep.

    The score of a pose is the weighted sum of its normalised displacement, axial and lateral
    resolution, and of 1 - its normalised coverage. Every metric is normalised between its minimum
    and its percentile over all poses that can be compared (NumPy's linear percentile).

    Parameters
    ----------
    dataset
        A sweep.
    weights
        The paper's by default. A metric of weight 0 is not needed for a pose to be ranked.
    statistic
        Of the displacements in one view; median and p95 forgive a few wild rays.
    resolution
        Definition of the resolution.
    region
        ``part`` (all of it), or the region that matters.
    percentile
        Where a normalised metric reaches 1.
    outside
        ``discard``: a pose above the percentile in any metric of positive weight, also in coverage,
        is unranked; the normalisation stays that of all poses.
    min_hits
        Poses with fewer good rays on the region are unranked and stay out of the normalisation.
    min_coverage
        Likewise poses that see a smaller share of the region's area, 0..1. A small displacement
        or a fine resolution can outweigh that hardly anything is seen.

    Raises
    ------
    InputError
        An option is wrong, the dataset is not a sweep, or no pose can be ranked.

    Warns
    -----
    IriftraceWarning
        A metric is the same, or nearly the same, in all ranked poses.
    """
    weights = Weights() if weights is None else weights
    check_choice("outside", outside, get_args(Outside))
    if not 0 < percentile <= 100:
        raise InputError(
            f"The percentile is {percentile}, so no metric can be normalised; give a number above "
            "0 and up to 100."
        )
    needed = [name for name, weight in weights.as_dict().items() if weight > 0]
    found = find_candidates(dataset, statistic, resolution, region, min_hits, min_coverage, needed)
    limits = {
        name: _limits(values[found.eligible], percentile) for name, values in found.metrics.items()
    }
    unranked = dict(found.reasons)
    if outside == "discard":
        for name in needed:
            upper = limits[name][1]
            above = found.eligible & (found.metrics[name] > upper + _ROUNDING * abs(upper))
            for pose in np.flatnonzero(above).tolist():
                unranked.setdefault(
                    pose,
                    f"{name} {found.metrics[name][pose]:.4g} is above the {percentile:g}th "
                    f"percentile, {upper:.4g}",
                )
    ranked = np.ones(len(found.eligible), dtype=np.bool_)
    ranked[list(unranked)] = False
    if not ranked.any():
        raise InputError(
            "Every pose is above the percentile in some metric, so none is left to rank; "
            "clip instead of discarding."
        )

    constant = tuple(name for name in METRICS if _is_constant(found.metrics[name][ranked]))
    normalised, costs = {}, {}
    for name, values in found.metrics.items():
        scaled = 0 * values if name in constant else _normalise(values, *limits[name])
        normalised[name] = np.where(ranked, scaled, np.nan)
        costs[name] = _cost(name, normalised[name], constant)
    score = _score(costs, {name: weights.as_dict()[name] for name in needed})
    order = np.argsort(score, kind="stable")[: np.count_nonzero(ranked)]

    messages = []
    if same := [name for name in needed if name in constant]:
        messages.append(
            f"The ranked poses ({len(order)}) do not differ in {', '.join(same)}, which therefore "
            "counts 0 in the score."
        )
    for name in needed:
        spread = _spread(found.metrics[name][ranked])
        if name not in constant and spread < _LITTLE:
            messages.append(
                f"The ranked poses differ in {name} by {100 * spread:.2g} % only, which the "
                "normalisation stretches so that it decides as much as the others; give it the "
                "weight 0 if so little does not matter."
            )
    for message in messages:
        warnings.warn(message, IriftraceWarning, stacklevel=2)
    return Plan(
        order=order.astype(np.int64),
        score=score,
        metrics=found.metrics,
        normalised=normalised,
        costs=costs,
        limits=limits,
        unranked=dict(sorted(unranked.items())),
        constant=constant,
        weights=weights,
        percentile=percentile,
        statistic=statistic,
        resolution=resolution,
        region=region,
        outside=outside,
        min_hits=min_hits,
        min_coverage=min_coverage,
        warnings=tuple(messages),
    )


def score_of(plan: Plan, metrics: Mapping[str, float]) -> float:
    """Score of a pose that is not in the sweep, by the sweep's own normalisation.

    Parameters
    ----------
    plan
        The ranking of the sweep.
    metrics
        The pose's value of each of `METRICS` that has a positive weight; mm, and 0..1 for the
        coverage.

    Returns
    -------
    float
        As `Plan.score`. NaN if a value is unknown, or where the plan discards poses above the
        percentile and this one is.
    """
    total = 0.0
    for name, weight in plan.weights.as_dict().items():
        if weight == 0 or name in plan.constant:
            continue
        value = np.array([metrics[name]], dtype=np.float64)
        lower, upper = plan.limits[name]
        if plan.outside == "discard" and value[0] > upper + _ROUNDING * abs(upper):
            return math.nan
        total += weight * float(_cost(name, _normalise(value, lower, upper), plan.constant)[0])
    return total


def _limits(values: FloatArray, percentile: float) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return math.nan, math.nan
    return float(known.min()), float(np.percentile(known, percentile))


def _normalise(values: FloatArray, lower: float, upper: float) -> FloatArray:
    if upper > lower:
        scaled: FloatArray = np.clip((values - lower) / (upper - lower), 0.0, 1.0)
        return scaled
    # The limit of a vanishing interval: nearly all poses share the minimum.
    return np.where(np.isfinite(values), np.where(values > lower, 1.0, 0.0), np.nan)


def _cost(name: str, normalised: FloatArray, constant: Collection[str]) -> FloatArray:
    return 1 - normalised if name == "coverage" and name not in constant else normalised


def _is_constant(values: FloatArray) -> bool:
    return _spread(values) <= _ROUNDING


def _spread(values: FloatArray) -> float:
    """Range of the known values as a share of the largest; 0 if there are none."""
    known = values[np.isfinite(values)]
    largest = np.abs(known).max(initial=0.0)
    return float(np.ptp(known) / largest) if largest > 0 else 0.0


def _score(costs: dict[str, FloatArray], weights: dict[str, float]) -> FloatArray:
    terms: FloatArray = np.stack([weight * costs[name] for name, weight in weights.items()])
    total: FloatArray = terms.sum(axis=0)
    return total
