"""Colour scales of figures and the round numbers on them."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Limits = tuple[float, float]


def colour_norm(limits: Limits) -> Normalize:
    """Logarithmic between two positive limits; linear from 0."""
    # Clipped, because a ray that crosses no shell has a displacement of 0, which has no logarithm:
    # it would leave a hole in the part.
    return LogNorm(*limits, clip=True) if limits[0] > 0.0 else Normalize(*limits)


def round_ticks(limits: Limits) -> FloatArray:
    """Round numbers between two limits that label a colour bar without crowding it."""
    low, high = limits
    if low > 0.0:
        decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
        for steps in ((1,), (1, 3), (1, 2, 5), (1, 1.5, 2, 3, 5, 7)):
            ticks = np.outer(decades, steps).ravel()
            ticks = ticks[(ticks >= low) & (ticks <= high)]
            if len(ticks) >= 5:
                return np.asarray(ticks, dtype=np.float64)
    return even_ticks(limits)


def even_ticks(limits: Limits) -> FloatArray:
    """Round numbers at equal steps between two limits."""
    low, high = limits
    ticks = np.asarray(MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(low, high))
    return ticks[(ticks >= low) & (ticks <= high)]
