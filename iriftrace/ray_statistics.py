"""Numbers that stand for those of many rays, and from how many on they may."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FEWEST_RAYS = 100
"""A metric of fewer good rays is null, and a pose with fewer of them counts as empty."""

STATISTICS = ("mean", "median", "p95", "max")
"""Keys of `statistics`."""


def statistics(values: NDArray[np.float64]) -> dict[str, float]:
    """Mean, median, 95th percentile and largest of some values, (n,) array with n > 0.

    A few silhouette rays jump by millimetres and rule the mean, so the median stands beside it.
    """
    median, p95 = np.percentile(values, (50, 95))
    return {
        "mean": float(values.mean()),
        "median": float(median),
        "p95": float(p95),
        "max": float(values.max()),
    }


def root_mean_square(values: NDArray[np.float64]) -> float:
    """Root of the mean square of some values, (n,) array with n > 0."""
    return float(np.sqrt(np.mean(values**2)))
