"""Stability of a plan's best pose: other weights, and poses that score nearly as well."""

from __future__ import annotations

import numpy as np
from attrs import evolve, frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.planning.rank import Plan

_VARIED = 0.5
"""Fraction by which weights vary."""

# Scores that differ by less than this fraction of the sum of the weights differ by rounding.
_EQUAL_SCORES = 1e-12

# Scores that differ by less than this fraction of the sum of the weights are not decisive.
_CLOSE_SCORES = 0.03

# Different coverages: one view sees twice as much, and not only of next to nothing.
_OTHER_RATIO = 2.0
_OTHER_DIFFERENCE = 0.05


@frozen(eq=False)
class Stability:
    """Ranks of a plan's best pose when the weights vary by half.

    Ranks (1: still the best) and winners are for the one weight made smaller, and larger. The k
    rivals are all poses that are better than the best one for some weights within the range, if
    all weights vary at once; its rank is never worse than k + 1.
    """

    ranks: dict[str, tuple[int, int]]  # of the pose that is the best by the plan
    winners: dict[str, tuple[int, int]]  # number of the best pose then
    rivals: IntArray  # (k,), numbers

    @property
    def worst_rank(self) -> int:
        """Worst rank of the best pose when one weight varies."""
        return max(rank for pair in self.ranks.values() for rank in pair)


def stability(plan: Plan) -> Stability:
    """Compute the rank of a plan's best pose when weights vary.

    The score is linear in the weights, so a pose beats another somewhere in the box of weights if
    it does so where each weight is at the end that favours it.
    """
    weights = {name: weight for name, weight in plan.criteria.weights.items() if weight > 0}
    equal = _EQUAL_SCORES * sum(weights.values())
    costs = {name: plan.costs[name][plan.order] for name in weights}
    objective, ranks, winners = plan.objective, {}, {}
    lead = np.zeros(len(plan.order))
    for name, weight in weights.items():
        factors = (1 - _VARIED, 1 + _VARIED)
        scores = [
            evolve(objective, weights={**weights, name: weight * factor}).weighted(costs)
            for factor in factors
        ]
        smaller, larger = (1 + int(np.count_nonzero(s < s[0] - equal)) for s in scores)
        ranks[name] = smaller, larger
        smaller, larger = (int(plan.order[np.argmin(s)]) for s in scores)
        winners[name] = smaller, larger
        behind = weight * (costs[name][0] - costs[name])
        lead += behind + _VARIED * np.abs(behind)
    return Stability(ranks, winners, plan.order[lead > equal])


def close_alternative(plan: Plan) -> int | None:
    """Number of the best pose with nearly the winner's score and far larger or smaller coverage.

    None if the winner is clear, or the coverage is unknown.
    """
    behind = plan.score[plan.order] - plan.score[plan.best]
    coverage = plan.metrics["coverage"][plan.order]
    margin = _CLOSE_SCORES * sum(plan.criteria.weights.values())
    near = behind <= margin * (1 + _EQUAL_SCORES)
    found = plan.order[far_apart(coverage[0], coverage) & near]
    return int(found[0]) if len(found) else None


def far_apart(coverage: float, others: FloatArray) -> BoolArray:
    """True if one coverage is at least twice the other, and they differ by 5 % of the area."""
    low, high = np.minimum(others, coverage), np.maximum(others, coverage)
    return (high >= _OTHER_RATIO * low) & (high - low >= _OTHER_DIFFERENCE)
