"""Score by which poses or pairs are ranked and refined: scaled quantities, weighted and summed.

A quantity is scaled to 0..1 between its minimum and a high percentile over all that is ranked, so
that quantities of different units can be weighted against each other.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
from attrs import evolve, frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.sweep.measures import Limits


@frozen(eq=False)
class Objective:
    """Weighted sum of the costs of some quantities; the smallest is the best.

    The cost of a quantity is 0 at its minimum and 1 at its percentile, or the reverse for a gain.
    """

    weights: Mapping[str, float]  # of each quantity; one of weight 0 may be unknown
    limits: Mapping[str, Limits]  # where a quantity is normalised to 0 and to 1
    constant: Collection[str] = ()  # quantities that count 0, as they are the same everywhere
    gains: Collection[str] = ()  # quantities of which a larger value is better
    clipped: bool = True  # no quantity counts less than its minimum or more than its percentile

    def normalised(self, name: str, values: FloatArray) -> FloatArray:
        """A quantity's values between its limits; NaN stays NaN."""
        if name in self.constant:
            return 0.0 * values
        lower, upper = self.limits[name]
        if upper > lower:
            scaled = (values - lower) / (upper - lower)
            return np.clip(scaled, 0.0, 1.0) if self.clipped else scaled
        # The limit of a vanishing interval: nearly all have the minimum.
        return np.where(np.isfinite(values), np.where(values > lower, 1.0, 0.0), np.nan)

    def cost(self, name: str, normalised: FloatArray) -> FloatArray:
        """What normalised values of a quantity cost; the smaller the better."""
        return 1 - normalised if name in self.gains and name not in self.constant else normalised

    def weighted(self, costs: Mapping[str, FloatArray]) -> FloatArray:
        """Weighted sum of costs."""
        terms = [self.weights[name] * cost for name, cost in costs.items() if self.weights[name]]
        return np.asarray(np.sum(terms, axis=0))

    def score(self, quantities: Mapping[str, FloatArray]) -> FloatArray:
        """Score of the values of some quantities; those left out count 0."""
        return self.weighted(
            {name: self.cost(name, self.normalised(name, q)) for name, q in quantities.items()}
        )

    def order(self, quantities: Mapping[str, FloatArray]) -> IntArray:
        """Places of values by their score, the smallest first and NaN last.

        Clipping makes all beyond a limit equal; then the smaller unclipped score is first.
        """
        unclipped = evolve(self, clipped=False).score(quantities)
        return np.lexsort((unclipped, self.score(quantities))).astype(np.int64)


def limits_of(values: FloatArray, percentile: float) -> Limits:
    """Minimum and percentile of the known values (NumPy's linear percentile)."""
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return math.nan, math.nan
    return float(known.min()), float(np.percentile(known, percentile))
