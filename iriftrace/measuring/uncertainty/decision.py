"""Conformity of a value to its tolerance, by JCGM 106:2012 and ISO 14253-1:2017.

Conformity is proven if the probability that the true value lies outside the tolerance is at most
`RISK`, and so is its contrary; else nothing is decided. For a normal distribution this is the guard
band of 1.65 u of ISO 14253-1.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from attrs import Attribute, field, frozen
from scipy.special import ndtr

from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.measuring.uncertainty.budget import DRAWS, Uncertainty, drawn

RISK = 0.05
"""Largest probability of a wrong acceptance or rejection."""

SMALLEST_U = 1e-300
"""In place of a standard uncertainty of 0, with which a value lies inside or outside."""

Verdict = Literal["accepted", "rejected", "not decided"]


@frozen
class Tolerance:
    """Nominal value and limit deviations of a value, in its unit.

    Attributes
    ----------
    nominal, lower, upper : float
        The value must lie between nominal + lower and nominal + upper.
    """

    nominal: float
    lower: float = field()
    upper: float = field()

    @upper.validator
    def _check(self, _: Attribute[float], upper: float) -> None:
        values = (self.nominal, self.lower, upper)
        if not (all(map(math.isfinite, values)) and self.lower < upper):
            raise InputError(
                f"The tolerance {self.nominal:g} {self.lower:+g} {upper:+g} has no width; give the "
                "nominal value, the lower deviation and a larger upper one.",
                code="tolerance.no_width",
                argument="tolerance",
            )

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest value that conform."""
        return self.nominal + self.lower, self.nominal + self.upper

    def holds(self, value: float) -> bool:
        """True for a value within the limits."""
        low, high = self.limits
        return low <= value <= high


def _outside(tolerance: Tolerance, uncertainty: Uncertainty) -> float:
    """Probability that the true value does not conform."""
    low, high = tolerance.limits
    change, u = np.zeros(1), np.full(1, uncertainty.normal)
    if uncertainty.mixture is not None:
        change, u, _ = drawn(uncertainty.normal, uncertainty.mixture, DRAWS)
    places, u = uncertainty.value + change, np.maximum(u, SMALLEST_U)
    return float(np.mean(ndtr((low - places) / u) + ndtr((places - high) / u)))


@frozen
class Decision:
    """Verdict on a value.

    Attributes
    ----------
    verdict : str
        "accepted", "rejected" or "not decided".
    outside : float
        Probability that the true value does not conform.
    reason : str
        Why nothing is decided although U is known for a part; else "".
    measured : bool or None
        Whether the value as measured, in hot air, lies within the limits; None if not known. Of an
        expanded part the measured value scaled to the drawing.
    """

    tolerance: Tolerance
    verdict: Verdict
    outside: float
    reason: str = ""
    measured: bool | None = None

    @property
    def risk(self) -> float | None:
        """Probability that the verdict is wrong; None without one."""
        if self.verdict == "not decided":
            return None
        return self.outside if self.verdict == "accepted" else 1.0 - self.outside

    @classmethod
    def of(cls, row: JsonObject) -> Decision:
        """The verdict that plain JSON values state; LookupError or TypeError for others."""
        return cls(
            Tolerance(row["nominal"], *row["deviations"]),
            row["verdict"],
            row["probability_outside"],
            row["reason"],
            row["as_measured_within"],
        )

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        return {
            "nominal": self.tolerance.nominal,
            "deviations": [self.tolerance.lower, self.tolerance.upper],
            "verdict": self.verdict,
            "probability_outside": self.outside,
            "risk": self.risk,
            "reason": self.reason,
            "as_measured_within": self.measured,
        }


def decide(
    tolerance: Tolerance, uncertainty: Uncertainty, measured: float | None = None
) -> Decision:
    """The verdict on a value with an uncertainty.

    An uncertainty of which a group is not known is a lower bound, with which nothing is decided.
    `measured` is the value in hot air, `Quantity.uncorrected`.
    """
    inside = None if measured is None else tolerance.holds(measured)
    outside = _outside(tolerance, uncertainty)
    if uncertainty.missing:
        reason = f"not known: {', '.join(uncertainty.missing)}"
        return Decision(tolerance, "not decided", outside, reason, inside)
    verdict: Verdict = "not decided"
    if outside <= RISK:
        verdict = "accepted"
    elif outside >= 1.0 - RISK:
        verdict = "rejected"
    return Decision(tolerance, verdict, outside, "", inside)
