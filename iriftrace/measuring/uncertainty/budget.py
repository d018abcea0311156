"""Uncertainty of one value from independent groups of inputs, by Monte Carlo (JCGM 101:2008).

A value is y plus one term for each group, and the variances of the groups add up. All but the air
are normal. Air that is like the members of an ensemble or lies between them is not, and some groups
scale its effect, whichever it is:

    Y = y + s Z + (1 + r Z') sum_i w_i x_i - sum_i E w_i x_i,   Z, Z' normal, w Dirichlet(c E w),

where x_i is the effect in the air of member i of n, r the relative standard uncertainty by what
scales it, and c that of
:func:`iriftrace.core.member_weights.concentration`. For two equal weights w is uniform. The
interval is the probabilistically symmetric one of a scrambled Sobol sequence, which is repeated and
doubled until the scatter of its ends is below half a digit of U.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import numpy as np
from attrs import field, frozen
from scipy.special import gammaincinv, gammaln, ndtri

from iriftrace.core.arrays import FloatArray
from iriftrace.core.member_weights import concentration
from iriftrace.core.plain import JsonObject

COVERED = 0.9544997361036416
"""Probability of the interval: that of a normal distribution within k = 2."""

SCRAMBLINGS, DRAWS, MOST_DRAWS = 8, 2**11, 2**15
"""Number of Sobol sequences, and of the draws of each at first and at most."""

SEED = 20251663
"""Seed of the scramblings, so that the same inputs give the same digits."""

EvaluationType = Literal["A", "B"]
"""Evaluation of an uncertainty: from statistics, or from other knowledge (GUM, 3.3.4)."""


def _size(u: float) -> float:
    return abs(float(u))


@frozen
class Contribution:
    """Standard uncertainty of a value by one group of inputs, in the value's unit."""

    group: str
    u: float = field(converter=_size)
    kind: EvaluationType = "B"
    source: str = ""


@frozen(eq=False)
class Mixture:
    """A group whose effect is a mixture of members, and the groups by which this effect scales.

    Attributes
    ----------
    group : str
    weights : (k,) array
        Of the mean; those of members that it does not have are 0.
    values : (k,) array
        Effect of each member, 0 without hot air, in the value's unit.
    scaled : tuple of str
        Groups that scale the effect of the real air, whichever mixture it is.
    relative : float
        Standard uncertainty of the effect by all of them, as a fraction.
    """

    group: str
    weights: FloatArray
    values: FloatArray
    scaled: tuple[str, ...] = ()
    relative: float = 0.0

    def as_dict(self, unit: str) -> JsonObject:
        """Plain JSON values, of the members that the mean has."""
        used = self.weights > 0.0
        weights, values = self.weights[used].tolist(), self.values[used].tolist()
        return {
            "group": self.group,
            "weights": weights,
            f"values_{unit}": values,
            "scaled": list(self.scaled),
            "relative": self.relative,
        }

    @classmethod
    def of(cls, row: JsonObject, unit: str) -> Mixture:
        """The mixture that plain JSON values state; LookupError, TypeError or ValueError else."""
        values = np.array(row[f"values_{unit}"], dtype=np.float64)
        weights = np.array(row["weights"], dtype=np.float64)
        return cls(row["group"], weights, values, tuple(row["scaled"]), row["relative"])


@frozen
class Uncertainty:
    """Uncertainty of a corrected value, in its unit.

    Attributes
    ----------
    value : float
        Best estimate.
    contributions : tuple of Contribution
        The largest first.
    interval : tuple of two float
        Ends between which the true value lies with the probability `COVERED`.
    missing : tuple of str
        Groups that are not known, so that U is a lower bound.
    mixture : Mixture or None
        Distribution of the contribution that is not normal.
    """

    value: float
    contributions: tuple[Contribution, ...]
    interval: tuple[float, float]
    missing: tuple[str, ...] = ()
    mixture: Mixture | None = field(default=None, eq=False)

    @property
    def parts(self) -> dict[str, float]:
        """Standard uncertainties by group, the largest first."""
        return {one.group: one.u for one in self.contributions}

    @property
    def standard(self) -> float:
        """Combined standard uncertainty."""
        return math.hypot(*self.parts.values())

    @property
    def normal(self) -> float:
        """Standard uncertainty by the groups that do not depend on the mixture."""
        return _normal(self.contributions, self.mixture)

    @property
    def expanded(self) -> float:
        """U: the larger distance of the interval's ends from the value."""
        return max(self.interval[1] - self.value, self.value - self.interval[0])

    @property
    def coverage_factor(self) -> float:
        """k = U / u."""
        return self.expanded / self.standard if self.standard else 2.0

    def share(self, one: Contribution) -> float:
        """Fraction of the variance by one group."""
        return (one.u / self.standard) ** 2 if self.standard else 0.0

    def as_dict(self, unit: str) -> JsonObject:
        """Plain JSON values; `unit` is part of the keys."""
        rows = [
            {
                "group": one.group,
                f"u_{unit}": one.u,
                "share": self.share(one),
                "type": one.kind,
                "source": one.source,
            }
            for one in self.contributions
        ]
        return {
            f"value_{unit}": self.value,
            f"U_{unit}": self.expanded,
            "k": self.coverage_factor,
            f"interval_{unit}": list(self.interval),
            "contributions": rows,
            "not_covered": list(self.missing),
            **({} if self.mixture is None else {"mixture": self.mixture.as_dict(unit)}),
        }

    @classmethod
    def of(cls, row: JsonObject, unit: str) -> Uncertainty:
        """The uncertainty that plain JSON values state; LookupError or TypeError for others."""
        contributions = tuple(
            Contribution(one["group"], one[f"u_{unit}"], one["type"], one["source"])
            for one in row["contributions"]
        )
        low, high = row[f"interval_{unit}"]
        mixture = Mixture.of(row["mixture"], unit) if "mixture" in row else None
        missing = tuple(row["not_covered"])
        return cls(row[f"value_{unit}"], contributions, (low, high), missing, mixture)


def uncertainty_of(
    value: float,
    contributions: Sequence[Contribution],
    mixture: Mixture | None = None,
    missing: Sequence[str] = (),
) -> Uncertainty:
    """Combine independent groups.

    Parameters
    ----------
    value : float
    contributions : sequence of Contribution
    mixture : Mixture, optional
        Distribution of the one of them that is not normal.
    missing : sequence of str
        Groups that are not known.
    """
    listed = sorted((one for one in contributions if one.u > 0.0), key=lambda one: -one.u)
    if mixture is None:
        half = 2.0 * math.hypot(*(one.u for one in listed))
        low, high = -half, half
    else:
        low, high = _interval(_normal(listed, mixture), mixture)
    return Uncertainty(value, tuple(listed), (value + low, value + high), tuple(missing), mixture)


def _normal(contributions: Sequence[Contribution], mixture: Mixture | None) -> float:
    """Standard uncertainty by the groups that do not depend on a mixture."""
    of_mixture = () if mixture is None else (mixture.group, *mixture.scaled)
    return math.hypot(*(one.u for one in contributions if one.group not in of_mixture))


def _interval(normal: float, mixture: Mixture) -> tuple[float, float]:
    """Ends, relative to the mean, of the sum of a mixture and a normal variable."""
    tails = [0.5 * (1.0 - COVERED), 0.5 * (1.0 + COVERED)]
    draws = DRAWS
    while True:
        change, u, z = drawn(normal, mixture, draws)
        ends = np.quantile(change + u * z, tails, axis=1)
        low, high = ends.mean(axis=1)
        scatter = 2.0 * float(ends.std(axis=1, ddof=1).max()) / math.sqrt(SCRAMBLINGS)
        if scatter < half_a_digit(max(high, -low)) or draws >= MOST_DRAWS:
            return float(low), float(high)
        draws *= 2


def half_a_digit(expanded: float) -> float:
    """Half of the last of the two digits with which an uncertainty is stated."""
    return 0.5 * 10.0 ** (math.floor(math.log10(expanded)) - 1) if expanded > 0.0 else math.inf


def drawn(normal: float, mixture: Mixture, draws: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Changes x, standard deviations u and unit normal variables z (SCRAMBLINGS, draws).

    A deviation from the mean is x + u z: x by the mixture, u by what scales its effect together
    with the other groups, whose standard uncertainty is `normal`.
    """
    used = mixture.weights > 0.0
    z, shares = _unit_draws(tuple(map(float, mixture.weights[used])), draws)
    effect = shares @ mixture.values[used]
    change = effect - mixture.weights @ mixture.values
    return change, np.hypot(normal, mixture.relative * effect), z


@lru_cache(maxsize=8)
def _unit_draws(weights: tuple[float, ...], draws: int) -> tuple[FloatArray, FloatArray]:
    """A normal variable (s, draws) and Dirichlet's weights (s, draws, n) of the mean `weights`."""
    from scipy.stats import qmc  # half a second, which reading of tolerances need not take

    generators = np.random.default_rng(SEED).spawn(SCRAMBLINGS)
    units = np.array(
        [qmc.Sobol(len(weights) + 1, rng=generator).random(draws) for generator in generators]
    )
    units = np.clip(units, 1e-12, 1.0 - 1e-12)
    return ndtri(units[..., 0]), dirichlet(np.array(weights), units[..., 1:])


def dirichlet(weights: FloatArray, units: FloatArray) -> FloatArray:
    """Dirichlet's weights (..., n) with the means (n,), all positive, from uniform draws in 0..1.

    Their parameters are the means times :func:`iriftrace.core.member_weights.concentration`.
    """
    shape = concentration(len(weights)) * weights
    gammas = gammaincinv(shape, units)
    # Gamma variables of small shapes underflow; there P(a, x) = x^a / Gamma(a + 1).
    small = (np.log(units) + gammaln(shape + 1.0)) / shape
    logarithms = np.where(gammas > 1e-8, np.log(np.maximum(gammas, 1e-8)), small)
    gammas = np.exp(logarithms - logarithms.max(axis=-1, keepdims=True))
    return np.asarray(gammas / gammas.sum(axis=-1, keepdims=True))
