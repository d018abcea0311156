"""Whether the flow stands still: heat from the wall and temperatures in the plume over a while."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.openfoam.case import Case
from iriftrace.openfoam.log import read_heat, read_plume

FloatArray = NDArray[np.float64]

STEADY_HEAT, STEADY_PLUME = 0.02, 0.01
"""Steady is what varies less: heat flow by its share, the plume by this share of the heating."""


@frozen
class Steadiness:
    """Heat flow and plume over some time.

    Attributes
    ----------
    heat_w
        Mean heat flow from the whole part to the air, W.
    heat_variation
        Largest minus smallest heat flow, as a share of the mean.
    plume_swing_k
        Largest minus smallest temperature at the restless one of the points in the plume, K.
    steady
        Whether both are small.
    """

    heat_w: float
    heat_variation: float
    plume_swing_k: float
    steady: bool

    @property
    def text(self) -> str:
        """In words, for results and for the field's origin."""
        state = "steady" if self.steady else "NOT STEADY"
        return (
            f"{state} (heat flow varies by {self.heat_variation:.1%}, plume by "
            f"{self.plume_swing_k:.0f} K)"
        )


def judge_steadiness(case: Case, folder: Path, window: tuple[float, float]) -> Steadiness | None:
    """Look at the heat flow and at the plume between two times; None while too little is there."""
    heat = _within(read_heat(folder), window)
    plume = _within(read_plume(folder), window)
    if len(heat) < 3 or len(plume) < 3:
        return None
    watts = heat[:, 1] * 2 ** len(case.mirrors)
    mean = float(watts.mean())
    variation = float(np.ptp(watts)) / abs(mean) if mean else np.inf
    swing = float(np.ptp(plume[:, 1:], axis=0).max())
    heating = case.wall.hottest - case.ambient_k
    return Steadiness(
        heat_w=mean,
        heat_variation=variation,
        plume_swing_k=swing,
        steady=variation <= STEADY_HEAT and swing <= STEADY_PLUME * heating,
    )


def _within(rows: FloatArray, window: tuple[float, float]) -> FloatArray:
    if not len(rows):
        return rows
    chosen: FloatArray = rows[(rows[:, 0] >= window[0]) & (rows[:, 0] <= window[1] * (1 + 1e-9))]
    return chosen
