"""Statistics of an array by their names."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from iriftrace.core.arrays import FloatArray

COVERAGE_FACTOR = 2.0
"""Expanded uncertainty over standard uncertainty."""

SPREAD = ("mean", "median", "p95", "rms", "min", "max")


def rms(values: FloatArray) -> float:
    """Root of the mean square of an (n,) array, or of the lengths of (n, k) vectors."""
    squares = values**2
    return float(np.sqrt((squares if values.ndim == 1 else squares.sum(axis=1)).mean()))


def spread(values: FloatArray, names: Sequence[str] = SPREAD) -> dict[str, float]:
    """Statistics of an (n,) array, n > 0, by name; ``p95`` is the 95th percentile."""
    plain: dict[str, Callable[[FloatArray], float]] = {"mean": np.mean, "rms": rms}
    plain |= {"min": np.min, "max": np.max}
    percent = {n: 50.0 if n == "median" else float(n[1:]) for n in names if n not in plain}
    # All percentiles at once, because each call sorts.
    ranked = np.percentile(values, list(percent.values())).tolist()
    found = dict(zip(percent, ranked, strict=True))
    return {n: found[n] if n in found else float(plain[n](values)) for n in names}
