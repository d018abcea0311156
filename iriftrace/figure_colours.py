"""Colours of shells: linear in the air's refractivity, labelled by its temperature."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import FuncNorm
from numpy.typing import NDArray

from iriftrace.shell_stack import ShellStack
from iriftrace.units import ZERO_CELSIUS_K

FloatArray = NDArray[np.float64]


def celsius_of(shells: ShellStack) -> FloatArray:
    """(shells,) array, degC: temperature of the air at each surface."""
    return shells.temperature_k - ZERO_CELSIUS_K


def temperature_norm(shells: ShellStack) -> FuncNorm:
    """Colours over temperature (degC) that are linear in 1/T, hence in the refractivity."""
    celsius = celsius_of(shells)
    low, high = float(celsius.min()), float(celsius.max())
    if high - low < 1.0:
        low, high = low - 10.0, high + 10.0
    return FuncNorm(
        (
            lambda t: -1.0 / (np.asarray(t) + ZERO_CELSIUS_K),
            lambda u: -1.0 / np.asarray(u) - ZERO_CELSIUS_K,
        ),
        low,
        high,
    )


def temperature_ticks(norm: FuncNorm) -> list[float]:
    """Round temperatures that do not crowd the colour bar."""
    rounds = np.array([20, 30, 40, 50, 75, 100, 150, 200, 300, 400, 500, 700, 1000, 1500, 2000])
    low, high = (float(t) for t in norm.inverse(np.array((0.0, 1.0))))
    inside = rounds[(rounds >= low) & (rounds <= high)]
    ticks: list[float] = []
    for tick in inside.tolist():
        if not ticks or norm(tick) - norm(ticks[-1]) > 0.045:
            ticks.append(tick)
    return ticks if len(ticks) > 1 else [round(low), round(high)]
