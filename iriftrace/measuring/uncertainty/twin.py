"""Repeats of a real measurement against simulated ones: does the twin deserve its U?

For each feature, with the mean of real and simulated repeats,

    E = (sim - real) / sqrt(U_sim^2 + U_real^2),
    U_real = k sqrt(u_cal^2 + u_p^2 + u_b^2),    U_sim = k s_sim,

u_cal is that of the calibration, u_p the standard deviation of the real repeats, u_b entered for
all else, s_sim the standard deviation of the simulated ones. A feature passes if \\|E\\| < 1 and
u_cal / u_p + s_sim / u_p < 2: a twin that is only vague does not pass (after ISO 15530-3 and the
VDI/VDE 2630 sheets on simulation).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject, plain
from iriftrace.core.statistics import COVERAGE_FACTOR

FEWEST = 3
"""Fewest repeats with a standard deviation that means something."""


@frozen
class TwinResult:
    """Comparison of one feature, mm."""

    feature: str
    real: float
    simulated: float
    u_p: float  # standard deviation of the real repeats
    u_cal: float
    u_b: float
    u_sim: float  # standard deviation of the simulated repeats

    @property
    def e(self) -> float:
        """Normalised error E."""
        both = math.hypot(self.u_sim, self.u_cal, self.u_p, self.u_b)
        return (self.simulated - self.real) / (COVERAGE_FACTOR * both)

    @property
    def vagueness(self) -> float:
        """(u_cal + s_sim) / u_p, which must be below 2."""
        return (self.u_cal + self.u_sim) / self.u_p

    @property
    def passes(self) -> bool:
        """True if the twin agrees and is not only vague."""
        return abs(self.e) < 1.0 and self.vagueness < 2.0

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        own = {"E": self.e, "vagueness": self.vagueness, "passes": self.passes}
        return {**plain(self), **own}


def compare_twin(
    real: Mapping[str, FloatArray],
    simulated: Mapping[str, FloatArray],
    *,
    u_cal_mm: float = 0.0,
    u_b_mm: float = 0.0,
) -> tuple[TwinResult, ...]:
    """Compare repeats of features.

    Parameters
    ----------
    real, simulated : mappings of (n,) arrays, mm
        Values of each feature by its name, one a repeat.
    u_cal_mm, u_b_mm : float, mm
        Standard uncertainties of the calibration and of all else.

    Raises
    ------
    InputError
        The features are not the same, or one has fewer than `FEWEST` repeats or repeats without
        any scatter.
    """
    other = sorted(set(real) ^ set(simulated))
    if other:
        raise InputError(
            f"Only one of both tables has {', '.join(other)}; give repeats of the same features.",
            code="twin.other_features",
        )
    found = []
    for name, values in real.items():
        twin = simulated[name]
        if min(len(values), len(twin)) < FEWEST:
            raise InputError(
                f"{name} has {len(values)} real and {len(twin)} simulated repeats; give at least "
                f"{FEWEST} of both.",
                code="twin.few_repeats",
            )
        scatter = float(np.std(values, ddof=1))
        if not scatter > 0.0:
            raise InputError(
                f"All real repeats of {name} are the same, so their scatter is not known; give "
                "more digits, or measure again.",
                code="twin.no_scatter",
            )
        s_sim = float(np.std(twin, ddof=1))
        means = float(np.mean(values)), float(np.mean(twin))
        found.append(TwinResult(name, *means, scatter, u_cal_mm, u_b_mm, s_sim))
    return tuple(found)
